//! What waits for the line to the agent: one place a type, so that it cannot grow, and a fixed order.
//!
//! The answer to a set-up must not wait behind a scan: the status goes first, and is made at the moment
//! at which it is sent. A sample that finds its place taken replaces the older one, and is counted.

use crate::scan::{Readings, USUAL, WIDE};
use xtb_board_codec::{Frame, Writer, kind};

/// What the firmware runs on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hardware {
    /// Raspberry Pi Pico, RP2040.
    Pico = 1,
    /// Raspberry Pi Pico 2, RP2350.
    Pico2 = 2,
}

/// Which firmware this is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// Major version in the high byte, minor in the low one.
    pub version: u16,
    /// CRC-32 of the program in flash.
    pub hash: u32,
    /// What it runs on.
    pub hardware: Hardware,
    /// The last start was a reset by the hardware watchdog.
    pub after_hang: bool,
}

#[derive(Debug, Clone, Default)]
pub(crate) struct Outbox {
    writer: Writer,
    pub(crate) status: bool,
    pub(crate) identity: bool,
    encoder: Option<u16>,
    remote: Option<[u16; 3]>,
    imu: Option<[u16; 7]>,
    adc: Option<Readings>,
    /// Scans go out with all range finders.
    pub(crate) wide_scans: bool,
    /// Samples that were replaced before they could be sent.
    dropped: u16,
}

impl Outbox {
    pub(crate) fn encoder(&mut self, pulses: u16) {
        self.dropped = self.dropped.saturating_add(u16::from(self.encoder.replace(pulses).is_some()));
    }

    pub(crate) fn remote(&mut self, readings: [u16; 3]) {
        self.dropped = self.dropped.saturating_add(u16::from(self.remote.replace(readings).is_some()));
    }

    pub(crate) fn imu(&mut self, sample: [u16; 7]) {
        self.dropped = self.dropped.saturating_add(u16::from(self.imu.replace(sample).is_some()));
    }

    pub(crate) fn adc(&mut self, numbers: Readings) {
        self.dropped = self.dropped.saturating_add(u16::from(self.adc.replace(numbers).is_some()));
    }

    pub(crate) fn dropped(&self) -> u16 {
        self.dropped
    }

    /// The next frame, the most urgent first.
    pub(crate) fn take(&mut self, status: [u16; 4], identity: [u16; 6]) -> Option<Frame> {
        let writer = &mut self.writer;
        if core::mem::take(&mut self.status) {
            return Some(writer.frame(kind::STATUS, status));
        }
        if let Some(pulses) = self.encoder.take() {
            return Some(writer.frame(kind::ENCODER, [pulses]));
        }
        if let Some(readings) = self.remote.take() {
            return Some(writer.frame(kind::REMOTE, readings));
        }
        if let Some(sample) = self.imu.take() {
            return Some(writer.frame(kind::IMU, sample));
        }
        if let Some(numbers) = self.adc.take() {
            let (kind, length) = if self.wide_scans { (kind::WIDE_ADC, WIDE) } else { (kind::ADC, USUAL) };
            return Some(writer.frame(kind, numbers.into_iter().take(length)));
        }
        core::mem::take(&mut self.identity).then(|| writer.frame(kind::IDENTITY, identity))
    }
}
