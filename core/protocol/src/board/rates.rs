//! What the frames need of their lines: which baud rate carries them, and which does not.
//!
//! A byte is ten bits on a line (8N1), and each direction has the whole rate to itself. The sum of a
//! direction is asked for with a quarter more, so that what is urgent (the neutral pulse, the answer
//! to a set-up) does not wait behind a full line. `docs/io-board.md` prints these tables.

use crate::bno085;
use crate::gyro_3dmg::{EULER_LEN, FIRMWARE_LEN, PERIOD_MS, START_CONTINUOUS, STOP_CONTINUOUS};
use thiserror::Error;
use xtb_control::tpu::TpuSetup;
use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};

/// Bits of one byte on the line: start, eight, stop.
pub const BITS_A_BYTE: f64 = 10.0;
/// A line has to be this much faster than the sum of its frames.
pub const HEAD_ROOM: f64 = 1.25;
/// Around a payload: COBS, type, sequence, CRC, delimiter.
const AROUND: usize = 1 + 1 + 1 + 4 + 1;
/// Between two PWM frames, in s.
pub const PWM_EVERY_S: f64 = 0.020;
/// PWM frames that go out beside those, when a new setpoint turns the wheels: in any second at most. More than
/// the 20 setpoints of a client, and as many as 38,400 baud carry with their reserve.
pub const EARLY_PWM_A_SECOND: u32 = 25;
/// Between two set-ups while the board has not confirmed, in s.
pub const SETUP_EVERY_S: f64 = 0.1;
/// Between two asks while what was asked for does not come, in s.
pub const ASK_EVERY_S: f64 = 0.1;
/// Between two scans of the converter, in s (§4.5).
pub const SCAN_EVERY_S: f64 = 0.038;
/// Between two status frames, in s.
pub const STATUS_EVERY_S: f64 = 0.1;
/// Between two attempts to start a silent gyro, in s.
pub const GREETING_EVERY_S: f64 = 0.5;

/// Rates that serial ports have, in baud.
const STANDARD: [u32; 16] = [
    1200, 2400, 4800, 9600, 14_400, 19_200, 28_800, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600,
    1_000_000, 2_000_000, 4_000_000,
];
/// Those among them that nearly every device has.
const USUAL: [u32; 9] = [4800, 9600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 921_600];

/// Which way a frame goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From board or gyro to the agent.
    FromDevice,
    /// From the agent to board or gyro.
    ToDevice,
}

/// What one type of frame needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRate {
    /// What it carries.
    pub name: &'static str,
    /// Which way.
    pub direction: Direction,
    /// Length on the line, everything included.
    pub bytes: usize,
    /// Between two of them, in s; at most as often, where `only` says when.
    pub every_s: f64,
    /// When it is sent; empty = always.
    pub only: &'static str,
}

impl FrameRate {
    /// Bytes per second.
    #[must_use]
    pub fn bytes_per_s(&self) -> f64 {
        self.bytes as f64 / self.every_s
    }

    /// The share of the line's rate, in baud.
    #[must_use]
    pub fn baud(&self) -> f64 {
        self.bytes_per_s() * BITS_A_BYTE
    }

    /// Time on the line at a rate, in ms.
    #[must_use]
    pub fn time_ms(&self, baud: u32) -> f64 {
        self.bytes as f64 * BITS_A_BYTE * 1000.0 / f64::from(baud)
    }
}

/// All frames of one line, both ways.
#[derive(Debug, Clone, PartialEq)]
pub struct LineRates {
    device: &'static str,
    frames: Vec<FrameRate>,
}

impl LineRates {
    /// The I/O board's line for a truck with this `encoder.window_s` and `remote.period_ms`.
    #[must_use]
    pub fn board(encoder_window_s: f64, remote_period_ms: f64) -> Self {
        use Direction::{FromDevice, ToDevice};
        let remote_s = remote_period_ms / 1000.0;
        let frame = |name, direction, payload: usize, every_s, only| FrameRate {
            name,
            direction,
            bytes: payload + AROUND,
            every_s,
            only,
        };
        Self {
            device: "board",
            frames: vec![
                frame("encoder", FromDevice, 2, encoder_window_s, ""),
                frame("converter", FromDevice, 38, SCAN_EVERY_S, ""),
                frame("remote control", FromDevice, 6, remote_s, "with a receiver"),
                frame("status", FromDevice, 8, STATUS_EVERY_S, ""),
                frame("pwm", ToDevice, 20, PWM_EVERY_S, ""),
                frame("early pwm", ToDevice, 20, 1.0 / f64::from(EARLY_PWM_A_SECOND), "after new setpoints"),
                frame("set-up", ToDevice, TpuSetup::LEN, SETUP_EVERY_S, "until confirmed"),
                frame("channel reset", ToDevice, 2, remote_s, "while a channel reads 420 %"),
            ],
        }
    }

