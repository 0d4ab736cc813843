// What several checks begin with.

import { MS } from '../bench.mjs';
import { KIND, NEUTRAL, READY, fletcher16, setup } from '../frames.mjs';

export const CHECKSUM = fletcher16(setup());
/** Motor ahead, everything else somewhere of its own. */
export const DRIVE = [4000, 3600, 4300, 3000, 5000, 3800, 3801, 3802, 3803, 2500];
/** The same with motor and pistons at rest. */
export const HELD = [NEUTRAL, 3600, 4300, 3000, 5000, NEUTRAL, NEUTRAL, NEUTRAL, NEUTRAL, 2500];

export const same = (a, b) => a.every((value, i) => Math.abs(value - b[i]) < 1e-6);
export const neutral = (pulses) => [NEUTRAL, ...pulses.slice(1)];

/** Confirmed set-up, or an error. */
export function setUp(bench) {
  bench.tell(KIND.setup, setup(), false);
  const confirmed = () => bench.status()?.checksum === CHECKSUM && bench.status().state & READY;
  if (!bench.waitFor(confirmed, 50 * MS)) throw new Error('the set-up is not confirmed');
}

/** Set up, a neutral frame, and two that drive: the end of the last one. */
export function drive(bench, pulses = DRIVE) {
  bench.tell(KIND.pwm, neutral(pulses));
  bench.run(20 * MS);
  bench.tell(KIND.pwm, pulses);
  bench.run(20 * MS);
  const { end } = bench.tell(KIND.pwm, pulses);
  return end;
}
