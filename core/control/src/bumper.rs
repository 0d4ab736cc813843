//! Bumper servos (§4.5, Annex A.1): the angle of its range finders above the horizontal.
//!
//! The servo gets the pulse that its calibration gives for the configured angle, and the ranging
//! stage gets the angle that this pulse stands for (θ in hyp · cos θ). The memorandum says no more
//! of when the bumpers move; they stand where the configuration has them.

use crate::units::PwmCount;
use crate::vehicle::{Bumpers, Calibration};

/// A bumper's pulse and angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumperServo {
    /// Pulse, within the servo's limits.
    pub pulse: PwmCount,
    /// Angle of that pulse above the horizontal, in degrees.
    pub angle_deg: f64,
}

/// Front and rear bumper as configured and calibrated.
#[must_use]
pub fn bumper_servos(config: &Bumpers, calibration: &Calibration) -> [BumperServo; 2] {
    let [front, rear] = calibration.bumpers();
    [(front, config.front_deg), (rear, config.rear_deg)].map(|(line, wanted_deg)| {
        let pulse = PwmCount::saturating(line.count(wanted_deg));
        BumperServo { pulse, angle_deg: line.at(pulse.as_f64()) }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pulse_is_limited_and_the_angle_is_the_limited_pulses() {
        let bumpers = Bumpers { front_deg: 18.0, rear_deg: 60.0 };
        let [front, rear] = bumper_servos(&bumpers, &Calibration::default());
        assert_eq!(front.pulse.get(), 4250);
        assert!((front.angle_deg - 18.0).abs() < 1e-9);
        assert_eq!(rear.pulse, PwmCount::MAX);
        assert!((rear.angle_deg - 54.792).abs() < 1e-9);
    }
}
