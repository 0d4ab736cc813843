// UART at line rate: rp2040js 1.4.1 sends a byte in no time, so its transmit FIFO is never full and no
// frame ever waits; it counts no overrun; it does not know UARTIFLS and UARTDMACR. Interrupts of the
// UART are not modelled here: the firmware polls.

const UARTDR = 0x00, UARTRSR = 0x04, UARTFR = 0x18, UARTIFLS = 0x34, UARTDMACR = 0x48;
const BUSY = 1 << 3, RXFE = 1 << 4, TXFF = 1 << 5, RXFF = 1 << 6, TXFE = 1 << 7;
const OVERRUN = 1 << 11;
const BITS_A_BYTE = 10;

/** Gives a chip's UART a transmit FIFO and a shift register. */
export function uartAtLineRate(uart) {
  const { rp2040 } = uart;
  const original = { read: uart.readUint32, write: uart.writeUint32 };
  const sending = [];
  const registers = new Map([[UARTRSR, 0], [UARTIFLS, 0x12], [UARTDMACR, 0]]);
  let shifting = false, overrun = false;
  uart.overruns = 0;

  const depth = () => (uart.fifosEnabled ? 32 : 1);
  const shifted = rp2040.clock.createAlarm(() => {
    const byte = sending.shift();
    shifting = false;
    shift();
    uart.onByte?.(byte);
  });
  // The byte in the shift register is the first of `sending`.
  function shift() {
    if (shifting || sending.length === 0 || !uart.enabled || !uart.txEnabled) return;
    shifting = true;
    const bitNanos = (uart.baudDivider * 16 * 1e9) / rp2040.clkPeri;
    shifted.schedule(BITS_A_BYTE * bitNanos);
  }
  const inFifo = () => sending.length - (shifting ? 1 : 0);

  uart.feedByte = (byte) => {
    if (!uart.enabled || !uart.rxEnabled) return;
    if (uart.rxFIFO.itemCount >= depth()) {
      overrun = true;
      uart.overruns++;
    } else {
      uart.rxFIFO.push(overrun ? byte | OVERRUN : byte);
      overrun = false;
    }
  };
  uart.readUint32 = (offset) => {
    if (offset === UARTDR) return uart.rxFIFO.pull();
    if (offset === UARTFR) {
      const received = uart.rxFIFO.itemCount;
      return (sending.length ? BUSY : 0) | (received ? 0 : RXFE) | (received >= depth() ? RXFF : 0)
        | (inFifo() >= depth() ? TXFF : 0) | (inFifo() ? 0 : TXFE);
    }
    return registers.get(offset) ?? original.read.call(uart, offset);
  };
  uart.writeUint32 = (offset, value) => {
    if (offset === UARTDR) {
      if (inFifo() < depth()) sending.push(value & 0xff);
    } else if (registers.has(offset)) {
      registers.set(offset, value);
    } else {
      original.write.call(uart, offset, value);
    }
    shift();
  };
}
