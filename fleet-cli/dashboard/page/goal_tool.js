// Goals and points by mouse, finger and keyboard on the map: what is being aimed at, and when it is sent.
//
//   look:   a tap on a robot selects it; on the floor it sets a preview, whose ring turns it; Send sends
//   goals:  press, drag for the heading, let go: sent at once
//   points: each tap adds a point to the task, or replaces the only one
//   pose:   press where the selected robot stands, drag for its heading; Set pose sends
//   edit:   nothing here: edit_tool.js has mouse and keys

import { HANDLE_PX } from "./draw.js";
import { placeAt } from "./floor.js";
import { shown } from "./store.js";

const TAP_PX = 7;
const TURN_FROM_PX = 14; // a shorter drag has no heading
const HANDLE_NEAR_PX = 20;
const ROBOT_NEAR_PX = 24;
const PLACE_NEAR_PX = 14;
const TURN_RAD = Math.PI / 12;
const STEP_M = 0.25;
const FAST_STEP_M = 1;
const EDGE_PX = 40;

export class GoalTool {
  tool = "look";
  preview = null; // {x_m, y_m, yaw_rad}
  cursor = null; // {x_m, y_m}: shown while the keyboard is used
  points = []; // of the task that is being made
  #canvas;
  #view;
  #store;
  #do;
  #placeYaw = null; // of the place that is aimed at
  #press = null; // {pointer, x, y, kind: "tap" | "goal" | "turn"}

  // `act`: {select(name), goal(preview), pose(preview), changed(), say(text), fit(), withPoint(points, point), mayAim(), editing()}
  constructor(canvas, view, store, act) {
    [this.#canvas, this.#view, this.#store, this.#do] = [canvas, view, store, act];
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", () => {
      if (this.#press?.kind === "goal") this.preview = null;
      this.#drop();
    });
    canvas.addEventListener("keydown", (event) => this.#key(event));
    canvas.addEventListener("blur", () => this.#setCursor(null));
  }

  use(tool) {
    if (this.tool === "edit" && this.#do.editing()) return;
    this.tool = tool;
    this.preview = null;
    this.#canvas.classList.toggle("aims", !["look", "edit"].includes(tool));
    this.#do.changed();
  }

  // A pose that is known already, as if it had been pressed: it is sent as any other.
  propose(at) {
    this.use("pose");
    if (this.tool === "pose" && this.#canAim()) this.preview = this.#poseAt(at);
    this.#do.changed();
  }

  clear() {
    this.preview = null;
    this.#drop();
    this.#do.changed();
  }

  #canAim() {
    return this.#store.selected !== null && this.#do.mayAim();
  }

  #down(event) {
    this.#setCursor(null);
    if (this.tool === "edit") return;
    if (this.#press !== null) {
      // A second finger pans or zooms: nothing is aimed at.
      if (this.#press.kind === "goal" || this.#press.kind === "pose") this.preview = null;
      this.#drop();
      this.#do.changed();
      return;
    }
    if (event.button !== 0) return;
    const [x, y] = [event.offsetX, event.offsetY];
    const press = { pointer: event.pointerId, x, y, kind: "tap" };
    if (this.tool === "goals" && this.#canAim() && !this.#robotAt(x, y)) {
      press.kind = "goal";
      this.preview = this.#aimAt(x, y);
    } else if (this.tool === "pose" && this.#canAim() && !(this.preview && this.#onHandle(x, y))) {
      press.kind = "pose";
      this.preview = this.#poseAt(this.#aimAt(x, y));
    } else if (this.preview && this.#onHandle(x, y)) {
      press.kind = "turn";
    }
    this.#press = press;
    this.#view.held = press.kind !== "tap";
    if (this.#view.held) this.#canvas.setPointerCapture(event.pointerId);
    this.#do.changed();
  }

  #move(event) {
    const press = this.#press;
    if (press?.pointer !== event.pointerId || press.kind === "tap" || !this.preview) return;
    const [x, y] = this.#view.toScreen(this.preview.x_m, this.preview.y_m);
    const [dx, dy] = [event.offsetX - x, y - event.offsetY];
    const turned = Math.hypot(dx, dy) >= TURN_FROM_PX;
    this.preview.yaw_rad = turned ? Math.atan2(dy, dx) : this.#placeYaw;
    this.#do.changed();
  }

  #up(event) {
    const press = this.#press;
    if (press?.pointer !== event.pointerId) return;
    this.#drop();
    if (press.kind === "goal" && this.preview) {
      this.#send();
    } else if (press.kind === "tap" && Math.hypot(event.offsetX - press.x, event.offsetY - press.y) <= TAP_PX) {
      this.#tap(event.offsetX, event.offsetY);
    }
  }

  // The floor there, or the place that is marked there, with its yaw.
  #aimAt(x, y) {
    const place = placeAt(this.#view, this.#store.places, x, y, PLACE_NEAR_PX);
    this.#placeYaw = place?.yaw_rad ?? null;
    const { x_m, y_m } = place ?? this.#view.toFloor(x, y);
    if (place) this.#do.say(place.name);
    return { x_m, y_m, yaw_rad: this.#placeYaw };
  }

  // As a pose: with a heading, the present one unless the place has another.
  #poseAt(at) {
    this.#placeYaw = at.yaw_rad ?? this.#store.robot()?.pose?.yaw_rad ?? 0;
    return { x_m: at.x_m, y_m: at.y_m, yaw_rad: this.#placeYaw };
  }

  #drop() {
    this.#press = null;
    this.#view.held = false;
  }

  #tap(x, y) {
    const robot = this.#robotAt(x, y);
    if (this.tool === "points") {
      this.#addPoint(this.#aimAt(x, y));
    } else if (robot) {
      this.#do.select(robot);
    } else if (this.#canAim()) {
      this.preview = this.#aimAt(x, y);
    } else {
      this.#do.say(this.#do.mayAim() ? "Select a robot first; then tap the map to set its goal." : "");
    }
    this.#do.changed();
  }

  #addPoint(point) {
    this.points = this.#do.withPoint(this.points, { yaw_rad: null, ...point });
    this.#do.changed();
  }

