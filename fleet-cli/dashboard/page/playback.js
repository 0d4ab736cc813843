// The bar of a recording that is played: where it is, pausing it, and going to another place.

const LOOK_EVERY_MS = 500;

export class PlaybackBar {
  #place;
  #parts = null; // {button, slider, text}
  #paused = false;
  #held = false; // somebody drags the slider: it stays where the hand is

  constructor(place) {
    this.#place = place;
  }

  // A recording is played here.
  begin() {
    if (this.#parts) return;
    const [button, slider, text] = ["button", "input", "output"].map((name) => document.createElement(name));
    button.type = "button";
    slider.type = "range";
    slider.step = 100;
    slider.setAttribute("aria-label", "Position in the recording");
    button.addEventListener("click", () => this.#ask({ pause: { paused: !this.#paused } }));
    slider.addEventListener("input", () => {
      this.#held = true;
      this.#write(Number(slider.value));
    });
    slider.addEventListener("change", async () => {
      await this.#ask({ seek: { position_ms: Number(slider.value) } });
      this.#held = false;
    });
    this.#place.append(button, slider, text);
    this.#parts = { button, slider, text };
    this.#ask();
    setInterval(() => this.#ask(), LOOK_EVERY_MS);
  }

  async #ask(wish) {
    const json = { "content-type": "application/json" };
    const request = wish ? { method: "POST", headers: json, body: JSON.stringify(wish) } : {};
    try {
      const answer = await fetch("/playback", request);
      if (answer.ok) this.#show(await answer.json());
    } catch {
      // The page says by itself that it has lost its server.
    }
  }

  #show({ position_ms, duration_ms, speed, paused, ended }) {
    const { button, slider } = this.#parts;
    this.#paused = paused;
    const what = paused ? "Continue" : "Pause";
    if (button.textContent !== what) button.textContent = what;
    button.disabled = ended && !paused;
    slider.max = duration_ms;
    if (!this.#held) slider.value = position_ms;
    this.#write(this.#held ? Number(slider.value) : position_ms, duration_ms, speed);
  }

  #write(position_ms, duration_ms = Number(this.#parts.slider.max), speed = 1) {
    const times = speed === 1 ? "" : ` · ${speed} ×`;
    const words = `${clock(position_ms)} of ${clock(duration_ms)}${times}`;
    this.#parts.text.textContent = words;
    this.#parts.slider.setAttribute("aria-valuetext", words);
  }
}

// 65400 → `1:05`
function clock(ms) {
  const [minutes, seconds] = [Math.floor(ms / 60_000), Math.floor((ms % 60_000) / 1000)];
  return `${minutes}:${String(seconds).padStart(2, "0")}`;
}
