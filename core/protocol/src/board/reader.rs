//! Frames, found in the bytes of the line and read.

use super::frames::{
    ADC_SCANS, BoardError, BoardStatus, CRC32, FromBoard, MAX_FRAME, MAX_PULSES, NO_PULSE, NOT_FITTED, READY,
    TYPE_ADC, TYPE_ENCODER, TYPE_PWM, TYPE_REMOTE, TYPE_RESET, TYPE_SETUP, TYPE_STATUS, ToBoard, WATCHDOG,
};
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, Setup};
use xtb_control::units::PwmCount;

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
        self.frames(bytes, |reader, body| {
            let result = body.and_then(|opened| match opened.repeated {
                true => Err(BoardError::Repeated(opened.seq)),
                false => parse_from_board(opened.kind, opened.payload()),
            });
            reader.count(&result);
            found(result);
        });
    }

    /// Frames of the agent, for the board (real firmware or simulated).
    pub fn to_board(&mut self, bytes: &[u8], mut found: impl FnMut(Result<ToBoard, BoardError>)) {
        self.frames(bytes, |reader, body| {
            // An agent that restarts may begin with any number: the board obeys it.
            let result = body.and_then(|opened| parse_to_board(opened.kind, opened.payload()));
            reader.count(&result);
            found(result);
        });
    }

    fn frames(&mut self, mut bytes: &[u8], mut each: impl FnMut(&mut Self, Result<Opened, BoardError>)) {
        while let Some(end) = bytes.iter().position(|&byte| byte == 0) {
            self.keep(&bytes[..end]);
            if let Some(body) = self.close() {
                each(self, body);
            }
            bytes = &bytes[end + 1..];
        }
        self.keep(bytes);
    }

    fn count<T>(&mut self, result: &Result<T, BoardError>) {
        match result {
            Ok(_) => self.counters.frames += 1,
            Err(BoardError::Repeated(_)) => {} // counted when it was opened
            Err(_) => self.counters.rejected += 1,
        }
    }

    /// Bytes of a frame, without a delimiter.
    fn keep(&mut self, piece: &[u8]) {
        let room = &mut self.buffer[self.len..];
        let kept = piece.len().min(room.len());
        room[..kept].copy_from_slice(&piece[..kept]);
        self.len += kept;
        self.overrun |= kept < piece.len();
    }

    /// A delimiter closes a frame: what is in it, checked.
    fn close(&mut self) -> Option<Result<Opened, BoardError>> {
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
