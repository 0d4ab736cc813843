//! The sweep of a piston (A.3): time, position and pulse, the pulse constant for several samples.
//!
//! ```text
//!   height │ reach ─ ─ ─ ─ ─ ─ ─ ─ ─ ─ ─ ─
//!          │         ∙∙╱│╲                       ∙∙ = servo starts, not timed
//!   middle ┼───────∙∙──────╲────∙∙────────       ╱  = timed: the slope is the speed
//!          │     move   back     ╲╱ next         ╲  = back to the middle
//! ```
//! A move ends after 21 scans or 60 % of the way to the nearer end stop, whichever comes first, so an
//! end stop is never reached. Which way lifts is taken from the configuration at first; a piston that
//! moves away from the middle instead of towards it is turned round.

use super::bench::{Bench, Trouble};
use xtb_control::calibration::{Actuator, Branch, Point, speed_mps};
use xtb_control::pistons::height_m;
use xtb_control::vehicle::{Line, Pistons};
use xtb_control::{PwmCount, Stamp};

/// From a new pulse to a steady speed: frame, PWM period, servo.
const START_S: f64 = 0.15;
/// Scans of one move (0.8 s).
const SCANS: usize = 21;
/// A speed from fewer scans is none.
const LEAST_SCANS: usize = 4;
/// Part of the way from the middle to the nearer end stop that a move may take.
const REACH_PART: f64 = 0.6;
/// Part of the fastest pulse that brings it back to the middle.
const BACK_PART: f64 = 0.5;
/// Near enough to the middle.
const NEAR_M: f64 = 0.001;
/// Slower than this is not moving: less than two counts of the converter in a move.
const STILL_MPS: f64 = 1.0e-4;
/// On its way to the middle it has to come nearer by this …
const PROGRESS_M: f64 = 0.0005;
/// … within this time.
const PROGRESS_S: f64 = 1.0;
/// After turning round this often it is given up.
const MOST_TURNS: usize = 2;

/// A piston on the bench.
pub(crate) struct Piston<'a> {
    bench: &'a mut Bench,
    actuator: Actuator,
    index: usize,
    config: &'a Pistons,
    /// Pulse of zero movement as configured.
    zero: f64,
    /// 1 if longer pulses lift, else −1.
    lifts: f64,
}

impl<'a> Piston<'a> {
    pub(crate) fn new(
        bench: &'a mut Bench,
        (actuator, index): (Actuator, usize),
        config: &'a Pistons,
        line: Line,
    ) -> Self {
        Self { bench, actuator, index, config, zero: line.count(0.0), lifts: line.slope.signum() }
    }

    /// The speed at each pulse; `done` hears of each.
    pub(crate) fn speeds(
        &mut self,
        counts: &[PwmCount],
        mut done: impl FnMut(&Point),
    ) -> Result<Vec<Point>, Trouble> {
        let mut points = Vec::with_capacity(counts.len());
        for &count in counts {
            self.go_to_middle()?;
            let point = self.timed_move(count)?;
            done(&point);
            points.push(point);
        }
        self.go_to_middle()?;
        Ok(points)
    }

    /// Comes near the middle, from wherever it is.
    fn go_to_middle(&mut self) -> Result<(), Trouble> {
        let (mut since, height) = self.height()?;
        let mut nearest = (height - self.config.middle_m).abs();
        let mut turns = 0;
        loop {
            let (at, height) = self.height()?;
            let below = self.config.middle_m - height;
            if below.abs() <= NEAR_M {
                return Ok(());
            }
            if below.abs() < nearest - PROGRESS_M {
                (nearest, since) = (below.abs(), at);
            } else if below.abs() > nearest + NEAR_M || at.since_s(since) > PROGRESS_S {
                self.lifts = -self.lifts;
                turns += 1;
                (nearest, since) = (below.abs(), at);
            }
            if turns > MOST_TURNS {
                let (height_mm, travel_mm) = (height * 1000.0, self.config.travel_m * 1000.0);
                return Err(Trouble::Stuck { height_mm, travel_mm });
            }
            let offset = BACK_PART * self.config.max_offset_counts * self.lifts * below.signum();
            self.bench.drive(self.actuator, PwmCount::saturating(self.zero + offset));
        }
    }

    /// Moves at one pulse, and how fast that was.
    fn timed_move(&mut self, count: PwmCount) -> Result<Point, Trouble> {
        let &Pistons { min_m, middle_m, max_m, .. } = self.config;
        let reach_m = REACH_PART * (max_m - middle_m).min(middle_m - min_m);
        self.bench.drive(self.actuator, count);
        self.bench.hold(START_S)?;
        let mut heights = Vec::with_capacity(SCANS);
        while heights.len() < SCANS {
            let (at, height) = self.height()?;
            heights.push((at, height));
            if (height - middle_m).abs() >= reach_m {
                break;
            }
        }
        self.bench.drive(self.actuator, PwmCount::saturating(self.zero));
        let speed = Some(&heights).filter(|heights| heights.len() >= LEAST_SCANS);
        let quantity =
            speed.and_then(|heights| speed_mps(heights)).ok_or(Trouble::TooFast { count: count.get() })?;
        let branch = match quantity {
            speed if speed.abs() < STILL_MPS => Branch::Still,
            speed if speed > 0.0 => Branch::Up,
            _ => Branch::Down,
        };
        Ok(Point { count, quantity, branch })
    }

    /// Its next position reading.
    fn height(&mut self) -> Result<(Stamp, f64), Trouble> {
        let (at, sample) = self.bench.next_scan()?;
        Ok((at, height_m(self.config, sample.pistons[self.index])))
    }
}
