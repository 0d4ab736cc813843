// The watchdog, at phases all over a PWM period: when motor and pistons go to rest, and what ends that.

import { MS, PERIOD } from '../bench.mjs';
import { KIND, WATCHDOG, setup } from '../frames.mjs';
import { DRIVE, HELD, drive, same, setUp } from './common.mjs';

export function watchdog({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  const phases = long ? 200 : 24;
  let least = Infinity, most = 0, wrong = 0, ended = 0, silent = 0, stillHeld = 0;
  for (let i = 0; i < phases; i++) {
    b.forget();
    b.run(((i + random(0, 999) / 1000) * PERIOD) / phases);
    const end = drive(b);
    b.runUntil(end + 95 * MS);
    if (!same(b.counts, DRIVE)) wrong++;
    b.runUntil(end + 150 * MS);
    const first = b.periods.find(({ at, counts }) => at > end && counts[0] === 3750);
    const after = first ? (first.at - end) / MS : Infinity;
    least = Math.min(least, after);
    most = Math.max(most, after);
    if (!first || !same(first.counts, HELD)) wrong++;
    const said = b.ofKind(KIND.status, end + 99 * MS).find(({ words }) => words[1] & WATCHDOG);
    if (!said || Math.abs(said.end - first.at) > 8 * MS) silent++;
    // Frames that drive, a set-up and a reset end nothing.
    for (let frame = 0; frame < 3; frame++) {
      b.tell(KIND.pwm, DRIVE);
      if (frame === 1) b.tell(KIND.setup, setup(), false);
      if (frame === 2) b.tell(KIND.reset, [7]);
      b.run(20 * MS);
    }
    if (same(b.counts, HELD)) stillHeld++;
    const neutral = drive(b);
    b.runUntil(neutral + PERIOD + 3 * MS);
    if (same(b.counts, DRIVE)) ended++;
  }
  const range = `${least.toFixed(2)} to ${most.toFixed(2)} ms, ${phases} phases`;
  row('watchdog: neutral after the last frame', range, '100.0 to 122.3 ms', least >= 100 && most <= 122.3);
  row('… motor and pistons, steering stays', `${wrong} wrong`, '0', wrong === 0);
  row('… the status says so at once', `${silent} late`, '0 later than 8 ms', silent === 0);
  row('… frames that drive do not end it', `${stillHeld} of ${phases} held`, 'all', stillHeld === phases);
  row('… a neutral frame does', `${ended} of ${phases}`, 'all', ended === phases);
}
