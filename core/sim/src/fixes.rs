//! Pose fixes as a tracker in the ceiling would give them: from the truth, with its faults.
//!
//! A source measures at its rate, with bell-shaped noise. Some measurements are outliers, which it does not
//! know of; in drop-outs it measures nothing; and everything comes late. Off unless a rate is asked for.

use crate::rng::Rng;
use std::collections::VecDeque;
use std::f64::consts::PI;
use xtb_control::config::{
    Allowed::{Range, Switch},
    DefaultOrigin::Ours,
};
use xtb_control::config_section;
use xtb_control::frames::wrap_rad;
use xtb_control::units::Stamp;
use xtb_nav::localization::{FixSource, StampedFix};
use xtb_protocol::messages::{self, TruthRobot};

config_section! {
    /// What measures the trucks' poses from outside.
    FixTruth "fixes" {
        rate_hz: f64 = 0.0, "Hz", Range(0.0, 50.0), Ours, "Fixes a second of each truck; 0 = none.";
        noise_m: f64 = 0.05, "m", Range(0.001, 10.0), Ours, "Standard deviation of x and of y.";
        heading: bool = false, "", Switch, Ours, "Whether a fix has a heading.";
        noise_rad: f64 = 0.05, "rad", Range(0.001, 1.0), Ours, "Standard deviation of the heading.";
        outliers: f64 = 0.0, "", Range(0.0, 1.0), Ours, "Fraction of the fixes that are outliers.";
        outlier_m: f64 = 2.0, "m", Range(0.0, 100.0), Ours, "An outlier is 0.3 to 1 of this away, its heading anything.";
        drop_out_every_s: f64 = 0.0, "s", Range(0.0, 1.0e6), Ours, "Mean time from one drop-out to the next; 0 = none.";
        drop_out_s: f64 = 5.0, "s", Range(0.0, 1.0e6), Ours, "A drop-out takes 0.5 to 1.5 of this.";
        latency_s: f64 = 0.0, "s", Range(0.0, 1.0), Ours, "From the measurement until it arrives.";
    }
}

/// What the source knows itself: it cannot tell an outlier.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SimulatedFix {
    /// As the truck gets it.
    pub fix: StampedFix,
    /// Whether it is an outlier.
    pub outlier: bool,
}

impl SimulatedFix {
    /// As it travels.
    #[must_use]
    pub fn message(&self, now: Stamp) -> messages::Fix {
        let StampedFix { stamp, x_m, y_m, yaw_rad, covariance, source } = self.fix;
        messages::Fix {
            x_m,
            y_m,
            yaw_rad,
            sigma_m: covariance[0][0].sqrt(),
            sigma_yaw_rad: covariance[2][2].sqrt(),
            source,
            age_ms: now.since_ms(stamp),
        }
    }
}

/// The source of one truck's fixes.
#[derive(Debug, Clone)]
pub struct FixMaker {
    truth: FixTruth,
    noise: Rng,
    /// When it measures next, and when the present or next drop-out begins and ends.
    next: Stamp,
    drop_out: (Stamp, Stamp),
    /// On their way; never more than a second's worth.
    coming: VecDeque<SimulatedFix>,
}

impl FixMaker {
    /// The source for the truck of this number. Its values should be within their table's ranges.
    #[must_use]
    pub fn new(truth: FixTruth, seed: u64, truck: usize) -> Self {
        // Another seed than the truck's own, whose stream has the same number.
        let mut noise = Rng::new(seed ^ 0x0F1C_5EED, truck as u64);
        let first_s = if truth.rate_hz > 0.0 { noise.uniform(0.0, 1.0 / truth.rate_hz) } else { 0.0 };
        let mut maker = Self {
            truth,
            noise,
            next: Stamp::from_s(first_s),
            drop_out: (Stamp::ZERO, Stamp::ZERO),
            coming: VecDeque::with_capacity(64),
        };
        maker.plan_drop_out(Stamp::ZERO);
        maker
    }

    /// One step of the simulation: measures if it is time to.
    pub fn step(&mut self, now: Stamp, truck: &TruthRobot) {
        if self.truth.rate_hz <= 0.0 || now < self.next {
            return;
        }
        self.next = now.max(self.next.plus_ns((1e9 / self.truth.rate_hz) as u64));
        if now >= self.drop_out.1 {
            self.plan_drop_out(now);
        }
        let measured = self.measure(now, truck);
        if !(self.drop_out.0..self.drop_out.1).contains(&now) && self.coming.len() < self.coming.capacity() {
            self.coming.push_back(measured);
        }
    }

    /// The next fix that has arrived by `now`.
    pub fn take(&mut self, now: Stamp) -> Option<SimulatedFix> {
        let latency_ns = Stamp::from_s(self.truth.latency_s).ns();
        let arrived = self.coming.front().is_some_and(|first| first.fix.stamp.plus_ns(latency_ns) <= now);
        if arrived { self.coming.pop_front() } else { None }
    }

