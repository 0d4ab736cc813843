// Voltages through the multiplexers, in their places.

import { MS } from '../bench.mjs';
import { ASK_WIDE, KIND } from '../frames.mjs';
import { setUp } from './common.mjs';

const COUNTS_A_VOLT = 1024 / 5;
/** 3.3 V at the pin are 5 V before the divider. */
const DIVIDER = 5 / 3.3;

export function ranges({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  let range = 0, sums = 0, battery = 0, scans = 0;
  const times = long ? 100 : 15;
  let began = null, ended = null;
  for (let i = 0; i < times; i++) {
    // Neighbours far apart, so that a channel that has not settled is seen.
    for (let channel = 0; channel < 16; channel++) {
      const low = (channel + i) % 2 === 0;
      b.first[channel] = (low ? random(0, 600) : random(2400, 3200)) / 1000;
      b.second[channel] = (low ? random(2000, 3290) : random(0, 900)) / 1000;
    }
    b.first[14] = random(1600, 3200) / 1000; // 6.4 to 12.8 V
    b.forget();
    b.run(85 * MS); // the second scan has seen nothing but these
    const scan = b.ofKind(KIND.converter).at(-1);
    began ??= scan.begin;
    ended = scan.begin;
    scans++;
    const { words } = scan;
    for (let channel = 0; channel < 12; channel++) {
      range = Math.max(range, Math.abs(words[channel] - b.first[channel] * COUNTS_A_VOLT));
    }
    const five = [b.first[12], b.first[13], ...b.second.slice(12, 16)].map((volts) => volts * DIVIDER);
    five.forEach((volts, place) => (sums = Math.max(sums, Math.abs(words[12 + place] / 64 - volts * COUNTS_A_VOLT))));
    battery = Math.max(battery, Math.abs(words[18] - b.first[14] * 4000));
  }
  row('twelve ranges', `${range.toFixed(2)} counts off, ${scans} sets`, '1 count of 1023', range <= 1);
  const wide = wideScan(b, random);
  row('… the other four, if asked for', `${wide.toFixed(2)} counts off`, '1 count of 1023', wide <= 1);
  row('tilt and pistons', `${sums.toFixed(2)} counts off`, '1 count of 1023', sums <= 1);
  row('battery', `${battery.toFixed(0)} mV off`, '20 mV', battery <= 20);
  b.forget();
  b.run(2000 * MS);
  const all = b.ofKind(KIND.converter);
  const period = (all.at(-1).begin - all[0].begin) / (all.length - 1) / MS;
  row('a scan each', `${period.toFixed(2)} ms`, '38 ms (1 %)', Math.abs(period - 38) < 0.38);
}

/** How far off the second multiplexer's four range finders are at most, in counts; the first one's stay as they are. */
function wideScan(b, random) {
  const usual = b.ofKind(KIND.converter).at(-1).words;
  for (let channel = 0; channel < 4; channel++) {
    b.second[channel] = (channel % 2 ? random(2400, 3200) : random(0, 600)) / 1000;
  }
  b.forget();
  b.tell(KIND.ask, [ASK_WIDE]);
  b.run(85 * MS);
  const { words } = b.ofKind(KIND.wide).at(-1);
  b.tell(KIND.ask, [0]);
  b.run(85 * MS);
  const off = words.slice(19).map((word, channel) => Math.abs(word - b.second[channel] * COUNTS_A_VOLT));
  const same = words.slice(0, 12).every((word, channel) => Math.abs(word - usual[channel]) <= 1);
  return words.length === 23 && same ? Math.max(...off) : Infinity;
}
