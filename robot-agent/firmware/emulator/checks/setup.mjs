// The set-up: how soon it is answered, and what happens to an impossible one.

import { MS } from '../bench.mjs';
import { KIND, READY, WIRING, setup as payload } from '../frames.mjs';
import { CHECKSUM, setUp } from './common.mjs';

export function setup({ bench, row, long, random }) {
  let slowest = 0, quiet = true;
  const times = long ? 50 : 10;
  for (let i = 0; i < times; i++) {
    const b = bench();
    // Half of them close to a regular status, which may be in the way.
    b.run(i % 2 ? 95 * MS + random(0, 8000) * 1000 : random(10_000, 90_000) * 1000);
    quiet &&= b.frames.every(({ kind }) => kind === KIND.status);
    const { begin } = b.tell(KIND.setup, payload(), false);
    if (!b.waitFor(() => b.status()?.checksum === CHECKSUM, 50 * MS)) throw new Error('no answer');
    const answer = b.ofKind(KIND.status).find(({ words }) => words[2] === CHECKSUM);
    slowest = Math.max(slowest, (answer.end - begin) / MS);
  }
  row('first set-up: answer complete after it began', `${slowest.toFixed(2)} ms, ${times} phases`, '5 ms', slowest <= 5);
  row('before it, nothing but status', quiet, 'true', quiet);

  const b = bench();
  setUp(b);
  b.receiver = [1.1, 1.5, 1.9];
  let busiest = 0;
  for (let i = 0; i < times; i++) {
    b.run(random(20_000, 60_000) * 1000);
    const { end } = b.tell(KIND.setup, payload(), false);
    b.run(15 * MS);
    const answer = b.ofKind(KIND.status, end)[0];
    busiest = Math.max(busiest, (answer.end - end) / MS);
  }
  row('again, beside all other frames: after it ended', `${busiest.toFixed(2)} ms, ${times} phases`, '6.5 ms', busiest <= 6.5);

  const impossible = [
    { period: 12499 }, { prescaler: 0 }, { window: 3124 }, { watchdog: 0 },
    { wiring: [...WIRING.slice(0, 13), 0x30] }, { wiring: [WIRING[1], WIRING[0], ...WIRING.slice(2)] },
  ];
  let refused = 0;
  for (const [i, settings] of impossible.entries()) {
    const { end } = b.tell(KIND.setup, payload(settings), false);
    b.run(15 * MS);
    const answer = b.ofKind(KIND.status, end)[0];
    if (answer && answer.words[1] & READY && answer.words[2] === CHECKSUM && answer.words[3] === i + 1) refused++;
  }
  row('impossible set-ups refused, counted, answered', `${refused} of ${impossible.length}`, 'all', refused === impossible.length);

  b.tell(KIND.setup, payload({ period: 25000, watchdog: 50 }), false);
  b.run(60 * MS);
  b.forget();
  b.run(100 * MS);
  const tenMs = b.periods.length > 5 && b.periods.every(({ at }, i, all) => i === 0 || Math.abs(at - all[i - 1].at - 10 * MS) < 1);
  row('another period takes effect', tenMs ? '10.0000 ms' : 'no', '10.0000 ms', tenMs);
}
