// The list of robots: a field that filters them, how many are in which state, and a row for each.

import { html, nothing } from "./vendor/lit-html.js";
import { live } from "./vendor/directives/live.js";
import { repeat } from "./vendor/directives/repeat.js";
import { chipOf, resetAll } from "./robots.js";
import { Order, counts, shownRobots } from "./robot_filter.js";
import { age, line } from "./words.js";

const DENSE_FROM = 16; // robots: from here on a row is one line
const ORDER_EVERY_MS = 1000;
const HOVERS = matchMedia("(hover: hover)");

const order = new Order();
let [text, orderedMs] = ["", -Infinity];
const list = () => document.getElementById("robots");

// Whether a row must not move: the pointer is over the list, a finger on it, or the keyboard in it. (Where there is no
// pointer, what was tapped last counts as hovered.)
function isHeld() {
  const held = HOVERS.matches ? ".robot-list:is(:hover, :active)" : ".robot-list:active";
  return list().querySelector(`${held}, .robot-row:focus-visible`) !== null;
}

function setFilter(to, act) {
  text = to;
  act.changed();
}

// The field of the filter gets the focus; on a small screen the list comes first.
export function focusFilter(act) {
  act.tab("robots");
  requestAnimationFrame(() => {
    const field = document.getElementById("robot-filter");
    field?.focus();
    field?.select();
  });
}

function keys(event, robots, act) {
  if (event.key === "Escape") {
    event.preventDefault();
    setFilter("", act);
    document.getElementById("floor").focus({ preventScroll: true });
  } else if (event.key === "Enter" && robots.length > 0) {
    event.preventDefault();
    act.select(robots[0].name, true);
    document.getElementById("floor").focus({ preventScroll: true });
  } else if (event.key === "ArrowDown") {
    event.preventDefault();
    list().querySelector(".robot-row")?.focus();
  }
}

function filter(all, shown, act) {
  const tags = [...new Set(all.flatMap((robot) => robot.tags))].map((tag) => tag.replace(/^@/, "")).sort();
  const toggle = (word) => () => setFilter(text.trim() === word ? "" : word, act);
  const chip = (word, count) => html`<button type="button" class="chip" data-filter=${word} aria-pressed=${text.trim() === word}
    @click=${toggle(word)}>${count === null ? word : `${count} ${word}`}</button>`;
  return html`<div class="filter">
    <input id="robot-filter" type="search" placeholder="Filter: name, @tag, state" aria-label="Filter robots by name, @tag or state"
      aria-keyshortcuts="/" autocomplete="off" autocapitalize="off" spellcheck="false" .value=${live(text)}
      @input=${(event) => setFilter(event.target.value, act)} @keydown=${(event) => keys(event, shown, act)}><kbd>/</kbd></div>
    <div class="filter-chips" role="group" aria-label="Robots by state and tag">
      ${counts(all).map(([word, count]) => chip(word, count))}${tags.map((tag) => chip(`@${tag}`, null))}</div>`;
}

function row(robot, store, act) {
  return html`<li><button type="button" class="robot-row ${robot.stale ? "is-stale" : ""}" data-robot=${robot.name}
      aria-pressed=${store.selected === robot.name} @click=${() => act.select(robot.name, true)}>
      <span class="dot c${robot.colour}" aria-hidden="true"></span>
      <span class="name">${robot.name}${robot.alias ? html` <span class="alias">${robot.alias}</span>` : nothing}</span>
      ${chipOf(robot)}
      <span class="why" title=${line(robot)}>${line(robot)}</span>
      <span class="age">${robot.stale ? `${age(robot.age_ms)} old` : robot.task ?? ""}</span>
    </button></li>`;
}

export function robotList(store, act, nowMs) {
  const all = [...store.robots.values()];
  if (all.length === 0) {
    return html`<h2>Robots</h2>
      <p class="empty">${store.frame ? "No robots found. Start robots with robot-agent or fleet-cli sim." : "Searching…"}</p>`;
  }
  if (nowMs - orderedMs >= ORDER_EVERY_MS || all.some((robot) => order.place(robot.name) === Infinity)) {
    order.update(all, isHeld());
    orderedMs = nowMs;
  }
  const shown = shownRobots(all, text, order);
  const heading = shown.length === all.length ? all.length : `${shown.length} of ${all.length}`;
  const dense = all.length >= DENSE_FROM ? "dense" : "";
  return html`<h2>Robots (${heading})</h2>
    ${filter(all, shown, act)}
    ${resetAll(all, store, act)}
    <ul class="robot-list ${dense}">${repeat(shown, (robot) => robot.name, (robot) => row(robot, store, act))}</ul>
    ${shown.length === 0 ? html`<p class="empty">No robot fits “${text.trim()}”.
      <button type="button" @click=${() => setFilter("", act)}>Show all</button></p>` : nothing}`;
}