    /// The same line with a BNO085 at the board, whose samples it carries too.
    #[must_use]
    pub fn with_bno085(mut self) -> Self {
        use Direction::{FromDevice, ToDevice};
        let (every_s, only) = (bno085::PERIOD_MS / 1000.0, "with a BNO085");
        let sample =
            FrameRate { name: "inertial unit", direction: FromDevice, bytes: 14 + AROUND, every_s, only };
        let only = "with a BNO085, until it is heard";
        let ask =
            FrameRate { name: "ask", direction: ToDevice, bytes: 2 + AROUND, every_s: ASK_EVERY_S, only };
        self.frames.extend([sample, ask]);
        self.frames.sort_by_key(|frame| frame.direction == ToDevice);
        self
    }

    /// The same line of a car with more than six range finders on a bumper, whose scans are longer.
    #[must_use]
    pub fn with_wide_scans(mut self) -> Self {
        for frame in &mut self.frames {
            if frame.name == "converter" {
                frame.bytes += 2 * 2 * (SLOTS - USUAL_SLOTS);
            }
        }
        self
    }

    /// The gyro's line.
    #[must_use]
    pub fn gyro() -> Self {
        use Direction::{FromDevice, ToDevice};
        let asking = STOP_CONTINUOUS.len() + 1 + START_CONTINUOUS.len();
        let frame =
            |name, direction, bytes, every_s, only| FrameRate { name, direction, bytes, every_s, only };
        let greeted = "at start and without data";
        Self {
            device: "gyro",
            frames: vec![
                frame("angles", FromDevice, EULER_LEN, PERIOD_MS / 1000.0, ""),
                frame("firmware", FromDevice, FIRMWARE_LEN, GREETING_EVERY_S, greeted),
                frame("commands", ToDevice, asking, GREETING_EVERY_S, greeted),
            ],
        }
    }

    /// The frames, what comes from the device first.
    #[must_use]
    pub fn frames(&self) -> &[FrameRate] {
        &self.frames
    }

    /// Sum of a direction's frames, in baud, without head-room.
    #[must_use]
    pub fn sum_baud(&self, direction: Direction) -> f64 {
        self.of(direction).map(FrameRate::baud).sum()
    }

    /// What a direction needs, in baud: the sum with [`HEAD_ROOM`], rounded up.
    #[must_use]
    pub fn need_baud(&self, direction: Direction) -> u32 {
        libm::ceil(self.sum_baud(direction) * HEAD_ROOM) as u32
    }

    /// What the line needs, in baud: the more demanding direction.
    #[must_use]
    pub fn needs_baud(&self) -> u32 {
        self.need_baud(Direction::FromDevice).max(self.need_baud(Direction::ToDevice))
    }

    /// Whether the line fits into a rate.
    ///
    /// # Errors
    /// It does not; the error says what would.
    pub fn check(&self, baud: u32) -> Result<(), TooSlow> {
        let least = self.needs_baud();
        if baud >= least {
            return Ok(());
        }
        let next = |rates: &[u32]| rates.iter().copied().find(|rate| *rate >= least).unwrap_or(least);
        Err(TooSlow {
            device: self.device,
            from: self.share(Direction::FromDevice),
            to: self.share(Direction::ToDevice),
            standard: next(&STANDARD),
            usual: next(&USUAL),
        })
    }

    fn of(&self, direction: Direction) -> impl Iterator<Item = &FrameRate> {
        self.frames.iter().filter(move |frame| frame.direction == direction)
    }

    fn share(&self, direction: Direction) -> Share {
        let parts = self.of(direction).map(|frame| (frame.name, libm::round(frame.baud()) as u32));
        Share { need_baud: self.need_baud(direction), parts: parts.collect() }
    }
}

/// What one direction needs, and which frames make it up.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Share {
    need_baud: u32,
    parts: Vec<(&'static str, u32)>,
}

impl Share {
    fn parts(&self) -> String {
        let parts: Vec<String> = self.parts.iter().map(|(name, baud)| format!("{name} {baud}")).collect();
        parts.join(" + ")
    }
}

/// A rate that does not carry a line's frames.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "the frames need {} baud from the {device} ({}, and a quarter more) and {} to it ({}, and a quarter \
     more); use at least {standard}{}",
    .from.need_baud, .from.parts(), .to.need_baud, .to.parts(), if_unusual(*.standard, *.usual)
)]
pub struct TooSlow {
    device: &'static str,
    from: Share,
    to: Share,
    /// The slowest standard rate that fits, in baud.
    pub standard: u32,
    /// The slowest rate that fits and that nearly every device has, in baud.
    pub usual: u32,
}