  #send() {
    const preview = this.preview;
    this.preview = null;
    if (this.tool === "pose") this.#do.pose(preview);
    else this.#do.goal(preview);
    this.#do.changed();
  }

  // Sends the preview, as the button does.
  send() {
    if (this.preview) this.#send();
  }

  #robotAt(x, y) {
    let [nearest, distance] = [null, ROBOT_NEAR_PX];
    for (const robot of this.#store.robots.values()) {
      const pose = shown(robot, performance.now());
      if (!pose) continue;
      const [rx, ry] = this.#view.toScreen(pose.x_m, pose.y_m);
      const away = Math.hypot(rx - x, ry - y);
      if (away < distance) [nearest, distance] = [robot.name, away];
    }
    return nearest;
  }

  #onHandle(x, y) {
    const at = this.#view.toScreen(this.preview.x_m, this.preview.y_m);
    return Math.abs(Math.hypot(x - at[0], y - at[1]) - HANDLE_PX) < HANDLE_NEAR_PX;
  }

  #setCursor(cursor) {
    if (this.cursor === cursor) return;
    this.cursor = cursor;
    this.#do.changed();
  }

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || event.defaultPrevented) return;
    const step = event.shiftKey ? FAST_STEP_M : STEP_M;
    const keys = {
      ArrowLeft: () => this.#step(-step, 0),
      ArrowRight: () => this.#step(step, 0),
      ArrowUp: () => this.#step(0, step),
      ArrowDown: () => this.#step(0, -step),
      Enter: () => this.#enter(),
      Escape: () => this.clear(),
      "[": () => this.#turn(TURN_RAD),
      "]": () => this.#turn(-TURN_RAD),
      "+": () => this.#view.zoomBy(1),
      "-": () => this.#view.zoomBy(-1),
      0: () => this.#do.fit(),
      n: () => this.#next(),
    };
    const act = keys[event.key];
    if (!act || (this.tool === "edit" && !["+", "-", "0"].includes(event.key))) return;
    event.preventDefault();
    act();
    this.#do.changed();
  }

  #place() {
    if (this.cursor) return this.cursor;
    const pose = this.#store.robot()?.pose;
    const { x_m, y_m } = pose ?? this.#view.toFloor(this.#canvas.clientWidth / 2, this.#canvas.clientHeight / 2);
    const on = (m) => Math.round(m / STEP_M) * STEP_M;
    return { x_m: on(x_m), y_m: on(y_m) };
  }

  #step(dx_m, dy_m) {
    const { x_m, y_m } = this.#place();
    this.cursor = { x_m: x_m + dx_m, y_m: y_m + dy_m };
    // The map follows the cursor.
    const [x, y] = this.#view.toScreen(this.cursor.x_m, this.cursor.y_m);
    const over = (at, size) => Math.min(0, at - EDGE_PX) + Math.max(0, at - (size - EDGE_PX));
    const [ox, oy] = [over(x, this.#canvas.clientWidth), over(y, this.#canvas.clientHeight)];
    if (ox !== 0 || oy !== 0) this.#view.panBy(-ox, -oy);
    this.#do.say(`x ${this.cursor.x_m.toFixed(2)}, y ${this.cursor.y_m.toFixed(2)} m`);
  }

  #enter() {
    const at = this.#place();
    if (this.tool === "points") {
      this.#addPoint(at);
      this.#do.say(`point ${this.points.length}`);
    } else if (!this.#canAim()) {
      this.#do.say("no robot selected: press N to select one");
    } else if (this.preview && this.preview.x_m === at.x_m && this.preview.y_m === at.y_m) {
      this.#send();
    } else {
      this.cursor = at;
      this.preview = this.tool === "pose" ? this.#poseAt(at) : { ...at, yaw_rad: null };
      if (this.tool === "pose") this.#do.say(`${this.#store.selected} stands there? Enter sets its pose`);
      else if (this.tool === "goals") this.#send();
      else this.#do.say(`goal for ${this.#store.selected} at x ${at.x_m.toFixed(2)}, y ${at.y_m.toFixed(2)} m; Enter sends it`);
    }
  }

  #turn(by_rad) {
    if (!this.preview) return;
    const yaw_rad = (this.preview.yaw_rad ?? 0) + by_rad;
    this.preview.yaw_rad = Math.atan2(Math.sin(yaw_rad), Math.cos(yaw_rad));
    this.#do.say(`heading ${Math.round((this.preview.yaw_rad * 180) / Math.PI)} degrees`);
  }

  #next() {
    const names = [...this.#store.robots.keys()];
    if (names.length === 0) return;
    const name = names[(names.indexOf(this.#store.selected) + 1) % names.length];
    this.#do.select(name);
    this.#do.say(`${name} selected`);
  }
}
