//! Frames, found in the bytes of the line and read.

use super::firmware::{BoardIdentity, Firmware};
use super::frames::{ADC_SCANS, Ask, BoardError, BoardStatus, FromBoard, MAX_PULSES, ToBoard};
use crate::bno085::Bno085Sample;
use xtb_board_codec::flags::{EMERGENCY_STOP, READY, WATCHDOG};
use xtb_board_codec::{Content, NO_PULSE, NOT_FITTED, Reader, ask, kind};
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, TpuSetup};
use xtb_control::units::{AdcCount, PwmCount};

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
#[derive(Debug, Clone, Default)]
pub struct FrameReader {
    reader: Reader,
    frames: u64,
    rejected: u64,
}

impl FrameReader {
    /// What has been seen so far.
    #[must_use]
    pub fn counters(&self) -> LineCounters {
        let losses = self.reader.losses();
        let (frames, rejected) = (self.frames, self.rejected);
        LineCounters { frames, rejected, lost: losses.lost, repeated: losses.repeated }
    }

    /// The line was cut: what comes next has nothing to do with what came before.
    pub fn forget(&mut self) {
        self.reader.forget();
    }

    /// Frames of the board, for the agent.
    pub fn from_board(&mut self, bytes: &[u8], found: impl FnMut(Result<FromBoard, BoardError>)) {
        self.read(bytes, found, |content| match content.repeated {
            true => Err(BoardError::Repeated(content.seq)),
            false => parse_from_board(content.kind, content.payload()),
        });
    }

    /// Frames of the agent, for the board (real firmware or simulated).
    pub fn to_board(&mut self, bytes: &[u8], found: impl FnMut(Result<ToBoard, BoardError>)) {
        // An agent that restarts may begin with any number: the board obeys it.
        self.read(bytes, found, |content| parse_to_board(content.kind, content.payload()));
    }

    fn read<T>(
        &mut self,
        bytes: &[u8],
        mut found: impl FnMut(Result<T, BoardError>),
        parse: impl Fn(&Content) -> Result<T, BoardError>,
    ) {
        let (frames, rejected) = (&mut self.frames, &mut self.rejected);
        self.reader.read(bytes, |content| {
            let result = content.map_err(BoardError::from).and_then(|content| parse(&content));
            match &result {
                Ok(_) => *frames += 1,
                Err(BoardError::Repeated(_)) => {} // counted when it was opened
                Err(_) => *rejected += 1,
            }
            found(result);
        });
    }
}

/// A payload of exactly `N` numbers.
fn words<const N: usize>(kind: u8, payload: &[u8]) -> Result<[u16; N], BoardError> {
    xtb_board_codec::words(payload).ok_or(BoardError::Length { kind, got: payload.len(), expected: 2 * N })
}

fn parse_from_board(kind: u8, payload: &[u8]) -> Result<FromBoard, BoardError> {
    match kind {
        kind::ENCODER => match words::<1>(kind, payload)? {
            [pulses] if pulses <= MAX_PULSES => Ok(FromBoard::Encoder { pulses }),
            [pulses] => Err(BoardError::Pulses(pulses)),
        },
        kind::ADC => parse_adc(&words::<19>(kind, payload)?, None),
        kind::WIDE_ADC => parse_wide_adc(&words(kind, payload)?),
        kind::REMOTE => {
            let ticks = |word: u16| (word != NO_PULSE).then_some(u32::from(word));
            let [speed, steering, selector] = words::<3>(kind, payload)?.map(ticks);
            Ok(FromBoard::Remote(RemoteSample { speed, steering, selector }))
        }
        kind::STATUS => Ok(FromBoard::Status(parse_status(words(kind, payload)?))),
        kind::IDENTITY => Ok(FromBoard::Identity(parse_identity(words(kind, payload)?))),
        kind::IMU => Ok(FromBoard::Bno085(Bno085Sample::from_words(words(kind, payload)?)?)),
        _ => Err(BoardError::UnknownType(kind)),
    }
}

