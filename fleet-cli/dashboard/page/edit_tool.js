// Zones and places under the mouse, a finger and the keyboard: a tap selects; what is selected is dragged as a whole,
// by its corners, or by the middle of a side, which makes a corner; a place's ring turns it. An armed tool draws.

import { holds, moved, on, rectangle, turned } from "./map_draft.js";

const TAP_PX = 7;
const HANDLE_PX = 14;
const PLACE_PX = 16;
export const RING_PX = 30;
const LEAST_M = 0.1; // a smaller zone was a tap
const USUAL_M = 1; // side of a zone that is put by the keyboard
const TURN_RAD = Math.PI / 12;
const STEP_M = 0.05;
const FAST_STEP_M = 0.5;

export class EditTool {
  armed = null; // "keep_out" | "one_way" | "place" | null = select and move
  #canvas;
  #view;
  #do;
  #press = null; // {pointer, x, y, at: [x_m, y_m], kind, item, index, name, moved}

  // `act`: {draft(): the draft or null, changed(), say(text)}
  constructor(canvas, view, act) {
    [this.#canvas, this.#view, this.#do] = [canvas, view, act];
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    canvas.addEventListener("pointerup", (event) => this.#up(event));
    canvas.addEventListener("pointercancel", () => this.#giveUp());
    canvas.addEventListener("keydown", (event) => this.#key(event));
  }

  arm(tool) {
    this.armed = this.armed === tool ? null : tool;
    this.#canvas.classList.toggle("aims", this.armed !== null);
    this.#do.changed();
  }

  #down(event) {
    const draft = this.#do.draft();
    if (draft === null) return;
    if (this.#press !== null) {
      // A second finger pans or zooms.
      this.#giveUp();
      return;
    }
    if (event.button !== 0) return;
    const [x, y] = [event.offsetX, event.offsetY];
    const press = { pointer: event.pointerId, x, y, at: this.#floor(x, y), ...this.#grip(draft, x, y) };
    this.#press = press;
    this.#view.held = press.kind !== "tap";
    if (!this.#view.held) return;
    this.#canvas.setPointerCapture(event.pointerId);
    if (press.kind === "new") {
      press.name = this.#name(draft);
      draft.add(...this.#made(press.name, press.at, press.at));
    }
    this.#do.changed();
  }

  // What a press at this point takes hold of.
  #grip(draft, x, y) {
    if (this.armed !== null) return { kind: "new" };
    const { item, selected } = draft;
    if (item === null) return { kind: "tap" };
    const near = (point, px) => {
      const [sx, sy] = this.#view.toScreen(...point);
      return Math.hypot(sx - x, sy - y) <= px;
    };
    if (selected.kind === "places") {
      const [px, py] = this.#view.toScreen(item.x_m, item.y_m);
      if (Math.abs(Math.hypot(px - x, py - y) - RING_PX) <= HANDLE_PX / 2) return { kind: "turn", item };
      if (near([item.x_m, item.y_m], PLACE_PX)) return { kind: "body", item };
    }
    const corner = item.points.findIndex((point) => near(point, HANDLE_PX));
    if (corner >= 0) return { kind: "corner", item, index: corner };
    const side = middles(item.points).findIndex((point) => near(point, HANDLE_PX));
    if (side >= 0) {
      const points = item.points.toSpliced(side + 1, 0, middles(item.points)[side]);
      return { kind: "corner", item: { ...item, points }, index: side + 1 };
    }
    return selected.kind === "zones" && holds(item.points, this.#floor(x, y)) ? { kind: "body", item } : { kind: "tap" };
  }

  #move(event) {
    const [press, draft] = [this.#press, this.#do.draft()];
    if (draft === null || press?.pointer !== event.pointerId || press.kind === "tap") return;
    const to = this.#floor(event.offsetX, event.offsetY);
    const by = [to[0] - press.at[0], to[1] - press.at[1]];
    press.moved ||= Math.hypot(event.offsetX - press.x, event.offsetY - press.y) > TAP_PX;
    if (!press.moved) return;
    if (press.kind === "new") draft.amend(this.#made(press.name, press.at, to)[1]);
    else draft.drag(this.#dragged(draft.selected.kind, press, to, by));
    this.#do.changed();
  }

  #dragged(kind, { kind: grip, item, index }, to, by) {
    if (grip === "body") return moved(kind, item, ...by);
    if (grip === "corner") return { ...item, points: item.points.with(index, to.map(on)) };
    return turned(kind, { ...item, yaw_rad: 0 }, Math.atan2(to[1] - item.y_m, to[0] - item.x_m));
  }

  #up(event) {
    const [press, draft] = [this.#press, this.#do.draft()];
    if (press?.pointer !== event.pointerId) return;
    this.#drop();
    if (draft === null) return;
    draft.drop();
    const isTap = Math.hypot(event.offsetX - press.x, event.offsetY - press.y) <= TAP_PX;
    if (press.kind === "new") this.#drawn(draft);
    else if (isTap && (press.kind === "tap" || press.kind === "body")) this.#tap(draft, event.offsetX, event.offsetY);
    this.#do.changed();
  }

  // A zone without a size was no more than a tap.
  #drawn(draft) {
    const { item, selected } = draft;
    if (selected.kind === "zones") {
      const [[west, south], , [east, north]] = item.points;
      if (east - west < LEAST_M || north - south < LEAST_M) {
        draft.takeBack();
        this.#do.say("Press and drag to draw a zone.");
        return;
      }
    }
    this.arm(this.armed);
    this.#do.say(`${item.name} added`);
  }

  #tap(draft, x, y) {
    const away = ({ x_m, y_m }) => {
      const [px, py] = this.#view.toScreen(x_m, y_m);
      return Math.hypot(px - x, py - y);
    };
    const near = [...draft.now.places.keys()].filter((i) => away(draft.now.places[i]) <= PLACE_PX);
    const place = near.sort((a, b) => away(draft.now.places[a]) - away(draft.now.places[b]))[0];
    const zone = draft.now.zones.findLastIndex(({ points }) => holds(points, this.#floor(x, y)));
    if (place !== undefined) draft.select("places", place);
    else if (zone >= 0) draft.select("zones", zone);
    else draft.select(null);
    if (draft.item) this.#do.say(`${draft.item.name} selected`);
  }

  #name(draft) {
    const [kind, stem] = { place: ["places", "place"], one_way: ["zones", "lane"], keep_out: ["zones", "keep-out"] }[this.armed];
    return draft.name(kind, stem);
  }

  // A new item between two points: [kind, item].
  #made(name, from, to) {
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    if (this.armed === "place") {
      const yaw_rad = from === to ? null : rounded(Math.atan2(dy, dx));
      return ["places", { name, kind: "place", x_m: on(from[0]), y_m: on(from[1]), yaw_rad, tags: [], points: [] }];
    }
    const kind = this.armed === "one_way" ? { one_way: { heading_rad: rounded(along(dx, dy)) } } : "keep_out";
    return ["zones", { name, kind, points: rectangle(from.map(on), to.map(on)) }];
  }

  #key(event) {
    const draft = this.#do.draft();
    if (draft === null || event.ctrlKey || event.altKey || event.metaKey) return;
    const step = event.shiftKey ? FAST_STEP_M : STEP_M;
    const move = (dx, dy) => () => draft.put(moved(draft.selected.kind, draft.item, dx * step, dy * step));
    const turn = (by) => () => draft.put(turned(draft.selected.kind, draft.item, by));
    const ofItem = {
      ArrowLeft: move(-1, 0), ArrowRight: move(1, 0), ArrowUp: move(0, 1), ArrowDown: move(0, -1),
      "[": turn(TURN_RAD), "]": turn(-TURN_RAD),
      Delete: () => draft.remove(), Backspace: () => draft.remove(),
    };
    const always = { Enter: () => this.#putInMiddle(draft), Escape: () => (this.armed ? this.arm(this.armed) : draft.select(null)) };
    const act = (draft.item !== null && ofItem[event.key]) || always[event.key];
    if (!act) return;
    event.preventDefault();
    act();
    this.#do.changed();
  }

  // What is armed, in the middle of what is seen.
  #putInMiddle(draft) {
    if (this.armed === null) return;
    const [x, y] = this.#floor(this.#canvas.clientWidth / 2, this.#canvas.clientHeight / 2);
    const half = this.armed === "place" ? 0 : USUAL_M / 2;
    const corners = [[x - half, y - half], [x + half, y + half]];
    draft.add(...this.#made(this.#name(draft), corners[0], half === 0 ? corners[0] : corners[1]));
    this.arm(this.armed);
    this.#do.say(`${draft.item.name} added; arrow keys move it`);
  }

  #floor(x, y) {
    const { x_m, y_m } = this.#view.toFloor(x, y);
    return [x_m, y_m];
  }

  #giveUp() {
    const draft = this.#do.draft();
    const isNew = this.#press?.kind === "new";
    this.#drop();
    if (draft === null) return;
    draft.giveUp();
    if (isNew) draft.takeBack();
    this.#do.changed();
  }

  #drop() {
    this.#press = null;
    this.#view.held = false;
  }
}

function rounded(rad) {
  return Math.round(rad * 1e4) / 1e4;
}

// A lane leads along its longer side, the way it was drawn.
function along(dx, dy) {
  if (Math.abs(dx) > Math.abs(dy)) return dx < 0 ? Math.PI : 0;
  return dy < 0 ? -Math.PI / 2 : Math.PI / 2;
}

// The middle of each side.
export function middles(points) {
  return points.map(([x, y], i) => {
    const [nx, ny] = points[(i + 1) % points.length];
    return [(x + nx) / 2, (y + ny) / 2];
  });
}
