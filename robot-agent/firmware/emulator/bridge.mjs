// The pin interface for a simulator, which owns the clock: one line of JSON each way per step.
//
//   node bridge.mjs ELF [--no-receiver]
//
//   → {"t":ns,"rx":hex,"a":[16 V],"m":[4 V],"p":[4 V],"e":[encoder edges, ns],"r":[3 ms]|null,"s":pressed,"i":hex}
//   ← {"t":ns,"tx":hex,"w":[10 pulse counts],"at":ns,"resets":n}
//
// `t` is the end of the step, in ns since power-on; everything but `t` may be missing and then stays as it
// was (`rx`, `e`, `i`: nothing). `rx` goes over the line from the step's beginning at 115,200 baud, `i` over
// the inertial unit's. `a` are the first multiplexer's inputs (at the pin, behind the dividers), `m` the seventh
// and eighth range finder of both bumpers at the second one, `p` the pistons' there, `r` the receiver's pulses of speed, steering and selector. `w` are the pulses of
// the last complete period in counts of 0.4 µs, which began at `at`; 0 = none yet. `tx` are the bytes whose
// stop bit ended in the step.

import { createInterface } from 'node:readline';
import { Bench } from './bench.mjs';
import { readElf } from './elf.mjs';

const [path, option] = process.argv.slice(2);
if (!path || (option && option !== '--no-receiver')) {
  console.error('usage: node bridge.mjs ELF [--no-receiver]');
  process.exit(2);
}
const bench = new Bench(readElf(path), { fitted: option === undefined });
let sent = [], period = { at: 0, counts: bench.counts };
bench.onLine = (byte) => sent.push(byte);

const volts = (values, length, name) => {
  if (!Array.isArray(values) || values.length !== length || !values.every(Number.isFinite)) {
    throw new Error(`"${name}" has to be ${length} voltages`);
  }
  return values;
};
const bytes = (hex) => [...Buffer.from(hex, 'hex')];

for await (const line of createInterface({ input: process.stdin })) {
  const step = JSON.parse(line);
  if (!Number.isFinite(step.t) || step.t < bench.now - 1000) throw new Error(`"t" = ${step.t} is in the past`);
  if (step.a !== undefined) bench.first = volts(step.a, 16, 'a');
  if (step.m !== undefined) bench.second.splice(0, 4, ...volts(step.m, 4, 'm'));
  if (step.p !== undefined) bench.second.splice(12, 4, ...volts(step.p, 4, 'p'));
  if (step.r !== undefined) bench.receiver = step.r === null ? null : volts(step.r, 3, 'r');
  if (step.s !== undefined) bench.stop = step.s;
  for (const edge of step.e ?? []) bench.encoderPulse(edge);
  if (step.rx) bench.lay(bytes(step.rx));
  if (step.i) bench.layImu(bytes(step.i));
  bench.runUntil(step.t);
  period = bench.periods.at(-1) ?? period;
  const w = period.counts.map((counts) => Math.round(counts)), at = Math.round(period.at);
  const tx = Buffer.from(sent).toString('hex');
  console.log(JSON.stringify({ t: step.t, tx, w, at, resets: bench.chip.resets.length }));
  sent = [];
  bench.forget();
}
