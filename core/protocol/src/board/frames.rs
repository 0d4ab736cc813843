//! What the frames carry, each way, with their types and bounds, and what can be wrong with one.

use super::firmware::{BoardIdentity, Firmware};
use crate::bno085::Bno085Sample;
use thiserror::Error;
use xtb_board_codec::FrameError;
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, TpuSetup};
use xtb_control::units::OutOfRange;

pub use xtb_board_codec::{ADC_SCANS, Frame, MAX_FRAME, MAX_PULSES};

const _: () = assert!(MAX_PULSES == xtb_control::speed::MAX_WINDOW_PULSES);

/// What the board sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FromBoard {
    /// An encoder window closed.
    Encoder {
        /// Pulses in the window.
        pulses: u16,
    },
    /// A scan of the converter is complete.
    Adc {
        /// Ranges, tilt and pistons.
        sample: AdcSample,
        /// Battery voltage in mV; `None` if the board does not measure it.
        battery_mv: Option<u16>,
        /// Whether it holds all eight channels a bumper, as an [`Ask`] may want it; else the seventh and eighth read 0.
        is_wide: bool,
    },
    /// A frame of the receiver.
    Remote(RemoteSample),
    /// How the board is.
    Status(BoardStatus),
    /// Who it is; the answer to an [`Ask`].
    Identity(BoardIdentity),
    /// A sample of the inertial unit at the board, for whoever has [asked](Ask).
    Bno085(Bno085Sample),
}

/// What a board says of itself, every 100 ms and after each set-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardStatus {
    /// Which firmware it runs.
    pub firmware: Firmware,
    /// Set up; a board that is not sends nothing but its status and keeps every output neutral.
    pub ready: bool,
    /// The watchdog holds motor and pistons neutral.
    pub watchdog: bool,
    /// Whether the emergency stop at the board is pressed; `None` of a firmware that does not know it.
    pub emergency_stop: Option<bool>,
    /// [`TpuSetup::checksum`] of the set-up in force.
    pub setup_checksum: u16,
    /// Frames that the board has refused, modulo 65,536.
    pub rejected: u16,
}

/// What the agent sends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ToBoard {
    /// Ten pulses.
    Pwm(PwmOutputs),
    /// How to configure itself (Fig. 8).
    Setup(TpuSetup),
    /// Channels of the remote control to reset (Fig. 9).
    Reset(ResetMask),
    /// What else to send.
    Ask(Ask),
}

/// What a board is asked to send beside what it sends by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ask {
    /// Its [identity](FromBoard::Identity), once.
    pub identity: bool,
    /// The [samples](FromBoard::Bno085) of its inertial unit from now on; without this, none.
    pub imu: bool,
    /// Scans with all eight range finders a bumper from now on; without this, with six.
    pub wide_scan: bool,
}

/// Why bytes were not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum BoardError {
    /// Longer than any frame.
    #[error("no end of frame within {MAX_FRAME} bytes")]
    TooLong,
    /// Not valid COBS.
    #[error("COBS encoding broken")]
    Cobs,
    /// Shorter than any frame.
    #[error("frame of {0} bytes is too short")]
    TooShort(usize),
    /// The check sum does not match.
    #[error("CRC is {got:#010x}, should be {expected:#010x}")]
    Crc {
        /// As received.
        got: u32,
        /// As computed.
        expected: u32,
    },
    /// A frame of the board with the number of the one before: it hangs, and repeats itself.
    #[error("repeated frame number {0}")]
    Repeated(u8),
    /// A type that this side does not know.
    #[error("unknown frame type {0:#04x}")]
    UnknownType(u8),
    /// The payload has the wrong length for its type.
    #[error("frame type {kind:#04x} with {got} payload bytes, should be {expected}")]
    Length {
        /// Frame type.
        kind: u8,
        /// As received.
        got: usize,
        /// As specified.
        expected: usize,
    },
    /// A value is out of its range.
    #[error("{0}")]
    Value(#[from] OutOfRange),
    /// More pulses than the encoder can give.
    #[error("{0} pulses in one window, the encoder gives at most {MAX_PULSES}")]
    Pulses(u16),
}

impl From<FrameError> for BoardError {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::TooLong => Self::TooLong,
            FrameError::Cobs => Self::Cobs,
            FrameError::TooShort(bytes) => Self::TooShort(bytes),
            FrameError::Crc { got, expected } => Self::Crc { got, expected },
        }
    }
}
