// A core that hangs, with interrupts off, is reset by the hardware watchdog, and the board is not set up.

import { MS, PERIOD } from '../bench.mjs';
import { ASK_IDENTITY, KIND, READY, WATCHDOG } from '../frames.mjs';
import { DRIVE, drive, setUp } from './common.mjs';

export function hang({ bench, row, long, random }) {
  let slowest = 0, quiet = 0, back = 0, told = 0, moved = 0;
  const times = long ? 30 : 5;
  for (let i = 0; i < times; i++) {
    const b = bench();
    setUp(b);
    drive(b);
    b.run(PERIOD + random(0, 30_000) * 1000);
    const hung = b.now;
    b.chip.hang();
    b.run(60 * MS);
    const reset = b.chip.resets[0] ?? Infinity;
    slowest = Math.max(slowest, (reset - hung) / MS);
    b.forget();
    b.tell(KIND.ask, [ASK_IDENTITY]);
    for (let frame = 0; frame < 8; frame++) {
      b.tell(KIND.pwm, DRIVE);
      b.run(20 * MS);
    }
    const { state } = b.status() ?? {};
    if (state === WATCHDOG && !(state & READY)) back++;
    moved += b.periods.filter(({ counts }) => counts[0] !== 3750).length;
    const first = b.periods[0];
    quiet = Math.max(quiet, first ? (first.at - reset) / MS : Infinity);
    if (b.ofKind(KIND.identity).at(-1)?.words[3] & 0x100) told++;
  }
  row('hung core: reset after', `${slowest.toFixed(2)} ms, ${times} times`, '50 ms', slowest <= 50.001);
  row('… outputs at rest again, after the reset', `${quiet.toFixed(2)} ms`, '25 ms', quiet <= 25);
  row('… not set up, watchdog', `${back} of ${times}, ${moved} pulses moved`, 'all, 0', back === times && moved === 0);
  row('… said when asked', `${told} of ${times}`, 'all', told === times);
}