fn if_unusual(standard: u32, usual: u32) -> String {
    if standard == usual { String::new() } else { format!(" ({usual} is usual)") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bno085::Bno085Sample;
    use crate::board::{ADC_SCANS, Ask, BoardStatus, Firmware, FrameWriter};
    use xtb_control::AdcCount;
    use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
    use xtb_control::tpu::ResetMask;
    use xtb_control::{PwmCount, VehicleConfig};

    fn usual_board() -> LineRates {
        let vehicle = VehicleConfig::default();
        LineRates::board(vehicle.encoder.window_s, vehicle.remote.period_ms)
    }

    #[test]
    fn the_lengths_are_those_of_the_frames() {
        let (n, zero) = (PwmCount::NEUTRAL, AdcCount::ZERO);
        let pwm = PwmOutputs {
            motor: n,
            steer_front: n,
            steer_rear: n,
            bumper_front: n,
            bumper_rear: n,
            pistons: [n; 4],
            spare: n,
        };
        let side = [zero; SLOTS];
        let scan = AdcSample { ir_front: side, ir_rear: side, tilt: [zero; 2], pistons: [zero; 4] };
        let status = BoardStatus {
            firmware: Firmware(0),
            ready: true,
            watchdog: false,
            emergency_stop: None,
            setup_checksum: 0,
            rejected: 0,
        };
        let setup = TpuSetup::of(&VehicleConfig::default()).unwrap();
        let mut writer = FrameWriter::default();
        let written = [
            ("encoder", writer.encoder(0)),
            ("converter", writer.adc(&scan, None)),
            ("remote control", writer.remote(&RemoteSample::default())),
            ("status", writer.status(&status)),
            ("pwm", writer.pwm(&pwm)),
            ("early pwm", writer.pwm(&pwm)),
            ("set-up", writer.setup(&setup)),
            ("channel reset", writer.reset(ResetMask::default())),
        ];
        let written: Vec<_> = written.iter().map(|(name, frame)| (*name, frame.as_bytes().len())).collect();
        let table = |line: LineRates| -> Vec<_> {
            line.frames().iter().map(|frame| (frame.name, frame.bytes)).collect()
        };
        assert_eq!(table(usual_board()), written);
        let mut wide = written.clone();
        wide[1].1 = writer.wide_adc(&scan, None).as_bytes().len();
        assert_eq!(table(usual_board().with_wide_scans()), wide);
        let mut with_unit = written;
        with_unit.insert(4, ("inertial unit", writer.bno085(&Bno085Sample::default()).as_bytes().len()));
        with_unit.push(("ask", writer.ask(Ask::default()).as_bytes().len()));
        assert_eq!(table(usual_board().with_bno085()), with_unit);
        assert!(f64::from(ADC_SCANS) * 1023.0 < 65_536.0, "a sum fits its word");
    }

    #[test]
    fn the_memorandums_9600_baud_do_not_carry_the_board_and_38400_do_with_all_early_frames() {
        let line = usual_board();
        for (baud, fits) in [(9600, false), (19_200, false), (28_800, false), (38_400, true)] {
            assert_eq!(line.check(baud).is_ok(), fits, "{baud}");
        }
        let error = line.check(9600).unwrap_err();
        assert_eq!((error.standard, error.usual), (38_400, 38_400));
        assert_eq!(
            error.to_string(),
            "the frames need 27399 baud from the board (encoder 1907 + converter 12105 + remote control \
             6306 + status 1600, and a quarter more) and 35631 to it (pwm 14000 + early pwm 7000 + set-up \
             3000 + channel reset 4505, and a quarter more); use at least 38400"
        );
    }

    #[test]
    fn a_bno085_at_the_board_needs_57600_baud() {
        let line = usual_board().with_bno085();
        assert_eq!(line.check(38_400).unwrap_err().standard, 57_600);
        line.check(57_600).unwrap();
    }

    #[test]
    fn eight_range_finders_a_bumper_need_no_faster_line() {
        usual_board().with_wide_scans().check(38_400).unwrap();
        usual_board().with_bno085().with_wide_scans().check(57_600).unwrap();
    }

    #[test]
    fn a_shorter_window_needs_a_faster_line() {
        let line = LineRates::board(0.001, 1.0);
        assert!(line.check(115_200).is_err());
        assert_eq!(line.check(115_200).unwrap_err().standard, 460_800);
        line.check(460_800).unwrap();
        assert!(LineRates::board(1.0, 100.0).needs_baud() < usual_board().needs_baud());
    }

    #[test]
    fn the_gyro_fits_half_of_its_own_rate() {
        let error = LineRates::gyro().check(9600).unwrap_err();
        assert_eq!((error.standard, error.usual), (14_400, 19_200));
        assert!(error.to_string().contains("from the gyro (angles 11000 + firmware 100"), "{error}");
        LineRates::gyro().check(19_200).unwrap();
    }
}
