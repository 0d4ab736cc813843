// The protocol's names in words for people, and what to do about them (docs/protocol.md has the names).

const ANEW = "give it a new goal";

// reason → [words, what to do]; no second entry: it ends by itself.
const REASONS = {
  no_command: ["nothing was asked of it", ANEW],
  goal_reached: ["the goal is reached", ANEW],
  cancelled: ["the goal was cancelled", ANEW],
  time_up: ["the goal's time was up", ANEW],
  stop: ["it was told to stop", ANEW],
  setpoint_expired: ["no setpoint arrived in time", "hold the joystick; if it was held, look at the link"],
  link_lost: ["the link to the router was lost", "look at the network between robot and router"],
  lease_expired: ["whoever drove it fell silent", ANEW],
  lease_taken: ["somebody else took control", "agree with whoever has control"],
  lease_released: ["control was given back", ANEW],
  loop_stalled: ["its control loop was held up", "see what holds up the robot's computer, then give it a new goal"],
  setpoint_zero: ["the setpoint is zero", "move the joystick"],
  obstacle_front: ["obstacle ahead", "clear the way ahead, or drive astern"],
  obstacle_rear: ["obstacle behind", "clear the way behind, or drive ahead"],
  wander_pause: ["wander's pause"],
  estop: ["emergency stop", "reset it, then give it a new goal"],
  remote_takeover: ["the remote control took over", "switch the transmitter back to the computer, then reset"],
  runaway: ["the wheels ran away", "look at the encoder and the motor, then reset"],
  sensor_fault: ["a sensor failed", "see to the sensor, then reset"],
  battery_critical: ["the battery is nearly empty", "charge it, then reset"],
  board_lost: ["the I/O board is lost", "look at its cable and its power, then reset"],
  gyro_lost: ["the gyro is lost", "look at its cable and its power, then reset"],
  stalled: ["the motor was driven and the wheels did not turn", "look whether it is stuck; if nothing holds it, see vehicle.guard.stall_counts in its configuration"],
  remote_neutral: ["the remote control drives, its stick is neutral", "switch its selector to the computer"],
  remote_lost: ["the remote control is lost", "switch the transmitter on"],
  over_speed: ["the remote control drives too fast", "drive slower, or away from the obstacle"],
  planning: ["a path is being planned"],
  waiting_for_traffic: ["waits: others go first"],
  giving_way: ["another robot goes first"],
  way_blocked: ["something not on the map is in its way", "clear its way; it looks for another one by itself"],
  pose_uncertain: ["it does not know well enough where it is", "bring it pose fixes, or tell it where it is: fleet-cli set-pose"],
  in_keep_out: ["it stands in a keep-out zone", "drive it out by hand"],
  at_cusp: ["it changes gear"],
  starting: ["it has only just been told to drive"],
  changing_direction: ["it stops before it drives the other way"],
  coasting: ["it rolls by itself"],
};

// Reasons that hold by a latch alone. The reason stays until the robot drives again, the latch until it is reset.
const LATCHES = ["estop", "remote_takeover", "runaway", "sensor_fault", "battery_critical"];

function isReset(name, robot) {
  return LATCHES.includes(name) && !robot.latches.includes(name);
}

export function reason(name) {
  return REASONS[name]?.[0] ?? plain(name);
}

export function remedy(name) {
  return REASONS[name]?.[1] ?? null;
}

// Why a robot stands: in words, and what to do about it now.
export function standing(name, robot) {
  return isReset(name, robot) ? [`${reason(name)}, that is reset`, ANEW] : [reason(name), remedy(name)];
}

// `board_half_frames` → `board half frames`
export function plain(name) {
  return String(name).replaceAll("_", " ");
}

// The robot in a line for the list: what it does, or why it stands.
export function line(robot) {
  if (robot.age_ms === null && !robot.alive) return "not there";
  if (!robot.alive) return "gone: what it does is unknown";
  if (robot.stale) return "silent: what it does is unknown";
  if (robot.latches.length > 0) return `latched: ${robot.latches.map(reason).join(", ")}`;
  if (robot.why.length > 0) return robot.why.map((name) => standing(name, robot)[0]).join(", ");
  const { goal } = robot;
  if (goal && ["accepted", "running", "blocked"].includes(goal.status)) {
    const left = goal.distance_m === null ? "" : `, ${metres(goal.distance_m)} left`;
    return goal.kind === "wander" ? "wanders" : `drives to ${point(goal)}${left}`;
  }
  return robot.mode === "teleop" ? "driven by hand" : plain(robot.mode ?? "unknown");
}

// What its chip says: [words, tone].
export function chip(robot) {
  if (!robot.alive) return ["gone", ""];
  if (robot.stale) return ["silent", ""];
  if (robot.latches.length > 0) return ["latched", "bad"];
  if (robot.faults.length > 0) return ["fault", "bad"];
  if (robot.goal?.status === "blocked") return ["blocked", "warn"];
  // What ends by itself is part of driving.
  if (!robot.why.some(remedy)) return [plain(robot.mode), "good"];
  return robot.mode === "idle" ? ["idle", ""] : [plain(robot.mode), "warn"];
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
  return [`${who} is ${there ? "there" : "gone"}`, there ? "" : "bad"];
}

function robotEvent({ robot, kind }) {
  const [name] = Object.keys(kind);
  const body = kind[name];
  switch (name) {
    case "started":
      return [`${robot} has started, version ${body.version}`, ""];
    case "mode":
      return [`${robot}: ${plain(body.from)} → ${plain(body.to)}`, ""];
    case "goal": {
      const tone = body.status === "reached" ? "good" : body.status === "failed" ? "bad" : "";
      return [`${robot}: goal ${plain(body.status)}${body.reason ? `: ${body.reason}` : ""}`, tone];
    }
    case "lease":
      return [body.holder ? `${body.holder} has control of ${robot}` : `nobody has control of ${robot}`, ""];
    case "latch":
      return [`${robot}: ${reason(body.latch)} ${body.set ? "latched" : "reset"} by ${body.by}`, body.set ? "bad" : "good"];
    case "fault":
      return [`${robot}: ${plain(body.fault)} ${body.present ? "has come" : "has gone"}`, body.present ? "bad" : "good"];
    default:
      return [`${robot}: ${plain(name)}`, ""];
  }
}
