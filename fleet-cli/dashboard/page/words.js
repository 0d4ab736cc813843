// The protocol's names in words for people, and what to do about them (docs/protocol.md has the names).

import { TEXTS } from "./texts.js";

// Reasons that hold by a latch alone. The reason stays until the robot drives again, the latch until it is reset.
const LATCHES = ["estop", "remote_takeover", "runaway", "sensor_fault", "battery_critical"];

function isReset(name, robot) {
  return LATCHES.includes(name) && !robot.latches.includes(name);
}

export function reason(name) {
  return (TEXTS.stop_reason[name] ?? TEXTS.latch[name])?.text ?? plain(name);
}

// What ends the cause of a latch.
export function cause(latch) {
  return TEXTS.latch[latch]?.remedy ?? null;
}

export function faultText(name) {
  return TEXTS.fault[name]?.text ?? plain(name);
}

// What a person does about it; null: it ends by itself.
export function remedy(name, robot) {
  const told = TEXTS.stop_reason[name]?.remedy;
  return told && !told.startsWith("none needed") ? told.replaceAll("ROBOT", robot.name) : null;
}

// Why a robot stands: in words, and what to do about it now.
export function standing(name, robot) {
  return isReset(name, robot) ? [`${reason(name)}, since reset`, remedy("no_command", robot)] : [reason(name), remedy(name, robot)];
}

// `board_half_frames` → `board half frames`
export function plain(name) {
  return String(name).replaceAll("_", " ");
}

// The robot in a line for the list: what it does, or why it stands.
export function line(robot) {
  if (robot.alive === null) return "unknown: no connection";
  if (robot.age_ms === null && !robot.alive) return "missing";
  if (!robot.alive) return "missing: motion unknown";
  if (robot.stale) return "stale: motion unknown";
  if (robot.latches.length > 0) return `latched: ${robot.latches.map(reason).join(", ")}`;
  if (robot.why.length > 0) return robot.why.map((name) => standing(name, robot)[0]).join(", ");
  const { goal } = robot;
  if (goal && ["accepted", "running", "blocked"].includes(goal.status)) {
    const left = goal.distance_m === null ? "" : `, ${metres(goal.distance_m)} left`;
    return goal.kind === "wander" ? "wandering" : `driving to ${point(goal)}${left}`;
  }
  return robot.mode === "teleop" ? "driven by hand" : mode(robot.mode);
}

const MODES = { goto: "driving", wander: "wandering", teleop: "hand-driven", manual: "transmitter" };

function mode(name) {
  return MODES[name] ?? plain(name ?? "unknown");
}

// What its chip says: [words, tone].
export function chip(robot) {
  if (robot.alive === null) return ["unknown", ""];
  if (!robot.alive) return ["missing", ""];
  if (robot.stale) return ["stale", ""];
  if (robot.latches.length > 0) return ["latched", "bad"];
  if (robot.faults.length > 0) return ["faulty", "bad"];
  if (robot.goal?.status === "blocked") return ["blocked", "warn"];
  // What ends by itself is part of driving.
  if (!robot.why.some((name) => remedy(name, robot))) return [mode(robot.mode), "good"];
  return robot.mode === "idle" ? ["idle", ""] : ["stopped", "warn"];
}

export function age(ms) {
  if (ms === null || ms === undefined) return "never";
  if (ms < 1000) return `${Math.round(ms)} ms`;
  if (ms < 60_000) return `${(ms / 1000).toFixed(1)} s`;
  if (ms < 3_600_000) return `${Math.floor(ms / 60_000)} min ${Math.floor((ms % 60_000) / 1000)} s`;
  return `${Math.floor(ms / 3_600_000)} h ${Math.floor((ms % 3_600_000) / 60_000)} min`;
}

export function number(value, digits, unit) {
  if (value === null || value === undefined) return "unknown";
  const text = value.toFixed(digits);
  return `${Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−")} ${unit}`;
}

export function metres(value) {
  return number(value, 2, "m");
}

export function degrees(rad) {
  return `${Math.round((rad * 180) / Math.PI)}°`.replace("-", "−");
}

export function point({ x_m, y_m }) {
  return `(${x_m.toFixed(2)}, ${y_m.toFixed(2)})`.replaceAll("-", "−");
}

// A happening: [words, tone].
export function happening({ what }) {
  if (what.robot) return robotEvent(what.robot);
  if (what.task) {
    const { task, step } = what.task;
    const who = step.robot ? ` (${step.robot})` : "";
    const why = step.reason ? `: ${step.reason}` : "";
    const tone = step.state === "failed" ? "bad" : step.state === "done" ? "good" : "";
    return [`task ${task} ${plain(step.state)}${who}${why}`, tone];
  }
  const { robot, there, key } = what.presence;
  const who = robot ?? (key.includes("traffic") ? "traffic control" : "the dispatcher");
  return [`${who} is ${there ? "online" : "missing"}`, there ? "" : "bad"];
}

function robotEvent({ robot, kind }) {
  const [name] = Object.keys(kind);
  const body = kind[name];
  switch (name) {
    case "started":
      return [`${robot} has started, version ${body.version}`, ""];
    case "mode":
      return [`${robot}: ${mode(body.from)} → ${mode(body.to)}`, ""];
    case "goal": {
      const tone = body.status === "reached" ? "good" : body.status === "failed" ? "bad" : "";
      return [`${robot}: goal ${plain(body.status)}${body.reason ? `: ${body.reason}` : ""}`, tone];
    }
    case "lease":
      return [body.holder ? `${body.holder} has control of ${robot}` : `no client has control of ${robot}`, ""];
    case "latch":
      return [`${robot}: ${reason(body.latch)} ${body.set ? "latched" : "reset"} by ${body.by}`, body.set ? "bad" : "good"];
    case "fault":
      return [`${robot}: ${body.present ? "fault" : "fault cleared"}: ${faultText(body.fault)}`, body.present ? "bad" : "good"];
    default:
      return [`${robot}: ${plain(name)}`, ""];
  }
}
