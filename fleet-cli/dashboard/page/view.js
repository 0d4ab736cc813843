// Which part of the floor is seen: pan and zoom by d3-zoom (mouse, wheel, touch), in metres with y north.

const { select, zoom, zoomIdentity, zoomTransform } = globalThis.d3;

const LEAST_PX_PER_M = 4;
const MOST_PX_PER_M = 600;
const STEP = 1.5;

export class View {
  #canvas;
  #zoom;
  held = false; // true: a drag means something else than panning
  dragged = false; // the user is moving it
  changed = true;
  touched = false; // the user has chosen what to see

  constructor(canvas) {
    this.#canvas = select(canvas);
    this.#zoom = zoom()
      .scaleExtent([LEAST_PX_PER_M, MOST_PX_PER_M])
      .filter((event) => !this.held && !event.button && (!event.ctrlKey || event.type === "wheel"))
      .clickDistance(6)
      .on("start end", (event) => {
        if (event.sourceEvent) this.dragged = event.type === "start";
      })
      .on("zoom", (event) => {
        this.changed = true;
        if (event.sourceEvent) this.touched = true;
      });
    this.#canvas.call(this.#zoom).on("dblclick.zoom", null);
  }

  get transform() {
    return zoomTransform(this.#canvas.node());
  }

  get pxPerM() {
    return this.transform.k;
  }

  // Metres → CSS pixels of the canvas.
  toScreen(x_m, y_m) {
    const { x, y, k } = this.transform;
    return [x + k * x_m, y - k * y_m];
  }

  toFloor(x_px, y_px) {
    const { x, y, k } = this.transform;
    return { x_m: (x_px - x) / k, y_m: (y - y_px) / k };
  }

  // Shows all of [west, south, east, north], with a margin.
  fit([west, south, east, north], width_px, height_px) {
    const margin = Math.min(56, width_px / 12);
    const k = Math.min((width_px - 2 * margin) / (east - west), (height_px - 2 * margin) / (north - south));
    const scale = Math.min(MOST_PX_PER_M, Math.max(LEAST_PX_PER_M, k));
    const x = width_px / 2 - (scale * (west + east)) / 2;
    const y = height_px / 2 + (scale * (south + north)) / 2;
    this.#canvas.call(this.#zoom.transform, zoomIdentity.translate(x, y).scale(scale));
  }

  zoomBy(steps) {
    this.touched = true;
    this.#canvas.call(this.#zoom.scaleBy, STEP ** steps);
  }

  // Moves a place to a pixel of the canvas.
  bring(x_m, y_m, x_px, y_px) {
    const [x, y] = this.toScreen(x_m, y_m);
    this.#move(x_px - x, y_px - y);
  }

  panBy(dx_px, dy_px) {
    this.touched = true;
    this.#move(dx_px, dy_px);
  }

  #move(dx_px, dy_px) {
    const { k } = this.transform;
    this.#canvas.call(this.#zoom.translateBy, dx_px / k, dy_px / k);
  }
}
