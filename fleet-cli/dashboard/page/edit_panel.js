// The panel that edits the map: what there is, the selected zone or place in figures, undo, and saving.

import { html, nothing } from "./vendor/lit-html.js";
import { live } from "./vendor/directives/live.js";
import { startRobot, startTag } from "./map_draft.js";
import { age } from "./words.js";

const PLACE_KINDS = { place: "Place", dock: "Dock", parking: "Parking", waiting: "Waiting" };
const HISTORY_SHOWN = 10;
const MOST_WHY = 200;
const MOST_TAG = 32; // characters

export function mapPanel(store, editor) {
  if (!store.map) return html`<p class="empty">No map is served to this fleet. Serve one with <code>fleet-cli map serve FILE</code>.</p>`;
  const { draft } = editor;
  if (draft === null) return overview(store, editor);
  return html`<h2>Editing map ${store.map.name}</h2>
    ${conflict(editor)}
    ${tools(editor)}
    ${draft.item ? form(draft, editor, [...store.robots.keys()]) : html`<p class="hint">Tap a zone or a place to select it. What is selected can be dragged:
      as a whole, by its corners, or by the middle of a side, which makes a corner.</p>`}
    ${list(draft, editor)}
    ${saving(store, editor)}
    ${history(editor)}`;
}

function overview(store, editor) {
  const { zones } = store.map;
  const denied = store.denied();
  return html`<h2>Map ${store.map.name}</h2>
    <p class="hint">${count(zones?.length ?? 0, "zone")}, ${count(store.places.length, "place")}. Zones bind all robots as soon as they are saved:
      a robot under way plans anew.</p>
    ${store.controls() ? html`<div class="row"><button type="button" class="main" id="edit-begin" title=${denied ?? nothing}
      ?disabled=${denied !== null} @click=${() => editor.begin()}>Edit zones and places</button></div>` : nothing}
    ${history(editor)}
    <div class="row"><button type="button" id="edit-history" @click=${() => editor.readHistory()}>Show who changed it</button></div>`;
}

function count(number, word) {
  return `${number === 0 ? "No" : number} ${word}${number === 1 ? "" : "s"}`;
}

// Somebody else has saved meanwhile.
function conflict(editor) {
  const lost = editor.lost.length === 0 ? nothing : html`<div class="box warn" role="status"><p>Changed by both, and left as the other
    version has it: <strong>${editor.lost.join(", ")}</strong>.</p></div>`;
  if (!editor.isOld) return lost;
  return html`${lost}<div class="box bad" role="alert"><p><strong>Somebody else has saved this map.</strong> Nothing of yours is
      overwritten, and nothing of theirs.</p>
    <div class="row"><button type="button" id="edit-merge" @click=${() => editor.takeTheirs(true)}>Put my changes on top</button>
      <button type="button" class="danger" id="edit-theirs" @click=${() => editor.takeTheirs(false)}>Discard mine</button></div></div>`;
}

function tools(editor) {
  const { draft, tool } = editor;
  const arm = (name, text, title) => html`<button type="button" data-arm=${name} title=${title} aria-pressed=${tool.armed === name}
    @click=${() => tool.arm(name)}>${text}</button>`;
  return html`<div class="row edit-tools" role="group" aria-label="Add">
      ${arm("keep_out", "+ Keep-out", "Drag a rectangle; no robot may be inside")}
      ${arm("one_way", "+ One-way", "Drag a rectangle; robots drive the way it was drawn")}
      ${arm("place", "+ Place", "Press, and drag for the yaw on arrival")}</div>
    <div class="row"><button type="button" id="edit-undo" aria-keyshortcuts="Control+Z" ?disabled=${!draft.undoable}
        @click=${() => editor.change((it) => it.undo())}>Undo</button>
      <button type="button" id="edit-redo" aria-keyshortcuts="Control+Shift+Z" ?disabled=${!draft.redoable}
        @click=${() => editor.change((it) => it.redo())}>Redo</button></div>`;
}

// What is selected, in figures. A number that cannot be read changes nothing.
function form(draft, editor, robots) {
  const { item, selected } = draft;
  const put = (change) => editor.change((it) => it.put({ ...it.item, ...change }));
  const number = (label, value, set, rest = {}) => html`<label>${label}<input type="number" step=${rest.step ?? "0.05"} .value=${value}
    placeholder=${rest.placeholder ?? ""} @change=${(event) => {
      const read = event.target.value === "" ? (rest.placeholder ? null : undefined) : Number(event.target.value);
      if (read === null || Number.isFinite(read)) set(read);
      else event.target.value = value;
    }}></label>`;
  const own = selected.kind === "zones" ? zoneFields(item, put, number)
    : html`${placeFields(item, put, number)}${startField(item, editor, robots)}`;
  return html`<fieldset class="form edit-item" id="edit-item">
    <label class="wide">Name<input id="edit-name" type="text" maxlength="64" .value=${item.name}
      @change=${(event) => put({ name: event.target.value.trim() })}></label>
    ${own}
    <details class="wide"><summary>${count(item.points.length, "corner")}</summary>
      ${item.points.map(([x, y], i) => html`<div class="corner">
        ${number(`x ${i + 1}, m`, String(x), (read) => put({ points: item.points.with(i, [read, y]) }))}
        ${number(`y ${i + 1}, m`, String(y), (read) => put({ points: item.points.with(i, [x, read]) }))}
        <button type="button" aria-label="Remove corner ${i + 1}" ?disabled=${item.points.length <= 3}
          @click=${() => put({ points: item.points.toSpliced(i, 1) })}>✕</button></div>`)}</details>
    <button type="button" class="wide danger" id="edit-remove" @click=${() => editor.change((it) => it.remove())}>Delete ${item.name}</button>
  </fieldset>`;
}

