//! Position servos: steering linkages with play, and the bumpers that carry the range finders.
//!
//! ```text
//!   pulse ─► angle = slope · count + intercept ─► lag, limited rate, stop ─► servo horn
//!            (this truck's own line)                                           │ play (steering)
//!                                                                              ▼
//!                                                                            wheels
//! ```
//! The lines differ a little from the nominal ones and from truck to truck: calibration (Annex A)
//! has to find them.

use crate::parameters::{BumperTruth, SteeringTruth};
use crate::rng::Rng;
use xtb_control::PwmCount;
use xtb_control::vehicle::Line;

/// Nearer than this a servo has arrived.
const ARRIVED_DEG: f64 = 1e-3;

/// Part of the way that a first-order lag covers in `dt_s`.
pub(crate) fn response(dt_s: f64, lag_s: f64) -> f64 {
    1.0 - libm::exp(-dt_s / lag_s)
}

/// A truck's own line near the nominal one: `zero_count` gives an angle of 0.
fn own_line(deg_per_count: f64, zero_count: f64, tolerance: (f64, f64), noise: &mut Rng) -> Line {
    let (slope_part, zero_counts) = tolerance;
    let slope = deg_per_count * (1.0 + noise.uniform(-slope_part, slope_part));
    let zero = zero_count + noise.uniform(-zero_counts, zero_counts);
    Line { slope, intercept: -slope * zero }
}

/// A servo that follows its pulse to an angle.
#[derive(Debug, Clone)]
struct Servo {
    line: Line,
    stop_deg: f64,
    response: f64,
    most_deg: f64,
    angle_deg: f64,
}

impl Servo {
    /// One step towards the pulse's angle; whether it moved.
    fn step(&mut self, count: PwmCount) -> bool {
        let wanted_deg = self.line.at(count.as_f64()).clamp(-self.stop_deg, self.stop_deg);
        let missing = wanted_deg - self.angle_deg;
        if missing == 0.0 {
            return false;
        }
        if missing.abs() < ARRIVED_DEG {
            self.angle_deg = wanted_deg;
        } else {
            self.angle_deg += (missing * self.response).clamp(-self.most_deg, self.most_deg);
        }
        true
    }
}

/// One axle: servo, linkage and wheels.
#[derive(Debug, Clone)]
pub(crate) struct SteeringAxle {
    servo: Servo,
    play_deg: f64,
    wheels_deg: f64,
    tan: f64,
    cos: f64,
}

impl SteeringAxle {
    /// `centre` is the nominal pulse for straight ahead.
    pub(crate) fn new(truth: &SteeringTruth, centre: f64, dt_s: f64, noise: &mut Rng) -> Self {
        let tolerance = (truth.slope_tolerance, truth.centre_tolerance_counts);
        // A count below the centre turns the wheels to the right.
        let line = own_line(-truth.stop_deg / truth.range_counts, centre, tolerance, noise);
        let servo = Servo {
            line,
            stop_deg: truth.stop_deg,
            response: response(dt_s, truth.lag_s),
            most_deg: truth.rate_dps * dt_s,
            angle_deg: 0.0,
        };
        Self { servo, play_deg: truth.play_deg, wheels_deg: 0.0, tan: 0.0, cos: 1.0 }
    }

    /// One step: the horn pulls the wheels along once the play is used up (Annex A.2).
    pub(crate) fn step(&mut self, count: PwmCount) {
        if !self.servo.step(count) {
            return;
        }
        let horn_deg = self.servo.angle_deg;
        let wheels_deg = self.wheels_deg.clamp(horn_deg - self.play_deg, horn_deg + self.play_deg);
        if wheels_deg != self.wheels_deg {
            self.wheels_deg = wheels_deg;
            let (sin, cos) = libm::sincos(wheels_deg.to_radians());
            (self.tan, self.cos) = (sin / cos, cos);
        }
    }

    /// Angle of the wheels in degrees, + = to the right.
    pub(crate) fn wheels_deg(&self) -> f64 {
        self.wheels_deg
    }

    /// Tangent of the wheels' angle, + = to the right.
    pub(crate) fn tan(&self) -> f64 {
        self.tan
    }

    /// Cosine of the wheels' angle.
    pub(crate) fn cos(&self) -> f64 {
        self.cos
    }

    /// Angle over count in the middle of the play.
    pub(crate) fn line(&self) -> Line {
        self.servo.line
    }
}

/// The servo that tilts a bumper with its range finders.
#[derive(Debug, Clone)]
pub(crate) struct BumperServo {
    servo: Servo,
    /// 1 / cos of the angle.
    stretch: f64,
}

