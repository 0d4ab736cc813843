// Encoder edges: every one is in some window.

import { MS } from '../bench.mjs';
import { KIND } from '../frames.mjs';
import { setUp } from './common.mjs';

const RATES_HZ = [50, 440, 1000, 3333, 8000, 12000, 12600];

export function encoder({ bench, row, long, random }) {
  const b = bench();
  setUp(b);
  const wanted = long ? 100_000 : 10_000;
  let told = 0, most = 0;
  const closed = [];
  const collect = () => {
    for (const { begin, words: [pulses] } of b.ofKind(KIND.encoder)) {
      told += pulses;
      closed.push(begin);
      most = Math.max(most, pulses);
    }
    b.forget();
  };
  for (let left = wanted, i = 0; left > 0; i++) {
    const hz = RATES_HZ[i % RATES_HZ.length];
    const edges = Math.min(left, Math.ceil(hz * (long ? 0.41 : 0.15)));
    left -= edges;
    let at = b.now + random(0, 50_000);
    for (let edge = 0; edge < edges; edge++) {
      b.encoderPulse(at, 1e9 / hz / 2);
      at += 1e9 / hz;
      if (edge % 50 === 49) b.runUntil(at - 1);
    }
    b.runUntil(at);
    collect();
  }
  b.run(200 * MS);
  collect();
  row('encoder edges lost, 50 Hz to 12.6 kHz', `${b.encoderEdges - told} of ${b.encoderEdges}`, '0', told === b.encoderEdges && told === wanted);
  const window = (closed.at(-1) - closed[0]) / (closed.length - 1) / MS;
  row('… in windows of', `${window.toFixed(3)} ms, ${most} pulses at most`, '52.429 ms (1 %), 660', Math.abs(window - 52.4288) < 0.52 && most <= 660);
}
