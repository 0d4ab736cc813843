// Zones and places of the map while somebody changes them. Each change is a step that can be undone; what somebody
// else has saved meanwhile is put together with it item by item. Items are never changed in place. No DOM, no I/O.

export const KINDS = ["zones", "places"];
const STEPS = 200;
const START_TAG = "start-";

export class MapDraft {
  base; // {map, places}: hashes of what was read
  now; // {zones, places}
  selected = null; // {kind, index}
  #read; // {zones, places} as they were read
  #saved = null; // hashes of what this page has replaced: seen for a moment after it was saved
  #undo = [];
  #redo = [];
  #held = null; // as it was before the drag that goes on

  constructor(base, zones, places) {
    this.base = base;
    this.#read = this.now = { zones, places };
  }

  get dirty() {
    return this.count > 0;
  }

  // Zones and places that differ from what was read.
  get count() {
    return KINDS.reduce((sum, kind) => sum + changes(this.#read[kind], this.now[kind]).length, 0);
  }

  get undoable() {
    return this.#undo.length > 0;
  }

  get redoable() {
    return this.#redo.length > 0;
  }

  // The selected item, or null.
  get item() {
    return this.selected === null ? null : this.now[this.selected.kind][this.selected.index] ?? null;
  }

  select(kind, index) {
    this.selected = kind === null ? null : { kind, index };
  }

  add(kind, item) {
    this.#step({ ...this.now, [kind]: [...this.now[kind], item] });
    this.select(kind, this.now[kind].length - 1);
  }

  // Another item in place of the selected one.
  put(item) {
    if (this.item !== null && !same(this.item, item)) this.#step(this.#with(item));
  }

  // The selected place becomes the start pose of a robot, and no other place is; null = it is nobody's.
  setStart(robot) {
    if (this.selected?.kind !== "places") return;
    const retagged = (place, i) => {
      const own = i === this.selected.index;
      const tags = place.tags.filter((tag) => (own ? startRobot([tag]) === null : tag !== startTag(robot)));
      if (own && robot !== null) tags.push(startTag(robot));
      return { ...place, tags };
    };
    this.#step({ ...this.now, places: this.now.places.map(retagged) });
  }

  remove() {
    if (this.item === null) return;
    const { kind, index } = this.selected;
    this.#step({ ...this.now, [kind]: this.now[kind].filter((_, i) => i !== index) });
    this.selected = null;
  }

  // The item that was just added as it becomes while it is drawn: no step of its own.
  amend(item) {
    if (this.item !== null) this.now = this.#with(item);
  }

  // The last step as if it had never been.
  takeBack() {
    this.giveUp();
    if (this.#undo.length > 0) [this.now, this.selected] = [this.#undo.pop(), null];
  }

  // The selected item while it is dragged: all of the drag is one step, which `drop` makes.
  drag(item) {
    if (this.item === null) return;
    this.#held ??= this.now;
    this.now = this.#with(item);
  }

  drop() {
    const [before, after] = [this.#held, this.now];
    if (before === null) return;
    [this.#held, this.now] = [null, before];
    if (!same(before, after)) this.#step(after);
  }

  // The drag is taken back.
  giveUp() {
    if (this.#held !== null) [this.now, this.#held] = [this.#held, null];
  }

  undo() {
    this.#swap(this.#undo, this.#redo);
  }

  redo() {
    this.#swap(this.#redo, this.#undo);
  }

  // A name that no other item of this kind has.
  name(kind, stem) {
    const taken = new Set(this.now[kind].map((item) => item.name));
    if (!taken.has(stem)) return stem;
    let number = 2;
    while (taken.has(`${stem}-${number}`)) number += 1;
    return `${stem}-${number}`;
  }

  // What keeps this from being saved: a sentence for each item.
  problems() {
    const wrong = [];
    for (const kind of KINDS) {
      const names = this.now[kind].map((item) => item.name);
      for (const [i, item] of this.now[kind].entries()) {
        if (names.indexOf(item.name) !== i) wrong.push(`Two ${kind} have the name ${item.name}.`);
        const bad = kind === "zones" ? zoneName(item.name) : placeName(item.name);
        if (bad) wrong.push(bad);
      }
    }
    return wrong;
  }

  // Whether the map that is served, by its hashes, is another one than this was made of.
  isOld(content) {
    return content !== null && !same(content, this.base) && !same(content, this.#saved);
  }

  // It was saved as this content.
  saved(content) {
    [this.#saved, this.base, this.#read] = [this.base, content, this.now];
  }

  // Puts the changes on top of what somebody else has saved, as one step. Names of what both have changed: they stay
  // as the other one has them.
  rebase(base, zones, places) {
    const [theirs, next, lost] = [{ zones, places }, {}, []];
    for (const kind of KINDS) {
      const [merged, names] = merge(this.#read[kind], this.now[kind], theirs[kind]);
      next[kind] = merged;
      lost.push(...names);
    }
    // What was undone before would take the other one's changes back.
    [this.#undo, this.#redo, this.selected] = [[], [], null];
    [this.base, this.#saved, this.#read, this.now] = [base, null, theirs, next];
    return lost;
  }

  #with(item) {
    const { kind, index } = this.selected;
    return { ...this.now, [kind]: this.now[kind].map((known, i) => (i === index ? item : known)) };
  }

  #step(next) {
    this.drop();
    this.#undo = [...this.#undo, this.now].slice(-STEPS);
    [this.#redo, this.now] = [[], next];
  }

  #swap(from, to) {
    this.giveUp();
    if (from.length === 0) return;
    to.push(this.now);
    this.now = from.pop();
    if (this.item === null) this.selected = null;
  }
}

// The tag of the place where this robot starts.
export function startTag(robot) {
  return `${START_TAG}${robot}`;
}

// The robot that starts at a place with these tags, or null.
export function startRobot(tags) {
  return tags.find((tag) => tag.startsWith(START_TAG) && tag !== START_TAG)?.slice(START_TAG.length) ?? null;
}

export function same(one, other) {
  return JSON.stringify(one) === JSON.stringify(other);
}

function byName(items) {
  return new Map(items.map((item) => [item.name, item]));
}

// Names that differ, are new or gone.
function changes(before, after) {
  const [old, now] = [byName(before), byName(after)];
  return [...new Set([...old.keys(), ...now.keys()])].filter((name) => !same(old.get(name), now.get(name)));
}

// What was changed from `read` to `mine`, put into `theirs`: [items, names that both have changed].
function merge(read, mine, theirs) {
  const [old, own, merged, lost] = [byName(read), byName(mine), byName(theirs), []];
  for (const name of changes(read, mine)) {
    const [before, wanted, there] = [old.get(name), own.get(name), merged.get(name)];
    if (!same(before, there) && !same(wanted, there)) lost.push(name);
    else if (wanted) merged.set(name, wanted);
    else merged.delete(name);
  }
  return [[...merged.values()], lost];
}

function zoneName(name) {
  const good = name.length > 0 && [...name].length <= 64 && name.trim() === name;
  return good ? null : `"${name}" cannot be a zone's name: 1 to 64 characters, no blank at either end.`;
}

function placeName(name) {
  const good = /^[a-z][a-z0-9-]{0,31}$/.test(name) && !["inf", "infinity", "nan", "all"].includes(name);
  return good ? null : `"${name}" cannot be a place's name: a-z, 0-9 and -, a letter first, at most 32.`;
}

// Shapes: points are [x_m, y_m].

const STEP_M = 0.05;

// On the grid of what people draw.
export function on(m) {
  return Math.round(m / STEP_M) / Math.round(1 / STEP_M);
}

export function rectangle([x0, y0], [x1, y1]) {
  const [west, east, south, north] = [Math.min(x0, x1), Math.max(x0, x1), Math.min(y0, y1), Math.max(y0, y1)];
  return [[west, south], [east, south], [east, north], [west, north]];
}

// The same item so much farther east and north.
export function moved(kind, item, dx_m, dy_m) {
  const points = item.points.map(([x_m, y_m]) => [on(x_m + dx_m), on(y_m + dy_m)]);
  return kind === "zones" ? { ...item, points } : { ...item, points, x_m: on(item.x_m + dx_m), y_m: on(item.y_m + dy_m) };
}

// Turned by so much, counter-clockwise: a lane's heading, a place's yaw. Other items stay.
export function turned(kind, item, by_rad) {
  const around = (rad) => Math.round(Math.atan2(Math.sin(rad), Math.cos(rad)) * 1e4) / 1e4;
  if (kind === "places") return { ...item, yaw_rad: around((item.yaw_rad ?? 0) + by_rad) };
  if (item.kind === "keep_out") return item;
  return { ...item, kind: { one_way: { heading_rad: around(item.kind.one_way.heading_rad + by_rad) } } };
}

export function holds(points, [x, y]) {
  let inside = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i, i += 1) {
    const [[xi, yi], [xj, yj]] = [points[i], points[j]];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) inside = !inside;
  }
  return inside;
}
