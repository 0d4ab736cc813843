//! Devices that hang on the wrong line, as they behave when nobody talks to them.

use crate::gyro::Attitude;
use crate::line::Outbox;
use xtb_control::controller::GyroSample;
use xtb_control::units::Stamp;
use xtb_protocol::board::{BoardStatus, Firmware, FrameWriter};
use xtb_protocol::gyro_3dmg::EulerFrame;

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
    pub(crate) fn on_gyro_line(&mut self, now: Stamp, firmware: Firmware, line: &mut Outbox) {
        if due(&mut self.status_due_ns, STATUS_PERIOD_NS, now) {
            let (ready, watchdog, emergency_stop) = (false, true, None);
            let (setup_checksum, rejected) = (0, 0);
            let waiting = BoardStatus { firmware, ready, watchdog, emergency_stop, setup_checksum, rejected };
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
