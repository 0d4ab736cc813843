//! Frames on the line between the I/O board and the agent, both directions.
//!
//! ```text
//!   frame := COBS( type u8 · seq u8 · payload · CRC-32 ) · 0x00
//! ```
//! All numbers little-endian; the CRC is CRC-32/ISO-HDLC over type, sequence and payload; the
//! sequence counts each direction's frames modulo 256, so that gaps can be counted. The high nibble
//! of the type is the layout's version (1). `docs/io-board.md` is the same for firmware writers.
//! A frame of the board with the number of the one before is a repeat and counts for nothing.
//! The decoder never panics, resynchronises at the next 0x00 and counts what it drops.

pub mod rates;

use crc::{CRC_32_ISO_HDLC, Crc};
use thiserror::Error;
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, Setup};
use xtb_control::units::{OutOfRange, PwmCount};

const CRC32: Crc<u32, crc::Table<16>> = Crc::<u32, crc::Table<16>>::new(&CRC_32_ISO_HDLC);

const TYPE_PWM: u8 = 0x10;
const TYPE_ENCODER: u8 = 0x11;
const TYPE_ADC: u8 = 0x12;
const TYPE_REMOTE: u8 = 0x13;
const TYPE_STATUS: u8 = 0x14;
const TYPE_SETUP: u8 = 0x18;
const TYPE_RESET: u8 = 0x19;

/// Type, sequence, the longest payload, CRC.
const MAX_BODY: usize = 2 + 38 + 4;
/// The longest frame on the wire: one COBS overhead byte and the delimiter.
pub const MAX_FRAME: usize = MAX_BODY + 2;
/// Most pulses that one encoder window can hold (12,000 rpm · 60 pulses, 5 % over).
pub const MAX_PULSES: u16 = 660;
/// Scans that tilt and piston readings are summed over (§4.8.3).
pub const ADC_SCANS: u16 = 64;
/// Battery reading of a board that does not measure it.
const NOT_FITTED: u16 = u16::MAX;
/// Time count of a channel that saw no pulse.
const NO_PULSE: u16 = u16::MAX;
/// Flags of a status frame.
const READY: u16 = 1;
const WATCHDOG: u16 = 2;

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
    },
    /// A frame of the receiver.
    Remote(RemoteSample),
    /// How the board is.
    Status(BoardStatus),
}

/// What a board says of itself, every 100 ms and after each set-up.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardStatus {
    /// Firmware's version, major in the high byte.
    pub firmware: u16,
    /// Set up; a board that is not sends nothing but its status and keeps every output neutral.
    pub ready: bool,
    /// The watchdog holds motor and pistons neutral.
    pub watchdog: bool,
    /// [`Setup::checksum`] of the set-up in force.
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
    Setup(Setup),
    /// Channels of the remote control to reset (Fig. 9).
    Reset(ResetMask),
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

/// A frame ready for the line.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    bytes: [u8; MAX_FRAME],
    len: usize,
}

impl Frame {
    /// The bytes, delimiter included.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Builds frames and counts their sequence.
#[derive(Debug, Clone, Default)]
pub struct FrameWriter {
    seq: u8,
}

impl FrameWriter {
    /// The agent's: ten pulses in [`PwmOutputs`] order.
    pub fn pwm(&mut self, pwm: &PwmOutputs) -> Frame {
        let [fl, fr, rl, rr] = pwm.pistons;
        let all = [
            pwm.motor,
            pwm.steer_front,
            pwm.steer_rear,
            pwm.bumper_front,
            pwm.bumper_rear,
            fl,
            fr,
            rl,
            rr,
            pwm.spare,
        ];
        self.frame(TYPE_PWM, all.map(PwmCount::get).into_iter())
    }

