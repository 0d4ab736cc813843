// The bridge for a simulator: what it answers is what the pins do, and the same twice.

import { spawnSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';
import { MS } from '../bench.mjs';
import { KIND, READY, decode, encode, setup as payload } from '../frames.mjs';
import { CHECKSUM, DRIVE, neutral, same } from './common.mjs';

const STEP = 5 * MS;
const hex = (bytes) => Buffer.from(bytes).toString('hex');

export function bridge({ row, long, path }) {
  const steps = long ? 400 : 80;
  const lines = Array.from({ length: steps }, (_, i) => {
    const step = { t: (i + 1) * STEP };
    if (i === 0) Object.assign(step, { a: new Array(16).fill(1), p: [1, 1, 1, 1], r: [1.2, 1.5, 1.8], s: false });
    if (i === 4) step.rx = hex(encode(KIND.setup, 0, payload(), false));
    if (i > 4 && i % 4 === 0) step.rx = hex(encode(KIND.pwm, i / 4, i < 16 ? neutral(DRIVE) : DRIVE));
    if (i > 8 && i < 28) step.e = [0, 1, 2].map((edge) => i * STEP + edge * MS);
    return JSON.stringify(step);
  });
  const script = fileURLToPath(new URL('../bridge.mjs', import.meta.url));
  const run = () => {
    const { stdout, stderr, status } = spawnSync(process.execPath, [script, path], { input: `${lines.join('\n')}\n` });
    if (status !== 0) throw new Error(`the bridge ended with ${status}: ${stderr}`);
    return stdout.toString();
  };
  const [first, second] = [run(), run()];
  const answers = first.trim().split('\n').map((line) => JSON.parse(line));
  const frames = answers.flatMap(({ tx }) => [...Buffer.from(tx, 'hex')])
    .reduce((all, byte) => (byte ? all.at(-1).push(byte) : all.push([]), all), [[]])
    .filter((bytes) => bytes.length).map(decode);
  const status = frames.filter((frame) => frame?.kind === KIND.status).at(-1)?.words;
  const edges = frames.filter((frame) => frame?.kind === KIND.encoder).reduce((sum, { words }) => sum + words[0], 0);
  const right = answers.length === steps && same(answers.at(-1).w, DRIVE) && edges === 57
    && status?.[1] === READY && status[2] === CHECKSUM && answers.at(-1).resets === 0;
  row('bridge: set up, driven, encoder counted', `${answers.length} steps, ${edges} edges`, `${steps} steps, 57 edges`, right);
  row('… twice', first === second ? 'the same bits' : 'not the same', 'the same bits', first === second);
}
