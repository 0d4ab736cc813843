//! What a calibration changes in a configuration file.

use robot_agent::settings_file::SettingChange;
use xtb_control::calibration::{Actuator, ActuatorKind, Fit};

/// Digits that are written: more than any protractor gives.
const DIGITS: i32 = 7;

/// What a fit changes, rounded as it will be written. A steering's centre goes with its line.
pub(crate) fn changes(what: Actuator, fit: &Fit) -> Vec<SettingChange> {
    let key = what.name().replace('-', "_");
    let mut changes = vec![
        SettingChange::new(&format!("vehicle.calibration.{key}_slope"), rounded(fit.line.slope)),
        SettingChange::new(&format!("vehicle.calibration.{key}_intercept"), rounded(fit.line.intercept)),
    ];
    if let ActuatorKind::Steering(axle) = what.kind() {
        let key = ["front_centre", "rear_centre"][axle];
        let centre = (fit.zero_count * 10.0).round() / 10.0;
        changes.push(SettingChange::new(&format!("vehicle.steering.{key}"), centre));
    }
    changes
}

/// To seven significant digits.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let places = DIGITS - 1 - value.abs().log10().floor() as i32;
    // By way of the decimal text, which is what will stand in the file.
    format!("{value:.*}", places.clamp(0, 15) as usize).parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_rounded_to_what_is_known() {
        assert_eq!(rounded(-0.020512820512), -0.02051282);
        assert_eq!(rounded(76.102564102564), 76.10256);
        assert_eq!(rounded(5.0123456789e-5), 5.012346e-5);
        assert_eq!((rounded(0.0), rounded(123_456_789.4)), (0.0, 123_456_789.0));
    }
}
