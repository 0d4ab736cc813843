// The board on a bench: what is at the chip's pins, in units, and what the agent's end of the line hears.
//
// This is the pin interface: bytes of the agent, sixteen voltages of the first multiplexer and sixteen of
// the second, encoder edges, the receiver's pulses, the emergency stop; and out of it ten pulses and bytes.

import { Chip } from './chip.mjs';
import { KIND, decode, encode } from './frames.mjs';

export const MS = 1e6, US = 1e3;
export const BYTE_NANOS = (10 * 1e9) / 115200;
export const PERIOD = 22.2 * MS;
const FIRST_OUTPUT = 2, OUTPUTS = 10;
const STOP = 12, SPEED = 13, ENCODER = 15, SELECTOR = 16, STEERING = 17, RECEIVER = 28;
const ADDRESS = [18, 19, 20, 22];
/** A multiplexer's output follows its address after this time (settling through 10 kΩ, generous). */
const SETTLING = 20 * US;

export class Bench {
  #lineFree = 0;
  #imuFree = 0;
  #sequence = 0;
  #heard = [];
  #begun = 0;
  #rose = new Array(OUTPUTS).fill(null);
  #period = null;
  #channel = 0;
  #before = 0;
  #switched = 0;
  /** Volts at the multiplexers' inputs. */
  first = new Array(16).fill(0);
  second = new Array(16).fill(0);
  /** The receiver's pulses in ms: speed, steering, selector; null = no pulses. */
  receiver = null;
  receiverPeriod = PERIOD;
  /** Good frames of the board: { begin, end, kind, sequence, words }; bad ones are counted. */
  frames = [];
  bad = 0;
  /** Bytes of the board, for those who want them: called with (byte, ns). */
  onLine = () => {};
  /** Complete PWM periods: { at, counts[10], skew } with `at` the moment of the rise. */
  periods = [];
  /** Last complete pulses. */
  counts = new Array(OUTPUTS).fill(0);
  encoderEdges = 0;

  constructor(elf, { fitted = true } = {}) {
    this.chip = new Chip(elf);
    this.chip.onPin = (pin, high, ns) => this.#pin(pin, high, ns);
    this.chip.onByte = (uart, byte, ns) => uart === 0 && this.#byte(byte, ns);
    this.chip.volts = (channel) => this.#volts(channel);
    this.chip.setPin(STOP, false);
    this.chip.setPin(RECEIVER, fitted);
    this.#receive(0);
  }

  get now() {
    return this.chip.now;
  }

  run(nanos) {
    this.chip.run(this.now + nanos);
  }

  runUntil(nanos) {
    this.chip.run(nanos);
  }

  /** Runs until something is so, in steps; false if it is not after a time. */
  waitFor(so, nanos, step = 0.1 * MS) {
    for (const end = this.now + nanos; this.now < end;) {
      if (so()) return true;
      this.run(step);
    }
    return so();
  }

  /** Lays bytes on the line to the board, as soon as it is free; when the first begins and the last ends. */
  lay(bytes) {
    const begin = Math.max(this.now, this.#lineFree);
    bytes.forEach((byte, i) =>
      this.chip.at(begin + (i + 1) * BYTE_NANOS, () => this.chip.rp2040.uart[0].feedByte(byte)));
    this.#lineFree = begin + bytes.length * BYTE_NANOS;
    return { begin, end: this.#lineFree };
  }

  /** Lays a frame. */
  tell(kind, payload, words = true) {
    return this.lay(encode(kind, this.#sequence++, payload, words));
  }

  /** Bytes of the inertial unit. */
  layImu(bytes) {
    const begin = Math.max(this.now, this.#imuFree);
    bytes.forEach((byte, i) =>
      this.chip.at(begin + (i + 1) * BYTE_NANOS, () => this.chip.rp2040.uart[1].feedByte(byte)));
    this.#imuFree = begin + bytes.length * BYTE_NANOS;
  }

  /** One pulse of the encoder at a time. */
  encoderPulse(nanos, width = 20 * US) {
    this.chip.at(nanos, () => {
      this.chip.setPin(ENCODER, true);
      this.encoderEdges++;
    });
    this.chip.at(nanos + width, () => this.chip.setPin(ENCODER, false));
  }

  set stop(pressed) {
    this.chip.setPin(STOP, pressed);
  }

  ofKind(kind, since = 0) {
    return this.frames.filter((frame) => frame.kind === kind && frame.end >= since);
  }

  /** The last status: { firmware, state, checksum, refused }. */
  status() {
    const words = this.frames.findLast((frame) => frame.kind === KIND.status)?.words;
    if (!words) return null;
    const [firmware, state, checksum, refused] = words;
    return { firmware, state, checksum, refused };
  }

  #receive(at) {
    this.chip.at(at, () => {
      if (this.receiver) {
        // One after the other, as most receivers do it.
        let rise = this.now;
        [SPEED, STEERING, SELECTOR].forEach((pin, i) => {
          const fall = rise + this.receiver[i] * MS;
          this.chip.at(rise, () => this.chip.setPin(pin, true));
          this.chip.at(fall, () => this.chip.setPin(pin, false));
          rise = fall;
        });
      }
      this.#receive(at + this.receiverPeriod);
    });
  }

  #volts(channel) {
    if (channel > 1) return 0;
    const inputs = channel === 0 ? this.first : this.second;
    const settled = Math.min(1, (this.now - this.#switched) / SETTLING);
    return inputs[this.#channel] * settled + inputs[this.#before] * (1 - settled);
  }

  #pin(pin, high, ns) {
    if (ADDRESS.includes(pin)) {
      if (ns - this.#switched > US) this.#before = this.#channel;
      const bit = 1 << ADDRESS.indexOf(pin);
      this.#channel = high ? this.#channel | bit : this.#channel & ~bit;
      this.#switched = ns;
    }
    const output = pin - FIRST_OUTPUT;
    if (output < 0 || output >= OUTPUTS) return;
    if (high) {
      this.#rose[output] = ns;
      this.#period ??= { at: ns, counts: new Array(OUTPUTS).fill(null), skew: 0 };
      this.#period.skew = Math.max(this.#period.skew, ns - this.#period.at);
    } else if (this.#rose[output] !== null && this.#period) {
      const counts = (ns - this.#rose[output]) / 400;
      this.#rose[output] = null;
      this.#period.counts[output] = counts;
      this.counts[output] = counts;
      if (this.#period.counts.every((count) => count !== null)) {
        this.periods.push(this.#period);
        this.#period = null;
      }
    }
  }

  #byte(byte, ns) {
    this.onLine(byte, ns);
    if (this.#heard.length === 0) this.#begun = ns - BYTE_NANOS;
    if (byte !== 0) {
      this.#heard.push(byte);
      return;
    }
    if (this.#heard.length) {
      const frame = decode(this.#heard);
      if (frame) this.frames.push({ begin: this.#begun, end: ns, ...frame });
      else this.bad++;
    }
    this.#heard = [];
  }

  /** Forgets what was recorded, so that long runs stay small. */
  forget() {
    this.frames.length = 0;
    this.periods.length = 0;
  }
}
