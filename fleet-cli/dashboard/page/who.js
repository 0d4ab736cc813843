// Who has signed in: the menu in the header, signing out, and what happens when the server has ended it.

import { html, nothing } from "./vendor/lit-html.js";

const PATH = "/sign-in#ended";

export function whoMenu(hello) {
  if (!hello?.who) return nothing;
  const { name, role, may, certificate } = hello.who;
  return html`<details class="who">
    <summary aria-label="Signed in as ${name}, ${role}"><span class="initial" aria-hidden="true">${name[0]}</span>
      <b>${name}</b> <span class="chip">${role}</span></summary>
    <div class="menu"><p><strong>${name}</strong>, ${role}: ${may}.</p>
      ${certificate
        ? html`<p class="hint">Signed in with this browser's certificate.</p>`
        : html`<button type="button" id="sign-out" @click=${signOut}>Sign out</button>`}</div></details>`;
}

async function signOut() {
  try {
    await fetch("/sign-out", { method: "POST" });
  } finally {
    location.replace("/sign-in");
  }
}

// The socket has closed: if that was because this browser stands for nobody any more, another sign-in is needed.
export async function leaveIfOut(hello) {
  if (!hello?.who) return;
  try {
    const answer = await fetch("/who");
    if (answer.ok && !(await answer.json()).who) location.replace(PATH);
  } catch {
    // no connection: the page says so, and tries again
  }
}

// A click beside the menu closes it.
document.addEventListener("pointerdown", (event) => {
  const menu = document.querySelector(".who[open]");
  if (menu && !menu.contains(event.target)) menu.open = false;
});
