// The map's zones and places while they are edited, with what can be dragged.

import { middles, RING_PX } from "./edit_tool.js";
import { drawPlaces, drawZones } from "./floor.js";
import { circle, disc } from "./shapes.js";

export function drawDraft(context, view, draft, colours) {
  drawZones(context, view, { zones: draft.now.zones }, colours);
  drawPlaces(context, view, draft.now.places, colours);
  const { item, selected } = draft;
  if (item === null) return;
  context.strokeStyle = colours.accent;
  context.lineWidth = 2.5;
  context.beginPath();
  item.points.forEach((point, i) => context[i === 0 ? "moveTo" : "lineTo"](...view.toScreen(...point)));
  context.closePath();
  context.stroke();
  for (const point of item.points) {
    const at = view.toScreen(...point);
    disc(context, ...at, 6, colours.panel);
    circle(context, ...at, 6, colours.accent, 1, 2.5);
  }
  for (const point of middles(item.points)) disc(context, ...view.toScreen(...point), 3.5, colours.accent);
  if (selected.kind === "places") ring(context, view, item, colours);
}

// Where a place is dragged, and turned.
function ring(context, view, { x_m, y_m, yaw_rad }, colours) {
  const at = view.toScreen(x_m, y_m);
  disc(context, ...at, 6, colours.accent);
  circle(context, ...at, RING_PX, colours.accent, 0.6, 1.5);
  const heading = yaw_rad ?? 0;
  const handle = [at[0] + RING_PX * Math.cos(heading), at[1] - RING_PX * Math.sin(heading)];
  disc(context, ...handle, 6, yaw_rad === null ? colours.panel : colours.accent);
  circle(context, ...handle, 6, colours.accent, 1, 2);
}
