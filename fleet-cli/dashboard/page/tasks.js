// The dispatcher's tasks: the list, and the form that submits one.

import { html, nothing } from "./vendor/lit-html.js";
import { repeat } from "./vendor/directives/repeat.js";
import { plain, point } from "./words.js";

const ENDED = ["done", "failed", "cancelled"];
const TONES = { running: "good", done: "good", failed: "bad", blocked: "warn", held: "warn", paused: "warn" };
const PUT_ASIDE = ["paused", "held"]; // they go on when they are resumed
const AGAIN = ["failed", "cancelled"];
const ENDED_SHOWN = 30;

// The form as it stands; kept here so that a new picture loses nothing.
export const form = { kind: "goto", who: "any", priority: 5, loops: 1, dwell_s: 0, for_s: "", due_min: "", error: null, sent: null };

// What the form means for the points: a TaskSpec, or the reason why it is none.
export function spec(points) {
  const { kind, who, priority, loops, dwell_s, for_s, due_min } = form;
  const waypoints = points.map(({ x_m, y_m, yaw_rad }) => ({ x_m: round(x_m), y_m: round(y_m), yaw_rad }));
  const least = { goto: 1, route: 1, patrol: 1, wander: 0 }[kind];
  if (waypoints.length < least) return { error: "Click the target on the map." };
  const seconds = for_s === "" ? null : Number(for_s);
  if (kind === "wander" && seconds === null) return { error: "Enter the number of seconds to wander." };
  const kinds = {
    goto: () => ({ goto: { to: waypoints.at(-1) } }),
    route: () => ({ route: { points: waypoints, loops: Number(loops), dwell_s: Number(dwell_s) } }),
    patrol: () => ({ patrol: { points: waypoints, dwell_s: Number(dwell_s), for_s: seconds } }),
    wander: () => ({ wander: { for_s: seconds } }),
  };
  if (due_min !== "" && !(Number(due_min) > 0)) return { error: "The deadline is a number of minutes from now." };
  const deadline_ms = due_min === "" ? null : Math.round(Date.now() + Number(due_min) * 60_000);
  return { spec: { kind: kinds[kind](), priority: Number(priority), deadline_ms, who: whom(who) } };
}

// The points after another one was picked.
export function withPoint(points, point) {
  form.error = null;
  return form.kind === "goto" ? [point] : [...points, point];
}

function round(m) {
  return Math.round(m * 1000) / 1000;
}

function whom(who) {
  const [kind, name] = who.split(":");
  return kind === "any" ? "any" : { [kind]: name };
}

export function taskPanel(store, act, look) {
  const list = store.tasks;
  const isThere = store.dispatcher();
  return html`<h2>New task</h2>
    ${isThere ? nothing : html`<p class="box warn">${isThere === null ? "Dispatcher state unknown."
      : html`No dispatcher. Start one with <code>fleet-cli dispatch serve</code>.`}</p>`}
    ${store.suspended().map((one) => suspended(one, store, act))}
    ${store.controls() ? formOf(store, act, look, isThere) : nothing}
    ${list?.ledger_failed ? html`<p class="box bad">The ledger cannot be written: ${list.ledger_failed}</p>` : nothing}
    ${tasks(list, store, act, isThere)}`;
}

