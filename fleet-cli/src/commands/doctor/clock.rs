//! A robot's clock beside ours. Pure: arrivals in.

use std::time::Instant;
use xtb_protocol::messages::RobotState;

/// A point on both clocks, in one boot of the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mark {
    at: Instant,
    epoch: u64,
    tick_ms: u64,
}

impl Mark {
    /// A state that arrived at `at`.
    pub(super) fn of(at: Instant, state: &RobotState) -> Self {
        Self { at, epoch: state.epoch, tick_ms: state.tick_ms }
    }

    /// The robot's time over ours since `earlier`; `None` if the robot has restarted between, or if
    /// both are the same moment.
    pub(super) fn rate_since(&self, earlier: &Self) -> Option<f64> {
        let ours_s = self.at.saturating_duration_since(earlier.at).as_secs_f64();
        let theirs_ms = self.tick_ms.checked_sub(earlier.tick_ms)?;
        (self.epoch == earlier.epoch && ours_s > 0.0).then(|| theirs_ms as f64 / 1000.0 / ours_s)
    }
}
