// Which robots the list shows, and in which order: those in trouble first, then by their names. No I/O, no clock.
//
// A filter is words between blanks; a robot is shown if it fits all of them:
//   @north     it has a tag that begins so
//   latched    its state: one of STATES, or the beginning of one from three letters on
//   7          the number at the end of its name; if nobody has just that one, a part of the name
//   anything   a part of its name or of its alias

import { chip } from "./words.js";

// The words of its chip → how urgent it is; what is not here drives or stands as it should.
const URGENT = { latched: 0, faulty: 1, missing: 2, stale: 2, blocked: 3, stopped: 4 };
const QUIET = 5;
export const STATES = [...Object.keys(URGENT), "driving", "wandering", "hand-driven", "transmitter", "idle"];
const STATE_FROM = 3; // letters of a state that mean it

export function state(robot) {
  return chip(robot)[0];
}

export function urgency(robot) {
  return URGENT[state(robot)] ?? QUIET;
}

export function matches(robot, text) {
  return words(text).every((word) => fits(robot, word));
}

function words(text) {
  return text.toLowerCase().split(/\s+/).filter((word) => word !== "");
}

function fits(robot, word) {
  if (word.startsWith("@")) {
    return robot.tags.some((tag) => tag.replace(/^@/, "").toLowerCase().startsWith(word.slice(1)));
  }
  const isState = word.length >= STATE_FROM && STATES.some((one) => one.startsWith(word));
  if (isState && state(robot).startsWith(word)) return true;
  return `${robot.name} ${robot.alias ?? ""}`.toLowerCase().includes(word);
}

// The robots that fit, as the list shows them. A number in the filter brings the robot of that number to the top.
export function shownRobots(robots, text, order) {
  const found = robots.filter((robot) => matches(robot, text));
  const numbers = words(text).filter((word) => /^\d+$/.test(word)).map(Number);
  const isNamed = (robot) => numbers.includes(Number(robot.name.match(/\d+$/)?.[0]));
  const exact = numbers.length > 0 ? found.filter(isNamed) : [];
  const rest = exact.length > 0 ? found.filter((robot) => !isNamed(robot)) : found;
  return [...exact, ...rest.sort((a, b) => order.place(a.name) - order.place(b.name))];
}

// How many robots are in each state that any robot is in, the most urgent first.
export function counts(robots) {
  const found = new Map();
  for (const robot of robots) found.set(state(robot), (found.get(state(robot)) ?? 0) + 1);
  const urgent = (name) => URGENT[name] ?? QUIET;
  return [...found].sort(([a], [b]) => urgent(a) - urgent(b) || STATES.indexOf(a) - STATES.indexOf(b));
}

// Who stands where. It is held while somebody points at the list, so that no row slips away below the finger.
export class Order {
  #places = new Map(); // name → place

  place(name) {
    return this.#places.get(name) ?? Infinity;
  }

  // Takes in who there is, in the order of their names; who is new while it is held comes last.
  update(robots, held) {
    const fresh = robots.map((robot, index) => [urgency(robot), index, robot.name]);
    fresh.sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const names = fresh.map(([, , name]) => name);
    if (held) {
      const old = names.filter((name) => this.#places.has(name)).sort((a, b) => this.place(a) - this.place(b));
      names.splice(0, names.length, ...old, ...names.filter((name) => !this.#places.has(name)));
    }
    this.#places = new Map(names.map((name, index) => [name, index]));
  }
}
