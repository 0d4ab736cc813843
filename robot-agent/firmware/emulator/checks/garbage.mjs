// Random bytes at the full rate of the line: no hang, and the next good frame is obeyed.

import { MS, PERIOD } from '../bench.mjs';
import { KIND, NEUTRAL } from '../frames.mjs';
import { DRIVE, drive, neutral, same, setUp } from './common.mjs';

export function garbage({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  drive(b);
  b.run(PERIOD + 3 * MS);
  const rounds = long ? 100 : 4, each = long ? 10_000 : 5000;
  let bytes = 0, obeyed = 0, moved = 0;
  for (let i = 0; i < rounds; i++) {
    for (let left = each; left > 0; left -= 1000) {
      bytes += 1000;
      b.runUntil(b.lay(Array.from({ length: 1000 }, () => random(0, 255))).end);
      b.forget();
      if (b.counts[0] !== NEUTRAL && b.counts[0] !== DRIVE[0]) moved++;
    }
    b.lay([0]);
    b.tell(KIND.pwm, neutral(DRIVE));
    b.run(20 * MS);
    b.tell(KIND.pwm, DRIVE.map((count) => count + 1));
    b.run(PERIOD + 6 * MS);
    if (same(b.counts, DRIVE.map((count) => count + 1))) obeyed++;
    drive(b);
    b.run(PERIOD);
  }
  b.run(110 * MS);
  const { refused } = b.status();
  row('random bytes: the next good frame is obeyed', `${obeyed} of ${rounds}, ${bytes} bytes`, 'all', obeyed === rounds);
  row('… pulses that nobody asked for', moved, '0', moved === 0);
  row('… resets, bytes lost in the UART', `${b.chip.resets.length}, ${b.chip.rp2040.uart[0].overruns}`, '0, 0', b.chip.resets.length === 0 && b.chip.rp2040.uart[0].overruns === 0);
  row('… refused, counted', refused, '> 0', refused > 0);
}
