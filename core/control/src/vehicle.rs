//! The vehicle's constants, each with unit, range, default and origin.
//!
//! Read once at start, validated as a whole, then only borrowed by the stages. What the
//! memorandum prints says so; what is *ours* has a switch, so that the published behaviour can be
//! run and compared.

mod calibration;
mod drivetrain;
mod gears;
mod imu;
mod range_finders;
mod sections;

pub use calibration::Line;
pub use drivetrain::Drivetrain;
pub use gears::{Gears, UNSEEN_MPS};
pub use imu::{Imu, ImuYaw};
pub use range_finders::{BumperFinders, RangeFinder, SLOTS, USUAL_SLOTS};
pub use sections::*;

use crate::config::{
    Allowed,
    DefaultOrigin::{DataSheet, Printed},
    Parameter, Value,
};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Which law drives A-to-B (§4.10).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GotoLaw {
    /// Table 4 as printed: on a drive that stops before it reverses, half of all starts limit-cycle with
    /// the published profile, a sixth with ours.
    Published,
    /// Table 4 with slice hysteresis and a steering that goes to zero at γ = 180°.
    Hysteresis,
}

/// Which of the two platform controllers runs (§4.8).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Platform {
    /// The balance controller (§4.8.3), which the memorandum prefers.
    #[default]
    Balance,
    /// The platform PID (§4.8.2).
    Pid,
    /// Neither: the pistons stand.
    Off,
}

impl Value for Platform {
    fn to_toml(&self) -> String {
        match self {
            Self::Balance => "\"balance\"".into(),
            Self::Pid => "\"pid\"".into(),
            Self::Off => "\"off\"".into(),
        }
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        true
    }
}

impl Value for GotoLaw {
    fn to_toml(&self) -> String {
        match self {
            Self::Published => "\"published\"".into(),
            Self::Hysteresis => "\"hysteresis\"".into(),
        }
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        true
    }
}

/// All constants of one vehicle.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleConfig {
    /// Which platform controller runs.
    pub platform: Platform,
    /// Which axles steer.
    pub drivetrain: Drivetrain,
    /// Which inertial unit is fitted.
    pub imu: Imu,
    /// Which way its yaw grows, of a BNO085.
    pub imu_yaw: ImuYaw,
    /// The body.
    pub geometry: Geometry,
    /// The encoder.
    pub encoder: Encoder,
    /// The speed controller.
    pub speed: Speed,
    /// The steering servos.
    pub steering: SteeringServos,
    /// What a GP2D12's voltage means.
    pub infrared: Infrared,
    /// The range finders that are fitted.
    pub range_finders: RangeFinders,
    /// The obstacle rule.
    pub obstacle: Obstacle,
    /// A-to-B.
    pub goto: Goto,
    /// Wander.
    pub wander: Wander,
    /// Teleoperation.
    pub teleop: Teleop,
    /// Odometry.
    pub odometry: Odometry,
    /// Remote control.
    pub remote: Remote,
    /// What counts as broken.
    pub guard: GuardLimits,
    /// Battery levels.
    pub battery: BatteryLevels,
    /// Bumper servos.
    pub bumpers: Bumpers,
    /// Tilt sensor.
    pub tilt: Tilt,
    /// Pistons.
    pub pistons: Pistons,
    /// Balance controller.
    pub balance: Balance,
    /// Platform PID.
    pub platform_pid: PlatformPid,
    /// Annex A's fits.
    pub calibration: Calibration,
    /// Channel map.
    pub channels: Channels,
}

