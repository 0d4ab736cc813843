// The chip with the firmware in its flash: rp2040js, put right, with a clock that its user moves.
//
// Time is emulated: `run(until)` executes instructions until that nanosecond and returns. A reset by the
// watchdog is a new chip with the same flash whose outputs are dead until the firmware has started again.

import { RP2040 } from 'rp2040js';
import { padsAfterReset } from './corrections/pads.mjs';
import { pwmEnable } from './corrections/pwm-enable.mjs';
import { pwmInputs } from './corrections/pwm-inputs.mjs';
import { timerAlarms } from './corrections/timer.mjs';
import { uartAtLineRate } from './corrections/uart.mjs';
import { isAsleep } from './corrections/wait-for-interrupt.mjs';
import { watchdogFiresOnce } from './corrections/watchdog.mjs';
import { FLASH } from './elf.mjs';

const CYCLE_NANOS = 8; // 125 MHz
const TIMER = 0x40054, WATCHDOG = 0x40058; // keys of rp2040js' peripherals
const WATCHDOG_TIMER = 1; // REASON register
const QUIET = { debug() {}, info() {}, warn() {}, error() {} };
const HIGH = 1;

export class Chip {
  #epoch = 0;
  #resetDue = false;
  #events = [];
  #nextEvent;
  #inputs = new Map();
  #levels = new Map();
  /** Called with (pin, high, ns) when an output pin changes; a pin that is no output counts as low. */
  onPin = () => {};
  /** Called with (uart, byte, ns) at the end of a byte's stop bit. */
  onByte = () => {};
  /** Volts at GP26 + channel. */
  volts = () => 0;
  /** When the watchdog reset the chip, in ns. */
  resets = [];
  executed = 0;

  constructor(elf) {
    this.elf = elf;
    this.#boot(0, 0);
  }

  #boot(now, reason) {
    for (const [pin, high] of this.#levels) if (high) this.onPin(pin, false, now);
    this.#levels.clear();
    const rp2040 = new RP2040();
    rp2040.logger = QUIET;
    padsAfterReset(rp2040.gpio);
    pwmEnable(rp2040.pwm);
    pwmInputs(rp2040.pwm);
    timerAlarms(rp2040.peripherals[TIMER]);
    const watchdog = rp2040.peripherals[WATCHDOG];
    watchdogFiresOnce(watchdog);
    watchdog.reason = reason;
    watchdog.onWatchdogTrigger = () => (this.#resetDue = true);
    rp2040.uart.forEach((uart, index) => {
      uartAtLineRate(uart);
      uart.onByte = (byte) => this.onByte(index, byte, this.now);
    });
    rp2040.gpio.forEach((pin, index) =>
      pin.addListener((state) => {
        const high = state === HIGH;
        if ((this.#levels.get(index) ?? false) === high) return;
        this.#levels.set(index, high);
        this.onPin(index, high, this.now);
      }));
    rp2040.adc.onADCRead = (channel) => {
      rp2040.adc.currentChannel = channel;
      rp2040.adc.channelValues[channel] = Math.max(0, Math.min(4095, Math.floor((this.volts(channel) / 3.3) * 4096)));
      rp2040.adc.sampleAlarm.schedule(rp2040.adc.sampleTime * 1000);
    };
    for (const { address, bytes } of this.elf.segments) rp2040.flash.set(bytes, address - FLASH);
    // The boot ROM and the second stage only make the flash readable, which it is here.
    const vectors = this.elf.symbols.get('__vector_table');
    rp2040.core.VTOR = vectors;
    rp2040.core.reset();
    this.rp2040 = rp2040;
    this.clock = rp2040.clock;
    this.#epoch = now;
    this.#resetDue = false;
    for (const [pin, high] of this.#inputs) rp2040.gpio[pin].setInputValue(high);
    this.#nextEvent = this.clock.createAlarm(() => this.#fire());
    this.#arm();
  }

  /** In ns since the first power-on. */
  get now() {
    return this.#epoch + this.clock.nanos;
  }

  /** Level of an input pin. */
  setPin(pin, high) {
    if (this.#inputs.get(pin) === high) return;
    this.#inputs.set(pin, high);
    this.rp2040.gpio[pin].setInputValue(high);
  }

  /** Level that the firmware gives a pin. */
  output(pin) {
    return this.#levels.get(pin) ?? false;
  }

  /** Lets something happen at a time, in ns. */
  at(nanos, what) {
    let place = this.#events.length;
    while (place > 0 && this.#events[place - 1].nanos < nanos) place--;
    while (place > 0 && this.#events[place - 1].nanos === nanos) place--;
    this.#events.splice(place, 0, { nanos, what });
    this.#arm();
  }

  #arm() {
    const next = this.#events.at(-1);
    if (next) this.#nextEvent.schedule(Math.max(0, next.nanos - this.now));
  }

  #fire() {
    while (this.#events.length && this.#events.at(-1).nanos <= this.now + 1e-3) this.#events.pop().what();
    this.#arm();
  }

  /** Executes until a time, in ns. */
  run(until) {
    while (this.now < until) {
      const { core } = this.rp2040;
      if (isAsleep(core)) {
        const left = until - this.now;
        this.clock.tick(this.clock.nextAlarm ? Math.min(left, this.clock.nanosToNextAlarm) : left);
      } else {
        this.clock.tick(core.executeInstruction() * CYCLE_NANOS);
        this.executed++;
      }
      if (this.#resetDue) {
        this.resets.push(this.now);
        this.#boot(this.now, WATCHDOG_TIMER);
      }
    }
  }

  /** The core executes a branch to itself, with interrupts off, from now on. */
  hang() {
    const { core } = this.rp2040;
    const somewhere = 0x20000100;
    this.rp2040.writeUint16(somewhere, 0xe7fe);
    core.waiting = false;
    core.PM = true;
    core.PC = somewhere;
  }
}
