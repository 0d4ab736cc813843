//! The lines of a robot: what watches and reads them.

use crate::line::{LINE_LOST_MS, LineWatch};
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_control::vehicle::ImuYaw;
use xtb_protocol::bno085::Bno085Counter;
use xtb_protocol::board::{BoardStatus, FrameReader};
use xtb_protocol::gyro_3dmg::{GyroReader, GyroStarter};

/// A line with what watches and reads it.
#[derive(Debug, Clone)]
pub(super) struct BoardLine {
    pub(super) watch: LineWatch,
    pub(super) reader: FrameReader,
    pub(super) foreign: GyroReader,
    pub(super) detail: Option<Arc<str>>,
    /// Why its firmware is refused: then it is not set up.
    pub(super) refused: Option<Arc<str>>,
    /// Version of the layout of the last frame that was none of ours.
    pub(super) other_layout: Option<u8>,
    /// It knows the bit of the emergency stop.
    pub(super) has_stop: bool,
    pub(super) open_since: Stamp,
    /// Since when it is set up and its line is well: it should send samples.
    pub(super) speaks_since: Stamp,
    /// Whether it has ever said that it hears pulses.
    pub(super) fed: bool,
    /// Since when it says that it hears none, and how often in a row.
    pub(super) starved: Option<(Stamp, u32)>,
    /// Until then its hunger is our own loop's fault.
    pub(super) excused_until: Stamp,
}

#[derive(Debug, Clone)]
pub(super) struct GyroLine {
    pub(super) watch: LineWatch,
    pub(super) reader: GyroReader,
    pub(super) foreign: FrameReader,
    pub(super) starter: GyroStarter,
    pub(super) detail: Option<Arc<str>>,
}

/// A BNO085, whose samples come over the board's line; the [`GyroLine`] watches them as if it had one of its own.
#[derive(Debug, Clone)]
pub(super) struct Bno085Link {
    /// Which way its yaw grows.
    pub(super) yaw: ImuYaw,
    pub(super) counter: Bno085Counter,
    /// Its yaw as it sent it last, in 0.01°.
    pub(super) yaw_cdeg: i16,
}

impl BoardLine {
    /// Whether the board gets our pulses, by what it says of its watchdog. One that has had them and
    /// says twice in a row that it has none hears nothing of us: when its wire is mended, no old goal
    /// may go on. One that has just been set up gets a moment.
    pub(super) fn hears_us(&mut self, now: Stamp, status: &BoardStatus) -> bool {
        if now < self.excused_until {
            self.starved = None;
            return true;
        }
        // While the emergency stop is pressed the same bit says that.
        if !(status.ready && status.watchdog) || status.emergency_stop == Some(true) {
            (self.fed, self.starved) = (self.fed || status.ready, None);
            return true;
        }
        let (since, times) = self.starved.map_or((now, 1), |(since, times)| (since, times + 1));
        self.starved = Some((since, times));
        let proven = if self.fed { times > 1 } else { now.since_ms(since) > LINE_LOST_MS };
        !proven
    }
}
