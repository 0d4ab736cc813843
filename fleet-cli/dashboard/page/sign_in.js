// Signing in: the token becomes a cookie that no script can read. Nothing is kept in this page.

import { theme } from "./theme.js";

const byId = (id) => document.getElementById(id);
const [form, token, error, button] = ["form", "token", "error", "sign-in"].map(byId);

function say(text) {
  error.textContent = text;
  error.hidden = !text;
}

async function signIn() {
  button.disabled = true;
  say("");
  try {
    const answer = await fetch("/sign-in", {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify({ token: token.value }),
    });
    if (answer.ok) {
      location.replace("/");
      return;
    }
    const text = await answer.text();
    say(told(text) ?? `Not signed in: ${text.trim() || answer.status}`);
    token.select();
  } catch {
    say("Not signed in: no connection to the dashboard.");
  }
  button.disabled = false;
}

function told(text) {
  try {
    const { error } = JSON.parse(text);
    return `${error.charAt(0).toUpperCase()}${error.slice(1)}.`;
  } catch {
    return null;
  }
}

// A link from another site brings no cookie along: this request does.
async function alreadyIn() {
  try {
    if ((await (await fetch("/who")).json()).who) location.replace("/");
  } catch {
    // then the form stays
  }
}

theme(byId("theme"), () => {});
byId("ended").hidden = location.hash !== "#ended";
form.addEventListener("submit", (event) => {
  event.preventDefault();
  signIn();
});
alreadyIn();
