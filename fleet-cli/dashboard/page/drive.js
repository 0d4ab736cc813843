// Driving by hand: the shell around press_hold.js. It takes the lease, feeds inputs in, sends what comes out.
//
// Every way in which an input can be lost lets go of it: pointerup, pointercancel, lost capture, keyup,
// blur of the window, a hidden page, pagehide, a closed or silent socket; a gamepad is looked at each 20 ms while a
// robot is driven, and gone at once when the browser says so. The timer runs only while something is held.

import { Gamepad } from "./gamepad.js";
import { PressHold, PERIOD_MS, isDriveKey } from "./press_hold.js";

const DEAD_ZONE = 0.08;
const LOOK_MS = 20; // at the gamepad
const byId = (id) => document.getElementById(id);

export class Drive {
  #link;
  #store;
  #hold = new PressHold();
  #pad = new Gamepad();
  #looking = null; // timer: looks at the gamepad while a robot is driven
  #timer = null;
  #asked = null; // the robot that we asked for
  #tell;
  #parts = { box: byId("drive"), who: byId("drive-who"), says: byId("drive-says"), stick: byId("stick"),
    knob: byId("knob"), share: byId("drive-share"), pad: byId("drive-pad") };

  // `tell(text)`: something the user has to know.
  constructor(link, store, tell) {
    [this.#link, this.#store, this.#tell] = [link, store, tell];
    const { stick } = this.#parts;
    stick.addEventListener("pointerdown", (event) => this.#down(event));
    stick.addEventListener("pointermove", (event) => {
      this.#hold.stickMoved(event.pointerId, ...this.#place(event));
      this.#show();
    });
    for (const lost of ["pointerup", "pointercancel", "lostpointercapture"]) {
      stick.addEventListener(lost, (event) => {
        this.#hold.stickReleased(event.pointerId);
        this.#settle();
      });
    }
    stick.addEventListener("contextmenu", (event) => event.preventDefault());
    window.addEventListener("keydown", (event) => this.#keyDown(event), true); // before the map
    window.addEventListener("keyup", (event) => {
      this.#hold.keyUp(event.code);
      this.#settle();
    });
    window.addEventListener("blur", () => this.letGo());
    window.addEventListener("gamepaddisconnected", () => this.#look());
    window.addEventListener("pagehide", () => this.end());
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.end();
    });
    byId("drive-end").addEventListener("click", () => this.end());
  }

  // The robot that is driven by this page; null = none.
  get robot() {
    const { teleop } = this.#store;
    return teleop?.state === "driving" && teleop.robot === this.#asked ? teleop.robot : null;
  }

  async begin(robot, take) {
    this.end();
    this.#asked = robot;
    const answer = await this.#link.command({ teleop: { robot, take } });
    if (answer.error) this.#asked = null;
    return answer;
  }

  // Gives the robot back.
  end() {
    this.letGo();
    if (this.#asked !== null) this.#link.command({ teleop_end: {} });
    this.#asked = null;
    this.#store.teleop = null;
    this.update();
  }

  // The server says how it stands, or the socket has closed.
  update() {
    const { box, who, says, stick } = this.#parts;
    const robot = this.robot;
    const { teleop } = this.#store;
    if (teleop?.state === "ended" && teleop.robot === this.#asked) {
      this.#tell(`Driving ${teleop.robot} ended${teleop.why ? `: ${teleop.why}` : ""}.`);
      this.#asked = null;
    }
    if (robot === null) this.letGo();
    if (robot !== null && box.hidden) queueMicrotask(() => stick.focus({ preventScroll: true }));
    box.hidden = robot === null;
    this.#watch(robot !== null);
    who.textContent = robot ?? "";
    if (robot !== null && !this.#hold.held) says.textContent = "no input";
  }

  // The socket has closed: the server has given the robot back.
  lost() {
    this.letGo();
    if (this.#asked !== null) this.#tell(`Driving ${this.#asked} ended: connection lost.`);
    this.#asked = null;
    this.#store.teleop = null;
    this.update();
  }

  letGo() {
    this.#hold.releaseAll();
    this.#pad.release();
    this.#settle();
  }

  #watch(drives) {
    if (drives && this.#looking === null) this.#looking = setInterval(() => this.#look(), LOOK_MS);
    if (drives || this.#looking === null) return;
    clearInterval(this.#looking);
    this.#looking = null;
  }

  #look() {
    if (this.#looking === null) return;
    const now = performance.now();
    // Browsers list gamepads on secure pages only.
    this.#hold.pad(this.#pad.read(navigator.getGamepads?.() ?? [], now), now);
    if (this.#parts.pad.textContent !== this.#pad.says) this.#parts.pad.textContent = this.#pad.says;
    this.#settle();
  }

  #down(event) {
    if (this.robot === null || event.button !== 0) return;
    event.preventDefault();
    this.#parts.stick.setPointerCapture(event.pointerId);
    this.#hold.stick(event.pointerId, ...this.#place(event), performance.now());
    this.#settle();
  }

  #keyDown(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) {
      // Some systems keep the keyup of what is held together with these.
      this.letGo();
      return;
    }
    if (this.robot === null || !isDriveKey(event.code) || event.target.matches?.("input, textarea")) return;
    event.preventDefault();
    if (!event.repeat) this.#hold.keyDown(event.code, performance.now());
    this.#settle();
  }

  // Where a pointer is on the stick: (x, y) in −1..1.
  #place(event) {
    const box = this.#parts.stick.getBoundingClientRect();
    const radius = box.width / 2;
    const x = (event.clientX - box.left - radius) / radius;
    const y = (box.top + radius - event.clientY) / radius;
    const length = Math.hypot(x, y);
    if (length < DEAD_ZONE) return [0, 0];
    const share = length > 1 ? 1 / length : 1;
    return [x * share, y * share];
  }

  // The timer runs while something is held; when nothing is held any more, one zero goes out.
  #settle() {
    this.#show();
    if (this.#hold.held && this.#timer === null) {
      this.#timer = setInterval(() => this.#tick(), PERIOD_MS);
    } else if (!this.#hold.held && this.#timer !== null) {
      clearInterval(this.#timer);
      this.#timer = null;
      if (this.robot !== null) this.#send(this.#hold.zero());
    }
  }

  // With the number of the latest frame: the server passes on nothing that was made before an old picture.
  #send(setpoint) {
    const { frame } = this.#store;
    if (frame !== null) this.#link.setpoint({ ...setpoint, seen: frame.n });
  }

  #tick() {
    if (this.robot === null || document.hidden || this.#store.silent) {
      this.letGo();
      return;
    }
    const setpoint = this.#hold.tick(performance.now(), Number(this.#parts.share.value));
    if (setpoint !== null) {
      this.#send(setpoint);
    } else {
      this.letGo();
      this.#parts.says.textContent = "page stalled: press again";
    }
  }

  #show() {
    const { stick, knob, says } = this.#parts;
    const at = this.#hold.at();
    const reach = stick.clientWidth / 2 - 34;
    knob.style.transform = at ? `translate(${at.x * reach}px, ${-at.y * reach}px)` : "";
    stick.classList.toggle("held", at !== null);
    if (at) {
      const share = Number(this.#parts.share.value);
      says.textContent = `${Math.round(at.y * share * 100)} % forward`.replace(/^-(\d+ %) forward/, "$1 reverse");
    } else if (this.#timer !== null) {
      says.textContent = "no input";
    }
  }
}
