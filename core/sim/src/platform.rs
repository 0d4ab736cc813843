//! The tilting platform: tilt sensor and four pistons.
//!
//! Signs are those for which both platform controllers of the memorandum (§4.8.2, §4.8.3) converge:
//! Φx > 0 is nose down, Φy > 0 is left side down, and a longer pulse lifts a piston.
//!
//! ```text
//!   speed │        . - ´ ¯   flat: v = slope · b · (1 − ¼ (b / flat)³), of the 4th order (Annex A.3)
//!         │      /
//!   ──────┼──▬▬▬/─────────── pulse       b = counts beyond the dead band around this piston's own
//!     /´  │                              zero movement
//! ```

use crate::gyro::Attitude;
use crate::parameters::{Body, PlatformTruth};
use crate::rng::Rng;
use xtb_control::PwmCount;
use xtb_control::units::ADC_SUPPLY_V;
use xtb_control::vehicle::Line;

/// One suspension piston on its screw, driven by a servo that turns for ever.
#[derive(Debug, Clone)]
struct Piston {
    height_m: f64,
    /// Its own pulse of zero movement.
    zero: f64,
    /// Its own slope beyond the dead band.
    mps_per_count: f64,
}

impl Piston {
    fn new(truth: &PlatformTruth, noise: &mut Rng) -> Self {
        let (zero, gain) = (truth.piston_zero_tolerance_counts, truth.piston_gain_tolerance);
        Self {
            height_m: truth.piston_travel_m / 2.0,
            zero: PwmCount::NEUTRAL.as_f64() + noise.uniform(-zero, zero),
            mps_per_count: truth.piston_mps_per_count * (1.0 + noise.uniform(-gain, gain)),
        }
    }

