//! Frames on the line between the I/O board and the agent, as numbers: what both ends share.
//!
//! ```text
//!   frame := COBS( type u8 · sequence u8 · payload · CRC-32 ) · 0x00
//! ```
//! All numbers are little-endian; the CRC is CRC-32/ISO-HDLC over type, sequence and payload; the
//! sequence counts each direction's frames modulo 256. `docs/io-board.md` is the contract.
//!
//! This crate needs neither `std` nor an allocator, so that the board's firmware uses the very code of
//! the agent. It knows bytes and u16, not quantities: those are `xtb_protocol::board`'s, which is a
//! typed layer over it. [`Reader`] and [`Writer`] are the two ends, [`kind`] names the frames,
//! [`Setup`] is the one payload that both ends have to understand as a whole.
//!
//! Cargo feature `wide-crc`: sixteen tables of CRC-32 (16 KiB), fast on a computer; without it one
//! table (1 KiB).
#![no_std]

mod reader;
mod setup;
mod stuffing;
mod writer;

pub use reader::{Content, FrameError, Losses, Reader, words};
pub use setup::{CLOCK_HZ, OUTPUTS, PINS, Setup};
pub use writer::{Frame, Writer};

use crc::{CRC_32_ISO_HDLC, Crc};

/// Types of frame; the high nibble is the version of the layout.
pub mod kind {
    /// Agent: ten pulses, each a u16 within [`PULSES`](super::PULSES), in counts of 0.4 µs.
    pub const PWM: u8 = 0x10;
    /// Board: u16, pulses of an encoder window, at most [`MAX_PULSES`](super::MAX_PULSES).
    pub const ENCODER: u8 = 0x11;
    /// Board: nineteen u16, a scan of the converter.
    pub const ADC: u8 = 0x12;
    /// Board: three u16, the receiver's pulses in time counts, or [`NO_PULSE`](super::NO_PULSE).
    pub const REMOTE: u8 = 0x13;
    /// Board: four u16, how it is ([`flags`](super::flags) in the second).
    pub const STATUS: u8 = 0x14;
    /// Board, if [asked](ASK): four u16, which firmware it runs.
    pub const IDENTITY: u8 = 0x15;
    /// Board, if [asked](ASK): seven u16, a sample of the inertial unit at the board.
    pub const IMU: u8 = 0x16;
    /// Board, if [asked](ASK), in place of [`ADC`]: its nineteen u16, then the seventh and eighth range finder of the
    /// front and of the rear bumper.
    pub const WIDE_ADC: u8 = 0x17;
    /// Agent: [`Setup`](super::Setup).
    pub const SETUP: u8 = 0x18;
    /// Agent: u16, channels of the receiver to reset.
    pub const RESET: u8 = 0x19;
    /// Agent: u16, what else the board shall send ([`ask`](super::ask)).
    pub const ASK: u8 = 0x1A;
}

/// Bits of the second number of a status.
pub mod flags {
    /// Set up; a board that is not sends nothing but its status and keeps every output at rest.
    pub const READY: u16 = 1;
    /// Motor and pistons are held at 3750.
    pub const WATCHDOG: u16 = 2;
    /// The emergency stop is pressed, or its wire is broken.
    pub const EMERGENCY_STOP: u16 = 4;
}

/// Bits of an [`ASK`](kind::ASK) frame.
pub mod ask {
    /// One [`IDENTITY`](super::kind::IDENTITY) frame.
    pub const IDENTITY: u16 = 1;
    /// [`IMU`](super::kind::IMU) frames from now on; without the bit, none.
    pub const IMU: u16 = 2;
    /// [`WIDE_ADC`](super::kind::WIDE_ADC) frames in place of [`ADC`](super::kind::ADC) from now on; without the bit,
    /// those.
    pub const WIDE_SCAN: u16 = 4;
}

#[cfg(feature = "wide-crc")]
const CRC32: Crc<u32, crc::Table<16>> = Crc::<u32, crc::Table<16>>::new(&CRC_32_ISO_HDLC);
#[cfg(not(feature = "wide-crc"))]
const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC of some bytes: 0xCBF43926 for `123456789`.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC32.checksum(bytes)
}

/// Type, sequence, the longest payload, CRC.
pub const MAX_BODY: usize = 2 + 46 + 4;
/// The longest frame on the line: one COBS overhead byte and the delimiter.
pub const MAX_FRAME: usize = MAX_BODY + 2;
/// Pulse lengths that a PWM frame may carry, in counts of 0.4 µs: 4.2 % to 9.5 % of 22.2 ms.
pub const PULSES: core::ops::RangeInclusive<u16> = 2331..=5272;
/// The pulse of 1.5 ms: motor at rest, pistons stopped.
pub const NEUTRAL: u16 = 3750;
/// Most pulses that one encoder window can hold (12,000 rpm · 60 pulses, 5 % over).
pub const MAX_PULSES: u16 = 660;
/// Largest reading of a range finder: 10 bit.
pub const MAX_RANGE: u16 = 1023;
/// Scans that tilt and piston readings are summed over (§4.8.3).
pub const ADC_SCANS: u16 = 64;
/// Battery reading of a board that does not measure it.
pub const NOT_FITTED: u16 = u16::MAX;
/// Time count of a channel that saw no pulse.
pub const NO_PULSE: u16 = u16::MAX;

#[cfg(test)]
mod tests;
