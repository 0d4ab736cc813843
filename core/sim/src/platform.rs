//! The tilting platform: tilt sensor and four pistons.
//!
//! Signs are those for which both platform controllers of the memorandum (§4.8.2, §4.8.3) converge:
//! Φx > 0 is nose down, Φy > 0 is left side down, and a longer pulse lifts a piston.

use crate::gyro::Attitude;
use crate::infrared::adc_count;
use crate::parameters::{Body, PlatformTruth};
use xtb_control::PwmCount;
use xtb_control::units::{ADC_SUPPLY_V, AdcCount};
use xtb_protocol::board::ADC_SCANS;

#[derive(Debug, Clone)]
pub(crate) struct Platform {
    truth: PlatformTruth,
    wheelbase_m: f64,
    track_m: f64,
    /// Heights of FL, FR, RL, RR.
    pistons_m: [f64; 4],
}

impl Platform {
    /// All pistons in the middle.
    pub(crate) fn new(truth: &PlatformTruth, body: &Body) -> Self {
        let middle_m = truth.piston_travel_m / 2.0;
        Self {
            truth: truth.clone(),
            wheelbase_m: body.wheelbase_m,
            track_m: body.track_m,
            pistons_m: [middle_m; 4],
        }
    }

    pub(crate) fn step(&mut self, pulses: &[PwmCount; 4], dt_s: f64) {
        for (piston_m, pulse) in self.pistons_m.iter_mut().zip(pulses) {
            let offset = pulse.as_f64() - PwmCount::NEUTRAL.as_f64();
            let moved_m = *piston_m + offset * self.truth.piston_mps_per_count * dt_s;
            *piston_m = moved_m.clamp(0.0, self.truth.piston_travel_m);
        }
    }

    /// Tilt sensor x and y for a truck that lies like this; the platform tilts on top of it.
    pub(crate) fn tilt(&self, ground: &Attitude) -> [AdcCount; 2] {
        let [fl, fr, rl, rr] = self.pistons_m;
        let nose_up_deg = libm::atan((fl + fr - rl - rr) / 2.0 / self.wheelbase_m).to_degrees();
        let left_up_deg = libm::atan((fl + rl - fr - rr) / 2.0 / self.track_m).to_degrees();
        let truth = &self.truth;
        let volts = |tilt_deg: f64, zero_v: f64, v_per_deg: f64| {
            // The sensor measures gravity's component; §4.8.1 takes the arcsine of it.
            zero_v + v_per_deg * libm::sin(tilt_deg.to_radians()).to_degrees()
        };
        let x_v = volts(-ground.pitch_deg - nose_up_deg, truth.tilt_x_zero_v, truth.tilt_x_v_per_deg);
        let y_v = volts(-ground.roll_deg - left_up_deg, truth.tilt_y_zero_v, truth.tilt_y_v_per_deg);
        [x_v, y_v].map(|v| adc_count(v, f64::from(ADC_SCANS)))
    }

    /// Position sensors of FL, FR, RL, RR.
    pub(crate) fn positions(&self) -> [AdcCount; 4] {
        let travel_m = self.truth.piston_travel_m;
        self.pistons_m.map(|m| adc_count(m / travel_m * ADC_SUPPLY_V, f64::from(ADC_SCANS)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVEL: Attitude = Attitude { heading_deg: 0.0, pitch_deg: 0.0, roll_deg: 0.0 };

    fn platform() -> Platform {
        Platform::new(&PlatformTruth::default(), &Body::default())
    }

    /// Φ as §4.8.1 computes it, in degrees.
    fn phi_deg(reading: AdcCount, zero_v: f64, v_per_deg: f64) -> f64 {
        libm::asin((reading.volts() - zero_v) / v_per_deg.to_degrees()).to_degrees()
    }

    #[test]
    fn a_slope_is_read_back_by_the_memorandums_formula() {
        let uphill = Attitude { pitch_deg: 8.0, roll_deg: -3.0, ..LEVEL };
        let [x, y] = platform().tilt(&uphill);
        assert!((phi_deg(x, 2.525, 0.034_813) + 8.0).abs() < 0.01, "nose up is negative");
        assert!((phi_deg(y, 2.503, 0.033_934) - 3.0).abs() < 0.01, "left side down is positive");
    }

    #[test]
    fn lifting_the_front_makes_x_fall_and_neutral_holds() {
        let (mut platform, lift) = (platform(), PwmCount::MAX);
        let before = platform.tilt(&LEVEL)[0];
        platform.step(&[lift, lift, PwmCount::NEUTRAL, PwmCount::NEUTRAL], 0.5);
        assert!(platform.tilt(&LEVEL)[0] < before);
        assert_eq!(platform.positions()[2].get(), 512.0);
        platform.step(&[lift; 4], 100.0);
        assert_eq!(platform.positions()[0].get(), 1023.0, "the end holds");
    }
}
