// Ten pulses: exact, together, of one frame, with a period of 22.2 ms.

import { MS, PERIOD } from '../bench.mjs';
import { KIND } from '../frames.mjs';
import { drive, same, setUp } from './common.mjs';

/** The latch is decided this long before a wrap, and what ends at it may count or not. */
const UNDECIDED = 0.6 * MS;

export function pulses({ bench, row, long, random }) {
  const b = bench();
  b.run(60 * MS);
  const rest = [3750, 3710, 4179, ...new Array(7).fill(3750)];
  row('at rest before the set-up', `${b.periods.length} periods`, 'all at rest', b.periods.length > 1
    && b.periods.every(({ counts }) => same(counts, rest)));
  setUp(b);
  drive(b);
  b.run(50 * MS);
  b.forget();
  const sent = [], changes = long ? 1000 : 120;
  for (let i = 0; i < changes; i++) {
    const frame = Array.from({ length: 10 }, () => random(2331, 5272));
    sent.push({ frame, end: b.tell(KIND.pwm, frame).end });
    b.run(random(5000, 28000) * 1000);
  }
  b.run(30 * MS);
  let mixed = 0, late = 0, wrongPeriod = 0, skew = 0, seen = 0, last = null;
  for (const { at, counts, skew: one } of b.periods) {
    skew = Math.max(skew, one);
    if (last !== null && Math.abs(at - last - PERIOD) > 1) wrongPeriod++;
    last = at;
    const which = sent.findIndex(({ frame }) => same(frame, counts));
    if (which < 0) {
      if (at > sent[0].end + PERIOD) mixed++;
      continue;
    }
    seen++;
    // It has to be the newest frame, or the one before if that came in while the latch was decided.
    const newest = sent.findLastIndex(({ end }) => end <= at);
    const decided = sent.findLastIndex(({ end }) => end <= at - UNDECIDED);
    if (which > newest || which < decided) late++;
  }
  row('ten pulses exact, of one frame', `${mixed} mixed of ${b.periods.length} periods, ${changes} changes`, '0 mixed', mixed === 0 && seen > changes / 2);
  row('the newest frame at each wrap', `${late} others`, '0', late === 0);
  row('period', `${wrongPeriod} not 22.2000 ms`, '0', wrongPeriod === 0);
  row('the ten rise together', `${skew} ns apart`, '0', skew === 0);
  row('frames lost, resets', `${b.bad} bad, ${b.status().refused} refused, ${b.chip.resets.length} resets`, '0', b.bad === 0 && b.status().refused === 0 && b.chip.resets.length === 0);

  // A frame with one pulse that no servo may get.
  const before = [...b.counts], refusedBefore = b.status().refused;
  let taken = 0, tried = 0;
  for (const bad of [2330, 5273]) {
    for (let place = 0; place < 10; place += long ? 1 : 3) {
      b.tell(KIND.pwm, before); // the watchdog shall have no part in this
      b.tell(KIND.pwm, before.map((count, i) => (i === place ? bad : 4444)));
      b.run(PERIOD + 6 * MS);
      tried++;
      if (!same(b.counts, before)) taken++;
    }
  }
  b.run(110 * MS);
  const refused = b.status().refused - refusedBefore;
  row('one pulse out of range: refused as a whole', `${tried - taken} of ${tried}, ${refused} counted`, 'all', taken === 0 && refused === tried);
}
