// What does not move: cells, zones, places and grid of the map, drawn once for each view and kept.

const UNKNOWN = "unknown";

// The map's cells as pictures, one pixel a cell, north up: the ground, and the walls that hide the grid.
export function cellsPictures(map, colours) {
  const ground = { free: packed(colours.floor), occupied: packed(colours.floor), [UNKNOWN]: packed(colours.unknown) };
  const walls = { free: 0, occupied: packed(colours.wall), [UNKNOWN]: 0 };
  return { ground: cellsPicture(map, ground), walls: cellsPicture(map, walls) };
}

function cellsPicture(map, kinds) {
  const picture = document.createElement("canvas");
  picture.width = map.width;
  picture.height = map.height;
  const context = picture.getContext("2d");
  const image = context.createImageData(map.width, map.height);
  const pixels = new Uint32Array(image.data.buffer);
  let cell = 0;
  for (const [kind, count] of map.cells) {
    for (const end = cell + count; cell < end; cell += 1) {
      const row = Math.floor(cell / map.width);
      pixels[(map.height - 1 - row) * map.width + (cell - row * map.width)] = kinds[kind];
    }
  }
  context.putImageData(image, 0, 0);
  return picture;
}

// `#rrggbb` as a pixel of ImageData on a little-endian machine.
function packed(colour) {
  const value = parseInt(colour.slice(1), 16);
  return (0xff000000 | ((value & 0xff) << 16) | (value & 0xff00) | (value >> 16)) >>> 0;
}

// [west, south, east, north] in m.
export function bounds(map) {
  const [west, south] = map.origin_m;
  return [west, south, west + map.width * map.resolution_m, south + map.height * map.resolution_m];
}

export function drawCells(context, view, map, picture) {
  const [west, south, east, north] = bounds(map);
  const [x0, y0] = view.toScreen(west, north);
  const [x1, y1] = view.toScreen(east, south);
  context.imageSmoothingEnabled = view.pxPerM * map.resolution_m < 2;
  context.drawImage(picture, x0, y0, x1 - x0, y1 - y0);
}

export function drawZones(context, view, map, colours) {
  for (const zone of map.zones ?? []) {
    const outline = new Path2D();
    zone.points.forEach(([x_m, y_m], index) => outline[index === 0 ? "moveTo" : "lineTo"](...view.toScreen(x_m, y_m)));
    outline.closePath();
    const keepOut = zone.kind === "keep_out";
    const colour = keepOut ? colours.zone : colours.lane;
    context.save();
    context.globalAlpha = 0.09;
    context.fillStyle = colour;
    context.fill(outline);
    context.globalAlpha = keepOut ? 0.28 : 0.5;
    context.strokeStyle = colour;
    context.lineWidth = 1;
    context.setLineDash([5, 4]);
    context.stroke(outline);
    context.setLineDash([]);
    context.clip(outline);
    const box = box_px(view, zone.points);
    if (keepOut) hatch(context, box);
    else arrows(context, box, zone.kind.one_way.heading_rad);
    context.restore();
    label(context, zone.name, (box[0] + box[2]) / 2, (box[1] + box[3]) / 2, box[2] - box[0], colour, colours);
  }
}

const PLACE_PX = 5;
const MARKS = { place: "", dock: "⚡", parking: "P", waiting: "…" };

// Named points and areas: a mark with its yaw, and the name where there is room.
export function drawPlaces(context, view, places, colours) {
  for (const place of places) {
    const [x, y] = view.toScreen(place.x_m, place.y_m);
    context.save();
    context.strokeStyle = colours.dim;
    context.lineWidth = 1;
    if (place.points.length > 0) {
      context.beginPath();
      place.points.forEach(([x_m, y_m], index) => context[index === 0 ? "moveTo" : "lineTo"](...view.toScreen(x_m, y_m)));
      context.closePath();
      context.setLineDash([2, 3]);
      context.stroke();
      context.setLineDash([]);
    }
    context.lineWidth = 1.5;
    context.beginPath();
    context.arc(x, y, PLACE_PX, 0, 2 * Math.PI);
    if (place.yaw_rad !== null) {
      const [ux, uy] = [Math.cos(place.yaw_rad), -Math.sin(place.yaw_rad)];
      context.moveTo(x + PLACE_PX * ux, y + PLACE_PX * uy);
      context.lineTo(x + 2.4 * PLACE_PX * ux, y + 2.4 * PLACE_PX * uy);
    }
    context.stroke();
    context.restore();
    label(context, `${MARKS[place.kind]} ${place.name}`.trim(), x, y + 17, Infinity, colours.dim, colours);
  }
}