    fn plan_drop_out(&mut self, now: Stamp) {
        let FixTruth { drop_out_every_s: every_s, drop_out_s: takes_s, .. } = self.truth;
        let begins = if every_s > 0.0 {
            now.plus_ns(Stamp::from_s(self.noise.uniform(0.5, 1.5) * every_s).ns())
        } else {
            Stamp::from_ns(u64::MAX)
        };
        self.drop_out = (begins, begins.plus_ns(Stamp::from_s(self.noise.uniform(0.5, 1.5) * takes_s).ns()));
    }

    fn measure(&mut self, now: Stamp, truck: &TruthRobot) -> SimulatedFix {
        let FixTruth { noise_m, noise_rad, outlier_m, .. } = self.truth;
        let noise = &mut self.noise;
        let (mut x_m, mut y_m) = (truck.x_m + noise.bell(noise_m), truck.y_m + noise.bell(noise_m));
        let mut yaw_rad = truck.yaw_rad + noise.bell(noise_rad);
        let outlier = noise.chance(self.truth.outliers);
        if outlier {
            let (sin, cos) = libm::sincos(noise.uniform(-PI, PI));
            let off_m = noise.uniform(0.3, 1.0) * outlier_m;
            (x_m, y_m) = (x_m + off_m * cos, y_m + off_m * sin);
            yaw_rad = noise.uniform(-PI, PI);
        }
        let fix = StampedFix {
            stamp: now,
            x_m,
            y_m,
            yaw_rad: self.truth.heading.then(|| wrap_rad(yaw_rad)),
            covariance: StampedFix::independent(noise_m, noise_rad),
            source: FixSource::MotionCapture,
        };
        SimulatedFix { fix, outlier }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUCK: TruthRobot = TruthRobot {
        x_m: 3.0,
        y_m: -2.0,
        yaw_rad: 3.1,
        speed_mps: 0.0,
        motor_counts: 3750,
        neutral_since_s: None,
        contacts: 0,
    };

    /// What arrives in so many seconds, with its time of arrival.
    fn watch(truth: FixTruth, seconds: u64) -> Vec<(Stamp, SimulatedFix)> {
        let (mut maker, mut found) = (FixMaker::new(truth, 4, 0), Vec::new());
        for ms in (0..seconds * 1000).step_by(5) {
            let now = Stamp::from_ms(ms);
            maker.step(now, &TRUCK);
            while let Some(fix) = maker.take(now) {
                found.push((now, fix));
            }
        }
        found
    }

    fn two_a_second() -> FixTruth {
        FixTruth { rate_hz: 2.0, ..FixTruth::default() }
    }

    #[test]
    fn it_is_silent_unless_asked() {
        assert!(watch(FixTruth::default(), 100).is_empty());
    }

    #[test]
    fn fixes_come_at_their_rate_with_their_noise_and_their_latency() {
        let found = watch(FixTruth { heading: true, latency_s: 0.2, ..two_a_second() }, 2000);
        assert!((3990..=4000).contains(&found.len()), "{}", found.len());
        let variance = found.iter().map(|(_, f)| (f.fix.x_m - 3.0) * (f.fix.x_m - 3.0)).sum::<f64>();
        let sigma_m = libm::sqrt(variance / found.len() as f64);
        assert!((0.047..0.053).contains(&sigma_m), "{sigma_m}");
        assert!(found.iter().all(|(at, f)| at.since_ms(f.fix.stamp) == 200 && !f.outlier));
        assert!(found.iter().all(|(_, f)| f.fix.yaw_rad.unwrap().abs() > 2.9), "wrapped");
    }

    #[test]
    fn outliers_are_as_many_and_as_far_as_asked() {
        let found = watch(FixTruth { outliers: 0.1, ..two_a_second() }, 2000);
        let off_m = |f: &SimulatedFix| libm::hypot(f.fix.x_m - 3.0, f.fix.y_m + 2.0);
        let outliers: Vec<f64> = found.iter().filter(|(_, f)| f.outlier).map(|(_, f)| off_m(f)).collect();
        assert!((320..480).contains(&outliers.len()), "{}", outliers.len());
        assert!(outliers.iter().all(|off_m| (0.3..2.4).contains(off_m)));
    }

    #[test]
    fn in_a_drop_out_nothing_comes() {
        let truth = FixTruth { drop_out_every_s: 30.0, drop_out_s: 10.0, ..two_a_second() };
        let found = watch(truth, 2000);
        let gaps: Vec<f64> = found.windows(2).map(|pair| pair[1].0.since_s(pair[0].0)).collect();
        let long: Vec<f64> = gaps.into_iter().filter(|gap_s| *gap_s > 0.6).collect();
        assert!((40..60).contains(&long.len()), "{}", long.len());
        assert!(long.iter().all(|gap_s| (4.9..16.1).contains(gap_s)), "{long:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_bits() {
        let truth = FixTruth { outliers: 0.1, heading: true, ..two_a_second() };
        assert_eq!(watch(truth.clone(), 50), watch(truth, 50));
    }
}
