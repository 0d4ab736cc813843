//! Tilt sensor (§4.8.1): two voltages to pitch and roll.
//!
//! Φ = asin((V − V_ref) / S) with S in **V/rad**: the printed arcsine uses V/deg, an erratum. Beyond
//! ±90° of that formula there is no angle (`None`): the pistons stop and the platform PID is reset.
//! x is pitch and y is roll: the prose example ("tilts on the right side … x") contradicts both sets
//! of formulas; the formulas win. Φx > 0 is nose down, Φy > 0 is left side down.

use crate::units::AdcCount;
use crate::vehicle::Tilt;

/// Pitch and roll in degrees, −90..=90; `None` = the voltage has no angle, or nothing was read yet.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TiltAngles {
    /// Pitch, + = nose down.
    pub x: Option<f64>,
    /// Roll, + = left side down.
    pub y: Option<f64>,
}

impl TiltAngles {
    /// Both axes, if both have an angle.
    #[must_use]
    pub fn both(self) -> Option<(f64, f64)> {
        self.x.zip(self.y)
    }
}

/// One reading of both axes (§4.8.1).
#[must_use]
pub fn tilt_angles(config: &Tilt, readings: &[AdcCount; 2]) -> TiltAngles {
    TiltAngles {
        x: angle_deg(readings[0].volts(), config.x_zero_v, config.x_v_per_deg),
        y: angle_deg(readings[1].volts(), config.y_zero_v, config.y_v_per_deg),
    }
}

fn angle_deg(volts: f64, zero_v: f64, v_per_deg: f64) -> Option<f64> {
    let v_per_rad = v_per_deg * 180.0 / std::f64::consts::PI;
    let sine = (volts - zero_v) / v_per_rad;
    (sine.abs() <= 1.0).then(|| libm::asin(sine).to_degrees())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn level_is_zero_and_the_sensitivity_holds_near_it() {
        let at = |v: f64| angle_deg(v, 2.525, 0.034_813).unwrap();
        assert!(at(2.525).abs() < 1e-12);
        assert!((at(2.525 + 0.034_813) - 1.0).abs() < 1e-4);
        assert!((at(2.525 - 10.0 * 0.034_813) + 10.0).abs() < 0.06);
    }

    #[test]
    fn a_voltage_beyond_the_arcsine_has_no_angle_and_every_other_one_is_finite() {
        let config = Tilt::default();
        for counts in 0..=1023_u16 {
            let reading = AdcCount::try_from(counts).unwrap();
            let angles = tilt_angles(&config, &[reading; 2]);
            let sine = (reading.volts() - 2.525) / 0.034_813_f64.to_degrees();
            assert_eq!(angles.x.is_none(), sine.abs() > 1.0, "{counts}");
            assert!(angles.x.is_none_or(|deg| deg.abs() <= 90.0));
            assert!(angles.y.is_none_or(|deg| deg.abs() <= 90.0));
        }
    }
}