impl VehicleConfig {
    /// Every parameter with its present value, section by section.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let word = |name: &str, value: String, words: &'static [&'static str], origin, about| Parameter {
            name: name.into(),
            value,
            unit: "",
            allowed: Allowed::OneOf(words),
            origin,
            about,
            valid: true,
        };
        let mut all = vec![
            word(
                "platform",
                self.platform.to_toml(),
                &["balance", "pid", "off"],
                Printed("§4.8"),
                "Platform controller: balance, pid or none (off).",
            ),
            word(
                "drivetrain",
                self.drivetrain.to_toml(),
                &Drivetrain::WORDS,
                Printed("§2.1"),
                "Which axles steer: both, in opposite directions, or the front one.",
            ),
            word(
                "imu",
                self.imu.to_toml(),
                &Imu::WORDS,
                Printed("§2.2"),
                "Inertial unit: a 3DM-G on a line of its own, or a BNO085 in UART-RVC mode at the I/O board.",
            ),
            word(
                "imu_yaw",
                self.imu_yaw.to_toml(),
                &ImuYaw::WORDS,
                DataSheet("BNO080, §4"),
                "Which way the yaw of a BNO085 grows, seen from above: verify on hardware.",
            ),
        ];
        all.extend(self.geometry.parameters());
        all.extend(self.encoder.parameters());
        all.extend(self.speed.parameters());
        all.extend(self.steering.parameters());
        all.extend(self.infrared.parameters());
        all.extend(self.range_finders.parameters());
        all.extend(self.obstacle.parameters());
        all.extend(self.goto.parameters());
        all.extend(self.wander.parameters());
        all.extend(self.teleop.parameters());
        all.extend(self.odometry.parameters());
        all.extend(self.remote.parameters());
        all.extend(self.guard.parameters());
        all.extend(self.battery.parameters());
        all.extend(self.bumpers.parameters());
        all.extend(self.tilt.parameters());
        all.extend(self.pistons.parameters());
        all.extend(self.balance.parameters());
        all.extend(self.platform_pid.parameters());
        all.extend(self.calibration.parameters());
        all.extend(self.channels.parameters());
        all
    }

    /// Metres per second at one wheel rpm.
    #[must_use]
    pub fn mps_per_rpm(&self) -> f64 {
        PI * self.geometry.wheel_diameter_m / 60.0
    }

    /// The fastest speed that the obstacle rule can stop from without contact, in m/s: what is left
    /// of the threshold, or of the sensors' sight if that is shorter, above their blind zone, over the
    /// reaction time of the whole path; by the worst of the range finders, and [`UNSEEN_MPS`] without any.
    #[must_use]
    pub fn admitted_mps(&self) -> f64 {
        let tilt_deg = self.bumpers.front_deg.abs().max(self.bumpers.rear_deg.abs());
        let cos = libm::cos(tilt_deg.to_radians());
        let RangeFinders { front, rear } = &self.range_finders;
        let rooms_cm = front.0.iter().chain(&rear.0).map(|f| f.room_cm(&self.infrared, &self.obstacle, cos));
        let worst_cm = rooms_cm.reduce(f64::min);
        worst_cm.map_or(UNSEEN_MPS, |room_cm| (room_cm / 100.0).max(0.0) / self.obstacle.reaction_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_that_contradicts_the_centre_is_refused() {
        let mut config = VehicleConfig::default();
        config.calibration.steering_rear_intercept += 10.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("steering.rear_centre") && error.contains("10.0 deg"), "{error}");
        config = VehicleConfig::default();
        config.calibration.piston_rl_slope = 0.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("calibration.piston_rl_slope"), "{error}");
        config = VehicleConfig::default();
        config.bumpers.front_deg = 60.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("5417"), "{error}");
    }

    #[test]
    fn the_defaults_are_valid() {
        VehicleConfig::default().validate().unwrap();
    }

    #[test]
    fn validate_names_field_value_and_allowed_range() {
        let mut config = VehicleConfig::default();
        config.speed.kp = -1.0;
        let error = config.validate().unwrap_err();
        assert_eq!(error.to_string(), "speed.kp = -1.0 is not allowed: 0..=1000 counts/rpm");
        config.speed.kp = f64::NAN;
        assert!(config.validate().is_err());
    }

    #[test]
    fn battery_levels_out_of_order_are_refused() {
        let mut config = VehicleConfig::default();
        config.battery.finish_v = 7.3;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("battery.warn_v") && error.contains("7.3"), "{error}");
        config = VehicleConfig::default();
        config.battery.stop_v = 6.9;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("battery.finish_v"), "{error}");
    }

    #[test]
    fn a_speed_that_the_obstacle_rule_cannot_stop_is_refused() {
        let mut config = VehicleConfig::default();
        config.teleop.max_rpm = 60.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("teleop.max_rpm") && error.contains("threshold_cm"), "{error}");
        config.obstacle.threshold_cm = 40.0;
        config.validate().unwrap();
    }

    #[test]
    fn what_the_sensors_cannot_see_admits_no_more_speed() {
        let mut config = VehicleConfig::default();
        assert!((config.admitted_mps() - (0.25 - 0.0974) / 0.358).abs() < 1e-12);
        config.obstacle.threshold_cm = 80.0;
        assert!((config.admitted_mps() - (0.558_3 - 0.097_4) / 0.358).abs() < 1e-3, "0.42 V is 55.8 cm");
        config.bumpers.rear_deg = -45.0;
        assert!((config.admitted_mps() - (0.394_8 - 0.097_4) / 0.358).abs() < 1e-3, "tilted, less far");
    }
}
