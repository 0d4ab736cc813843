//! What a lab may set of the second level, each with unit, range, default and origin.
//!
//! Few of all constants: the others belong to the truck's build and stay in the tables of
//! [`FollowerSettings`] and [`FilterTuning`]. Of these only `navigation.drive.obstacle_cm` reaches the
//! first level, as a sample.

use crate::geometry::Car;
use crate::localization::{FilterTuning, UncertaintyLimits};
use crate::path_follower::{FollowerSettings, GoalTolerance};
use serde::{Deserialize, Serialize};
use xtb_control::VehicleConfig;
use xtb_control::config::{
    Allowed::Range,
    ConfigError,
    DefaultOrigin::{Assumed, Ours, Printed},
    Parameter, validate,
};
use xtb_control::config_section;

/// Speed on a stretch that traffic control has released, in m/s: below what the obstacle rule can stop from
/// (0.43 m/s, [`VehicleConfig::admitted_mps`]). Traffic control names it to every robot, so that a higher
/// `navigation.drive.cruise_mps` makes no robot faster; a lower one makes it slower.
pub const CRUISE_MPS: f64 = 0.35;
/// Speed where another one may come head-on, in m/s: below half of what the obstacle rule can stop from,
/// since each of the two needs its own stopping distance.
pub const MEETING_MPS: f64 = 0.2;

config_section! {
    /// Along a path.
    DriveSettings "navigation.drive" {
        limit_mps: f64 = 1.0, "m/s", Range(0.1, 1.0), Ours, "Never faster than this, on planned paths or by hand over the network, whatever else allows more. May be changed while the robot runs (`fleet-cli param`).";
        cruise_mps: f64 = CRUISE_MPS, "m/s", Range(0.1, 1.0), Ours, "Maximum speed, on stretches with traffic clearance.";
        meeting_mps: f64 = MEETING_MPS, "m/s", Range(0.1, 0.5), Ours, "Maximum speed without traffic control: two robots that meet each need their own stopping distance.";
        obstacle_cm: f64 = 10.0, "cm", Range(10.0, 80.0), Ours, "What is nearer to a bumper than this is an obstacle, whoever drives; less than obstacle.threshold_cm counts as that. Paths are planned for 25: with more, a robot may stop before what they lead past. May be changed while the robot runs.";
        look_ahead_m: f64 = 0.22, "m", Range(0.15, 0.6), Ours, "Look-ahead at standstill: pose errors decay over about this distance.";
        look_ahead_s: f64 = 0.2, "s", Range(0.0, 1.0), Ours, "Additional look-ahead per m/s of speed.";
        deviation_m: f64 = 0.12, "m", Range(0.03, 0.5), Ours, "Lateral deviation from the path at which the robot stops and replans.";
        no_motion_s: f64 = 2.0, "s", Range(0.5, 30.0), Ours, "Driving commands for this long without wheel motion: stuck.";
        no_progress_s: f64 = 6.0, "s", Range(1.0, 60.0), Ours, "Turning wheels for this long without progress along the path: stuck.";
    }
}

config_section! {
    /// On arrival.
    ArrivalSettings "navigation.arrival" {
        tolerance_m: f64 = 0.2, "m", Range(0.03, 1.0), Printed("§4.10"), "Reached when both errors from the end of the path are at most this; a path ends within 5 cm of its goal.";
        tolerance_deg: f64 = 15.0, "deg", Range(5.0, 90.0), Ours, "Yaw error at most this, for goals with a yaw.";
    }
}

config_section! {
    /// What is not on the map.
    UnknownSettings "navigation.unknown" {
        fades_s: f64 = 60.0, "s", Range(5.0, 600.0), Ours, "How long an obstacle seen by the range finders is kept unless it is seen again.";
        fades_beside_s: f64 = 60.0, "s", Range(5.0, 600.0), Ours, "The same beside the body, where no beam points.";
    }
}

config_section! {
    /// Where it is.
    PoseSettings "navigation.pose" {
        gate: f64 = 1.0, "relative", Range(0.5, 5.0), Ours, "Outlier threshold, relative to the distance that 1 correct fix in 1,000 exceeds.";
        late_s: f64 = 0.5, "s", Range(0.0, 0.6), Ours, "Fixes older than this on arrival are ignored.";
        drift_radps: f64 = 0.003, "rad/s", Range(1.0e-4, 0.1), Assumed, "Standard deviation of the gyro's drift.";
        wheel_scale: f64 = 0.012, "of the diameter", Range(1.0e-3, 0.2), Assumed, "Standard deviation of the tyre diameter.";
        slow_part: f64 = 0.5, "of the clearance", Range(0.05, 0.95), Ours, "Above this pose uncertainty the robot drives slower.";
        stop_part: f64 = 1.0, "of the clearance", Range(0.1, 1.0), Ours, "Above this pose uncertainty the robot stops and waits for a fix.";
        least_mps: f64 = 0.10, "m/s", Range(0.08, 0.2), Ours, "Speed just below that limit.";
    }
}

