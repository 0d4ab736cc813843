//! What a test can break on the two lines from a truck's devices to its agent.
//!
//! A fault acts on each frame that a device sends from then on; what was already under way still
//! arrives. The devices themselves go on unharmed: take the fault away and the next frame is good.

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
