// The inertial unit's frames, re-emitted; and which firmware answers.

import { MS } from '../bench.mjs';
import { FLASH } from '../elf.mjs';
import { ASK_IDENTITY, ASK_IMU, KIND, crc32 } from '../frames.mjs';
import { setUp } from './common.mjs';

function rvc(index, numbers) {
  const body = [index, ...numbers.flatMap((n) => [n & 0xff, (n >> 8) & 0xff]), 0, 0, 0];
  return [0xaa, 0xaa, ...body, body.reduce((sum, byte) => (sum + byte) & 0xff, 0)];
}

/** CRC-32 of the program as it lies in the ELF file, with erased flash between its parts. */
export function imageHash({ segments, symbols }) {
  const start = symbols.get('__vector_table');
  const end = symbols.get('__sidata') + symbols.get('__edata') - symbols.get('__sdata');
  const image = new Uint8Array(end - start).fill(0xff);
  for (const { address, bytes } of segments) {
    if (address >= start) image.set(bytes.subarray(0, end - address), address - start);
  }
  return start >= FLASH ? crc32(image) : null;
}

export function imu({ bench, row, long, random, elf }) {
  const b = bench();
  setUp(b);
  b.layImu(rvc(0, [1, 2, 3, 4, 5, 6]));
  b.run(20 * MS);
  row('inertial unit: unasked', `${b.ofKind(KIND.imu).length} frames`, '0', b.ofKind(KIND.imu).length === 0);
  b.tell(KIND.ask, [ASK_IDENTITY | ASK_IMU]);
  b.run(10 * MS);
  const sent = [], samples = long ? 1000 : 100;
  b.receiver = [1.2, 1.4, 1.9];
  let longest = 0;
  for (let i = 0; i < samples; i++) {
    const numbers = Array.from({ length: 6 }, () => random(-32768, 32767));
    sent.push([i & 0xff, ...numbers.map((n) => n & 0xffff)]);
    const begin = b.now;
    b.layImu(rvc(i & 0xff, numbers));
    b.run(10 * MS);
    const got = b.ofKind(KIND.imu, begin)[0];
    if (got) longest = Math.max(longest, (got.end - begin) / MS);
  }
  b.run(20 * MS);
  const got = b.ofKind(KIND.imu).map(({ words }) => words);
  const right = got.length === sent.length && got.every((words, i) => words.every((word, n) => word === sent[i][n]));
  row('… asked: re-emitted', `${got.length} of ${samples}, ${right ? 'all' : 'not all'} right`, 'all', right);
  row('… complete after the unit began it', `${longest.toFixed(2)} ms`, '10 ms', longest <= 10);
  const bad = rvc(1, [1, 2, 3, 4, 5, 6]);
  bad[7] ^= 1;
  b.forget();
  b.layImu([...bad, ...rvc(2, [7, 8, 9, 10, 11, 12])]);
  b.run(20 * MS);
  const after = b.ofKind(KIND.imu).map(({ words }) => words);
  row('… a bad frame is dropped and counted', `${after.length} frame, ${after[0]?.[0] >> 8} bad`, '1 frame, 1 bad', after.length === 1 && after[0][0] === 0x102 && after[0][1] === 7);
  b.tell(KIND.ask, [ASK_IDENTITY]);
  b.run(20 * MS);
  const [version, low, high, hardware, lateLatches, dropped] = b.ofKind(KIND.identity).at(-1)?.words ?? [];
  const hash = ((high << 16) | low) >>> 0;
  row('firmware', `${version >> 8}.${version & 0xff}, hash ${hash.toString(16).padStart(8, '0')}, board ${hardware}`, 'the hash of its file', hash === imageHash(elf) && hardware === 1);
  row('… late latches, dropped samples', `${lateLatches}, ${dropped}`, '0, 0', lateLatches === 0 && dropped === 0);
}