/// All of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NavSettings {
    /// Along a path.
    pub drive: DriveSettings,
    /// On arrival.
    pub arrival: ArrivalSettings,
    /// What is not on the map.
    pub unknown: UnknownSettings,
    /// Where it is.
    pub pose: PoseSettings,
}

impl NavSettings {
    /// Every parameter with its present value, section by section.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = self.drive.parameters();
        all.extend(self.arrival.parameters());
        all.extend(self.unknown.parameters());
        all.extend(self.pose.parameters());
        all
    }

    /// Checks each parameter against its range, then their order.
    ///
    /// # Errors
    /// The first violation, naming field, value and what is allowed.
    pub fn validate(&self) -> Result<(), ConfigError> {
        validate(&self.parameters())?;
        let (drive, pose) = (&self.drive, &self.pose);
        for (name, value, least_name, least) in [
            ("navigation.drive.meeting_mps", drive.meeting_mps, "navigation.pose.least_mps", pose.least_mps),
            (
                "navigation.drive.cruise_mps",
                drive.cruise_mps,
                "navigation.drive.meeting_mps",
                drive.meeting_mps,
            ),
        ] {
            if value < least {
                return Err(conflict(name, value, format!("it must be at least {least_name}, {least}")));
            }
        }
        if pose.stop_part <= pose.slow_part {
            let reason = format!("it must be more than navigation.pose.slow_part, {}", pose.slow_part);
            return Err(conflict("navigation.pose.stop_part", pose.stop_part, reason));
        }
        Ok(())
    }

    /// Checks that this vehicle's obstacle rule can stop from these speeds.
    ///
    /// # Errors
    /// [`ConfigError::Conflict`] naming the speed and what would be allowed.
    pub fn validate_for(&self, vehicle: &VehicleConfig) -> Result<(), ConfigError> {
        let (admitted_mps, cm) = (vehicle.admitted_mps(), vehicle.obstacle.threshold_cm);
        if !vehicle.range_finders.gears().is_any() {
            return Ok(()); // it drives by hand only
        }
        for (name, mps, most_mps, whom) in [
            ("navigation.drive.cruise_mps", self.drive.cruise_mps, admitted_mps, "stops"),
            (
                "navigation.drive.meeting_mps",
                self.drive.meeting_mps,
                admitted_mps / 2.0,
                "stops two robots that meet",
            ),
        ] {
            if mps > most_mps {
                let reason = format!(
                    "the {cm} cm obstacle rule {whom} in time only up to {most_mps:.2} m/s; for more, \
                     raise obstacle.threshold_cm"
                );
                return Err(conflict(name, mps, reason));
            }
        }
        Ok(())
    }

    /// Fastest on a stretch that traffic control has released, in m/s.
    #[must_use]
    pub fn cruise_mps(&self) -> f64 {
        self.drive.cruise_mps.min(self.drive.limit_mps)
    }

    /// Fastest without traffic control, in m/s.
    #[must_use]
    pub fn meeting_mps(&self) -> f64 {
        self.drive.meeting_mps.min(self.drive.limit_mps)
    }

    /// For the follower of this vehicle: its servos turn as fast as an XTB's, so a wider lock takes longer.
    #[must_use]
    pub fn follower_of(&self, vehicle: &VehicleConfig) -> FollowerSettings {
        let follower = self.follower();
        let wider = vehicle.steering.stop_deg / VehicleConfig::default().steering.stop_deg;
        FollowerSettings { lock_s: follower.lock_s * wider, ..follower }
    }

    /// For the follower of an XTB.
    #[must_use]
    pub fn follower(&self) -> FollowerSettings {
        let DriveSettings { look_ahead_m, look_ahead_s, deviation_m, no_motion_s, no_progress_s, .. } =
            self.drive;
        FollowerSettings {
            look_ahead_m,
            look_ahead_s,
            deviation_m,
            no_motion_s,
            no_progress_s,
            ..FollowerSettings::default()
        }
    }

    /// What counts as reached; the yaw only of a goal that has one.
    #[must_use]
    pub fn tolerance(&self, with_yaw: bool) -> GoalTolerance {
        let ArrivalSettings { tolerance_m, tolerance_deg } = self.arrival;
        let yaw_rad = with_yaw.then(|| tolerance_deg.to_radians());
        GoalTolerance { position_m: tolerance_m, yaw_rad }
    }

    /// For the pose filter.
    #[must_use]
    pub fn filter(&self) -> FilterTuning {
        let PoseSettings { gate, late_s, drift_radps, wheel_scale, .. } = self.pose;
        FilterTuning { gate, late_s, drift_radps, wheel_scale, ..FilterTuning::default() }
    }

    /// How long obstacles count that are not seen again, and those beside the body, in ms.
    #[must_use]
    pub fn fades_ms(&self) -> (u64, u64) {
        let ms = |s: f64| libm::round(s * 1e3) as u64;
        (ms(self.unknown.fades_s), ms(self.unknown.fades_beside_s))
    }

    /// What an uncertain pose allows this car. (Its reach to whole centimetres: recordings replay bit for bit.)
    #[must_use]
    pub fn uncertainty_limits(&self, car: &Car) -> UncertaintyLimits {
        let PoseSettings { slow_part, stop_part, least_mps, .. } = self.pose;
        let reach_m = libm::round(car.reach_m() * 100.0) / 100.0;
        UncertaintyLimits { slow_part, stop_part, cruise_mps: self.cruise_mps(), least_mps, reach_m }
    }
}

