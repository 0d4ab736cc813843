// PressHold-to-run: what drives a robot by hand, and what ends it. Safety logic, so it is ours and has no I/O.
//
//   released ──press──▶ held ──tick each 50 ms──▶ a setpoint
//      ▲                  │
//      └── release, lost gamepad, lost focus, hidden page, closed socket, late tick
//
// A setpoint comes out of a tick only while an input is held at that moment. A tick that comes late (the
// page was held up, so a release may be waiting behind it) lets go instead of sending.

export const PERIOD_MS = 50;
export const LATE_MS = 150;

const KEYS = {
  KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0],
  KeyA: [0, -1], ArrowLeft: [0, -1], KeyD: [0, 1], ArrowRight: [0, 1],
};

export function isDriveKey(code) {
  return code in KEYS;
}

export class PressHold {
  #stick = null; // {pointer, x, y}
  #keys = new Set();
  #pad = null; // {x, y}: of the gamepad, while its deadman button is held
  #lastTickMs = null;
  #seq = 0;

  get held() {
    return this.#stick !== null || this.#keys.size > 0 || this.#pad !== null;
  }

  // The stick is at (x, y), each −1..1, + = right and up. Only the pointer that took it moves it.
  stick(pointer, x, y, nowMs) {
    if (this.#stick !== null && this.#stick.pointer !== pointer) return;
    this.#began(nowMs);
    this.#stick = { pointer, x, y };
  }

  stickMoved(pointer, x, y) {
    if (this.#stick?.pointer === pointer) this.#stick = { pointer, x, y };
  }

  stickReleased(pointer) {
    if (this.#stick?.pointer === pointer) this.#stick = null;
  }

  keyDown(code, nowMs) {
    if (!isDriveKey(code)) return;
    this.#began(nowMs);
    this.#keys.add(code);
  }

  keyUp(code) {
    this.#keys.delete(code);
  }

  // Where the gamepad's stick is, {x, y}; null = its deadman button is not held.
  pad(at, nowMs) {
    if (at !== null) this.#began(nowMs);
    this.#pad = at;
  }

  releaseAll() {
    this.#stick = null;
    this.#pad = null;
    this.#keys.clear();
  }

  // Where the input is: {x, y}, + = right and up; null while nothing is held.
  at() {
    if (this.#stick) return { x: this.#stick.x, y: this.#stick.y };
    if (this.#keys.size === 0) return this.#pad;
    let [x, y] = [0, 0];
    for (const code of this.#keys) {
      y += KEYS[code][0];
      x += KEYS[code][1];
    }
    return { x: Math.max(-1, Math.min(1, x)), y: Math.max(-1, Math.min(1, y)) };
  }

  // The setpoint to send now: {seq, throttle, steering}; null = nothing may be sent.
  // `share` (0..1) is how much of the full speed the user allows.
  tick(nowMs, share) {
    if (!this.held) return null;
    const late = nowMs - this.#lastTickMs > LATE_MS;
    this.#lastTickMs = nowMs;
    if (late) {
      this.releaseAll();
      return null;
    }
    const { x, y } = this.at();
    this.#seq += 1;
    return { seq: this.#seq, throttle: share * y, steering: x };
  }

  // The setpoint that goes out once when the last input is let go.
  zero() {
    this.#seq += 1;
    return { seq: this.#seq, throttle: 0, steering: 0 };
  }

  #began(nowMs) {
    if (!this.held) this.#lastTickMs = nowMs;
  }
}