// The place whose mark is within `near_px` of a point of the picture; the nearest one.
export function placeAt(view, places, x, y, near_px) {
  const away = (place) => {
    const [px, py] = view.toScreen(place.x_m, place.y_m);
    return Math.hypot(px - x, py - y);
  };
  const near = places.filter((place) => away(place) <= near_px);
  return near.sort((a, b) => away(a) - away(b))[0] ?? null;
}

// A name with a halo, if it is no wider than `width`.
function label(context, text, x, y, width, colour, colours) {
  context.save();
  context.font = "12px system-ui, DejaVu Sans, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  if (context.measureText(text).width <= width) {
    context.lineWidth = 3;
    context.strokeStyle = colours.floor;
    context.strokeText(text, x, y);
    context.fillStyle = colour;
    context.fillText(text, x, y);
  }
  context.restore();
}

function box_px(view, points) {
  const all = points.map(([x_m, y_m]) => view.toScreen(x_m, y_m));
  const xs = all.map(([x]) => x);
  const ys = all.map(([, y]) => y);
  return [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)];
}

function hatch(context, [x0, y0, x1, y1]) {
  context.beginPath();
  for (let x = x0 - (y1 - y0); x < x1; x += 12) {
    context.moveTo(x, y1);
    context.lineTo(x + (y1 - y0), y0);
  }
  context.stroke();
}

function arrows(context, [x0, y0, x1, y1], heading_rad) {
  context.globalAlpha = 0.35;
  context.lineWidth = 2;
  context.beginPath();
  const [ux, uy] = [Math.cos(heading_rad), -Math.sin(heading_rad)];
  for (let x = x0 + 22; x < x1; x += 44) {
    for (let y = y0 + 22; y < y1; y += 44) {
      const [tx, ty] = [x + 8 * ux, y + 8 * uy];
      context.moveTo(tx - 9 * ux - 6 * uy, ty - 9 * uy + 6 * ux);
      context.lineTo(tx, ty);
      context.lineTo(tx - 9 * ux + 6 * uy, ty - 9 * uy - 6 * ux);
    }
  }
  context.stroke();
}

// Lines each metre (or what fits), those of ten stronger, with figures along the west and south edge.
export function drawGrid(context, view, width, height, colours) {
  const step = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50].find((m) => m * view.pxPerM >= 38) ?? 100;
  const { x_m: west, y_m: north } = view.toFloor(0, 0);
  const { x_m: east, y_m: south } = view.toFloor(width, height);
  context.lineWidth = 1;
  const lines = (from, to, draw) => {
    for (let n = Math.ceil(from / step); n * step <= to; n += 1) draw(n * step, n % 5 === 0);
  };
  for (const strong of [false, true]) {
    context.strokeStyle = strong ? colours.gridStrong : colours.grid;
    context.beginPath();
    lines(west, east, (x_m, isStrong) => {
      if (isStrong !== strong) return;
      const x = Math.round(view.toScreen(x_m, 0)[0]) + 0.5;
      context.moveTo(x, 0);
      context.lineTo(x, height);
    });
    lines(south, north, (y_m, isStrong) => {
      if (isStrong !== strong) return;
      const y = Math.round(view.toScreen(0, y_m)[1]) + 0.5;
      context.moveTo(0, y);
      context.lineTo(width, y);
    });
    context.stroke();
  }
}

// A bar of a round number of metres.
export function drawScale(context, view, x, y, colours) {
  const length_m = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((m) => m * view.pxPerM >= 60) ?? 100;
  const length = length_m * view.pxPerM;
  context.strokeStyle = colours.dim;
  context.fillStyle = colours.dim;
  context.lineWidth = 2;
  context.beginPath();
  context.moveTo(x, y - 5);
  context.lineTo(x, y);
  context.lineTo(x + length, y);
  context.lineTo(x + length, y - 5);
  context.stroke();
  context.font = "12px system-ui, DejaVu Sans, sans-serif";
  context.textAlign = "left";
  context.fillText(`${length_m} m`, x + length + 8, y + 1);
}
