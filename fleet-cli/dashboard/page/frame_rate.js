// How many pictures a second the page draws, and what it leaves out when that is too few.

export const WANTED_FPS = 30;
const WINDOW_MS = 2000;
const EASY_FPS = 45;
const EASY_FOR_MS = 6000;

// In this order: what is left out at level 1, 2, …
export const THINNED = [
  "short trails", "infrared only for the selected robot", "paths only for the selected robot",
  "no trails", "slower names and panels",
];

export class FrameRate {
  #times = []; // of the pictures in the last two seconds
  #easySinceMs = null;
  #changedMs = 0;
  level = 0;

  // Notes a picture. The first two seconds of a page are for loading.
  drew(nowMs) {
    if (this.#times.length === 0) this.#changedMs = nowMs;
    this.#times.push(nowMs);
    while (this.#times.length > 0 && nowMs - this.#times[0] > WINDOW_MS) this.#times.shift();
    if (nowMs - this.#changedMs < WINDOW_MS) return; // the last change has yet to show
    const fps = this.fps();
    if (fps === null) return;
    if (fps < WANTED_FPS && this.level < THINNED.length) {
      this.#change(this.level + 1, nowMs);
    } else if (fps < EASY_FPS || this.level === 0) {
      this.#easySinceMs = null;
    } else {
      this.#easySinceMs ??= nowMs;
      if (nowMs - this.#easySinceMs > EASY_FOR_MS) this.#change(this.level - 1, nowMs);
    }
  }

  // The page was hidden or asleep: nothing of that counts.
  restart(nowMs) {
    this.#times = [];
    this.#easySinceMs = null;
    this.#changedMs = nowMs;
  }

  // Pictures a second, null = too few yet to say.
  fps() {
    const [first, last] = [this.#times[0], this.#times.at(-1)];
    return this.#times.length < 10 ? null : ((this.#times.length - 1) * 1000) / (last - first);
  }

  thinned() {
    return THINNED.slice(0, this.level);
  }

  #change(level, nowMs) {
    this.level = level;
    this.#changedMs = nowMs;
    this.#easySinceMs = null;
  }
}
