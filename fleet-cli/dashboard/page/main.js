// The page: wires the connection, what is known, the map and the panels together.
//
// One picture for each animation frame, from the latest frame only; it is answered when it has been drawn,
// so a slow page makes the server leave frames out and nobody wait.

import { render } from "./vendor/lit-html.js";
import { Alarm, alertBadge, alertPanel } from "./alerts.js";
import { events, history } from "./events.js";
import { GoalTool } from "./goal_tool.js";
import { Drive } from "./drive.js";
import { Picture } from "./draw.js";
import { bounds } from "./floor.js";
import { boxesOver, freest, isCovered } from "./free_area.js";
import { Link } from "./link.js";
import { FrameRate } from "./frame_rate.js";
import { mapPanel } from "./edit_panel.js";
import { MapEditor } from "./map_editor.js";
import * as panels from "./panels.js";
import { PlaybackBar } from "./playback.js";
import { Plots } from "./plots.js";
import { focusFilter, robotList } from "./robot_list.js";
import { robotPanel } from "./robots.js";
import { speedLimit } from "./speed.js";
import { Store, shown } from "./store.js";
import { form, spec, taskPanel, withPoint } from "./tasks.js";
import { theme } from "./theme.js";
import { View } from "./view.js";
import { leaveIfOut, whoMenu } from "./who.js";
import { age, happening } from "./words.js";

const PANELS_EVERY_MS = 200;
const PANELS_SLOW_MS = 1000; // when pictures are too few
const SILENT_MS = 1000; // no frame for so long: nothing is known, whatever the socket says
const WAKES_MS = 400; // a page that was hidden gets its first frame within this: no banner for so short a time
const SAID_MS = 8000;
const HIDDEN_MS = 1000; // a hidden page answers its frames this late
const WIDE = matchMedia("(min-width: 1151px)");
const CALM = matchMedia("(prefers-reduced-motion: reduce)");

const byId = (id) => document.getElementById(id);
const [store, pace, plots] = [new Store(), new FrameRate(), new Plots()];
const canvas = byId("floor");
const picture = new Picture(canvas);
const view = new View(canvas);
const playback = new PlaybackBar(byId("playback"));
const alarm = new Alarm();
let unseen = null; // number of the frame that is not answered yet
let panelsMs = 0;
let stop = null; // what became of the last emergency stop
let said = { text: "", atMs: 0 };
let answer = null; // to the last command for the selected robot
let held = null; // {text, take()}: somebody else has control of the selected robot
let moved = true; // something is to be drawn
let awakeMs = -Infinity; // when the page was hidden last, and seen again
let clocksMs = null; // wall clock less the page's clock, which stands while the computer sleeps
let inView = null; // the robot that is driven and was moved to where the map is free
let fitted = false; // all of the map was shown once; what the user looks at since then is left alone

