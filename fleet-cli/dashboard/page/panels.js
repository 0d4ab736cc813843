// The rest of the panels: tabs, what became of an emergency stop, the tools on the map, the header.

import { html, nothing } from "./vendor/lit-html.js";
import { repeat } from "./vendor/directives/repeat.js";
import { poseNote } from "./pose_tool.js";
import { form } from "./tasks.js";
import { degrees, number, point } from "./words.js";

export const TABS = { robots: "Robots", robot: "Robot", tasks: "Tasks", events: "Events", alerts: "Alerts", edit: "Map" };

export function tabs(shown, store, act) {
  const title = (name) => (name === "robot" && store.selected ? store.selected : TABS[name]);
  const key = (event) => {
    const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!by) return;
    const all = [...event.currentTarget.parentElement.children].filter((tab) => tab.offsetParent !== null);
    const next = all[(all.indexOf(event.currentTarget) + by + all.length) % all.length];
    act.tab(next.dataset.for);
    next.focus();
  };
  return Object.keys(TABS).map((name) => html`<button type="button" role="tab" id="tab-${name}" data-for=${name}
    aria-selected=${shown === name} aria-controls=${name} tabindex=${shown === name ? 0 : -1}
    @keydown=${key} @click=${() => act.tab(name)}>${title(name)}</button>`);
}

// `stop`: {who, pending, robots: {name: "stopped" | "unknown"}, error}
export function stops(stop, close) {
  if (stop === null) return nothing;
  const robots = Object.entries(stop.robots);
  const unknown = robots.filter(([, outcome]) => outcome !== "stopped");
  const verdict = stop.pending
    ? "sent, waiting for confirmation…"
    : stop.error ?? (unknown.length > 0 ? `${unknown.length} of ${robots.length} UNKNOWN: may still be driving` : "all stopped");
  return html`<strong>Emergency stop of ${stop.who}: ${verdict}</strong>
    ${robots.map(([name, outcome]) => html`<span class="chip ${outcome === "stopped" ? "good" : "bad"}" data-stopped=${name}>
      ${name} ${outcome}</span>`)}
    <span class="grow"></span><button type="button" @click=${close}>Close</button>`;
}

export function tools(store, act, look) {
  const denied = store.denied();
  const button = (tool, text, title) => html`<button type="button" data-tool=${tool} title=${denied ?? title}
    ?disabled=${denied !== null} aria-pressed=${look.tool === tool} @click=${() => act.use(tool)}>${text}</button>`;
  if (!store.controls() || look.tool === "edit") return nothing;
  return html`${button("look", "View", "Pan and zoom; a tap on the map previews a goal")}
    ${button("goals", "Send goals", "Press, drag for the heading, release: sent at once")}
    ${look.tool === "pose" ? button("pose", "Set pose", "Tell a standing robot where it is") : nothing}
    ${look.tool === "points" ? button("points", "Points", "Each tap adds a point to the new task") : nothing}`;
}

export function zoom(act) {
  return html`<button type="button" aria-label="Zoom in" @click=${() => act.zoom(1)}>+</button>
    <button type="button" aria-label="Zoom out" @click=${() => act.zoom(-1)}>−</button>
    <button type="button" aria-label="Show all" title="Show all" @click=${act.fit}>⤢</button>`;
}

export function note(store, act, look) {
  const { preview, said, tool } = look;
  if (tool === "pose" && (preview || !said)) return poseNote(store, act, preview);
  if (preview) {
    const heading = preview.yaw_rad === null ? "any yaw" : degrees(preview.yaw_rad);
    return html`<span><strong>${store.selected}</strong> to ${point(preview)}, ${heading}</span>
      ${tool === "goals" ? nothing : html`<button type="button" class="main" id="goal-send" @click=${act.sendGoal}>Send</button>
        <button type="button" aria-label="Discard this goal" @click=${act.dropGoal}>✕</button>`}`;
  }
  if (tool === "edit" && look.armed) {
    return html`<span>${look.armed === "place" ? "Press where the place is; drag for the yaw on arrival" : "Press and drag: a rectangle"}</span>`;
  }
  if (said) return html`<span>${said}</span>`;
  if (tool === "goals") {
    return store.selected ? html`<span>Press the target for <strong>${store.selected}</strong>; drag for the heading</span>`
      : html`<span>Select a robot first</span>`;
  }
  if (tool !== "points") return nothing;
  const words = form.kind === "goto" ? "Click the target of the task" : "Click the points of the task, in order";
  return html`<span>${words}</span>`;
}

export function services(store) {
  if (!store.hello) return nothing;
  const frame = store.silent ? null : store.frame;
  const words = (is) => (frame === null ? "?" : is ? "on" : "off");
  const chip = (is, name) => html`<span class="chip ${is ? "good" : ""}">${name} ${words(is)}</span>`;
  const dispatcher = store.isSuspended()
    ? html`<span class="chip bad" title=${store.suspended()[0].text}>dispatcher suspended</span>`
    : chip(frame?.dispatcher, "dispatcher");
  return html`${chip(frame?.traffic_control, "traffic control")}${dispatcher}`;
}

export function pace(pace, store) {
  const fps = pace.fps();
  const thinned = pace.thinned();
  const skipped = store.frame?.skipped ?? 0;
  return html`${thinned.length > 0 ? html`<b>Reduced detail: ${thinned.join("; ")}</b><br>` : nothing}
    ${fps === null ? "" : number(fps, 0, "fps")}${skipped > 0 ? `, ${skipped} skipped` : ""}`;
}