    /// The agent's: how the board shall configure itself.
    pub fn setup(&mut self, setup: &Setup) -> Frame {
        let bytes = setup.to_bytes();
        self.frame(TYPE_SETUP, bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])))
    }

    /// The agent's: channels of the remote control to reset.
    pub fn reset(&mut self, mask: ResetMask) -> Frame {
        let bits = u16::from(mask.speed) | u16::from(mask.steering) << 1 | u16::from(mask.selector) << 2;
        self.frame(TYPE_RESET, [bits].into_iter())
    }

    /// The board's: a frame of the receiver. Counts above 65,534 saturate there.
    pub fn remote(&mut self, sample: &RemoteSample) -> Frame {
        let word =
            |ticks: Option<u32>| ticks.map_or(NO_PULSE, |ticks| ticks.min(u32::from(NO_PULSE) - 1) as u16);
        self.frame(TYPE_REMOTE, [sample.speed, sample.steering, sample.selector].map(word).into_iter())
    }

    /// The board's: how it is.
    pub fn status(&mut self, status: &BoardStatus) -> Frame {
        let flags = (u16::from(status.ready) * READY) | (u16::from(status.watchdog) * WATCHDOG);
        let words = [status.firmware, flags, status.setup_checksum, status.rejected];
        self.frame(TYPE_STATUS, words.into_iter())
    }

    /// The board's: an encoder window.
    pub fn encoder(&mut self, pulses: u16) -> Frame {
        self.frame(TYPE_ENCODER, [pulses].into_iter())
    }

    /// The board's: a scan. Ranges as counts; tilt and pistons as sums of [`ADC_SCANS`] scans.
    pub fn adc(&mut self, sample: &AdcSample, battery_mv: Option<u16>) -> Frame {
        let ranges = sample.ir_front.iter().chain(&sample.ir_rear).map(|c| c.get() as u16);
        let sums = sample.tilt.iter().chain(&sample.pistons);
        let sums = sums.map(|c| (c.get() * f64::from(ADC_SCANS) + 0.5) as u16);
        self.frame(TYPE_ADC, ranges.chain(sums).chain([battery_mv.unwrap_or(NOT_FITTED)]))
    }

    fn frame(&mut self, kind: u8, payload: impl Iterator<Item = u16>) -> Frame {
        let mut body = [0_u8; MAX_BODY];
        body[0] = kind;
        body[1] = self.seq;
        self.seq = self.seq.wrapping_add(1);
        let mut len = 2;
        for value in payload {
            body[len..len + 2].copy_from_slice(&value.to_le_bytes());
            len += 2;
        }
        let crc = CRC32.checksum(&body[..len]);
        body[len..len + 4].copy_from_slice(&crc.to_le_bytes());
        let mut frame = Frame { bytes: [0; MAX_FRAME], len: 0 };
        let encoded = cobs::encode(&body[..len + 4], &mut frame.bytes);
        frame.len = encoded + 1; // the delimiter is already there
        frame
    }
}

/// What a reader has seen go wrong since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LineCounters {
    /// Good frames.
    pub frames: u64,
    /// Dropped frames: broken, unknown or out of range.
    pub rejected: u64,
    /// Gaps in the sequence, in frames.
    pub lost: u64,
    /// Frames with the number of the one before.
    pub repeated: u64,
}

/// Collects bytes into frames.
#[derive(Debug, Clone)]
pub struct FrameReader {
    buffer: [u8; MAX_FRAME],
    len: usize,
    overrun: bool,
    next_seq: Option<u8>,
    counters: LineCounters,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self {
            buffer: [0; MAX_FRAME],
            len: 0,
            overrun: false,
            next_seq: None,
            counters: LineCounters::default(),
        }
    }
}

impl FrameReader {
    /// What has been seen so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        self.counters
    }

    /// The line was cut: what comes next has nothing to do with what came before.
    pub fn forget(&mut self) {
        (self.len, self.overrun, self.next_seq) = (0, false, None);
    }

    /// Frames of the board, for the agent.
    pub fn from_board(&mut self, bytes: &[u8], mut found: impl FnMut(Result<FromBoard, BoardError>)) {
        for &byte in bytes {
            if let Some(body) = self.push(byte) {
                let result = body.and_then(|opened| match opened.repeated {
                    true => Err(BoardError::Repeated(opened.seq)),
                    false => parse_from_board(opened.kind, opened.payload()),
                });
                self.count(&result);
                found(result);
            }
        }
    }

    /// Frames of the agent, for the board (real firmware or simulated).
    pub fn to_board(&mut self, bytes: &[u8], mut found: impl FnMut(Result<ToBoard, BoardError>)) {
        for &byte in bytes {
            if let Some(body) = self.push(byte) {
                // An agent that restarts may begin with any number: the board obeys it.
                let result = body.and_then(|opened| parse_to_board(opened.kind, opened.payload()));
                self.count(&result);
                found(result);
            }
        }
    }

    fn count<T>(&mut self, result: &Result<T, BoardError>) {
        match result {
            Ok(_) => self.counters.frames += 1,
            Err(BoardError::Repeated(_)) => {} // counted when it was opened
            Err(_) => self.counters.rejected += 1,
        }
    }

    /// A delimiter closes a frame: what is in it, checked.
    fn push(&mut self, byte: u8) -> Option<Result<Opened, BoardError>> {
        if byte != 0 {
            if self.len == self.buffer.len() {
                self.overrun = true;
            } else {
                self.buffer[self.len] = byte;
                self.len += 1;
            }
            return None;
        }
        let (len, overrun) = (self.len, self.overrun);
        (self.len, self.overrun) = (0, false);
        if len == 0 {
            return None; // an idle line may send delimiters
        }
        Some(if overrun { Err(BoardError::TooLong) } else { self.open(len) })
    }

    fn open(&mut self, len: usize) -> Result<Opened, BoardError> {
        let mut body = [0; MAX_FRAME];
        let len = cobs::decode(&self.buffer[..len], &mut body).map_err(|_| BoardError::Cobs)?;
        if len < 6 {
            return Err(BoardError::TooShort(len));
        }
        let (content, crc) = body[..len].split_at(len - 4);
        let got = u32::from_le_bytes([crc[0], crc[1], crc[2], crc[3]]);
        let expected = CRC32.checksum(content);
        if got != expected {
            return Err(BoardError::Crc { got, expected });
        }
        let seq = body[1];
        let next = self.next_seq.replace(seq.wrapping_add(1));
        let gap = next.map_or(0, |next| seq.wrapping_sub(next));
        let repeated = gap == u8::MAX;
        if repeated {
            self.counters.repeated += 1;
        } else {
            self.counters.lost += u64::from(gap);
        }
        Ok(Opened { kind: body[0], seq, repeated, body, len: len - 4 })
    }
}

