//! What a test can break on a truck: the two lines to its agent, its sensors and its drive.
//!
//! A line's fault acts on each frame that a device sends from then on; what was already under way still
//! arrives. The devices themselves go on unharmed: take the fault away and the next frame is good.
//! A fault of a sensor or of the drive changes what is measured or done, never how frames are sent.

use crate::gyro::Attitude;
use crate::line::Outbox;
use xtb_control::controller::GyroSample;
use xtb_control::units::Stamp;
use xtb_protocol::board::{BoardStatus, FrameWriter};
use xtb_protocol::gyro_3dmg::EulerFrame;

/// What is wrong with one line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LineFault {
    /// Nothing.
    #[default]
    None,
    /// Nothing arrives: cable cut, device dead.
    Silent,
    /// Each frame arrives as as many random bytes: wrong baud rate.
    Garbage,
    /// The middle half of each frame is missing: bytes overrun.
    HalfFrames,
    /// The other device hangs on this line, as it behaves when nobody talks to it: a gyro that was
    /// left in continuous mode, or a board that waits for its set-up.
    WrongDevice,
    /// Each frame is lost with this probability, 0..=1.
    Lossy(f64),
    /// The same frame again and again, with an unchanged sequence or timer: the device hangs.
    Frozen,
}

/// Faults of both lines.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LineFaults {
    /// From the I/O board.
    pub board: LineFault,
    /// From the gyro.
    pub gyro: LineFault,
}

/// What is wrong with one range finder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum RangeFinderFault {
    /// Nothing.
    #[default]
    None,
    /// It shows its last reading for ever.
    Frozen,
    /// Its wire is broken: 0 V.
    BrokenWire,
    /// Its wire touches the supply: 5 V.
    Short,
}

/// What is wrong with the gyro.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum GyroFault {
    /// Nothing.
    #[default]
    None,
    /// Its angles stand still, its timer runs.
    AnglesFrozen,
    /// Its timer stands still, its angles are good.
    TimerFrozen,
    /// Both stand still.
    Frozen,
}

/// What is wrong with the encoder.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EncoderFault {
    /// Nothing.
    #[default]
    None,
    /// Its wire is broken: no pulses.
    BrokenWire,
    /// Interference: any number of pulses.
    Wild,
}

/// Faults of a truck's sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SensorFaults {
    /// Front, then rear range finders, left to right.
    pub range_finders: [RangeFinderFault; 12],
    /// Every channel of the converter shows its last reading for ever.
    pub converter_frozen: bool,
    /// The gyro.
    pub gyro: GyroFault,
    /// The encoder.
    pub encoder: EncoderFault,
    /// The board does not measure the battery.
    pub battery_unmeasured: bool,
}

impl SensorFaults {
    /// The same fault of all range finders.
    #[must_use]
    pub fn all_range_finders(fault: RangeFinderFault) -> Self {
        Self { range_finders: [fault; 12], ..Self::default() }
    }

    /// A fault of one range finder, 0..12: front, then rear, left to right.
    #[must_use]
    pub fn range_finder(index: usize, fault: RangeFinderFault) -> Self {
        let mut faults = Self::default();
        if let Some(one) = faults.range_finders.get_mut(index) {
            *one = fault;
        }
        faults
    }
}

/// What is wrong with the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum DriveFault {
    /// Nothing.
    #[default]
    None,
    /// The ESC goes on as it drives at this moment, whatever pulse it gets.
    Stuck,
    /// Something holds the wheels.
    Held,
}

const GYRO_PERIOD_NS: u64 = 10_000_000;
const STATUS_PERIOD_NS: u64 = 100_000_000;

/// The devices that hang on the wrong line.
#[derive(Debug, Clone, Default)]
pub(crate) struct Impostors {
    writer: FrameWriter,
    gyro_due_ns: u64,
    status_due_ns: u64,
}

impl Impostors {
    /// A gyro on the board's line.
    pub(crate) fn on_board_line(&mut self, now: Stamp, attitude: &Attitude, line: &mut Outbox) {
        if due(&mut self.gyro_due_ns, GYRO_PERIOD_NS, now) {
            let yaw = (attitude.heading_deg / 360.0 * 65_536.0) as i64 as i16;
            let angles = GyroSample { yaw, ..GyroSample::default() };
            line.pass(&EulerFrame { angles, ticks: (now.ns() / 6_553_600) as u16 }.encode());
        }
    }

    /// A board on the gyro's line.
    pub(crate) fn on_gyro_line(&mut self, now: Stamp, firmware: u16, line: &mut Outbox) {
        if due(&mut self.status_due_ns, STATUS_PERIOD_NS, now) {
            let waiting =
                BoardStatus { firmware, ready: false, watchdog: true, setup_checksum: 0, rejected: 0 };
            line.pass(self.writer.status(&waiting).as_bytes());
        }
    }
}

/// Whether something periodic is due; it begins when it is first asked after.
fn due(next_ns: &mut u64, period_ns: u64, now: Stamp) -> bool {
    if now.ns() < *next_ns {
        return false;
    }
    *next_ns = now.ns() + period_ns;
    true
}
