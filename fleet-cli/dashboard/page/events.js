// What happened: a line for each drive, task and other event, with its events on request; and a search in the history.

import { html, nothing } from "./vendor/lit-html.js";
import { repeat } from "./vendor/directives/repeat.js";
import { clock } from "./alerts.js";
import { age, happening, plain } from "./words.js";

const unfolded = new Set(); // numbers of the first events of lines whose details are shown
export const history = { text: "", found: null, more: false, error: null, asked: "" };

// What is one event's line, oldest first; as core/client/src/scene/fold.rs has it.
export function fold(events) {
  const [entries, drives, begins, tasks] = [[], new Map(), new Map(), new Map()];
  const add = (entry, event) => {
    if (entry) {
      entry.push(event);
      return entry;
    }
    entries.push([event]);
    return entries.at(-1);
  };
  for (const event of events) {
    const { robot: of, task } = event.what;
    if (task) {
      tasks.set(task.task, add(tasks.get(task.task), event));
    } else if (!of) {
      add(null, event);
    } else {
      const [name] = Object.keys(of.kind);
      const body = of.kind[name];
      const drive = drives.get(of.robot);
      if (name === "goal") {
        const entry = add((drive?.id === body.id ? drive.entry : null) ?? begins.get(of.robot), event);
        begins.delete(of.robot);
        drives.set(of.robot, { entry, id: body.id, open: ["accepted", "running", "blocked"].includes(body.status) });
      } else if (name === "mode" || name === "lease") {
        const ends = name === "mode" ? body.to === "idle" : body.holder === null;
        if (drive && (drive.open || ends)) add(drive.entry, event);
        else begins.set(of.robot, add(begins.get(of.robot), event));
      } else {
        begins.delete(of.robot);
        add(null, event);
      }
    }
  }
  return entries.sort((a, b) => a.at(-1).number - b.at(-1).number);
}

const goalOf = ({ what }) => what.robot?.kind.goal;

// A line in words: [words, tone].
export function line(entry) {
  const head = entry.findLast(goalOf) ?? entry.at(-1);
  if (entry.length === 1 || !goalOf(head)) return happening(head);
  const goals = entry.filter(goalOf);
  const { status, reason } = goalOf(head);
  const isOver = !["accepted", "running", "blocked"].includes(status);
  const took = isOver ? ` after ${Math.round((head.what.robot.tick_ms - goals[0].what.robot.tick_ms) / 1000)} s` : "";
  const blocked = goals.filter((event) => goalOf(event).status === "blocked").length;
  const text = `${head.what.robot.robot}: drive ${plain(status)}${took}${reason ? `: ${reason}` : ""}${["", ", blocked once"][blocked] ?? `, blocked ${blocked} times`}`;
  return [text, happening(head)[1]];
}

export function events(store, act, nowMs) {
  const rows = fold(store.happenings).reverse();
  const serverMs = store.serverMs(nowMs);
  const since = (event) => Math.max(0, serverMs - event.at_ms);
  const short = (ms) => age(ms).replace(/\.\d s$/, " s").replace(/^\d+ ms$/, "0 s");
  const time = (event) => html`<time title=${clock(Date.now() - since(event))}>−${short(since(event))}</time>`;
  const toggle = (key) => () => {
    if (!unfolded.delete(key)) unfolded.add(key);
    act.changed();
  };
  return html`<h2>Events</h2>${search(act)}
    ${history.found === null ? nothing : found()}
    <ol class="event-list" ?hidden=${history.found !== null}>${repeat(rows, (entry) => entry[0].number, (entry) => {
      const [text, tone] = line(entry);
      const key = entry[0].number;
      if (entry.length === 1) return html`<li>${time(entry[0])}<span class=${tone}>${text}</span></li>`;
      const isOpen = unfolded.has(key);
      return html`<li>${time(entry.at(-1))}<span><button type="button" class="fold ${tone}" aria-expanded=${isOpen} @click=${toggle(key)}>
        ${text} <span aria-hidden="true">${isOpen ? "▾" : "▸"}</span></button>
        ${isOpen ? html`<ol class="event-list">${entry.toReversed().map((event) => html`<li>${time(event)}
          <span class=${happening(event)[1]}>${happening(event)[0]}</span></li>`)}</ol>` : nothing}</span></li>`;
    })}</ol>
    ${rows.length === 0 && history.found === null ? html`<p class="empty">No events yet.</p>` : nothing}`;
}

function search(act) {
  return html`<form class="row" role="search" @submit=${(event) => { event.preventDefault(); act.searchEvents(); }}>
    <input type="search" id="event-search" class="grow" aria-label="Search the fleet's history" placeholder="Search the history"
      maxlength="100" .value=${history.text} @input=${(event) => { history.text = event.target.value; if (!history.text) act.searchEvents(); }}>
    <button type="submit">Search</button></form>`;
}

function found() {
  const { found: all, more, error, asked } = history;
  if (error) return html`<p class="error" role="alert">${error}</p>`;
  const what = `${all.length}${more ? " newest" : ""} ${all.length === 1 ? "event" : "events"} with “${asked}”`;
  return html`<p class="hint" role="status">${what}</p>
    <ol class="event-list" id="history">${all.toReversed().map((event) => html`<li class="dated"><time>${clock(event.at_ms)}</time>
      <span>${event.text}</span></li>`)}</ol>`;
}
