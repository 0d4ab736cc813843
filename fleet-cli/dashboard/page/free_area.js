// Where on the map nothing lies over it, so that a robot that is driven is always seen. No I/O.
//
// Boxes are {left, top, right, bottom} in px of the map; panels, tools, notes, whatever lies there now.

const STEP_PX = 24;

// Whether a point is under a box, or nearer than `near_px` to one or to the map's edge.
export function isCovered(x, y, boxes, width, height, near_px) {
  return room(x, y, boxes, width, height) < near_px;
}

// The point with the most room around it.
export function freest(boxes, width, height) {
  let best = { x: width / 2, y: height / 2, room: -Infinity };
  for (let y = STEP_PX / 2; y < height; y += STEP_PX) {
    for (let x = STEP_PX / 2; x < width; x += STEP_PX) {
      const here = room(x, y, boxes, width, height);
      if (here > best.room) best = { x, y, room: here };
    }
  }
  return best;
}

// How far it is to the nearest box or edge; 0 or less = under a box, or beyond the edge.
function room(x, y, boxes, width, height) {
  let least = Math.min(x, y, width - x, height - y);
  for (const { left, top, right, bottom } of boxes) {
    const [dx, dy] = [Math.max(left - x, x - right), Math.max(top - y, y - bottom)];
    least = Math.min(least, dx > 0 && dy > 0 ? Math.hypot(dx, dy) : Math.max(dx, dy));
  }
  return least;
}

// What lies over `canvas` now: its neighbours on the map, and whatever of the page's frame reaches over it.
export function boxesOver(canvas) {
  const map = canvas.getBoundingClientRect();
  const over = document.querySelectorAll("#map > :not(canvas, .unseen), aside, dialog[open], [data-over-map]");
  const boxes = [...over].map((one) => one.getBoundingClientRect());
  const inside = (box) => box.width > 0 && box.height > 0 && box.left < map.right && box.right > map.left
    && box.top < map.bottom && box.bottom > map.top;
  return boxes.filter(inside).map((box) => ({ left: box.left - map.left, top: box.top - map.top,
    right: box.right - map.left, bottom: box.bottom - map.top }));
}