    /// Speed that a pulse gives away from the ends, + = up; exactly 0 within the dead band.
    fn speed_mps(&self, truth: &PlatformTruth, pulse: PwmCount) -> f64 {
        let offset = pulse.as_f64() - self.zero;
        let beyond = (offset.abs() - truth.piston_dead_band_counts).min(truth.piston_flat_counts);
        if beyond <= 0.0 {
            return 0.0;
        }
        let part = beyond / truth.piston_flat_counts;
        // Lifting carries the truck's weight, lowering is helped by it.
        let load = 1.0 - truth.piston_load_effect * offset.signum();
        offset.signum() * self.mps_per_count * load * beyond * (1.0 - part * part * part / 4.0)
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Platform {
    truth: PlatformTruth,
    wheelbase_m: f64,
    track_m: f64,
    /// FL, FR, RL, RR.
    pistons: [Piston; 4],
    end_stop_pushes: u64,
}

impl Platform {
    /// All pistons in the middle.
    pub(crate) fn new(truth: &PlatformTruth, body: &Body, noise: &mut Rng) -> Self {
        Self {
            truth: truth.clone(),
            wheelbase_m: body.wheelbase_m,
            track_m: body.track_m,
            pistons: std::array::from_fn(|_| Piston::new(truth, noise)),
            end_stop_pushes: 0,
        }
    }

    /// Moves the pistons; a step in which at least one is driven on at its end counts as a push.
    pub(crate) fn step(&mut self, pulses: &[PwmCount; 4], dt_s: f64) {
        let mut pushes = false;
        for (piston, &pulse) in self.pistons.iter_mut().zip(pulses) {
            let speed_mps = piston.speed_mps(&self.truth, pulse);
            if speed_mps != 0.0 {
                let free_m = piston.height_m + speed_mps * dt_s;
                let held_m = free_m.clamp(0.0, self.truth.piston_travel_m);
                pushes |= held_m == piston.height_m;
                piston.height_m = held_m;
            }
        }
        self.end_stop_pushes += u64::from(pushes);
    }

    /// Steps in which a piston was driven on at its end.
    pub(crate) fn end_stop_pushes(&self) -> u64 {
        self.end_stop_pushes
    }

    /// Speed over count of FL, FR, RL, RR: the derivative beyond the dead band, through the pulse of
    /// zero movement.
    pub(crate) fn lines(&self) -> [Line; 4] {
        std::array::from_fn(|i| {
            let Piston { zero, mps_per_count, .. } = self.pistons[i];
            Line { slope: mps_per_count, intercept: -mps_per_count * zero }
        })
    }

    /// Voltages of tilt sensor x and y for a truck that lies like this; the platform tilts on top of it.
    pub(crate) fn tilt_v(&self, ground: &Attitude) -> [f64; 2] {
        let [fl, fr, rl, rr] = [0, 1, 2, 3].map(|i: usize| self.pistons[i].height_m);
        let nose_up_deg = libm::atan((fl + fr - rl - rr) / 2.0 / self.wheelbase_m).to_degrees();
        let left_up_deg = libm::atan((fl + rl - fr - rr) / 2.0 / self.track_m).to_degrees();
        let truth = &self.truth;
        let volts = |tilt_deg: f64, zero_v: f64, v_per_deg: f64| {
            // The sensor measures gravity's component; §4.8.1 takes the arcsine of it.
            zero_v + v_per_deg * libm::sin(tilt_deg.to_radians()).to_degrees()
        };
        let x_v = volts(-ground.pitch_deg - nose_up_deg, truth.tilt_x_zero_v, truth.tilt_x_v_per_deg);
        let y_v = volts(-ground.roll_deg - left_up_deg, truth.tilt_y_zero_v, truth.tilt_y_v_per_deg);
        [x_v, y_v]
    }

    /// Voltages of the position sensors of FL, FR, RL, RR.
    pub(crate) fn positions_v(&self) -> [f64; 4] {
        let travel_m = self.truth.piston_travel_m;
        self.pistons.each_ref().map(|piston| piston.height_m / travel_m * ADC_SUPPLY_V)
    }

    /// All that its voltages follow from.
    pub(crate) fn posture(&self, ground: &Attitude) -> [f64; 6] {
        let [fl, fr, rl, rr] = self.pistons.each_ref().map(|piston| piston.height_m);
        [ground.pitch_deg, ground.roll_deg, fl, fr, rl, rr]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVEL: Attitude = Attitude { heading_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };

    fn platform() -> Platform {
        Platform::new(&PlatformTruth::default(), &Body::default(), &mut Rng::new(3, 0))
    }

    fn count(counts: f64) -> PwmCount {
        PwmCount::saturating(counts)
    }

    /// Φ as §4.8.1 computes it, in degrees.
    fn phi_deg(v: f64, zero_v: f64, v_per_deg: f64) -> f64 {
        libm::asin((v - zero_v) / v_per_deg.to_degrees()).to_degrees()
    }

    #[test]
    fn a_slope_is_read_back_by_the_memorandums_formula() {
        let uphill = Attitude { pitch_deg: 8.0, roll_deg: -3.0, ..LEVEL };
        let [x, y] = platform().tilt_v(&uphill);
        assert!((phi_deg(x, 2.525, 0.034_813) + 8.0).abs() < 0.01, "nose up is negative");
        assert!((phi_deg(y, 2.503, 0.033_934) - 3.0).abs() < 0.01, "left side down is positive");
    }

    #[test]
    fn lifting_the_front_makes_x_fall_and_neutral_holds() {
        let (mut platform, lift) = (platform(), PwmCount::MAX);
        let before = platform.tilt_v(&LEVEL)[0];
        platform.step(&[lift, lift, PwmCount::NEUTRAL, PwmCount::NEUTRAL], 0.1);
        assert!(platform.tilt_v(&LEVEL)[0] < before);
        assert_eq!(platform.positions_v()[2], 2.5);
        platform.step(&[lift; 4], 100.0);
        assert_eq!(platform.positions_v()[0], 5.0, "the end holds");
    }

    #[test]
    fn lifting_the_left_side_makes_y_fall() {
        let (mut platform, lift) = (platform(), PwmCount::MAX);
        let before = platform.tilt_v(&LEVEL)[1];
        platform.step(&[lift, PwmCount::NEUTRAL, lift, PwmCount::NEUTRAL], 0.1);
        assert!(platform.tilt_v(&LEVEL)[1] < before);
    }

    #[test]
    fn only_driving_on_at_an_end_is_a_push_and_never_within_the_dead_band() {
        let mut platform = platform();
        let [up, hold] = [PwmCount::MAX, PwmCount::NEUTRAL];
        platform.step(&[up, hold, hold, hold], 100.0);
        assert_eq!(platform.end_stop_pushes(), 0, "it has just arrived");
        platform.step(&[hold; 4], 0.005);
        platform.step(&[PwmCount::MIN, hold, hold, hold], 0.005);
        assert_eq!(platform.end_stop_pushes(), 0, "away from the end");
        platform.step(&[up; 4], 100.0);
        (0..7).for_each(|_| platform.step(&[up; 4], 0.005));
        assert_eq!(platform.end_stop_pushes(), 7, "steps, however many pistons");
    }

    #[test]
    fn the_linear_part_has_the_line_told_as_truth() {
        let platform = platform();
        for (piston, line) in platform.pistons.iter().zip(platform.lines()) {
            assert!((line.slope / 5.0e-5 - 1.0).abs() <= 0.1, "{line:?}");
            assert!((line.count(0.0) - 3750.0).abs() <= 10.0, "{line:?}");
            let speed = |offset: f64| piston.speed_mps(&platform.truth, count(line.count(0.0) + offset));
            let slope = (speed(250.0) - speed(-250.0) - speed(150.0) + speed(-150.0)) / 200.0;
            assert!((slope / line.slope - 1.0).abs() < 0.02, "{slope} for {line:?}");
            assert!(speed(-250.0).abs() > speed(250.0), "the weight helps to lower");
        }
    }

    #[test]
    fn the_curve_bends_flattens_and_stands_still_around_neutral() {
        let platform = platform();
        let (truth, piston) = (&platform.truth, &platform.pistons[0]);
        let speed = |offset: f64| piston.speed_mps(truth, count(piston.zero + offset));
        assert_eq!((piston.speed_mps(truth, PwmCount::NEUTRAL), speed(10.0)), (0.0, 0.0));
        assert!(speed(900.0) < 0.9 * 3.0 * speed(310.0), "bent: {} {}", speed(900.0), speed(310.0));
        assert_eq!(speed(1200.0), speed(1400.0), "flat");
        let rising = (0..1400).all(|i| speed(f64::from(i) + 1.0) >= speed(f64::from(i)));
        assert!(rising, "never slower for a longer pulse");
        let full_travel_s = 0.04 / speed(1400.0);
        assert!((0.9..1.3).contains(&full_travel_s), "{full_travel_s}");
    }
}
