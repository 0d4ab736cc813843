// The emergency stop's sense wire.

import { MS, PERIOD } from '../bench.mjs';
import { EMERGENCY_STOP, KIND, READY, WATCHDOG } from '../frames.mjs';
import { DRIVE, HELD, drive, same, setUp } from './common.mjs';

export function stop({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  const times = long ? 20 : 4;
  let saidAfter = 0, heldAfter = 0, restarted = 0, ended = 0;
  for (let i = 0; i < times; i++) {
    drive(b);
    b.run(PERIOD + random(0, 22_000) * 1000);
    b.forget();
    const pressed = b.now;
    b.stop = true;
    b.tell(KIND.pwm, DRIVE);
    b.run(60 * MS);
    const said = b.ofKind(KIND.status).find(({ words }) => words[1] === (READY | WATCHDOG | EMERGENCY_STOP));
    const held = b.periods.find(({ at, counts }) => at > pressed && same(counts, HELD));
    saidAfter = Math.max(saidAfter, said ? (said.end - pressed) / MS : Infinity);
    heldAfter = Math.max(heldAfter, held ? (held.at - pressed) / MS : Infinity);
    drive(b);
    b.run(30 * MS);
    if (!same(b.counts, HELD)) restarted++; // frames while it is pressed
    b.stop = false;
    for (let frame = 0; frame < 4; frame++) {
      b.tell(KIND.pwm, DRIVE);
      b.run(20 * MS);
    }
    if (!same(b.counts, HELD)) restarted++; // its release
    drive(b);
    b.run(PERIOD + 3 * MS);
    if (same(b.counts, DRIVE)) ended++;
  }
  row('emergency stop: said after', `${saidAfter.toFixed(2)} ms`, '8 ms', saidAfter <= 8);
  row('… motor and pistons at rest after', `${heldAfter.toFixed(2)} ms`, 'a period and 0.8 ms', heldAfter <= 23);
  row('… nothing starts by itself', `${restarted} times`, '0', restarted === 0);
  row('… a neutral frame after the release ends it', `${ended} of ${times}`, 'all', ended === times);
}