function zoneFields({ kind }, put, number) {
  const heading = kind === "keep_out" ? null : kind.one_way.heading_rad;
  const choose = (event) => put({ kind: event.target.value === "keep_out" ? "keep_out" : { one_way: { heading_rad: heading ?? 1.5708 } } });
  return html`<label>Kind<select .value=${live(heading === null ? "keep_out" : "one_way")} @change=${choose}>
      <option value="keep_out" ?selected=${heading === null}>Keep-out</option>
      <option value="one_way" ?selected=${heading !== null}>One-way</option></select></label>
    ${heading === null ? nothing : number("Heading, °", degrees(heading), (read) => put({ kind: { one_way: { heading_rad: radians(read) } } }), { step: "1" })}`;
}

function placeFields({ kind, x_m, y_m, yaw_rad, tags }, put, number) {
  const labels = (text) => text.split(/[\s,]+/).filter((tag) => tag !== "");
  return html`<label>Kind<select .value=${live(kind)} @change=${(event) => put({ kind: event.target.value })}>
      ${Object.entries(PLACE_KINDS).map(([name, text]) => html`<option value=${name} ?selected=${kind === name}>${text}</option>`)}</select></label>
    ${number("Yaw on arrival, °", yaw_rad === null ? "" : degrees(yaw_rad), (read) => put({ yaw_rad: read === null ? null : radians(read) }), { step: "1", placeholder: "any" })}
    ${number("x (east), m", String(x_m), (read) => put({ x_m: read }))}
    ${number("y (north), m", String(y_m), (read) => put({ y_m: read }))}
    <label class="wide">Tags<input type="text" .value=${tags.join(" ")} @change=${(event) => put({ tags: labels(event.target.value) })}></label>`;
}

// Whose start pose a place is.
function startField({ tags }, editor, robots) {
  const now = startRobot(tags);
  const names = new Set(robots.filter((name) => startTag(name).length <= MOST_TAG));
  if (now !== null) names.add(now);
  const choose = (event) => editor.change((it) => it.setStart(event.target.value || null));
  return html`<label class="wide">Start pose of<select id="edit-start" .value=${live(now ?? "")} @change=${choose}>
      <option value="" ?selected=${now === null}>no robot</option>
      ${[...names].map((name) => html`<option value=${name} ?selected=${name === now}>${name}</option>`)}</select></label>`;
}

function degrees(rad) {
  return String(Math.round((rad * 1800) / Math.PI) / 10);
}

function radians(deg) {
  return Math.round(((deg * Math.PI) / 180) * 1e4) / 1e4;
}

function list(draft, editor) {
  const row = (kind, what) => (item, index) => {
    const chosen = draft.selected?.kind === kind && draft.selected.index === index;
    return html`<li><button type="button" data-item=${item.name} aria-pressed=${chosen}
      @click=${() => editor.change((it) => it.select(chosen ? null : kind, index))}>${item.name}<span class="more">${what(item)}</span></button></li>`;
  };
  return html`<ul class="edit-list" aria-label="Zones and places">
    ${draft.now.zones.map(row("zones", ({ kind }) => (kind === "keep_out" ? "keep-out" : "one-way")))}
    ${draft.now.places.map(row("places", ({ kind, tags }) => (startRobot(tags) ? `${kind}, start of ${startRobot(tags)}` : kind)))}</ul>`;
}

function saving(store, editor) {
  const { draft, error } = editor;
  const problems = draft.problems();
  const ready = draft.dirty && problems.length === 0 && editor.why.trim() !== "" && !editor.saving && !editor.isOld && store.writable();
  return html`<form class="edit-save" @submit=${(event) => { event.preventDefault(); if (ready) editor.save(); }}>
    <p><span class="chip ${draft.dirty ? "warn" : ""}" id="edit-state">${draft.dirty ? `${count(draft.count, "unsaved change")}` : "no changes"}</span></p>
    ${problems.map((problem) => html`<p class="error" role="alert">${problem}</p>`)}
    ${error ? html`<p class="error" role="alert" id="edit-error">${error.message}${error.hint ? ` (${error.hint})` : ""}</p>` : nothing}
    ${editor.said ? html`<p class="hint" role="status" id="edit-said">${editor.said}</p>` : nothing}
    <label>Why<input id="edit-why" type="text" maxlength=${MOST_WHY} placeholder="what has changed in the room" .value=${editor.why}
      @input=${(event) => { editor.why = event.target.value; editor.change(() => {}); }}></label>
    <div class="row"><button class="main" id="edit-save" ?disabled=${!ready}>${editor.saving ? "Saving…" : "Save for all"}</button>
      <button type="button" class=${draft.dirty ? "danger" : ""} id="edit-end" @click=${() => editor.end()}>
        ${draft.dirty ? "Discard and end" : "End editing"}</button></div></form>`;
}

function history({ history }) {
  if (history === null) return nothing;
  const nowMs = Date.now();
  const line = ({ number, at_ms, by, why }) => html`<li><time title=${new Date(at_ms).toLocaleString()}>${number}</time>
    <span>${why}<br><span class="more">${by}, ${age(Math.max(0, nowMs - at_ms)).replace(/\.\d s$/, " s")} ago</span></span></li>`;
  return html`<h2 class="later">Versions</h2>
    ${history.stored ? nothing : html`<p class="hint">Changes of this map end with the program that serves it.</p>`}
    <ol class="event-list edit-history">${history.versions.toReversed().slice(0, HISTORY_SHOWN).map(line)}</ol>`;
}
