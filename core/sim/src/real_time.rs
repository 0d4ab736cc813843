//! How fast a simulated world runs beside real time. A state machine: moments on both clocks in, factor
//! and changes out.
//!
//! ```text
//!             below SLOW_BELOW                    from CAUGHT_UP on
//!   in time ───────────────────► behind ─────────────────────────► in time
//! ```
//! The *real-time factor* is simulated time over real time, as in other simulators; what counts as slow
//! is its part of the speed that was asked for.

use crate::step::STEP_NS;
use std::collections::VecDeque;
use std::time::Duration;
use xtb_control::Stamp;
use xtb_protocol::messages::SLOW_BELOW;

/// The factor is measured over so much real time: a hiccup of the machine is no overload.
const WINDOW: Duration = Duration::from_secs(3);
/// A slow world moves on in steps: the window holds so many at least, for a factor within 1 %.
const WINDOW_STEPS: f64 = 100.0;
/// Moments that are remembered of a window; what comes more often is passed over.
const MOMENTS: u32 = 32;
/// A world that was behind is in time again from here on; apart from [`SLOW_BELOW`], so that one that
/// runs at just that does not change sides all the time.
const CAUGHT_UP: f64 = 0.95;

/// The world has changed sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pace {
    /// It is slower than was asked for.
    FellBehind,
    /// It is as fast as was asked for, again.
    CaughtUp,
}

/// Measures one world.
#[derive(Debug, Clone)]
pub struct RealTimeMeter {
    speed: f64,
    window: Duration,
    /// Real time since the beginning, and the world's.
    moments: VecDeque<(Duration, Stamp)>,
    behind: bool,
}

impl RealTimeMeter {
    /// Nothing measured yet, of a world that shall run at `speed` × real time.
    #[must_use]
    pub fn new(speed: f64) -> Self {
        let steps = Duration::from_nanos((WINDOW_STEPS * STEP_NS as f64 / speed) as u64);
        Self { speed, window: WINDOW.max(steps), moments: VecDeque::new(), behind: false }
    }

    /// It is `simulated` in the world after so much `real` time. Says when the world has changed sides.
    pub fn moment(&mut self, real: Duration, simulated: Stamp) -> Option<Pace> {
        if self.moments.back().is_some_and(|(last, _)| real < *last + self.window / MOMENTS) {
            return None;
        }
        self.moments.push_back((real, simulated));
        while self.moments.get(1).is_some_and(|(second, _)| *second + self.window <= real) {
            self.moments.pop_front();
        }
        let part = self.factor()? / self.speed;
        let behind = if self.behind { part < CAUGHT_UP } else { part < SLOW_BELOW };
        if std::mem::replace(&mut self.behind, behind) == behind {
            return None;
        }
        Some(if behind { Pace::FellBehind } else { Pace::CaughtUp })
    }

    /// Simulated over real time, lately; `None` = it does not run for long enough.
    #[must_use]
    pub fn factor(&self) -> Option<f64> {
        let ((began, from), (now, to)) = (self.moments.front()?, self.moments.back()?);
        let real = now.saturating_sub(*began);
        let simulated_s = to.ns().saturating_sub(from.ns()) as f64 / 1e9;
        (real >= self.window).then(|| simulated_s / real.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A world and its meter on a clock of the test's.
    struct Bench {
        meter: RealTimeMeter,
        real_ms: u64,
        simulated_ns: u64,
    }

    impl Bench {
        fn at(speed: f64) -> Self {
            Self { meter: RealTimeMeter::new(speed), real_ms: 0, simulated_ns: 0 }
        }

        /// Runs at `factor` × real time for so long, looked at every 100 ms.
        fn run(&mut self, seconds: u64, factor: f64) -> Vec<Pace> {
            let look = |_| {
                self.real_ms += 100;
                self.simulated_ns += (0.1e9 * factor) as u64;
                // The world's time goes on in steps.
                let simulated = Stamp::from_ns(self.simulated_ns / STEP_NS * STEP_NS);
                self.meter.moment(Duration::from_millis(self.real_ms), simulated)
            };
            (0..seconds * 10).filter_map(look).collect()
        }
    }

    #[test]
    fn an_overloaded_world_is_told_once_and_so_is_its_recovery() {
        let mut bench = Bench::at(1.0);
        assert_eq!(bench.run(20, 1.0), []);
        assert!((bench.meter.factor().unwrap() - 1.0).abs() < 0.01);
        assert_eq!(bench.run(60, 0.19), [Pace::FellBehind]);
        assert!((bench.meter.factor().unwrap() - 0.19).abs() < 0.01);
        assert_eq!(bench.run(60, 1.0), [Pace::CaughtUp]);
    }

    #[test]
    fn what_counts_is_the_part_of_the_speed_that_was_asked_for() {
        for speed in [0.01, 0.5, 8.0, 1000.0] {
            let mut bench = Bench::at(speed);
            assert_eq!(bench.run(200, speed), [], "{speed}");
            assert_eq!(bench.run(200, 0.8 * speed), [Pace::FellBehind], "{speed}");
            assert!((bench.meter.factor().unwrap() / speed - 0.8).abs() < 0.02, "{speed}");
        }
    }

    #[test]
    fn around_the_limit_it_does_not_change_sides_again_and_again() {
        let mut bench = Bench::at(1.0);
        bench.run(10, 1.0);
        let told: Vec<Pace> = (0..50).flat_map(|turn| bench.run(3, [0.88, 0.92][turn % 2])).collect();
        assert_eq!(told, [Pace::FellBehind]);
    }

    #[test]
    fn a_hiccup_is_no_overload_and_a_standstill_is() {
        let mut bench = Bench::at(1.0);
        bench.run(10, 1.0);
        bench.real_ms += 250;
        assert_eq!(bench.run(10, 1.0), [], "a quarter of a second lost");
        assert_eq!(bench.run(5, 0.0), [Pace::FellBehind]);
        assert_eq!(bench.meter.factor(), Some(0.0));
    }

    #[test]
    fn it_remembers_a_window_and_no_more_however_often_it_is_asked() {
        let mut meter = RealTimeMeter::new(1.0);
        assert_eq!(meter.factor(), None);
        for us in 0..10_000_000_u64 / 50 {
            let real = Duration::from_micros(50 * us);
            assert_eq!(meter.moment(real, Stamp::from_ns(real.as_nanos() as u64)), None);
            assert!(meter.moments.len() <= MOMENTS as usize + 2, "{}", meter.moments.len());
        }
        assert!((meter.factor().unwrap() - 1.0).abs() < 0.01);
    }
}
