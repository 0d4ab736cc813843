// What the page knows of the fleet: takes in the server's messages, holds the latest of everything.
// No I/O and no clock: `nowMs` is the page's monotonic clock, given by the caller.
// A stale robot keeps only its last pose, marked as such; everything else of it is unknown.

import { startTag } from "./map_draft.js";

export const TRAIL_POINTS = 400;
export const SAMPLES = 1200; // of the watched robot: 60 s at 20 Hz
export const HAPPENINGS = 200;
const COLOURS = 8;

export class Store {
  hello = null;
  map = null;
  mapCount = 0; // grows with each map and its places: who draws it sees that there is a new one
  places = [];
  mapContent = null; // hashes of map and places: what an edit is made of
  robots = new Map(); // by name, in the order of the names
  frame = null; // the latest, without its robots
  frameAtMs = null; // page's clock
  silent = false; // no frame comes any more, though the socket is open
  #known = null; // robots of the last frame while silent: the next frame leaves out what was in it
  tasks = null;
  alerts = null; // {alerts, left_out}; null = unknown
  happenings = []; // the newest last
  teleop = null; // {robot, state, why}
  selected = null;
  samples = emptySamples();

  // The connection has been lost, or is a new one: what was known before is not known any more. Until the
  // first frame comes the robots stay where they were last seen, grey, on the map as it was.
  begin() {
    const { selected, hello, robots, map, places, mapContent, mapCount, frameAtMs } = this;
    Object.assign(this, new Store(), { selected, hello, map, places, mapContent, mapCount, frameAtMs });
    this.#known = null;
    this.robots = forgotten(robots, frameAtMs);
  }

  // No frame has come for too long: until one does, everything is as unknown as without a connection.
  hush() {
    if (this.silent) return;
    this.silent = true;
    this.#known = this.robots;
    this.robots = forgotten(this.robots, this.frameAtMs);
    if (this.frame) this.#sample(this.frame.now_ms);
  }

  // The computer was asleep, and the page's clock stood for so long.
  slept(ms) {
    if (this.frameAtMs !== null) this.frameAtMs -= ms;
    for (const robot of this.robots.values()) {
      if (robot.heardMs) robot.heardMs -= ms;
    }
  }

  // The server's clock: without frames it goes on by the page's own.
  serverMs(nowMs) {
    if (!this.frame) return 0;
    return this.frame.now_ms + (this.silent ? nowMs - this.frameAtMs : 0);
  }

  // Without frames, ages grow by the page's own clock.
  age(nowMs) {
    for (const robot of this.robots.values()) {
      if (robot.heardMs) robot.age_ms = nowMs - robot.heardMs;
    }
  }

  // Takes in one message; says what has changed: "frame", "map", …
  take(message, nowMs) {
    const [kind] = Object.keys(message);
    const body = message[kind];
    switch (kind) {
      case "hello":
        this.hello = body;
        break;
      case "map":
        this.map = body;
        this.mapCount += 1;
        break;
      case "places":
        this.places = body;
        this.mapCount += 1;
        break;
      case "map_content":
        this.mapContent = body;
        break;
      case "frame":
        this.#frame(body, nowMs);
        break;
      case "tasks":
        this.tasks = body;
        break;
      case "alerts":
        this.alerts = body;
        break;
      case "happenings":
        this.happenings = this.happenings.concat(body).slice(-HAPPENINGS);
        break;
      case "teleop":
        this.teleop = body;
        break;
      default:
        break; // answers belong to the link; what is newer than this page is not for it
    }
    return kind;
  }

  select(name) {
    if (name === this.selected) return;
    this.selected = name;
    this.samples = emptySamples();
  }

  robot() {
    return this.robots.get(this.selected) ?? null;
  }

  // Where a robot starts: as the map says, else the roster; null = neither does.
  startOf(robot) {
    return this.places.find(({ tags }) => tags.includes(startTag(robot.name))) ?? robot.start ?? null;
  }

  // What the dispatcher has suspended; nothing where that is unknown.
  suspended() {
    return this.dispatcher() ? this.frame.suspended ?? [] : [];
  }

  // Whether it assigns nothing at all.
  isSuspended() {
    return this.suspended().some((one) => one.all);
  }

  // Whether a dispatcher is there, null = unknown.
  dispatcher() {
    return this.frame && !this.silent ? this.frame.dispatcher === true : null;
  }

  writable() {
    return this.hello !== null && this.hello.writable;
  }

  // Why whoever has signed in may do nothing but an emergency stop; null = that is not so.
  denied() {
    const { hello } = this;
    return hello?.who && !hello.writable && hello.estop ? hello.why_not : null;
  }