const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws${location.search}`;
const link = new Link(address, {
  open: () => {
    store.begin();
    if (store.selected) link.send({ watch: store.selected });
  },
  message: take,
  closed: () => {
    store.begin();
    drive.lost();
    changed();
    leaveIfOut(store.hello);
  },
});
const drive = new Drive(link, store, tell);
const act = actions();
const aim = new GoalTool(canvas, view, store, {
  select: (name) => act.select(name, true),
  goal: act.goal,
  pose: act.pose,
  editing: () => editor.draft !== null,
  changed,
  say: (text) => { byId("map-said").textContent = text; },
  fit: act.fit,
  withPoint,
  mayAim: () => store.writable() && link.open,
});
const editor = new MapEditor(canvas, view, store, link, {
  changed,
  say: (text) => { byId("map-said").textContent = text; },
  began: () => aim.use("edit"),
  ended: () => aim.use("look"),
});

function take(message) {
  const kind = store.take(message, performance.now());
  if (kind === "frame") {
    unseen = message.frame.n;
    // No picture is drawn of a hidden page; alerts come with the frames.
    if (document.hidden) setTimeout(answerFrame, HIDDEN_MS);
    if (store.selected === null && store.robots.size > 0 && WIDE.matches) act.select([...store.robots.keys()][0], false);
  } else if (kind === "teleop") {
    drive.update();
  } else if (kind === "happenings") {
    byId("event-said").textContent = message.happenings.map((one) => happening(one)[0]).slice(-3).join("; ");
  } else if (kind === "alerts") {
    title();
  } else if (kind === "map") {
    [fitted, view.touched] = [false, false];
  }
  if (kind !== "frame") changed();
  moved = true;
}

function answerFrame() {
  if (unseen === null) return;
  link.send({ seen: unseen });
  unseen = null;
}

// With how many alerts are open, also of a page that is hidden.
function title() {
  const calls = alarm.update(store);
  document.title = `${editor.dirty ? "* " : ""}${calls}XTB ${store.hello?.fleet ?? "fleet"}`;
}

// The panels are drawn anew with the next picture.
function changed() {
  panelsMs = 0;
  moved = true;
}

function tell(text) {
  said = { text, atMs: performance.now() };
  changed();
}

function actions() {
  const ask = async (command, words) => {
    const robot = store.selected;
    const { error, ok } = await link.command(command);
    // Where a button takes control the hint, which is for command lines, says nothing new.
    const hint = error?.hint && error.code !== "lease_held" ? ` (${error.hint})` : "";
    const text = error ? `${words}: ${error.message}${hint}` : `${words}: ${done(ok)}`;
    if (robot === store.selected) answer = { text, error: Boolean(error) };
    tell(text);
    return { error, ok };
  };
  return {
    changed,
    select(name, show) {
      store.select(name);
      [answer, held] = [null, null];
      if (drive.robot !== null && drive.robot !== name) drive.end();
      aim.clear();
      link.send({ watch: name });
      if (show) act.tab("robot");
      changed();
    },
    tab(name) {
      document.documentElement.dataset.tab = name;
      changed();
    },
    use: (tool) => aim.use(tool),
    aim: () => aim.use(aim.tool === "goals" ? "look" : "goals"),
    pickPoints: () => aim.use(aim.tool === "points" ? "look" : "points"),
    kindChosen() {
      if (form.kind === "goto") aim.points = aim.points.slice(-1);
    },
    dropPoints() {
      aim.points = [];
      changed();
    },
    aimPose: () => aim.use(aim.tool === "pose" ? "look" : "pose"),
    startPose(robot) {
      const start = store.startOf(robot);
      if (start) aim.propose(start);
    },
    sendGoal: () => aim.send(),
    sendPose: () => aim.send(),
    dropGoal: () => aim.clear(),
    async goal({ x_m, y_m, yaw_rad }) {
      const robot = store.selected;
      const send = (take) => ask({ goto: { robot, x_m, y_m, yaw_rad, take } }, `Goal for ${robot}`);
      mayTake((await send(false)).error, robot, "Take control and send", () => send(true));
    },
    async pose({ x_m, y_m, yaw_rad }) {
      const robot = store.selected;
      const send = (take) => ask({ set_pose: { robot, x_m, y_m, yaw_rad, take } }, `Pose of ${robot}`);
      const { ok, error } = await send(false);
      if (ok && aim.tool === "pose") aim.use("look");
      mayTake(error, robot, "Take control and set the pose", () => send(true));
    },
    stop: (robot) => ask({ stop: { robot } }, `Stop of ${robot}`),
    async reset(robot, take = false) {
      const { error } = await ask({ reset: { robot, take } }, `Reset of ${robot}`);
      mayTake(error, robot, "Take control and reset", () => act.reset(robot, true));
    },
    takeControl(robot, holder) {
      const take = () => act.drive(robot, true);
      offer(`${holder} has control of ${robot}. What it had the robot do ends.`, "Take control and drive", take);
    },
    dropHeld() {
      held = null;
      changed();
    },
    resetAll: (shown) => ask({ reset_all: { shown } }, "Reset of all"),
    cancel: (task) => ask({ cancel: { task } }, `Cancel of ${task}`),
    acknowledge: (ids) => ask({ acknowledge: { ids } }, "Acknowledgement"),
    muteAlerts() {
      alarm.mute();
      changed();
    },
    notifyAlerts: () => alarm.askForNotifications(changed),
    async searchEvents() {
      const text = history.text.trim();
      history.found = null;
      if (text) {
        const { ok, error } = await link.command({ events: { search: text } });
        Object.assign(history, { found: ok?.events ?? [], more: ok?.more ?? false, error: error?.message ?? null, asked: text });
      }
      changed();
    },
    pause: (task) => ask({ pause: { task } }, `Pause of ${task}`),
    resume: (task) => ask({ resume: { task } }, `Resume of ${task}`),
    retry: (task) => ask({ retry: { task } }, `Retry of ${task}`),
    activate: () => ask({ activate: {} }, "Activation of the dispatcher"),
    adopt: () => ask({ adopt: {} }, "Adoption of tasks"),
    async submit() {
      const made = spec(aim.points);
      form.sent = null;
      form.error = made.error ?? null;
      if (made.spec) {
        const { error, ok } = await ask({ submit: { spec: made.spec } }, "Task");
        form.error = error?.message ?? null;
        if (ok) {
          const waits = ok.waits ? ` It is not assigned yet: ${ok.waits}.` : "";
          form.sent = `Submitted${ok.submitted ? ` as ${[ok.submitted].flat().join(", ")}` : ""}.${waits}`;
          aim.points = [];
          aim.use("look");
        }
      }
      changed();
    },
    async drive(robot, take) {
      const { error } = await drive.begin(robot, take);
      if (!mayTake(error, robot, "Take control and drive", () => act.drive(robot, true)) && error) {
        tell(`Driving: ${error.message}`);
      }
      changed();
    },
    driveEnd: () => drive.end(),
    estop,
    zoom: (steps) => view.zoomBy(steps),
    fit() {
      [fitted, view.touched] = [false, false];
    },
  };
}

// After a refusal because somebody else has control: offers to take it. True = it does.
function mayTake(error, robot, title, take) {
  const isHeld = error?.code === "lease_held" && robot === store.selected;
  held = null;
  if (isHeld) offer(error.message, title, take);
  changed();
  return isHeld;
}

// Says who has control, with a button that takes it.
function offer(text, title, take) {
  held = { text, title, take: () => { held = null; take(); } };
  changed();
}

function done(ok) {
  if (ok?.status) return ok.status;
  if (ok?.robots && ok.unknown) return resets(ok);
  if (ok?.cleared) return ok.remaining?.length ? "some latches remain" : "done";
  return "done";
}

// What came of a reset of all.
function resets({ robots, unknown }) {
  const all = Object.entries(robots);
  const left = all.filter(([, one]) => one.refused).map(([name, one]) => `${name}: ${one.refused}`);
  const silent = unknown.length > 0 ? [`unknown: ${unknown.join(", ")}`] : [];
  return [`${all.length - left.length} of ${all.length} robots`, ...left, ...silent].join("; ");
}

// Stops one robot, or all of them; shows which have confirmed.
async function estop(robot) {
  drive.letGo();
  const call = { who: robot ?? "all robots", pending: true, robots: {}, error: null };
  stop = call;
  changed();
  const { ok, error } = await link.command({ estop: { robot } });
  call.pending = false;
  call.robots = ok?.robots ?? {};
  if (error) call.error = `NOT CONFIRMED, ${error.message}. Use the transmitter or the switch on the robot.`;
  changed();
}

function stopAll() {
  const button = byId("estop");
  // A press acts at once; the click that follows it is the same stop.
  let pressedMs = -Infinity;
  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    pressedMs = event.timeStamp;
    estop(null);
  });
  button.addEventListener("click", (event) => {
    if (event.detail !== 0 && event.timeStamp - pressedMs < 3000) return;
    estop(null);
  });
  const shortcut = (event) => event.code === "Space" && event.shiftKey;
  window.addEventListener("keydown", (event) => {
    if (!shortcut(event)) return;
    event.preventDefault();
    event.stopPropagation();
    if (!event.repeat) estop(null);
  }, true);
  window.addEventListener("keyup", (event) => {
    if (shortcut(event)) event.preventDefault(); // else a focused button would be pressed too
  }, true);
}

function drawPanels(nowMs) {
  panelsMs = nowMs;
  store.age(nowMs);
  const tab = document.documentElement.dataset.tab;
  if (WIDE.matches && tab === "robots") document.documentElement.dataset.tab = "robot";
  const look = { tool: aim.tool, preview: aim.preview, points: aim.points, said: nowMs - said.atMs < SAID_MS ? said.text : "",
    answer, held, driving: drive.robot, armed: editor.tool.armed };
  drawHeader(nowMs);
  render(panels.stops(stop, () => { stop = null; changed(); }), byId("stops"));
  render(panels.tabs(document.documentElement.dataset.tab, store, act), byId("tabs"));
  render(robotList(store, act, nowMs), byId("robots"));
  render(robotPanel(store, act, look), byId("robot"));
  if (tab === "tasks") render(taskPanel(store, act, look), byId("tasks"));
  if (tab === "edit") render(mapPanel(store, editor), byId("edit"));
  if (tab === "events") render(events(store, act, nowMs), byId("events"));
  if (tab === "alerts") render(alertPanel(store, act, alarm), byId("alerts"));
  render(panels.tools(store, act, look), byId("map-tools"));
  render(panels.zoom(act), byId("map-zoom"));
  render(panels.note(store, act, look), byId("map-note"));
  render(panels.pace(pace, store), byId("pace"));
  if (!["tasks", "events", "alerts", "edit"].includes(tab)) plots.draw(store.samples, (name) => document.querySelector(`[data-plot="${name}"]`));
}

function drawHeader(nowMs) {
  const { hello } = store;
  byId("fleet").textContent = hello?.fleet ?? "fleet";
  if (hello) title();
  const [words, tone, alarm] = connection(nowMs);
  const state = byId("link");
  state.className = `link ${tone}`;
  if (state.textContent !== words) state.textContent = words;
  const readOnly = hello && !hello.writable && !hello.estop ? `Commands disabled: ${hello.why_not ?? "read only"}.` : "";
  const slow = store.frame?.simulator ? `The ${store.frame.simulator}.` : "";
  const text = alarm ?? [readOnly, slow].filter(Boolean).join(" ");
  const banner = byId("banner");
  banner.className = `banner ${alarm ? "lost" : ""}`;
  banner.hidden = !text;
  if (banner.textContent !== text) banner.textContent = text;
  byId("estop").disabled = Boolean(readOnly);
  if (hello?.live === false) playback.begin();
  render(whoMenu(hello), byId("who"));
  render(alertBadge(store, act), byId("alert-count"));
  render(panels.services(store), byId("services"));
  render(speedLimit(store, (mps) => link.command({ speed_limit: { mps } }), changed), byId("speed"));
}

// How the page is connected: [words, tone, what the banner says or null].
function connection(nowMs) {
  const { hello, frame, frameAtMs, silent } = store;
  const sinceMs = frameAtMs ?? link.openedMs;
  const since = age(Math.floor((nowMs - sinceMs) / 1000) * 1000).replace(".0", "").replace(/^0 ms$/, "0 s");
  if (!link.open) {
    const when = frameAtMs === null ? "" : ` ${since} ago`;
    return ["no connection", "lost",
      `Connection lost${when}: the display is outdated and no command can be sent, not even a stop.`];
  }
  if (silent) {
    const text = `No data from the dashboard for ${since}: the display is outdated, and commands may not arrive, ` +
      "not even a stop.";
    return ["no data", "lost", nowMs - awakeMs < WAKES_MS ? null : text];
  }
  if (frame?.link === false) {
    return ["no router", "lost",
      "The dashboard has no link to the router: no command reaches the robots, not even a stop."];
  }
  if (!frame) return ["connecting…", "", null];
  return [hello?.live === false ? "recording" : "live", "live", null];
}

// Sees whether frames still come.
function listen(nowMs) {
  const apartMs = Date.now() - nowMs;
  if (clocksMs !== null && apartMs - clocksMs > SILENT_MS) store.slept(apartMs - clocksMs);
  clocksMs = apartMs;
  const sinceMs = store.frameAtMs ?? link.openedMs;
  if (!link.open || store.silent || sinceMs === null || nowMs - sinceMs <= SILENT_MS) return;
  drive.letGo();
  store.hush();
  changed();
}

// Moves the map so that the robot that is driven is not under anything that lies on the map, nor beyond its edge.
function uncover(nowMs) {
  const robot = store.robots.get(drive.robot);
  if (!robot?.pose) {
    if (inView !== null) fitted = false; // all of it again, unless the user has chosen what to see
    inView = null;
    return;
  }
  const { x_m, y_m } = shown(robot, nowMs);
  const [x, y] = view.toScreen(x_m, y_m);
  const { width, height } = picture;
  const boxes = boxesOver(canvas);
  const near = Math.min(MOST_COVERED_PX, Math.max(COVERED_PX, ((robot.body?.length_m ?? 0) / 2) * view.pxPerM));
  if (view.dragged || (inView === robot.name && !isCovered(x, y, boxes, width, height, near))) return;
  inView = robot.name;
  const free = freest(boxes, width, height);
  view.bring(x_m, y_m, free.x, free.y);
}

function fit() {
  const map = store.map;
  const poses = [...store.robots.values()].flatMap((robot) => (robot.pose ? [robot.pose] : []));
  if (map) {
    view.fit(bounds(map), picture.width, picture.height);
  } else if (poses.length > 0) {
    const [xs, ys] = [poses.map((pose) => pose.x_m), poses.map((pose) => pose.y_m)];
    const room = 2.5;
    view.fit([Math.min(...xs) - room, Math.min(...ys) - room, Math.max(...xs) + room, Math.max(...ys) + room],
      picture.width, picture.height);
  } else {
    return;
  }
  fitted = true;
}

const COVERED_PX = 24; // nearer than this, or than half its length, to a panel or the edge a robot is partly under it
const MOST_COVERED_PX = 60;
const GLIDES_MS = 120; // a frame's robots have reached their places by then

function animate(nowMs) {
  requestAnimationFrame(animate);
  listen(nowMs);
  const isResized = picture.resize();
  uncover(nowMs);
  if (inView === null && !view.touched && (!fitted || isResized)) fit();
  const gliding = !CALM.matches && store.frameAtMs !== null && nowMs - store.frameAtMs < GLIDES_MS;
  if (moved || view.changed || isResized || gliding) {
    [moved, view.changed] = [false, false];
    picture.draw(store, view, { preview: aim.preview, cursor: aim.cursor, points: aim.points, level: pace.level, draft: editor.draft },
      CALM.matches ? Infinity : nowMs);
  }
  if (store.frameAtMs !== null) pace.drew(nowMs);
  answerFrame();
  const every = pace.level >= 5 ? PANELS_SLOW_MS : PANELS_EVERY_MS;
  if (nowMs - panelsMs >= every || panelsMs === 0) drawPanels(nowMs);
}

theme(byId("theme"), () => {
  picture.recolour();
  plots.recolour();
  changed();
});
stopAll();
window.addEventListener("keydown", (event) => {
  const typing = event.target.matches?.("input, textarea, select");
  if (event.key !== "/" || event.ctrlKey || event.altKey || event.metaKey || typing || drive.robot !== null) return;
  event.preventDefault();
  focusFilter(act);
});
document.addEventListener("visibilitychange", () => {
  answerFrame();
  awakeMs = performance.now();
  pace.restart(awakeMs);
});
WIDE.addEventListener("change", changed);
requestAnimationFrame(animate);

// For tests in a browser.
export { aim, editor, pace, store, view };
