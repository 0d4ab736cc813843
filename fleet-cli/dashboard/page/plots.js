// The plots of the selected robot: the last minute, by uPlot. They live in places that the panel gives.

const { uPlot } = globalThis;
const SPAN_S = 60;
const HEIGHT_PX = 96;

// Name → its series: keys of the samples, and the least span of the value axis.
export const PLOTS = {
  speed: { title: "Speed", unit: "m/s", keys: ["speed", "reference"], names: ["actual", "reference"], least: 0.1, holds: 0 },
  tilt: { title: "Tilt", unit: "°", keys: ["tiltX", "tiltY"], names: ["pitch", "roll"], least: 2 },
  infrared: { title: "Infrared, nearest", unit: "cm", keys: ["irFront", "irRear"], names: ["front", "rear"], from: [0, 90] },
  battery: { title: "Battery", unit: "V", keys: ["battery"], names: ["battery"], least: 0.4 },
};

export class Plots {
  #plots = new Map(); // name → {plot, place}
  #colours = null;

  // Draws what `samples` holds into `place(name)`; a place that is not there or not seen is left alone.
  draw(samples, place) {
    for (const [name, spec] of Object.entries(PLOTS)) {
      const at = place(name);
      if (!at || at.clientWidth === 0) continue;
      const plot = this.#plot(name, spec, at);
      const now = samples.t.at(-1) ?? 0;
      const data = [samples.t, ...spec.keys.map((key) => samples[key])];
      plot.setData(data.map((list) => list.slice()), false);
      plot.batch(() => {
        plot.setScale("x", { min: now - SPAN_S, max: now });
        plot.setScale("y", range(spec, data.slice(1)));
      });
    }
  }

  // Takes the style sheet's colours anew.
  recolour() {
    for (const { plot } of this.#plots.values()) plot.destroy();
    this.#plots.clear();
    this.#colours = null;
  }

  #plot(name, spec, place) {
    const old = this.#plots.get(name);
    if (old && old.place === place) {
      if (old.plot.width !== place.clientWidth) old.plot.setSize({ width: place.clientWidth, height: HEIGHT_PX });
      return old.plot;
    }
    old?.plot.destroy();
    const plot = new uPlot(this.#options(spec, place.clientWidth), [[], ...spec.keys.map(() => [])], place);
    this.#plots.set(name, { plot, place });
    return plot;
  }

  #options(spec, width) {
    this.#colours ??= colours();
    const { dim, grid, series } = this.#colours;
    const axis = { stroke: dim, grid: { stroke: grid, width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    return {
      width,
      height: HEIGHT_PX,
      legend: { show: false },
      cursor: { show: false },
      padding: [6, 16, 0, 0],
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [
        { ...axis, size: 18, gap: 2, space: 60, values: (plot, ticks) => ticks.map((t) => ago(plot, t)), splits: tens },
        { ...axis, size: 44, gap: 4, space: 18 },
      ],
      series: [{}, ...spec.keys.map((_, i) => ({ stroke: series[i], width: 1.75, points: { show: false } }))],
    };
  }
}

function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (name) => style.getPropertyValue(name).trim();
  return { dim: of("--dim"), grid: of("--line"), series: [of("--c0"), of("--c1")] };
}

function tens(plot) {
  const { max } = plot.scales.x;
  return [60, 40, 20, 0].map((s) => max - s);
}

function ago(plot, t) {
  const s = Math.round(plot.scales.x.max - t);
  return s === 0 ? "now" : s === SPAN_S ? "" : `−${s} s`;
}

function range(spec, lists) {
  if (spec.from) return { min: spec.from[0], max: spec.from[1] };
  let [min, max] = [spec.holds ?? Infinity, spec.holds ?? -Infinity];
  for (const list of lists) {
    for (const value of list) {
      if (value === null) continue;
      if (value < min) min = value;
      if (value > max) max = value;
    }
  }
  if (min > max) return { min: -spec.least / 2, max: spec.least / 2 };
  const pad = Math.max(spec.least - (max - min), 0.1 * (max - min)) / 2;
  return { min: min - pad, max: max + pad };
}
