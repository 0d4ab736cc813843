//! The two UARTs, read and filled in each turn: their hardware holds 32 bytes each way, which is 2.8 ms
//! at 115,200 baud and more than five turns.

use embassy_rp::Peri;
use embassy_rp::pac::uart::Uart as Registers;
use embassy_rp::pac::{PADS_BANK0, UART0, UART1};
use embassy_rp::peripherals::{self, PIN_0, PIN_1, PIN_21};
use embassy_rp::uart::{Blocking, Config, Uart, UartRx};
use xtb_board_codec::Frame;

/// Bytes that the hardware holds.
const FIFO: usize = 32;

/// A receiving pin to which nothing is connected shall be an idle line.
fn pull_up(pin: usize) {
    PADS_BANK0.gpio(pin).modify(|w| w.set_pue(true));
}

/// What has come in; a byte with a line error is taken as it is, since the check sum finds it.
fn next_byte(uart: Registers) -> Option<u8> {
    (!uart.uartfr().read().rxfe()).then(|| uart.uartdr().read().data())
}

/// UART0, 8N1, 115,200 baud.
pub(crate) struct AgentLine {
    _uart: Uart<'static, Blocking>,
    /// On its way out, and how much of it.
    sending: Option<(Frame, usize)>,
}

impl AgentLine {
    pub(crate) fn new(
        uart: Peri<'static, peripherals::UART0>,
        tx: Peri<'static, PIN_0>,
        rx: Peri<'static, PIN_1>,
    ) -> Self {
        let line = Self { _uart: Uart::new_blocking(uart, tx, rx, Config::default()), sending: None };
        pull_up(1);
        UART0.uartdr().write(|w| w.set_data(0)); // ends what a restart may have cut off
        line
    }

    /// Hands out what has come in.
    pub(crate) fn receive(&mut self, heard: impl FnOnce(&[u8])) {
        let (mut bytes, mut len) = ([0; FIFO], 0);
        while let (Some(place), Some(byte)) = (bytes.get_mut(len), next_byte(UART0)) {
            *place = byte;
            len += 1;
        }
        if len > 0 {
            heard(&bytes[..len]);
        }
    }

    /// Fills the hardware with the frame on its way, and takes another when all of one has left it: so
    /// what is urgent waits for one frame at most.
    pub(crate) fn transmit(&mut self, next: impl FnOnce() -> Option<Frame>) {
        if self.sending.is_none() && UART0.uartfr().read().txfe() {
            self.sending = next().map(|frame| (frame, 0));
        }
        let Some((frame, sent)) = &mut self.sending else { return };
        while let Some(byte) = frame.as_bytes().get(*sent) {
            if UART0.uartfr().read().txff() {
                return;
            }
            UART0.uartdr().write(|w| w.set_data(*byte));
            *sent += 1;
        }
        self.sending = None;
    }
}

/// UART1, receiving only, 8N1, 115,200 baud.
pub(crate) struct ImuLine {
    _uart: UartRx<'static, Blocking>,
}

impl ImuLine {
    pub(crate) fn new(uart: Peri<'static, peripherals::UART1>, rx: Peri<'static, PIN_21>) -> Self {
        let line = Self { _uart: UartRx::new_blocking(uart, rx, Config::default()) };
        pull_up(21);
        line
    }

    /// Hands out what has come in, at most what the hardware holds.
    pub(crate) fn receive(&mut self, mut heard: impl FnMut(u8)) {
        for _ in 0..FIFO {
            let Some(byte) = next_byte(UART1) else { return };
            heard(byte);
        }
    }
}
