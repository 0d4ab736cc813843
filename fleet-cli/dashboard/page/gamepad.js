// A gamepad as a hand on the stick: where it is while its deadman button is held. Safety logic, so it has no I/O
// and no clock.
//
//   up ──deadman pressed──▶ held ──read──▶ {x, y}
//    ▲                       │
//    └── deadman released, pad gone, silent for 3 s, taken away by the page ──▶ spent ──deadman released──▶ up
//
// Of several pads the one drives whose button was pressed first; while another one's button is held too, releasing
// it hands nothing over: spent, until none is held.
// Whoever takes the hand away (the window lost its focus, a tick came late) leaves the deadman button spent: it has
// to be released and pressed anew. It is spent at first too, so that a button that is stuck drives nobody.

export const DEADMAN = [4, 5]; // either shoulder button, by the standard layout
const [STEERING, THROTTLE] = [0, 1]; // the left stick
const DEAD_ZONE = 0.12; // sticks do not return to just 0
const SILENT_MS = 3000; // no value has changed for so long: a hand is never that still, a lost radio is

export class Gamepad {
  #state = "spent"; // "up", "held"
  #index = null; // of the pad that has the deadman button held
  #stamp = null; // of its last change
  #changedMs = 0;
  says = "";

  // Takes in what navigator.getGamepads() lists; where the stick is, {x, y} in −1..1, + = right and up; null = nobody
  // holds a deadman button. `says` is then how it stands, in words, "" without a gamepad.
  read(pads, nowMs) {
    const there = [...pads].filter((pad) => pad?.connected);
    const usable = there.filter((pad) => pad.mapping === "standard");
    const pad = this.#state === "held" ? usable.find((one) => one.index === this.#index) : usable.find(isHeld) ?? usable[0];
    this.#step(pad, usable.some(isHeld), nowMs);
    this.says = words(this.#state, pad, there.length);
    if (this.#state !== "held") return null;
    const [x, y] = [pad.axes[STEERING], -pad.axes[THROTTLE]];
    return Number.isFinite(x) && Number.isFinite(y) ? round(x, y) : this.#drop();
  }

  // Nothing is held any more, whatever the pad says, until its deadman button was up.
  release() {
    this.#state = "spent";
    this.#index = null;
  }

  #step(pad, isAnyHeld, nowMs) {
    if (!pad) {
      this.release();
      return;
    }
    const held = isHeld(pad);
    if (!held) {
      this.#state = isAnyHeld ? "spent" : "up";
      this.#index = null;
    } else if (this.#state === "up") {
      [this.#state, this.#index, this.#stamp, this.#changedMs] = ["held", pad.index, pad.timestamp, nowMs];
    } else if (this.#state === "held") {
      if (pad.timestamp !== this.#stamp) [this.#stamp, this.#changedMs] = [pad.timestamp, nowMs];
      if (nowMs - this.#changedMs > SILENT_MS) this.release();
    }
  }

  #drop() {
    this.release();
    return null;
  }
}

function isHeld(pad) {
  return DEADMAN.some((button) => pad.buttons[button]?.pressed === true);
}

// The dead zone is round, and what lies beyond it begins at 0.
function round(x, y) {
  const length = Math.hypot(x, y);
  if (length <= DEAD_ZONE) return { x: 0, y: 0 };
  const share = Math.min(1, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length;
  return { x: x * share, y: y * share };
}

function words(state, pad, there) {
  if (there === 0) return "";
  if (!pad) return "Gamepad: its layout is unknown here, it cannot drive.";
  if (state === "held") return "Gamepad drives.";
  if (state === "spent" && isHeld(pad)) return "Gamepad: release the shoulder button first.";
  return "Gamepad: hold a shoulder button and use the left stick.";
}