// What ends a suspension may set robots in motion: it asks first.
let asked = null;
function suspended(one, store, act) {
  const [id, what, end] = one.all
    ? ["activate", "Activate the dispatcher", act.activate]
    : ["adopt", "Adopt these tasks for this map", act.adopt];
  const press = (asks, does) => () => {
    asked = asks;
    if (does) end();
    act.changed();
  };
  const button = asked === id
    ? html`<span>Robots may start at once.</span>
      <button type="button" id="${id}-yes" @click=${press(null, true)}>${what}</button>
      <button type="button" @click=${press(null, false)}>Cancel</button>`
    : html`<button type="button" id=${id} title=${store.denied() ?? nothing} ?disabled=${store.denied() !== null}
        @click=${press(id, false)}>${what}</button>`;
  return html`<div class="box bad"><p><strong>Suspended:</strong> ${one.text}</p>
    <p class="todo">${one.remedy.split("`").map((part, i) => (i % 2 ? html`<code>${part}</code>` : part))}</p>
    ${store.controls() ? html`<div class="row">${button}</div>` : nothing}</div>`;
}

function formOf(store, act, look, isThere) {
  const set = (name) => (event) => {
    form[name] = event.target.value;
    form.error = form.sent = null;
    if (name === "kind") act.kindChosen();
    act.changed();
  };
  const option = (value, text, name) => html`<option value=${value} ?selected=${form[name] === value}>${text}</option>`;
  const field = (name, label, rest) => html`<label>${label}<input type="number" .value=${String(form[name])}
    min=${rest.min} max=${rest.max} step=${rest.step ?? 1} placeholder=${rest.placeholder ?? ""} @input=${set(name)}></label>`;
  const robots = [...store.robots.keys()];
  const tags = [...new Set([...store.robots.values()].flatMap((robot) => robot.tags))];
  const needsPoints = form.kind !== "wander";
  const denied = store.denied();
  return html`<form @submit=${(event) => { event.preventDefault(); act.submit(); }}>
    <fieldset class="form" title=${denied ?? nothing} ?disabled=${denied !== null}>
    ${denied === null ? nothing : html`<p class="wide hint">${denied}.</p>`}
    <label>Task<select @change=${set("kind")}>${option("goto", "Go to a point", "kind")}${option("route", "Route", "kind")}
      ${option("patrol", "Patrol", "kind")}${option("wander", "Wander", "kind")}</select></label>
    <label>Robot<select @change=${set("who")}>${option("any", "Any robot", "who")}
      ${robots.map((name) => option(`robot:${name}`, name, "who"))}${tags.map((tag) => option(`tag:${tag}`, `tag ${tag}`, "who"))}</select></label>
    ${field("priority", "Priority (9 = first)", { min: 0, max: 9 })}
    ${field("due_min", "Deadline, min from now", { min: 1, max: 100_000, step: "any", placeholder: "none" })}
    ${form.kind === "route" ? field("loops", "Loops", { min: 1, max: 1000 }) : nothing}
    ${form.kind === "route" || form.kind === "patrol" ? field("dwell_s", "Wait at each, s", { min: 0, max: 86400, step: "any" }) : nothing}
    ${form.kind === "patrol" || form.kind === "wander" ? field("for_s", "Duration, s", { min: 0, max: 86400, step: "any", placeholder: form.kind === "patrol" ? "until cancelled" : "" }) : nothing}
    ${needsPoints ? pointsOf(act, look) : nothing}
    ${form.error ? html`<p class="wide error" role="alert">${form.error}</p>` : nothing}
    ${form.sent ? html`<p class="wide hint" role="status">${form.sent}</p>` : nothing}
    <button class="wide main" id="task-submit" ?disabled=${!isThere}>Submit</button>
    </fieldset></form>`;
}

function pointsOf(act, look) {
  const text = look.points.length === 0 ? "none yet" : look.points.map(point).join(" → ");
  return html`<p class="wide hint">${form.kind === "goto" ? "Point" : "Points"}: ${text}</p>
    <button type="button" id="task-points" aria-pressed=${look.tool === "points"} @click=${act.pickPoints}>
      ${look.tool === "points" ? "Click on the map…" : "Pick on the map"}</button>
    <button type="button" ?disabled=${look.points.length === 0} @click=${act.dropPoints}>Clear points</button>`;
}

function tasks(list, store, act, isThere) {
  if (!list) return html`<p class="empty">No task list yet.</p>`;
  const open = list.tasks.filter((task) => !ENDED.includes(task.state));
  const ended = list.tasks.filter((task) => ENDED.includes(task.state)).reverse();
  const shown = [...open, ...ended.slice(0, ENDED_SHOWN)];
  const row = (task) => html`<li class=${isThere ? "" : "is-stale"}>
    <span class="what">${task.id} · ${words(task)}</span>
    <span class="chip ${TONES[task.state] ?? ""}">${plain(task.state)}</span>
    <span class="more">${more(task)}</span>
    ${store.controls() && isThere ? buttons(task, store, act) : nothing}</li>`;
  return html`<h2 class="later">Tasks${isThere ? "" : ", last known"} (${open.length} open)</h2>
    <ul class="task-list">${repeat(shown, (task) => task.id, row)}</ul>
    ${list.left_out > 0 ? html`<p class="more">${list.left_out} more are not shown: see <code>fleet-cli tasks --all</code>.</p>` : nothing}
    ${shown.length === 0 ? html`<p class="empty">No tasks yet.</p>` : nothing}`;
}

// What can be done about a task as it stands.
function buttons({ id, state }, store, act) {
  const denied = store.denied();
  const button = (word, does) => html`<button type="button" title=${denied ?? nothing} ?disabled=${denied !== null}
    aria-label="${word} ${id}" @click=${() => does(id)}>${word}</button>`;
  const ended = ENDED.includes(state);
  const aside = PUT_ASIDE.includes(state);
  if (state === "done" || state === "cancelling") return nothing;
  return html`<span class="actions">
    ${!ended && !aside ? button("Pause", act.pause) : nothing}
    ${aside ? button("Resume", act.resume) : nothing}
    ${AGAIN.includes(state) ? button("Retry", act.retry) : nothing}
    ${ended ? nothing : button("Cancel", act.cancel)}</span>`;
}

function words({ spec: { kind } }) {
  const [name] = Object.keys(kind);
  const body = kind[name];
  if (name === "goto") return `go to ${point(body.to)}`;
  if (name === "wander") return `wander for ${body.for_s} s`;
  return `${name} over ${body.points.length} points`;
}

function more(task) {
  const legs = task.legs === null ? `${task.legs_done} ${task.legs_done === 1 ? "leg" : "legs"}` : `${task.legs_done}/${task.legs}`;
  const { who, deadline_ms, priority } = task.spec;
  const due = deadline_ms ? `due ${new Date(deadline_ms).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" })}` : null;
  const tag = who.tag ? `tag ${who.tag}` : null;
  const parts = [task.robot, tag, legs, dwell(task), due, `priority ${priority}`, `by ${task.by}`, task.reason];
  return parts.filter((part) => part).join(" · ");
}

function dwell({ spec: { kind } }) {
  const { dwell_s } = Object.values(kind)[0];
  return dwell_s > 0 ? `waits ${dwell_s} s at each` : null;
}
