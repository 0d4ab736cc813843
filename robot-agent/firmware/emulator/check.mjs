// The firmware at its pins: runs it in the emulator, prints a table, and ends with 1 if a row misses its limit.
//
//   node check.mjs ELF [--long] [--seed N] [--only NAME,…]
//
// Times are emulated, so a busy computer changes nothing but the waiting. What is expected is written
// from docs/io-board.md; the codec of these checks is their own (frames.mjs).

import { Bench } from './bench.mjs';
import { CHECKS } from './checks/index.mjs';
import { readElf } from './elf.mjs';
import { random } from './random.mjs';

function usage(message) {
  console.error(`${message}\nusage: node check.mjs ELF [--long] [--seed N] [--only NAME,…]\nnames: ${Object.keys(CHECKS).join(', ')}`);
  process.exit(2);
}

const args = process.argv.slice(2);
let path = null, long = false, seed = 1, only = Object.keys(CHECKS);
while (args.length) {
  const arg = args.shift();
  if (arg === '--long') long = true;
  else if (arg === '--seed') seed = Number(args.shift());
  else if (arg === '--only') only = (args.shift() ?? '').split(',');
  else if (path === null) path = arg;
  else usage(`unknown argument ${arg}`);
}
if (path === null) usage('which firmware?');
if (!Number.isInteger(seed)) usage('a seed is a whole number');
for (const name of only) if (!CHECKS[name]) usage(`there is no check ${name}`);

const elf = readElf(path);
let misses = 0, emulated = 0;
const began = Date.now();
console.log(`| ${'check'.padEnd(46)} | ${'measured'.padEnd(42)} | ${'limit'.padEnd(24)} |    |`);
console.log(`| ${'-'.repeat(46)} | ${'-'.repeat(42)} | ${'-'.repeat(24)} | -- |`);
for (const name of only) {
  const benches = [];
  const bench = (options) => {
    const one = new Bench(elf, options);
    benches.push(one);
    return one;
  };
  const row = (what, measured, limit, ok) => {
    misses += ok ? 0 : 1;
    console.log(`| ${what.padEnd(46)} | ${String(measured).padEnd(42)} | ${limit.padEnd(24)} | ${ok ? 'ok' : 'NO'} |`);
  };
  try {
    CHECKS[name]({ bench, row, long, random: random(seed), elf, path });
  } catch (error) {
    row(name, error.message, 'runs to its end', false);
  }
  emulated += benches.reduce((sum, { now }) => sum + now / 1e9, 0);
}
console.log(`\n${emulated.toFixed(1)} s emulated in ${((Date.now() - began) / 1000).toFixed(1)} s, seed ${seed}; ${misses} missed`);
process.exit(misses ? 1 : 0);
