// Random bytes at the full rate of the line: no hang, and the next good frame is obeyed.

import { MS, PERIOD } from '../bench.mjs';
import { KIND, NEUTRAL, encode } from '../frames.mjs';
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
  // Good frames with one wrong bit in a pulse.
  let wrongBit = 0;
  const flips = long ? 200 : 20;
  for (let i = 0; i < flips; i++) {
    drive(b);
    const bytes = encode(KIND.pwm, i, DRIVE);
    const place = 3 + 2 * random(0, 9), bit = 1 << random(0, 5);
    if ((bytes[place] ^ bit) === 0) continue;
    bytes[place] ^= bit;
    b.lay(bytes);
    b.run(PERIOD + 3 * MS);
    if (!same(b.counts, DRIVE)) wrongBit++;
  }
  row('frames with one wrong bit', `${wrongBit} of ${flips} obeyed`, '0', wrongBit === 0);
  b.run(110 * MS);
  const { refused } = b.status();
  row('random bytes: the next good frame is obeyed', `${obeyed} of ${rounds}, ${bytes} bytes`, 'all', obeyed === rounds);
  row('… pulses that nobody asked for', moved, '0', moved === 0);
  row('… resets, bytes lost in the UART', `${b.chip.resets.length}, ${b.chip.rp2040.uart[0].overruns}`, '0, 0', b.chip.resets.length === 0 && b.chip.rp2040.uart[0].overruns === 0);
  row('… refused, counted', refused, '> 0', refused > 0);
}
