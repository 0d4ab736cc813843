// Frames of docs/io-board.md, written from that page alone: nothing here is shared with the firmware.

const TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let bit = 0; bit < 8; bit++) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
  return n >>> 0;
});

export function crc32(bytes) {
  let crc = 0xffffffff;
  for (const byte of bytes) crc = TABLE[(crc ^ byte) & 0xff] ^ (crc >>> 8);
  return ~crc >>> 0;
}

export const KIND = {
  pwm: 0x10, encoder: 0x11, converter: 0x12, remote: 0x13, status: 0x14, identity: 0x15, imu: 0x16, wide: 0x17,
  setup: 0x18, reset: 0x19, ask: 0x1a,
};
export const READY = 1, WATCHDOG = 2, EMERGENCY_STOP = 4;
export const ASK_IDENTITY = 1, ASK_IMU = 2, ASK_WIDE = 4;
export const NEUTRAL = 3750;
export const WIRING = [0x00, 0x01, 0x02, 0x10, 0x03, 0x04, 0x11, 0x05, 0x06, 0x07, 0x12, 0x13, 0x14, 0x15];

const wordBytes = (words) => words.flatMap((word) => [word & 0xff, word >> 8]);

/** The payload of a set-up. */
export function setup({ period = 55500, prescaler = 64, window = 0x8000, watchdog = 100, wiring = WIRING } = {}) {
  return [...wordBytes([period, prescaler, window, watchdog]), ...wiring];
}

export function fletcher16(bytes) {
  let low = 0, high = 0;
  for (const byte of bytes) {
    low = (low + byte) % 255;
    high = (high + low) % 255;
  }
  return (high << 8) | low;
}

/** A frame's bytes; the payload is bytes, or words if `words` is given. */
export function encode(kind, sequence, payload, words = true) {
  const content = [kind, sequence & 0xff, ...(words ? wordBytes(payload) : payload)];
  const crc = crc32(content);
  const line = [];
  let piece = [];
  for (const byte of [...content, crc & 0xff, (crc >>> 8) & 0xff, (crc >>> 16) & 0xff, crc >>> 24, 0]) {
    if (byte === 0) {
      line.push(piece.length + 1, ...piece);
      piece = [];
    } else {
      piece.push(byte);
    }
  }
  return [...line, 0];
}

/** What the bytes before a delimiter are; null if they are no frame. */
export function decode(bytes) {
  const content = [];
  for (let at = 0; at < bytes.length;) {
    const next = at + bytes[at];
    if (next > bytes.length) return null;
    content.push(...bytes.slice(at + 1, next));
    if (next < bytes.length) content.push(0);
    at = next;
  }
  if (content.length < 6) return null;
  const body = content.slice(0, -4), crc = content.slice(-4);
  const got = (crc[0] | (crc[1] << 8) | (crc[2] << 16) | (crc[3] << 24)) >>> 0;
  if (got !== crc32(body)) return null;
  const words = [];
  for (let at = 2; at + 1 < body.length; at += 2) words.push(body[at] | (body[at + 1] << 8));
  return { kind: body[0], sequence: body[1], words };
}
