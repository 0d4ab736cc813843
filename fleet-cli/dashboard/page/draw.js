// The map's picture: floor and trails from pictures that are kept, everything that moves anew each time.

import { drawDraft } from "./edit_draw.js";
import { bounds, cellsPictures, drawCells, drawGrid, drawPlaces, drawScale, drawZones } from "./floor.js";
import { circle, disc, flag, octagon, wheels } from "./shapes.js";
import { shown } from "./store.js";

// How what the range finders see is drawn.
const FINDERS = { half_rad: 0.16, threshold_cm: 25 };
const TRAILS_EVERY_MS = 250;
const SHORT_TRAIL = 60;

export class Picture {
  #canvas;
  #context;
  #floor = layer();
  #trails = layer();
  #cells = null;
  #cellsKey = "";
  #floorKey = "";
  #trailsKey = "";
  #trailsMs = 0;
  #colours;
  width = 0;
  height = 0;

  constructor(canvas) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
    this.recolour();
  }

  // Takes the colours of the style sheet: again after each change of the theme.
  recolour() {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue(`--${name}`).trim();
    this.#colours = {
      bg: of("bg"), floor: of("floor"), unknown: of("unknown"), wall: of("wall"), grid: of("grid"),
      gridStrong: of("grid-strong"), zone: of("zone"), lane: of("lane"), dim: of("dim"), text: of("text"),
      panel: of("panel"), bad: of("bad"), warn: of("warn"), stale: of("stale"), accent: of("accent"),
      robots: Array.from({ length: 8 }, (_, i) => of(`c${i}`)),
    };
    this.#cellsKey = this.#floorKey = this.#trailsKey = "";
  }

  // Fits the canvas to its place; true = its size has changed.
  resize() {
    const { clientWidth, clientHeight } = this.#canvas;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.round(clientWidth * ratio), Math.round(clientHeight * ratio)];
    if (this.#canvas.width === width && this.#canvas.height === height) return false;
    for (const canvas of [this.#canvas, this.#floor, this.#trails]) {
      canvas.width = width;
      canvas.height = height;
    }
    [this.width, this.height] = [clientWidth, clientHeight];
    this.#floorKey = this.#trailsKey = "";
    return true;
  }

  // `look`: {preview, cursor, points, level, draft}
  draw(store, view, look, nowMs) {
    const context = this.#context;
    const ratio = this.#canvas.width / Math.max(1, this.width);
    this.#keepFloor(store, view, ratio, look.draft !== null);
    this.#keepTrails(store, view, ratio, look.level, nowMs);
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.drawImage(this.#floor, 0, 0);
    if (look.level < 4) context.drawImage(this.#trails, 0, 0);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    if (look.draft) drawDraft(context, view, look.draft, this.#colours);
    const robots = [...store.robots.values()].filter((robot) => robot.pose);
    const chosen = (robot) => robot.name === store.selected;
    for (const robot of robots) if (look.level < 3 || chosen(robot)) this.#path(view, robot);
    for (const robot of robots) this.#goal(view, robot, chosen(robot));
    for (const robot of robots) if (look.level < 2 || chosen(robot)) this.#infrared(view, robot, nowMs);
    for (const robot of robots) this.#robot(view, robot, chosen(robot), nowMs);
    for (const robot of robots) if (look.level < 5 || chosen(robot)) this.#name(view, robot, chosen(robot), nowMs);
    this.#points(view, look.points);
    if (look.preview) this.#preview(view, look.preview, store.robot());
    if (look.cursor) this.#cursor(view, look.cursor);
    drawScale(context, view, 14, this.height - 22, this.#colours);
  }

  // Zones and places that are being edited are not part of it.
  #keepFloor(store, view, ratio, edited) {
    const { x, y, k } = view.transform;
    const key = `${store.mapCount} ${x} ${y} ${k} ${edited}`;
    if (key === this.#floorKey) return;
    this.#floorKey = key;
    this.#trailsKey = "";
    const context = this.#floor.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = store.map ? this.#colours.bg : this.#colours.floor;
    context.fillRect(0, 0, this.width, this.height);
    if (store.map && this.#cellsKey !== store.map.hash) {
      this.#cells = cellsPictures(store.map, this.#colours);
      this.#cellsKey = store.map.hash;
    }
    context.save();
    if (store.map) {
      drawCells(context, view, store.map, this.#cells.ground);
      const [west, south, east, north] = bounds(store.map);
      const [[x0, y0], [x1, y1]] = [view.toScreen(west, north), view.toScreen(east, south)];
      context.beginPath();
      context.rect(x0, y0, x1 - x0, y1 - y0);
      context.clip();
    }
    drawGrid(context, view, this.width, this.height, this.#colours);
    context.restore();
    if (!store.map) return;
    if (!edited) drawZones(context, view, store.map, this.#colours);
    drawCells(context, view, store.map, this.#cells.walls);
    if (!edited) drawPlaces(context, view, store.places, this.#colours);
  }

  #keepTrails(store, view, ratio, level, nowMs) {
    const key = `${this.#floorKey} ${level}`;
    if (key === this.#trailsKey && nowMs - this.#trailsMs < TRAILS_EVERY_MS) return;
    [this.#trailsKey, this.#trailsMs] = [key, nowMs];
    const context = this.#trails.getContext("2d");
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, this.#trails.width, this.#trails.height);
    if (level >= 4) return;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.lineJoin = context.lineCap = "round";
    context.lineWidth = 2;
    for (const robot of store.robots.values()) {
      const trail = level === 0 ? robot.trail : robot.trail.slice(-SHORT_TRAIL);
      context.strokeStyle = this.#colour(robot);
      // Old parts are faint.
      const parts = 4;
      const size = Math.ceil(trail.length / parts);
      for (let part = 0; part < parts && trail.length > 1; part += 1) {
        context.globalAlpha = 0.08 + 0.13 * part;
        line(context, view, trail.slice(part * size, (part + 1) * size + 1));
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  #colour(robot) {
    return robot.stale ? this.#colours.stale : this.#colours.robots[robot.colour];
  }

  // Released part full, beyond it dashed, what is driven not at all.
  #path(view, robot) {
    if (!robot.path?.points) return;
    const { points, done_m, release_m } = robot.path;
    const context = this.#context;
    context.strokeStyle = this.#colour(robot);
    context.lineWidth = 2.5;
    context.globalAlpha = 0.85;
    line(context, view, between(points, done_m, release_m));
    context.stroke();
    context.globalAlpha = 0.5;
    context.setLineDash([5, 6]);
    line(context, view, between(points, Math.max(done_m, release_m), Infinity));
    context.stroke();
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  #goal(view, robot, chosen) {
    const { goal } = robot;
    if (!goal || goal.x_m === null || !["accepted", "running", "blocked"].includes(goal.status)) return;
    const colour = this.#colour(robot);
    const at = view.toScreen(goal.x_m, goal.y_m);
    flag(this.#context, at, goal.yaw_rad, colour, chosen ? 9 : 7);
  }

  #infrared(view, robot, nowMs) {
    if (!robot.ir_cm || robot.stale) return;
    const context = this.#context;
    const pose = shown(robot, nowMs);
    for (const side of ["front", "rear"]) {
      const beams = robot.body[side];
      this.#sight(view, pose, beams, robot.ir_cm[side]);
      for (const [i, beam] of beams.entries()) {
        const cm = robot.ir_cm[side][i] ?? null;
        if (cm === null) continue;
        const [x, y] = view.toScreen(...onFloor(pose, beam.ahead_m, beam.left_m));
        const heading = -(pose.yaw_rad + beam.yaw_rad);
        const near = cm < FINDERS.threshold_cm;
        context.strokeStyle = near ? this.#colours.bad : this.#colours.warn;
        context.lineWidth = near ? 2.5 : 1.5;
        context.globalAlpha = near ? 1 : 0.75;
        context.beginPath();
        context.arc(x, y, Math.max(2, (cm / 100) * view.pxPerM), heading - FINDERS.half_rad, heading + FINDERS.half_rad);
        context.stroke();
      }
    }
    context.globalAlpha = 1;
  }

  // What the range finders of one side see, as an area before the bumper.
  #sight(view, pose, beams, readings) {
    const cms = readings.slice(0, beams.length); // more than those that the factsheet names mean nothing
    if (cms.every((cm) => cm === null)) return;
    const context = this.#context;
    context.beginPath();
    const far = beams.map((beam, i) => alongBeam(beam, (cms[i] ?? 0) / 100));
    const near = [beams.at(-1), beams[0]].map((beam) => alongBeam(beam, 0));
    for (const [ahead_m, left_m] of [...far, ...near]) {
      context.lineTo(...view.toScreen(...onFloor(pose, ahead_m, left_m)));
    }
    context.closePath();
    const isNear = cms.some((cm) => cm !== null && cm < FINDERS.threshold_cm);
    context.fillStyle = isNear ? this.#colours.bad : this.#colours.warn;
    context.globalAlpha = 0.16;
    context.fill();
  }

  #robot(view, robot, chosen, nowMs) {
    const context = this.#context;
    const pose = shown(robot, nowMs);
    const [x, y] = view.toScreen(pose.x_m, pose.y_m);
    // Never smaller than can be seen and touched.
    const scale = Math.max(view.pxPerM, 28);
    const [length, width] = [robot.body.length_m * scale, robot.body.width_m * scale];
    const ahead = robot.body.ahead_m * scale; // to the middle of the body
    const colour = this.#colour(robot);
    if (pose.sigma_m * view.pxPerM > 4) circle(context, x, y, pose.sigma_m * view.pxPerM, colour, 0.35);
    if (chosen) circle(context, x, y, Math.hypot(length, width) / 2 + Math.abs(ahead) + 7, this.#colours.accent, 1, 2.5);
    context.save();
    context.translate(x, y);
    context.rotate(-pose.yaw_rad);
    context.translate(ahead, 0);
    const latched = robot.latches.length > 0;
    wheels(context, length, width, this.#colours.text);
    context.beginPath();
    context.roundRect(-length / 2, -width * 0.36, length, width * 0.72, width * 0.16);
    context.fillStyle = robot.stale ? this.#colours.panel : colour;
    context.fill();
    context.lineWidth = latched ? 3 : 1.5;
    context.strokeStyle = latched ? this.#colours.bad : robot.stale ? this.#colours.stale : this.#colours.panel;
    context.setLineDash(robot.stale ? [4, 3] : []);
    context.stroke();
    context.setLineDash([]);
    context.beginPath(); // the nose
    context.moveTo(length * 0.42, 0);
    context.lineTo(length * 0.16, -width * 0.24);
    context.lineTo(length * 0.16, width * 0.24);
    context.closePath();
    context.fillStyle = robot.stale ? this.#colours.stale : this.#colours.panel;
    context.fill();
    context.restore();
  }

  #name(view, robot, chosen, nowMs) {
    const context = this.#context;
    const pose = shown(robot, nowMs);
    const [x, y] = view.toScreen(pose.x_m, pose.y_m);
    const below = 0.32 * Math.max(view.pxPerM, 28) + 15;
    const text = robot.stale ? `${robot.name} ?` : robot.name;
    context.font = `${chosen ? 700 : 600} 12px system-ui, DejaVu Sans, sans-serif`;
    context.textAlign = "center";
    context.lineWidth = 3.5;
    context.lineJoin = "round";
    context.strokeStyle = this.#colours.floor;
    context.strokeText(text, x, y + below);
    context.fillStyle = robot.stale ? this.#colours.dim : this.#colours.text;
    context.fillText(text, x, y + below);
    if (robot.latches.length > 0) {
      const beside = context.measureText(text).width / 2 + 12;
      octagon(context, x - beside, y + below - 4, 8, this.#colours.bad, this.#colours.panel);
    }
  }

  #points(view, points) {
    const context = this.#context;
    if (points.length === 0) return;
    context.strokeStyle = this.#colours.accent;
    context.lineWidth = 2;
    context.setLineDash([6, 5]);
    line(context, view, points.map(({ x_m, y_m }) => [x_m, y_m]));
    context.stroke();
    context.setLineDash([]);
    points.forEach(({ x_m, y_m }, index) => {
      const [x, y] = view.toScreen(x_m, y_m);
      disc(context, x, y, 10, this.#colours.accent);
      context.fillStyle = this.#colours.panel;
      context.font = "700 12px system-ui, DejaVu Sans, sans-serif";
      context.textAlign = "center";
      context.fillText(String(index + 1), x, y + 4);
    });
  }

  #preview(view, preview, robot) {
    const context = this.#context;
    const at = view.toScreen(preview.x_m, preview.y_m);
    if (robot?.pose) {
      context.strokeStyle = this.#colours.accent;
      context.globalAlpha = 0.6;
      context.lineWidth = 1.5;
      context.setLineDash([3, 5]);
      line(context, view, [[robot.pose.x_m, robot.pose.y_m], [preview.x_m, preview.y_m]]);
      context.stroke();
      context.setLineDash([]);
      context.globalAlpha = 1;
    }
    circle(context, ...at, HANDLE_PX, this.#colours.accent, 0.5, 1.5);
    flag(context, at, preview.yaw_rad, this.#colours.accent, 10);
    // What is dragged to turn it.
    const heading = preview.yaw_rad ?? 0;
    const handle = [at[0] + HANDLE_PX * Math.cos(heading), at[1] - HANDLE_PX * Math.sin(heading)];
    disc(context, ...handle, 7, preview.yaw_rad === null ? this.#colours.panel : this.#colours.accent);
    circle(context, ...handle, 7, this.#colours.accent, 1, 2);
  }

  #cursor(view, cursor) {
    const context = this.#context;
    const [x, y] = view.toScreen(cursor.x_m, cursor.y_m);
    context.strokeStyle = this.#colours.text;
    context.lineWidth = 1.5;
    context.beginPath();
    for (const [ux, uy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + 4 * ux, y + 4 * uy);
      context.lineTo(x + 14 * ux, y + 14 * uy);
    }
    context.stroke();
  }
}

// Radius of the ring around a goal that is being set.
export const HANDLE_PX = 34;

function layer() {
  return document.createElement("canvas");
}

function onFloor({ x_m, y_m, yaw_rad }, ahead_m, left_m) {
  const [c, s] = [Math.cos(yaw_rad), Math.sin(yaw_rad)];
  return [x_m + c * ahead_m - s * left_m, y_m + s * ahead_m + c * left_m];
}

// So far along a range finder's beam, ahead and to the left of the pose.
function alongBeam({ ahead_m, left_m, yaw_rad }, out_m) {
  return [ahead_m + out_m * Math.cos(yaw_rad), left_m + out_m * Math.sin(yaw_rad)];
}

function line(context, view, points) {
  context.beginPath();
  points.forEach(([x_m, y_m], index) => context[index === 0 ? "moveTo" : "lineTo"](...view.toScreen(x_m, y_m)));
}

// The part of a polyline between two distances along it.
export function between(points, from_m, to_m) {
  const part = [];
  let at_m = 0;
  for (let i = 1; i < points.length && at_m < to_m; i += 1) {
    const [a, b] = [points[i - 1], points[i]];
    const length = Math.hypot(b[0] - a[0], b[1] - a[1]);
    const on = (m) => {
      const share = length === 0 ? 0 : (m - at_m) / length;
      return [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
    };
    if (at_m + length > from_m) {
      if (part.length === 0) part.push(on(Math.max(from_m, at_m)));
      part.push(on(Math.min(to_m, at_m + length)));
    }
    at_m += length;
  }
  return part;
}