impl BumperServo {
    pub(crate) fn new(truth: &BumperTruth, dt_s: f64, noise: &mut Rng) -> Self {
        let tolerance = (truth.slope_tolerance, truth.zero_tolerance_counts);
        let servo = Servo {
            line: own_line(truth.deg_per_count, truth.zero_count, tolerance, noise),
            stop_deg: truth.stop_deg,
            response: 1.0,
            most_deg: truth.rate_dps * dt_s,
            angle_deg: 0.0,
        };
        Self { servo, stretch: 1.0 }
    }

    pub(crate) fn step(&mut self, count: PwmCount) {
        if self.servo.step(count) {
            self.stretch = 1.0 / libm::cos(self.servo.angle_deg.to_radians());
        }
    }

    /// Angle in degrees, + = up.
    pub(crate) fn angle_deg(&self) -> f64 {
        self.servo.angle_deg
    }

    /// How much longer the tilted ray to an upright surface is than its way along the floor.
    pub(crate) fn stretch(&self) -> f64 {
        self.stretch
    }

    /// Angle over count.
    pub(crate) fn line(&self) -> Line {
        self.servo.line
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 0.005;

    fn count(counts: u16) -> PwmCount {
        PwmCount::try_from(counts).unwrap()
    }

    /// An axle exactly as nominal, with this much play.
    fn axle(play_deg: f64) -> SteeringAxle {
        let nominal = SteeringTruth {
            play_deg,
            slope_tolerance: 0.0,
            centre_tolerance_counts: 0.0,
            ..SteeringTruth::default()
        };
        SteeringAxle::new(&nominal, 3710.0, DT_S, &mut Rng::new(1, 1))
    }

    fn settle(axle: &mut SteeringAxle, counts: u16) -> f64 {
        (0..200).for_each(|_| axle.step(count(counts)));
        axle.wheels_deg()
    }

    #[test]
    fn wheels_turn_right_below_the_centre_at_a_limited_rate_up_to_the_stop() {
        let mut axle = axle(0.0);
        axle.step(count(3710 - 975));
        assert!((axle.wheels_deg - 1.0).abs() < 1e-12, "200°/s: {}", axle.wheels_deg);
        assert_eq!(settle(&mut axle, 2331), 20.0, "the stop holds");
        assert!((axle.tan() - libm::tan(20_f64.to_radians())).abs() < 1e-12);
    }

    #[test]
    fn the_wheels_stay_behind_by_the_play_on_the_way_out_and_on_the_way_back() {
        let mut axle = axle(0.5);
        let out = settle(&mut axle, 3710 - 390);
        assert!((out - 7.5).abs() < 1e-9, "{out}");
        settle(&mut axle, 2331);
        let back = settle(&mut axle, 3710 - 390);
        assert!((back - 8.5).abs() < 1e-9, "the same pulse from the other side: {back}");
        let rested = settle(&mut axle, 3710 - 400);
        assert_eq!(rested, back, "a small correction only takes up play");
    }

    #[test]
    fn every_axle_has_a_line_of_its_own_within_the_tolerances() {
        let mut noise = Rng::new(4, 0);
        let truth = SteeringTruth::default();
        let lines: Vec<Line> =
            (0..50).map(|_| SteeringAxle::new(&truth, 3710.0, DT_S, &mut noise).line()).collect();
        for line in &lines {
            assert!((line.slope / (-20.0 / 975.0) - 1.0).abs() <= 0.03, "{line:?}");
            assert!((line.count(0.0) - 3710.0).abs() <= 15.0, "{line:?}");
        }
        assert!(lines.iter().any(|line| (line.count(0.0) - 3710.0).abs() > 10.0));
    }

    #[test]
    fn a_bumper_takes_23_hundredths_of_a_second_for_60_degrees() {
        let nominal =
            BumperTruth { slope_tolerance: 0.0, zero_tolerance_counts: 0.0, ..BumperTruth::default() };
        let mut bumper = BumperServo::new(&nominal, DT_S, &mut Rng::new(1, 1));
        let up_30 = count(3750 + 833);
        let steps = (1..100).find(|_| {
            bumper.step(up_30);
            bumper.angle_deg() > 29.9
        });
        assert_eq!(steps, Some(23), "30° in 0.115 s");
        assert!((bumper.stretch() - 1.0 / libm::cos(bumper.angle_deg().to_radians())).abs() < 1e-12);
        (0..100).for_each(|_| bumper.step(count(3750)));
        assert_eq!((bumper.angle_deg(), bumper.stretch()), (0.0, 1.0));
    }
}
