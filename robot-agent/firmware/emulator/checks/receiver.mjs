// The receiver: lengths of its pulses, while frames come and go that could delay the measurement.

import { MS, PERIOD } from '../bench.mjs';
import { KIND } from '../frames.mjs';
import { drive, setUp } from './common.mjs';

const COUNTS_A_MS = 1000 / 1.6;
const NO_PULSE = 65535;

export function receiver({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  b.receiverPeriod = PERIOD * 1.0037; // its own, so that phases wander
  const worst = [0, 0, 0];
  const times = long ? 400 : 40;
  let missing = 0;
  for (let i = 0; i < times; i++) {
    b.receiver = [0, 1, 2].map(() => random(10_000, 20_000) / 10_000);
    b.forget();
    // Set before the next pulse; two more periods later the readings are those.
    for (let period = 0; period < 3; period++) {
      b.run(PERIOD * 1.01);
      if (period === 1) drive(b);
    }
    const { words } = b.ofKind(KIND.remote).at(-1);
    words.forEach((count, channel) => {
      if (count === NO_PULSE) missing++;
      else worst[channel] = Math.max(worst[channel], Math.abs(count - b.receiver[channel] * COUNTS_A_MS));
    });
  }
  const off = worst.map((count) => count.toFixed(2)).join(', ');
  row('receiver: speed, steering, selector', `${off} counts off, ${times} sets`, '1 count of 1.6 µs', Math.max(...worst) <= 1 && missing === 0);
  b.forget();
  b.run(1000 * MS);
  const remote = b.ofKind(KIND.remote);
  const period = (remote.at(-1).begin - remote[0].begin) / (remote.length - 1) / MS;
  row('… sent each', `${period.toFixed(2)} ms`, '22.2 ms (1 %)', Math.abs(period - 22.2) < 0.22);
  b.receiver = null;
  b.run(80 * MS);
  const off65535 = b.ofKind(KIND.remote).at(-1).words.every((count) => count === NO_PULSE);
  row('… transmitter off', off65535 ? 'no pulses' : 'pulses', 'no pulses, frames go on', off65535);
  const without = bench({ fitted: false });
  setUp(without);
  without.run(200 * MS);
  row('… not fitted', `${without.ofKind(KIND.remote).length} frames`, '0', without.ofKind(KIND.remote).length === 0);
}
