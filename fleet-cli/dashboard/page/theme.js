// Dark or light: as the system says, until the user chooses. The choice stays in this browser.

const KEY = "xtb-theme";
const NEXT = { system: "dark", dark: "light", light: "system" };
const SIGNS = { system: "◐", dark: "☾", light: "☀" };

export function theme(button, changed) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  let choice = remembered();
  const show = () => {
    const isDark = choice === "system" ? dark.matches : choice === "dark";
    document.documentElement.classList.toggle("dark", isDark);
    button.textContent = SIGNS[choice];
    button.title = `Colours: ${choice === "system" ? "as the system" : choice}`;
    button.setAttribute("aria-label", button.title);
    changed();
  };
  button.addEventListener("click", () => {
    choice = NEXT[choice];
    remember(choice);
    show();
  });
  dark.addEventListener("change", show);
  show();
}

function remembered() {
  try {
    const choice = localStorage.getItem(KEY);
    return choice in NEXT ? choice : "system";
  } catch {
    return "system"; // storage may be forbidden
  }
}

function remember(choice) {
  try {
    localStorage.setItem(KEY, choice);
  } catch {
    // then it holds for this page only
  }
}
