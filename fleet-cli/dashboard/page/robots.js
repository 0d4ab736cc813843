// The panel of the robot that is selected, and what resets all that are latched.

import { html, nothing } from "./vendor/lit-html.js";
import { PLOTS } from "./plots.js";
import { nearest } from "./store.js";
import { age, cause, chip, degrees, faultText, line, metres, number, plain, point, reason, standing } from "./words.js";

const RUNNING = ["accepted", "running", "blocked"];

export function chipOf(robot) {
  const [words, tone] = chip(robot);
  return html`<span class="chip ${tone}">${words}</span>`;
}

// All that is latched at once: asks first, and resets what it has shown. What is stale may be latched or not, and is
// not counted.
let asked = null; // a robot's name → its latches, as they are shown
export function resetAll(robots, store, act) {
  const latched = robots.filter((robot) => robot.latches?.length > 0);
  if (latched.length === 0 || !store.controls()) {
    asked = null;
    return nothing;
  }
  const press = (asks, reset) => () => {
    if (reset) act.resetAll(asked);
    asked = asks ? Object.fromEntries(latched.map((robot) => [robot.name, robot.latches])) : null;
    act.changed();
  };
  if (!asked) {
    const denied = store.denied();
    return html`<div class="row"><button type="button" id="reset-all" title=${denied ?? nothing}
      ?disabled=${denied !== null} @click=${press(true, false)}>
      Reset all (${latched.length} latched)</button></div>`;
  }
  return html`<div class="box warn" role="alertdialog" aria-label="Reset all">
    <p><strong>Reset ${Object.keys(asked).join(", ")}?</strong>
      ${store.isSuspended() ? "The dispatcher is suspended: it assigns no task until it is activated."
        : store.dispatcher() ? "The dispatcher may assign them tasks at once." : "No robot moves until a new goal."}</p>
    <div class="row"><button type="button" id="reset-all-yes" @click=${press(false, true)}>Reset</button>
      <button type="button" @click=${press(false, false)}>Cancel</button></div></div>`;
}

export function robotPanel(store, act, look) {
  const robot = store.robot();
  if (!robot) {
    return html`<p class="empty">No robot selected. Choose one in the list or on the map.</p>`;
  }
  return html`
    <div class="title ${robot.stale ? "is-stale" : ""}">
      <span class="dot c${robot.colour}" aria-hidden="true"></span>
      <h2>${robot.name}</h2>${robot.alias ? html`<span class="alias">${robot.alias}</span>` : nothing}${chipOf(robot)}
      ${robot.tags.map((tag) => html`<span class="chip">${tag}</span>`)}
    </div>
    ${robot.stale ? stale(robot) : html`${latches(robot, store, act)}${why(robot, store)}`}
    ${look.answer ? html`<p class="box ${look.answer.error ? "bad" : ""}" role="status">${look.answer.text}</p>` : nothing}
    ${store.controls() ? buttons(robot, store, act, look) : nothing}
    ${facts(robot, store)}
    ${Object.entries(PLOTS).map(([name, spec]) => plot(name, spec, robot))}`;
}

function stale(robot) {
  const last = robot.pose ? ` Last position: ${point(robot.pose)}.` : "";
  return html`<div class="box warn"><p><strong>${robot.alive === null ? "Unknown" : robot.alive ? "Stale" : "Offline"}: motion unknown.</strong></p>
    <p>Last message: ${robot.age_ms === null ? "none" : `${age(robot.age_ms)} ago`}.${last}</p></div>`;
}

function latches(robot, store, act) {
  const states = store.detail()?.state?.latches ?? [];
  return robot.latches.map((latch) => {
    const state = states.find((one) => one.latch === latch);
    const by = state ? ` by ${state.by}, ${age(state.age_ms)} ago` : "";
    const why = state?.present ? html`<p class="todo">Cause still present: ${cause(latch)}, then reset it</p>` : nothing;
    return html`<div class="box bad"><p><strong>Latched: ${reason(latch)}</strong>${by}</p>${why}
      <p class="todo">${store.isSuspended()
        ? "After a reset the robot does not move: the dispatcher is suspended until it is activated."
        : store.dispatcher()
        ? "After a reset the dispatcher may assign it a task at once."
        : "After a reset the robot moves only with a new goal."}</p>
      ${store.controls()
        ? html`<div class="row"><button type="button" data-reset=${latch} title=${store.denied() ?? nothing}
            ?disabled=${store.denied() !== null} @click=${() => act.reset(robot.name)}>
            Reset ${robot.name}</button></div>`
        : nothing}</div>`;
  });
}

function why(robot, store) {
  const names = robot.why.filter((name) => !robot.latches.includes(name));
  const reasons = names.map((name) => standing(name, robot));
  const faults = robot.faults.map((fault) => html`<div class="box bad"><p><strong>Fault: ${faultText(fault)}</strong></p></div>`);
  if (robot.why.length === 0) return html`${faults}<div class="box"><p>${capital(line(robot))}</p></div>`;
  const todos = new Set(reasons.map(([, todo]) => todo));
  if (reasons.length === 0) return faults;
  const goal = store.detail()?.state?.goal; // says who is in the way
  const detail = RUNNING.includes(goal?.status) ? goal.reason : null;
  const since = robot.stopped_age_ms === null ? "" : ` for ${age(robot.stopped_age_ms)}`;
  return html`${faults}<div class="box"><p><strong>Stopped${since}:</strong> ${reasons.map(([words]) => words).join(", ")}</p>
    ${detail ? html`<p>${capital(detail)}</p>` : nothing}
    ${[...todos].map((todo) => (todo ? html`<p class="todo">${todo}</p>` : nothing))}</div>`;
}

