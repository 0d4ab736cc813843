//! How fast a robot's clock runs beside ours. A real one's keeps step; a simulator's may run many
//! times as fast, and then a lease has to be retained as many times as often. Pure: arrivals in.

use std::time::{Duration, Instant};
use xtb_protocol::messages::RobotState;

/// The fastest that is kept up with: a retain every 5 ms.
pub(crate) const FASTEST: f64 = 20.0;
/// Shorter than this, the way of one state weighs too much.
const AT_LEAST: Duration = Duration::from_millis(100);
/// Who has not been heard for this long after the start has an ordinary clock, as far as we know.
const UNHEARD: Duration = Duration::from_secs(1);

/// A point on both clocks, in one boot of the robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Mark {
    at: Instant,
    epoch: u64,
    tick_ms: u64,
}

impl Mark {
    /// A state that arrived at `at`.
    pub(crate) fn of(at: Instant, state: &RobotState) -> Self {
        Self { at, epoch: state.epoch, tick_ms: state.tick_ms }
    }

    /// The robot's time over ours since `earlier`; `None` if the robot has restarted between, or if
    /// both are the same moment.
    pub(crate) fn rate_since(&self, earlier: &Self) -> Option<f64> {
        let ours_s = self.at.saturating_duration_since(earlier.at).as_secs_f64();
        let theirs_ms = self.tick_ms.checked_sub(earlier.tick_ms)?;
        (self.epoch == earlier.epoch && ours_s > 0.0).then(|| theirs_ms as f64 / 1000.0 / ours_s)
    }

    /// Ours, since `earlier`.
    pub(crate) fn since(&self, earlier: &Self) -> Duration {
        self.at.saturating_duration_since(earlier.at)
    }
}

/// Follows one robot's clock.
#[derive(Debug, Clone)]
pub(crate) struct Pace {
    began: Instant,
    last: Option<Mark>,
    rate: Option<f64>,
}

impl Pace {
    /// Nothing heard at `now`.
    pub(crate) fn new(now: Instant) -> Self {
        Self { began: now, last: None, rate: None }
    }

    /// A state arrived.
    pub(crate) fn heard(&mut self, mark: Mark) {
        match self.last {
            Some(last) if last.epoch == mark.epoch => {
                if mark.since(&last) >= AT_LEAST {
                    self.rate = mark.rate_since(&last).or(self.rate);
                    self.last = Some(mark);
                }
            }
            _ => self.last = Some(mark),
        }
    }

    /// How many times faster than ours it has to be reckoned with, `1.0..=FASTEST`: the worst until
    /// it is known.
    pub(crate) fn factor(&self, now: Instant) -> f64 {
        let silent = self.last.is_none() && now.saturating_duration_since(self.began) > UNHEARD;
        self.rate.unwrap_or(if silent { 1.0 } else { FASTEST }).clamp(1.0, FASTEST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(start: Instant, ours_ms: u64, epoch: u64, tick_ms: u64) -> Mark {
        Mark { at: start + Duration::from_millis(ours_ms), epoch, tick_ms }
    }

    #[test]
    fn a_fast_clock_is_followed_and_the_worst_is_assumed_until_it_is_known() {
        let start = Instant::now();
        let mut pace = Pace::new(start);
        assert_eq!(pace.factor(start), FASTEST);
        pace.heard(mark(start, 0, 7, 5000));
        pace.heard(mark(start, 10, 7, 5010));
        assert_eq!(pace.factor(start), FASTEST, "10 ms say nothing");
        pace.heard(mark(start, 100, 7, 5800));
        assert_eq!(pace.factor(start), 8.0);
        pace.heard(mark(start, 200, 7, 5850));
        assert_eq!(pace.factor(start), 1.0, "never slower than ours");
    }

    #[test]
    fn a_restart_begins_anew_and_a_silent_robot_counts_as_ordinary() {
        let start = Instant::now();
        let mut pace = Pace::new(start);
        assert_eq!(pace.factor(start + Duration::from_millis(1001)), 1.0);
        pace.heard(mark(start, 0, 7, 5000));
        pace.heard(mark(start, 500, 8, 10));
        pace.heard(mark(start, 600, 8, 210));
        assert_eq!(pace.factor(start), 2.0);
    }
}
