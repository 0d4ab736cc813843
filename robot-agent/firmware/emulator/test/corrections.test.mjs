// Each correction of the emulator, with the reason for it: the first half of every test shows what
// rp2040js does by itself, so a version that no longer needs a correction fails here.

import assert from 'node:assert/strict';
import { test } from 'node:test';
import { RP2040 } from 'rp2040js';
import { padsAfterReset } from '../corrections/pads.mjs';
import { pwmEnable } from '../corrections/pwm-enable.mjs';
import { pwmInputs } from '../corrections/pwm-inputs.mjs';
import { timerAlarms } from '../corrections/timer.mjs';
import { uartAtLineRate } from '../corrections/uart.mjs';
import { isAsleep } from '../corrections/wait-for-interrupt.mjs';
import { watchdogFiresOnce } from '../corrections/watchdog.mjs';

const TIMER = 0x40054, WATCHDOG = 0x40058;
const SLICE = 0x14, CSR = 0x00, DIV = 0x04, CTR = 0x08, EN = 0xa0;
const ENABLE = 1, RISING_EDGES = 2 << 4;
const PIN_OF_SLICE_7B = 15;

/** Runs the same on a chip as it is and on one with a correction. */
function without_and_with(correct, run) {
  const chip = () => {
    const rp2040 = new RP2040();
    rp2040.logger = { debug() {}, info() {}, warn() {}, error() {} };
    return rp2040;
  };
  const [plain, corrected] = [chip(), chip()];
  correct(corrected);
  return [run(plain), run(corrected)];
}

test('pads: inputs are alive after a reset', () => {
  const [plain, corrected] = without_and_with((chip) => padsAfterReset(chip.gpio), ({ gpio }) => {
    gpio[7].setInputValue(true);
    return gpio[7].inputValue;
  });
  assert.deepEqual([plain, corrected], [false, true]);
});

test('PWM inputs: edges are counted while other pins are outputs', () => {
  const [plain, corrected] = without_and_with((chip) => pwmInputs(chip.pwm), ({ gpio, pwm }) => {
    padsAfterReset(gpio);
    gpio[PIN_OF_SLICE_7B].ctrl = 4;
    pwm.writeUint32(7 * SLICE + DIV, 1 << 4);
    pwm.writeUint32(7 * SLICE + CSR, RISING_EDGES | ENABLE);
    for (let edge = 0; edge < 5; edge++) {
      gpio[PIN_OF_SLICE_7B].setInputValue(true);
      gpio[PIN_OF_SLICE_7B].setInputValue(false);
    }
    return pwm.readUint32(7 * SLICE + CTR);
  });
  assert.deepEqual([plain, corrected], [0, 5]);
});

test('PWM EN: a bit that is set through the alias leaves the others', () => {
  const SET = 2;
  const [plain, corrected] = without_and_with((chip) => pwmEnable(chip.pwm), ({ pwm }) => {
    pwm.writeUint32Atomic(EN, 0b0010, SET);
    pwm.writeUint32Atomic(EN, 0b0100, SET);
    return [1, 2].map((slice) => pwm.channels[slice].csr & ENABLE);
  });
  assert.deepEqual([plain, corrected], [[0, 1], [1, 1]]);
});

test('timer: an alarm fires when the counter has reached it, not before', () => {
  const [plain, corrected] = without_and_with((chip) => timerAlarms(chip.peripherals[TIMER]), ({ clock, peripherals }) => {
    const timer = peripherals[TIMER];
    clock.tick(1992); // in the middle of a µs
    timer.writeUint32(0x10, 11);
    const fire = timer.fireAlarm;
    let at = null;
    timer.fireAlarm = (index) => {
      at = timer.readUint32(0x28);
      fire.call(timer, index);
    };
    clock.tick(20_000);
    return at;
  });
  assert.deepEqual([plain, corrected], [10, 11]);
});

test('watchdog: it fires once', () => {
  const [plain, corrected] = without_and_with((chip) => watchdogFiresOnce(chip.peripherals[WATCHDOG]), ({ clock, peripherals }) => {
    const watchdog = peripherals[WATCHDOG];
    let fired = 0;
    watchdog.onWatchdogTrigger = () => {
      if (++fired === 100) throw new Error('for ever');
    };
    watchdog.writeUint32(0x04, 2 * 50_000);
    watchdog.writeUint32(0x00, 1 << 30);
    try {
      clock.tick(49.9e6);
      assert.equal(fired, 0);
      clock.tick(0.2e6);
      clock.tick(1e9);
    } catch (error) {
      return error.message;
    }
    return fired;
  });
  assert.deepEqual([plain, corrected], ['for ever', 1]);
});

/** A UART at 115,200 baud with its FIFOs on. */
function uart(chip) {
  const [one] = chip.uart;
  const FEN = 1 << 4, EIGHT = 3 << 5;
  one.writeUint32(0x24, 67);
  one.writeUint32(0x28, 52);
  one.writeUint32(0x2c, FEN | EIGHT);
  one.writeUint32(0x30, (1 << 9) | (1 << 8) | 1);
  return one;
}

test('UART: bytes leave at line rate, and the FIFO fills', () => {
  const TXFF = 1 << 5;
  const [plain, corrected] = without_and_with((chip) => uartAtLineRate(chip.uart[0]), (chip) => {
    const one = uart(chip);
    const sent = [];
    one.onByte = (byte) => sent.push([byte, chip.clock.nanos]);
    let filled = 0;
    while (filled < 40 && !(one.readUint32(0x18) & TXFF)) one.writeUint32(0x00, filled++);
    chip.clock.tick(10e6);
    return { filled, last: Math.round((sent.at(-1)[1] / 1e3)), order: sent.every(([byte], i) => byte === i) };
  });
  assert.deepEqual(plain, { filled: 40, last: 0, order: true });
  assert.deepEqual(corrected, { filled: 33, last: 2864, order: true }); // 33 bytes of 86.8 µs
});

test('UART: a byte that finds the FIFO full is lost and counted', () => {
  const [plain, corrected] = without_and_with((chip) => uartAtLineRate(chip.uart[0]), (chip) => {
    const one = uart(chip);
    for (let byte = 0; byte < 40; byte++) one.feedByte(byte);
    return one.overruns;
  });
  assert.deepEqual([plain, corrected], [undefined, 8]);
});

test('WFI: an interrupt that is pending already wakes the core', () => {
  const run = (asleep) => (chip) => {
    const { core } = chip;
    const code = 0x20000000;
    chip.writeUint16(code, 0xbf30); // wfi
    chip.writeUint16(code + 2, 0x2001); // movs r0, #1
    core.PC = code;
    core.PM = true;
    core.enabledInterrupts = 1;
    core.setInterrupt(0, true);
    for (let i = 0; i < 5 && core.registers[0] !== 1; i++) {
      if (!asleep(core)) core.executeInstruction();
    }
    return core.registers[0] === 1;
  };
  const [plain] = without_and_with(() => {}, run((core) => core.waiting));
  const [, corrected] = without_and_with(() => {}, run(isAsleep));
  assert.deepEqual([plain, corrected], [false, true]);
});