function buttons(robot, store, act, look) {
  const denied = store.denied();
  const [title, off] = [denied ?? nothing, denied !== null];
  const driving = look.driving === robot.name;
  const { held } = look;
  const holder = robot.stale || robot.lease === store.hello?.client ? null : robot.lease;
  return html`${denied === null ? nothing : html`<p class="box">${denied}.</p>`}<div class="row">
      <button type="button" id="goal-here" title=${title} ?disabled=${off} @click=${act.aim} aria-pressed=${look.tool === "goals"}>Send goals</button>
      <button type="button" id="drive-begin" title=${title} ?disabled=${off || !robot.alive || robot.stale}
        @click=${() => (driving ? act.driveEnd() : act.drive(robot.name, false))}>${driving ? "End driving" : "Drive by hand"}</button>
    </div>
    <div class="row"><button type="button" id="set-pose" title=${denied ?? "Tell it where it stands"} aria-pressed=${look.tool === "pose"}
      ?disabled=${off || !robot.alive || robot.stale} @click=${act.aimPose}>Set pose</button>
      ${store.startOf(robot) === null ? nothing
        : html`<button type="button" id="set-start" title=${denied ?? "Tell it that it stands at its start pose"}
            ?disabled=${off || !robot.alive || robot.stale} @click=${() => act.startPose(robot)}>Set to start pose</button>`}</div>
    ${held
      ? html`<div class="box warn"><p>${held.text}</p><div class="row">
          <button type="button" class="danger" id="take" @click=${held.take}>${held.title}</button>
          <button type="button" @click=${act.dropHeld}>Cancel</button></div></div>`
      : holder === null || driving
        ? nothing
        : html`<div class="row"><button type="button" id="take-control" title=${title} ?disabled=${off}
            @click=${() => act.takeControl(robot.name, holder)}>Take control from ${holder}</button></div>`}
    <div class="row">
      <button type="button" id="stop-one" title=${title} ?disabled=${off} @click=${() => act.stop(robot.name)}>Stop</button>
      <button type="button" class="danger" id="estop-one" @click=${() => act.estop(robot.name)}>E-stop ${robot.name}</button>
    </div>`;
}

function facts(robot, store) {
  const state = store.detail()?.state;
  const { goal, pose } = robot;
  const fact = (name, value) => html`<div><dt>${name}</dt><dd>${value}</dd></div>`;
  const where = pose && !robot.stale ? `${point(pose)}, ${degrees(pose.yaw_rad)} ± ${number(pose.sigma_m * 100, 0, "cm")}` : "unknown";
  const isRunning = goal && RUNNING.includes(goal.status);
  const target = goal && goal.x_m !== null ? `${point(goal)}, ` : "";
  return html`<dl class="facts">
    ${fact("Pose", where)}
    ${fact(isRunning ? "Goal" : "Last goal", goal ? `${target}${plain(goal.status)}` : robot.stale ? "unknown" : "none")}
    ${fact("Distance to goal", isRunning ? metres(goal.distance_m) : "–")}
    ${fact("Task", robot.task ?? (robot.stale ? "unknown" : "none"))}
    ${fact("Control", robot.stale ? "unknown" : robot.lease ? `${robot.lease}${robot.lease === store.hello?.client ? " (here)" : ""}` : "none")}
    ${fact("Waiting for", state?.nav?.route?.waits_for ?? "–")}
    ${fact("State", robot.age_ms === null ? "no message yet" : `${age(robot.age_ms)} old`)}
    ${fact("Battery", robot.battery_level ? `${plain(robot.battery_level)}` : "unknown")}
  </dl>`;
}

function plot(name, spec, robot) {
  const values = {
    speed: () => `${number(robot.speed_mps, 2, "m/s")}`,
    tilt: () => `${number(robot.tilt_deg?.x, 1, "°")}, ${number(robot.tilt_deg?.y, 1, "°")}`,
    battery: () => number(robot.battery_v, 2, "V"),
    infrared: () => ["front", "rear"].map((side) => far(robot, side)).join(", "),
  };
  const keys = spec.names.map((key, i) => html`<span class="key ${i === 1 ? "second" : ""}">${key}</span>`);
  return html`<div class="plot"><h3>${spec.title}<span>${spec.names.length > 1 ? keys : nothing} ${values[name]()}</span></h3>
    <div class="plot-at" data-plot=${name} role="img" aria-label="${spec.title} of the last minute; now ${values[name]()}"></div></div>`;
}

function far(robot, side) {
  if (!robot.ir_cm) return "unknown";
  if (robot.ir_cm[side].length === 0) return "none fitted";
  const cm = nearest(robot.ir_cm[side]);
  return cm === null ? "clear" : number(cm, 0, "cm");
}

function capital(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