fn parse_status([firmware, flags, setup_checksum, rejected]: [u16; 4]) -> BoardStatus {
    let (firmware, is_set) = (Firmware(firmware), |flag: u16| flags & flag != 0);
    // A 0 says something only if the firmware knows the bit.
    let pressed = is_set(EMERGENCY_STOP);
    BoardStatus {
        firmware,
        ready: is_set(READY),
        watchdog: is_set(WATCHDOG),
        emergency_stop: (pressed || firmware.answers_asks()).then_some(pressed),
        setup_checksum,
        rejected,
    }
}

fn parse_identity([firmware, low, high, board, late_periods, replaced_samples]: [u16; 6]) -> BoardIdentity {
    let [model, notes] = board.to_le_bytes();
    BoardIdentity {
        firmware: Firmware(firmware),
        hash: u32::from(high) << 16 | u32::from(low),
        model,
        after_hang: notes & 1 != 0,
        late_periods,
        replaced_samples,
    }
}

/// The numbers of a usual scan, then those of the channels that it does not hold.
fn parse_wide_adc(words: &[u16; 23]) -> Result<FromBoard, BoardError> {
    let (mut usual, mut more) = ([0; 19], [0; 4]);
    usual.copy_from_slice(&words[..19]);
    more.copy_from_slice(&words[19..]);
    parse_adc(&usual, Some(more))
}

/// `more`: the seventh and eighth range finder of the front and of the rear bumper.
fn parse_adc(words: &[u16; 19], more: Option<[u16; 4]>) -> Result<FromBoard, BoardError> {
    let mut counts = [AdcCount::ZERO; 18];
    for (i, (count, &word)) in counts.iter_mut().zip(words).enumerate() {
        let scans = if i < 12 { 1.0 } else { f64::from(ADC_SCANS) };
        *count = AdcCount::try_from(f64::from(word) / scans)?;
    }
    let mut beyond = [AdcCount::ZERO; 4];
    for (count, word) in beyond.iter_mut().zip(more.unwrap_or_default()) {
        *count = AdcCount::try_from(word)?;
    }
    let [a, b, c, d, e, f, g, h, i, j, k, l, tilt_x, tilt_y, fl, fr, rl, rr] = counts;
    let [front_7, front_8, rear_7, rear_8] = beyond;
    let sample = AdcSample {
        ir_front: [a, b, c, d, e, f, front_7, front_8],
        ir_rear: [g, h, i, j, k, l, rear_7, rear_8],
        tilt: [tilt_x, tilt_y],
        pistons: [fl, fr, rl, rr],
    };
    let battery_mv = (words[18] != NOT_FITTED).then_some(words[18]);
    Ok(FromBoard::Adc { sample, battery_mv, is_wide: more.is_some() })
}

fn parse_to_board(kind: u8, payload: &[u8]) -> Result<ToBoard, BoardError> {
    match kind {
        kind::PWM => parse_pwm(&words::<10>(kind, payload)?).map(ToBoard::Pwm),
        kind::SETUP => match <&[u8; TpuSetup::LEN]>::try_from(payload) {
            Ok(bytes) => Ok(ToBoard::Setup(TpuSetup::from_bytes(bytes))),
            Err(_) => Err(BoardError::Length { kind, got: payload.len(), expected: TpuSetup::LEN }),
        },
        kind::RESET => {
            let [bits] = words::<1>(kind, payload)?;
            let bit = |n: u16| bits & (1 << n) != 0;
            Ok(ToBoard::Reset(ResetMask { speed: bit(0), steering: bit(1), selector: bit(2) }))
        }
        kind::ASK => {
            let [bits] = words::<1>(kind, payload)?;
            let asks = |bit: u16| bits & bit != 0;
            Ok(ToBoard::Ask(Ask {
                identity: asks(ask::IDENTITY),
                imu: asks(ask::IMU),
                wide_scan: asks(ask::WIDE_SCAN),
            }))
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