fn conflict(name: &str, value: f64, reason: String) -> ConfigError {
    ConfigError::Conflict { name: name.to_owned(), value: format!("{value:?}"), reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacle_layer::ObstacleLayer;

    #[test]
    fn the_defaults_are_those_of_the_parts() {
        let settings = NavSettings::default();
        settings.validate().unwrap();
        settings.validate_for(&VehicleConfig::default()).unwrap();
        assert_eq!(settings.follower(), FollowerSettings::default());
        assert_eq!(settings.tolerance(true), GoalTolerance::default());
        assert_eq!(settings.tolerance(false).yaw_rad, None);
        assert_eq!(settings.filter(), FilterTuning::default());
        let car = Car::of(&VehicleConfig::default());
        assert_eq!(settings.uncertainty_limits(&car), UncertaintyLimits::default());
        assert_eq!(settings.fades_ms(), (ObstacleLayer::FADES_MS, ObstacleLayer::FADES_BESIDE_MS));
    }

    #[test]
    fn whatever_is_allowed_here_is_allowed_of_the_parts() {
        let ends = |of: fn(f64, f64) -> f64| {
            let mut settings = NavSettings::default();
            let value = |name: &str| {
                let all = NavSettings::default().parameters();
                let found = all.iter().find(|p| p.name == name).unwrap().allowed;
                let Range(min, max) = found else { panic!("{name}") };
                of(min, max)
            };
            settings.drive.look_ahead_m = value("navigation.drive.look_ahead_m");
            settings.drive.look_ahead_s = value("navigation.drive.look_ahead_s");
            settings.drive.deviation_m = value("navigation.drive.deviation_m");
            settings.drive.no_motion_s = value("navigation.drive.no_motion_s");
            settings.drive.no_progress_s = value("navigation.drive.no_progress_s");
            settings.pose.gate = value("navigation.pose.gate");
            settings.pose.late_s = value("navigation.pose.late_s");
            settings.pose.drift_radps = value("navigation.pose.drift_radps");
            settings.pose.wheel_scale = value("navigation.pose.wheel_scale");
            settings
        };
        for settings in [ends(|min, _| min), ends(|_, max| max)] {
            validate(&settings.follower().parameters()).unwrap();
            validate(&settings.filter().parameters()).unwrap();
        }
    }

    #[test]
    fn a_value_out_of_range_or_out_of_order_is_refused_by_its_name() {
        let refused = |change: fn(&mut NavSettings)| {
            let mut settings = NavSettings::default();
            change(&mut settings);
            settings.validate().unwrap_err().to_string()
        };
        assert_eq!(
            refused(|s| s.drive.look_ahead_m = 0.0),
            "navigation.drive.look_ahead_m = 0.0 is not allowed: 0.15..=0.6 m"
        );
        assert_eq!(
            refused(|s| s.drive.cruise_mps = 0.15),
            "navigation.drive.cruise_mps = 0.15 is not allowed: it must be at least navigation.drive.meeting_mps, 0.2"
        );
        let order = refused(|s| (s.pose.slow_part, s.pose.stop_part) = (0.5, 0.5));
        assert!(
            order.starts_with("navigation.pose.stop_part = 0.5 is not allowed: it must be more than"),
            "{order}"
        );
        assert!(refused(|s| s.unknown.fades_s = f64::NAN).starts_with("navigation.unknown.fades_s = NaN"));
    }

    #[test]
    fn a_speed_that_the_vehicle_cannot_stop_from_is_refused() {
        let vehicle = VehicleConfig::default();
        let mut settings = NavSettings::default();
        settings.drive.cruise_mps = 0.45;
        let error = settings.validate_for(&vehicle).unwrap_err().to_string();
        assert!(
            error.starts_with("navigation.drive.cruise_mps = 0.45") && error.contains("0.43 m/s"),
            "{error}"
        );
        settings = NavSettings::default();
        settings.drive.meeting_mps = 0.3;
        let error = settings.validate_for(&vehicle).unwrap_err().to_string();
        assert!(
            error.starts_with("navigation.drive.meeting_mps = 0.3") && error.contains("0.21 m/s"),
            "{error}"
        );
    }
}