/// A frame whose check sum is right.
struct Opened {
    kind: u8,
    seq: u8,
    /// It has the number of the one before.
    repeated: bool,
    body: [u8; MAX_FRAME],
    /// Of type, sequence and payload.
    len: usize,
}

impl Opened {
    fn payload(&self) -> &[u8] {
        &self.body[2..self.len]
    }
}

/// A payload of exactly `N` numbers.
fn words<const N: usize>(kind: u8, payload: &[u8]) -> Result<[u16; N], BoardError> {
    if payload.len() != 2 * N {
        return Err(BoardError::Length { kind, got: payload.len(), expected: 2 * N });
    }
    let mut words = [0; N];
    for (word, bytes) in words.iter_mut().zip(payload.chunks_exact(2)) {
        *word = u16::from_le_bytes([bytes[0], bytes[1]]);
    }
    Ok(words)
}

fn parse_from_board(kind: u8, payload: &[u8]) -> Result<FromBoard, BoardError> {
    match kind {
        TYPE_ENCODER => match words::<1>(kind, payload)? {
            [pulses] if pulses <= MAX_PULSES => Ok(FromBoard::Encoder { pulses }),
            [pulses] => Err(BoardError::Pulses(pulses)),
        },
        TYPE_ADC => parse_adc(&words::<19>(kind, payload)?),
        TYPE_REMOTE => {
            let ticks = |word: u16| (word != NO_PULSE).then_some(u32::from(word));
            let [speed, steering, selector] = words::<3>(kind, payload)?.map(ticks);
            Ok(FromBoard::Remote(RemoteSample { speed, steering, selector }))
        }
        TYPE_STATUS => {
            let [firmware, flags, setup_checksum, rejected] = words::<4>(kind, payload)?;
            let (ready, watchdog) = (flags & READY != 0, flags & WATCHDOG != 0);
            Ok(FromBoard::Status(BoardStatus { firmware, ready, watchdog, setup_checksum, rejected }))
        }
        _ => Err(BoardError::UnknownType(kind)),
    }
}

fn parse_adc(words: &[u16; 19]) -> Result<FromBoard, BoardError> {
    use xtb_control::AdcCount;
    let mut counts = [AdcCount::ZERO; 18];
    for (i, (count, &word)) in counts.iter_mut().zip(words).enumerate() {
        let scans = if i < 12 { 1.0 } else { f64::from(ADC_SCANS) };
        *count = AdcCount::try_from(f64::from(word) / scans)?;
    }
    let [a, b, c, d, e, f, g, h, i, j, k, l, tilt_x, tilt_y, fl, fr, rl, rr] = counts;
    let sample = AdcSample {
        ir_front: [a, b, c, d, e, f],
        ir_rear: [g, h, i, j, k, l],
        tilt: [tilt_x, tilt_y],
        pistons: [fl, fr, rl, rr],
    };
    let battery_mv = (words[18] != NOT_FITTED).then_some(words[18]);
    Ok(FromBoard::Adc { sample, battery_mv })
}

fn parse_to_board(kind: u8, payload: &[u8]) -> Result<ToBoard, BoardError> {
    match kind {
        TYPE_PWM => parse_pwm(&words::<10>(kind, payload)?).map(ToBoard::Pwm),
        TYPE_SETUP => match <&[u8; Setup::LEN]>::try_from(payload) {
            Ok(bytes) => Ok(ToBoard::Setup(Setup::from_bytes(bytes))),
            Err(_) => Err(BoardError::Length { kind, got: payload.len(), expected: Setup::LEN }),
        },
        TYPE_RESET => {
            let [bits] = words::<1>(kind, payload)?;
            let bit = |n: u16| bits & (1 << n) != 0;
            Ok(ToBoard::Reset(ResetMask { speed: bit(0), steering: bit(1), selector: bit(2) }))
        }
        _ => Err(BoardError::UnknownType(kind)),
    }
}

fn parse_pwm(words: &[u16; 10]) -> Result<PwmOutputs, BoardError> {
    let mut counts = [PwmCount::NEUTRAL; 10];
    for (count, word) in counts.iter_mut().zip(words) {
        *count = PwmCount::try_from(*word)?;
    }
    let [motor, steer_front, steer_rear, bumper_front, bumper_rear, fl, fr, rl, rr, spare] = counts;
    let pistons = [fl, fr, rl, rr];
    Ok(PwmOutputs { motor, steer_front, steer_rear, bumper_front, bumper_rear, pistons, spare })
}
