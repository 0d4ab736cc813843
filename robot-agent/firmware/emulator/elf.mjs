// Just enough of ELF32: what goes into flash, and a symbol's address.

import { readFileSync } from 'node:fs';

const PT_LOAD = 1, SHT_SYMTAB = 2;
export const FLASH = 0x10000000;
const FLASH_END = 0x11000000;

/** Segments of flash as `{ address, bytes }`, and symbols by name. */
export function readElf(path) {
  const file = readFileSync(path);
  const view = new DataView(file.buffer, file.byteOffset, file.length);
  const u32 = (at) => view.getUint32(at, true), u16 = (at) => view.getUint16(at, true);
  if (u32(0) !== 0x464c457f || file[4] !== 1) throw new Error(`${path} is not a 32-bit ELF file`);
  const segments = [];
  for (let i = 0; i < u16(44); i++) {
    const header = u32(28) + i * u16(42);
    const [type, offset, , address, size] = [0, 4, 8, 12, 16].map((field) => u32(header + field));
    if (type === PT_LOAD && size > 0 && address >= FLASH && address < FLASH_END) {
      segments.push({ address, bytes: file.subarray(offset, offset + size) });
    }
  }
  const symbols = new Map();
  for (let i = 0; i < u16(48); i++) {
    const section = u32(32) + i * u16(46);
    if (u32(section + 4) !== SHT_SYMTAB) continue;
    const [table, size] = [u32(section + 16), u32(section + 20)];
    const strings = u32(u32(32) + u32(section + 24) * u16(46) + 16);
    for (let at = table; at < table + size; at += 16) {
      const name = strings + u32(at);
      symbols.set(file.toString('latin1', name, file.indexOf(0, name)), u32(at + 4));
    }
  }
  return { segments, symbols };
}