  // Whether controls are shown, though they may be disabled.
  controls() {
    return this.writable() || this.denied() !== null;
  }

  // The selected robot's full state, as long as it is fresh.
  detail() {
    const detail = this.frame?.detail;
    const robot = this.robot();
    return detail && robot && !robot.stale && detail.robot === this.selected ? detail : null;
  }

  #frame(frame, nowMs) {
    const before = this.#known ?? this.robots;
    [this.#known, this.silent] = [null, false];
    const after = new Map();
    const all = [...frame.robots].sort((a, b) => compare(a.name, b.name));
    all.forEach((news, index) => {
      after.set(news.name, merge(before.get(news.name), news, index % COLOURS, nowMs));
    });
    this.robots = after;
    this.frame = { ...frame, robots: undefined };
    this.frameAtMs = nowMs;
    this.#sample(frame.now_ms);
  }

  #sample(atMs) {
    const robot = this.robot();
    if (!robot) return;
    const fresh = !robot.stale;
    const samples = this.samples;
    const put = (list, value) => list.push(fresh && Number.isFinite(value) ? value : null);
    samples.t.push(atMs / 1000);
    put(samples.speed, robot.speed_mps);
    put(samples.reference, robot.reference_mps);
    put(samples.tiltX, robot.tilt_deg?.x);
    put(samples.tiltY, robot.tilt_deg?.y);
    put(samples.battery, robot.battery_v);
    put(samples.irFront, nearest(robot.ir_cm?.front));
    put(samples.irRear, nearest(robot.ir_cm?.rear));
    if (samples.t.length > SAMPLES) for (const list of Object.values(samples)) list.shift();
  }
}

function emptySamples() {
  return { t: [], speed: [], reference: [], tiltX: [], tiltY: [], battery: [], irFront: [], irRear: [] };
}

function compare(a, b) {
  return a.localeCompare(b, "en", { numeric: true });
}

export function nearest(all) {
  const seen = (all ?? []).filter((cm) => cm !== null);
  return seen.length === 0 ? null : Math.min(...seen);
}

function forgotten(robots, frameAtMs) {
  return new Map([...robots].map(([name, robot]) => {
    const heardMs = robot.heardMs ?? (robot.age_ms === null ? null : frameAtMs - robot.age_ms);
    return [name, { ...unknown(robot), heardMs }];
  }));
}

function unknown(robot) {
  return { ...robot, alive: null, stale: true, latches: [], faults: [], why: [], mode: null, lease: null,
    task: null, goal: null, ir_cm: null, path: null, speed_mps: null, reference_mps: null,
    battery_v: null, battery_level: null, tilt_deg: null, obstacle: null, stopped_age_ms: null };
}

// The news of a frame, with what a frame leaves out because it was sent before.
function merge(old, news, colour, nowMs) {
  const robot = { ...news, colour, latches: news.latches ?? [], faults: news.faults ?? [], why: news.why ?? [] };
  robot.body = news.body ?? old?.body;
  robot.start = news.start ?? old?.start;
  robot.trail = news.trail_reset || !old ? [] : old.trail;
  if (news.trail?.length) {
    robot.trail = robot.trail.concat(news.trail).slice(-TRAIL_POINTS);
  }
  if (news.path && !news.path.points) {
    const points = old?.path?.plan === news.path.plan ? old.path.points : null;
    robot.path = points ? { ...news.path, points } : null;
  }
  // Where it was shown last, so that the picture glides there instead of jumping.
  robot.glide = old?.pose && news.pose ? { from: shown(old, nowMs), atMs: nowMs } : null;
  return robot;
}

const GLIDE_MS = 60; // a frame comes each 50 ms
const JUMP_M = 0.5; // farther than this it was put somewhere else

// Where the robot is drawn at `nowMs`: its latest pose, or on the way there from the one before.
export function shown(robot, nowMs) {
  const { pose, glide } = robot;
  if (!pose || !glide || robot.stale) return pose;
  const part = Math.min(1, Math.max(0, (nowMs - glide.atMs) / GLIDE_MS));
  const { from } = glide;
  if (part >= 1 || !from || Math.hypot(pose.x_m - from.x_m, pose.y_m - from.y_m) > JUMP_M) return pose;
  const turn = Math.atan2(Math.sin(pose.yaw_rad - from.yaw_rad), Math.cos(pose.yaw_rad - from.yaw_rad));
  return {
    ...pose,
    x_m: from.x_m + part * (pose.x_m - from.x_m),
    y_m: from.y_m + part * (pose.y_m - from.y_m),
    yaw_rad: from.yaw_rad + part * turn,
  };
}
