//! Bytes from serial lines: board frames in both directions, and the gyro's.

use crc::{CRC_32_ISO_HDLC, Crc};
use std::fmt::Debug;
use xtb_control::controller::{GyroSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::ResetMask;
use xtb_control::{AdcCount, PwmCount};
use xtb_protocol::board::{
    BoardError, Frame, FrameReader, FrameWriter, FromBoard, MAX_FRAME, MAX_PULSES, ToBoard,
};
use xtb_protocol::gyro_3dmg::{EULER_LEN, EulerFrame, GyroFrame, GyroReader, encode_firmware};

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

type Heard<T> = Result<T, BoardError>;

/// One direction of the board's line.
struct Direction<T> {
    read: fn(&mut FrameReader, &[u8]) -> Vec<Heard<T>>,
    write: fn(&mut FrameWriter, &T) -> Frame,
    in_range: fn(&T) -> bool,
    /// A frame that must be found after anything.
    good: T,
}

/// A board's line, seen by the agent and by the board; and the same bytes as one frame's content.
#[must_use]
pub fn board(bytes: &[u8]) -> bool {
    let from_board = Direction {
        read: |reader, bytes| {
            let mut found = Vec::new();
            reader.from_board(bytes, |frame| found.push(frame));
            found
        },
        write: |writer, frame| match frame {
            FromBoard::Encoder { pulses } => writer.encoder(*pulses),
            FromBoard::Adc { sample, battery_mv, is_wide: false } => writer.adc(sample, *battery_mv),
            FromBoard::Adc { sample, battery_mv, is_wide: true } => writer.wide_adc(sample, *battery_mv),
            FromBoard::Remote(sample) => writer.remote(sample),
            FromBoard::Status(status) => writer.status(status),
            FromBoard::Identity(identity) => writer.identity(identity),
            FromBoard::Bno085(sample) => writer.bno085(sample),
        },
        in_range: from_board_in_range,
        good: FromBoard::Encoder { pulses: 23 },
    };
    let to_board = Direction {
        read: |reader, bytes| {
            let mut found = Vec::new();
            reader.to_board(bytes, |frame| found.push(frame));
            found
        },
        write: |writer, frame| match frame {
            ToBoard::Pwm(pwm) => writer.pwm(pwm),
            ToBoard::Setup(setup) => writer.setup(setup),
            ToBoard::Reset(mask) => writer.reset(*mask),
            ToBoard::Ask(ask) => writer.ask(*ask),
        },
        in_range: to_board_in_range,
        good: ToBoard::Reset(ResetMask { speed: true, ..ResetMask::default() }),
    };
    let framed = framed(bytes);
    let mut accepted = false;
    for line in [bytes, &framed] {
        accepted |= from_board.holds(line);
        accepted |= to_board.holds(line);
    }
    from_board.opens(&framed);
    to_board.opens(&framed);
    accepted
}

/// The bytes as a frame whose check sum is right.
fn framed(content: &[u8]) -> Vec<u8> {
    let mut body = content.to_vec();
    body.extend(CRC32.checksum(content).to_le_bytes());
    let mut line = vec![0; cobs::max_encoding_length(body.len()) + 1];
    let len = cobs::encode(&body, &mut line);
    line.truncate(len + 1);
    line
}

impl<T: PartialEq + Debug> Direction<T> {
    fn holds(&self, line: &[u8]) -> bool {
        let mut reader = FrameReader::default();
        let found = (self.read)(&mut reader, line);
        self.in_any_pieces(line, &found, &reader);
        self.each_delimiter_closes_one(line, &found);
        let good: Vec<&T> = found.iter().flatten().collect();
        let counters = reader.counters();
        assert_eq!(counters.frames, good.len() as u64);
        assert!(counters.rejected <= (found.len() - good.len()) as u64, "{counters:?}");
        for frame in &good {
            assert!((self.in_range)(frame), "{frame:?}");
            let written = (self.write)(&mut FrameWriter::default(), frame);
            let again = (self.read)(&mut FrameReader::default(), written.as_bytes());
            assert_eq!(again.iter().flatten().collect::<Vec<_>>(), [*frame]);
        }
        self.finds_the_next(&mut reader);
        !good.is_empty()
    }

    fn in_any_pieces(&self, line: &[u8], whole: &[Heard<T>], after: &FrameReader) {
        for sizes in [&[1][..], &[3, 1, 17, 46]] {
            let (mut reader, mut found) = (FrameReader::default(), Vec::new());
            for piece in pieces(line, sizes) {
                found.extend((self.read)(&mut reader, piece));
            }
            assert_eq!((found.as_slice(), reader.counters()), (whole, after.counters()));
        }
    }

    fn each_delimiter_closes_one(&self, line: &[u8], found: &[Heard<T>]) {
        let end = line.iter().rposition(|byte| *byte == 0).unwrap_or(0);
        let closed: Vec<&[u8]> =
            line[..end].split(|byte| *byte == 0).filter(|frame| !frame.is_empty()).collect();
        assert_eq!(closed.len(), found.len());
        for (frame, result) in closed.iter().zip(found) {
            let too_long = matches!(result, Err(BoardError::TooLong));
            assert_eq!(too_long, frame.len() > MAX_FRAME, "{result:?}");
        }
    }

    /// Whatever the line has held: after a cut the next frames are found, after a delimiter as well, and
    /// half a frame costs no other. (Of two, because the first may bear the number of the last one.)
    fn finds_the_next(&self, reader: &mut FrameReader) {
        let mut cut = reader.clone();
        cut.forget();
        (self.read)(reader, &[0]);
        let mut writer = FrameWriter::default();
        let frames: [Frame; 4] = std::array::from_fn(|_| (self.write)(&mut writer, &self.good));
        let [first, second, broken, last] = frames.each_ref().map(Frame::as_bytes);
        for reader in [&mut cut, reader] {
            (self.read)(reader, first);
            assert_eq!((self.read)(reader, second).iter().flatten().collect::<Vec<_>>(), [&self.good]);
            (self.read)(reader, &broken[..broken.len() / 2]);
            (self.read)(reader, &[0]);
            assert_eq!((self.read)(reader, last).iter().flatten().collect::<Vec<_>>(), [&self.good]);
        }
    }

    /// A frame whose check sum is right is refused for what it says only.
    fn opens(&self, framed: &[u8]) {
        let found = (self.read)(&mut FrameReader::default(), framed);
        assert_eq!(found.len(), 1);
        if let Some(Err(BoardError::Crc { .. } | BoardError::Cobs)) = found.first() {
            panic!("{found:?}");
        }
    }
}

fn pieces<'a>(line: &'a [u8], sizes: &'a [usize]) -> impl Iterator<Item = &'a [u8]> {
    let (mut rest, mut sizes) = (line, sizes.iter().cycle());
    std::iter::from_fn(move || {
        let (piece, after) = rest.split_at((*sizes.next()?).min(rest.len()));
        rest = after;
        (!piece.is_empty()).then_some(piece)
    })
}

fn from_board_in_range(frame: &FromBoard) -> bool {
    let count = |count: &AdcCount| (0.0..=1023.0).contains(&count.get());
    let ticks = |ticks: &Option<u32>| ticks.is_none_or(|ticks| ticks < u32::from(u16::MAX));
    match frame {
        FromBoard::Encoder { pulses } => *pulses <= MAX_PULSES,
        FromBoard::Adc { sample, battery_mv, .. } => {
            let all =
                sample.ir_front.iter().chain(&sample.ir_rear).chain(&sample.tilt).chain(&sample.pistons);
            all.into_iter().all(count) && *battery_mv != Some(u16::MAX)
        }
        FromBoard::Remote(RemoteSample { speed, steering, selector }) => {
            [speed, steering, selector].into_iter().all(ticks)
        }
        FromBoard::Status(_) | FromBoard::Identity(_) => true,
        FromBoard::Bno085(sample) => {
            sample.yaw_cdeg.unsigned_abs() <= 18_000
                && sample.pitch_cdeg.unsigned_abs() <= 9_000
                && sample.roll_cdeg.unsigned_abs() <= 18_000
        }
    }
}

fn to_board_in_range(frame: &ToBoard) -> bool {
    let ToBoard::Pwm(pwm) = frame else { return true };
    let PwmOutputs { motor, steer_front, steer_rear, bumper_front, bumper_rear, pistons, spare } = pwm;
    let single = [motor, steer_front, steer_rear, bumper_front, bumper_rear, spare];
    single.into_iter().chain(pistons).all(|count| (PwmCount::MIN..=PwmCount::MAX).contains(count))
}

/// The gyro's line; and the same bytes as frames whose check sums are right.
#[must_use]
pub fn gyro(bytes: &[u8]) -> bool {
    let mut line = Vec::new();
    for words in bytes.chunks_exact(8) {
        let word = |i: usize| u16::from_be_bytes([words[i], words[i + 1]]);
        let angles = GyroSample { roll: word(0) as i16, pitch: word(2) as i16, yaw: word(4) as i16 };
        let frame = EulerFrame { angles, ticks: word(6) };
        assert_eq!(listen(&frame.encode()).1, [GyroFrame::Euler(frame)]);
        assert_eq!(listen(&encode_firmware(frame.ticks)).1, [GyroFrame::Firmware(frame.ticks)]);
        line.extend(frame.encode());
        line.extend(&words[..usize::from(words[0] % 5)]);
    }
    gyro_line(&line);
    gyro_line(bytes)
}

fn listen(bytes: &[u8]) -> (GyroReader, Vec<GyroFrame>) {
    let (mut reader, mut found) = (GyroReader::default(), Vec::new());
    reader.push(bytes, |frame| found.push(frame));
    (reader, found)
}

fn gyro_bytes(frame: &GyroFrame) -> Vec<u8> {
    match frame {
        GyroFrame::Euler(frame) => frame.encode().to_vec(),
        GyroFrame::Firmware(version) => encode_firmware(*version).to_vec(),
    }
}

fn gyro_line(line: &[u8]) -> bool {
    let (mut reader, found) = listen(line);
    for sizes in [&[1][..], &[5, 11, 2, 64]] {
        let (mut in_pieces, mut again) = (GyroReader::default(), Vec::new());
        for piece in pieces(line, sizes) {
            in_pieces.push(piece, |frame| again.push(frame));
        }
        assert_eq!(again, found);
        let counted = |reader: &GyroReader| (reader.frames, reader.skipped, reader.lost);
        assert_eq!(counted(&in_pieces), counted(&reader));
    }
    each_frame_stands_in_the_line(line, &found);
    let used: usize = found.iter().map(|frame| gyro_bytes(frame).len()).sum();
    let pending = line.len().checked_sub(used + reader.skipped as usize);
    assert!(pending.is_some_and(|pending| pending < EULER_LEN), "{pending:?} bytes wait");
    assert_eq!(reader.frames, found.len() as u64);
    // No frame begins with 0: after as many of them as a frame has bytes the reader starts afresh.
    let angles = GyroSample { roll: 1, pitch: -2, yaw: 3 };
    let good = EulerFrame { angles, ticks: 77 };
    reader.push(&[0; EULER_LEN], |_| {});
    let mut last = None;
    reader.push(&good.encode(), |frame| last = Some(frame));
    assert_eq!(last, Some(GyroFrame::Euler(good)));
    !found.is_empty()
}

/// Nothing is made up: the frames' own bytes come one after the other in the line.
fn each_frame_stands_in_the_line(line: &[u8], found: &[GyroFrame]) {
    let mut rest = line;
    for frame in found {
        let bytes = gyro_bytes(frame);
        let at = rest.windows(bytes.len()).position(|window| window == bytes);
        let at = at.unwrap_or_else(|| panic!("{frame:?} does not stand in the line"));
        rest = &rest[at + bytes.len()..];
    }
}
