//! The vehicle's constants, each with unit, range, default and origin.
//!
//! Read once at start, validated as a whole, then only borrowed by the stages. What the
//! memorandum prints says so; what is *ours* has a switch, so that the published behaviour can be
//! run and compared.

use crate::config::{Allowed, ConfigError, Origin, Parameter, Value};
use crate::config_section;
use crate::units::WheelRpm;
use Allowed::{OneOf, Range, Switch};
use Origin::{Assumed, Ours, Printed};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Which law drives A-to-B (§4.10).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GotoLaw {
    /// Table 4 as printed: half of all starts limit-cycle on a drive that stops before it reverses.
    Published,
    /// Table 4 with slice hysteresis and a steering that goes to zero at γ = 180°.
    Hysteresis,
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

config_section! {
    /// The body, seen from above.
    Geometry "geometry" {
        wheelbase_m: f64 = 0.286, "m", Range(0.05, 2.0), Assumed, "Distance between the axles.";
        track_m: f64 = 0.262, "m", Range(0.05, 2.0), Assumed, "Distance between the wheels of an axle.";
        body_length_m: f64 = 0.50, "m", Range(0.1, 3.0), Assumed, "Bumper to bumper.";
        body_width_m: f64 = 0.40, "m", Range(0.1, 3.0), Assumed, "Tyre to tyre.";
        wheel_diameter_m: f64 = 0.1651, "m", Range(0.02, 1.0), Printed("§2.1 (6.5 in)"), "Tyre diameter.";
    }
}

config_section! {
    /// The encoder on the motor shaft (§4.2.3).
    Encoder "encoder" {
        window_s: f64 = 0.052_428_8, "s", Range(0.001, 1.0), Printed("§4.2.3 (0x8000 · 64 / 40 MHz)"), "Length of the counting window.";
        pulses_per_rev: f64 = 60.0, "pulses", Range(1.0, 10_000.0), Printed("§2.2"), "Pulses per revolution of the motor shaft.";
        gear_ratio: f64 = 34.0, "motor turns per wheel turn", Range(1.0, 1000.0), Printed("§2.1"), "Gear box.";
    }
}

config_section! {
    /// The speed controller (§4.7).
    Speed "speed" {
        kp: f64 = 10.0, "counts/rpm", Range(0.0, 1000.0), Printed("§4.7"), "Proportional gain.";
        ki: f64 = 20.0, "counts/(rpm·s)", Range(0.0, 1000.0), Printed("§4.7"), "Integral gain.";
        kd: f64 = 0.1, "counts·s/rpm", Range(0.0, 100.0), Printed("§4.7"), "Differential gain.";
        anti_windup: bool = true, "", Switch, Ours, "Hold the sum while the output is saturated in the error's direction.";
        reset_on_change: bool = true, "", Switch, Ours, "Reset the controller when the mode or the sign of the reference changes.";
        direction_interlock: bool = true, "", Switch, Ours, "Hold a reversed reference at zero until the wheels stand.";
        interlock_pulses: u32 = 1, "pulses", Range(0.0, 100.0), Ours, "A window with at most this many pulses counts as standing.";
    }
}

config_section! {
    /// The steering servos (§4.10, Table 4).
    SteeringServos "steering" {
        front_centre: f64 = 3710.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Front servo, straight ahead.";
        rear_centre: f64 = 4179.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Rear servo, straight ahead.";
        range_counts: f64 = 975.0, "counts", Range(1.0, 1400.0), Printed("§4.10 (5° · 195)"), "Full lock either side of the centre.";
        stop_deg: f64 = 20.0, "deg", Range(1.0, 45.0), Assumed, "Wheel angle at full lock.";
    }
}

config_section! {
    /// The twelve infrared range finders (§4.5).
    Infrared "infrared" {
        far_v: f64 = 0.42, "V", Range(0.1, 1.0), Ours, "Below this voltage nothing is in range (the fit ends there).";
        near_v: f64 = 2.35, "V", Range(1.0, 5.0), Ours, "Above this voltage an object is too close (the fit turns back there).";
        near_cm: f64 = 9.74, "cm", Range(1.0, 25.0), Ours, "What a voltage above near_v counts as.";
        front_angle_deg: f64 = 0.0, "deg", Range(-60.0, 60.0), Assumed, "Angle of the front bumper above the horizontal.";
        rear_angle_deg: f64 = 0.0, "deg", Range(-60.0, 60.0), Assumed, "Angle of the rear bumper above the horizontal.";
    }
}

config_section! {
    /// The obstacle rule (§4.6).
    Obstacle "obstacle" {
        threshold_cm: f64 = 25.0, "cm", Range(10.0, 80.0), Printed("§4.6"), "Anything nearer than this is an obstacle.";
        foldback_latch: bool = true, "", Switch, Ours, "Keep a sensor near that jumps from near to far: below 10 cm it lies.";
        foldback_cm: f64 = 14.0, "cm", Range(10.0, 25.0), Ours, "A sensor that was nearer than this may fold back.";
        foldback_clear_s: f64 = 0.5, "s", Range(0.0, 10.0), Ours, "Clear readings for this long release the latch.";
        foldback_retreat_m: f64 = 0.05, "m", Range(0.0, 1.0), Ours, "Backing off by this much releases the latch.";
        reaction_s: f64 = 0.358, "s", Range(0.1, 5.0), Assumed, "Sensor, scan, pulse and motor lag from sighting to standstill.";
    }
}

config_section! {
    /// A-to-B (§4.10).
    Goto "goto" {
        law: GotoLaw = GotoLaw::Hysteresis, "", OneOf(&["hysteresis", "published"]), Ours, "Table 4 as printed, or with our hysteresis.";
        reference_rpm: f64 = 13.0, "rpm", Range(1.0, WheelRpm::MAX), Printed("§4.10"), "Wheel speed V.";
        kp: f64 = 195.0, "counts/deg", Range(1.0, 5000.0), Printed("§4.10"), "Steering gain.";
        tolerance_m: f64 = 0.20, "m", Range(0.01, 5.0), Printed("§4.10"), "Arrived when both errors are at most this.";
        hysteresis_deg: f64 = 5.0, "deg", Range(0.0, 22.0), Ours, "A slice is kept until the bearing is this far outside it.";
    }
}

config_section! {
    /// Wander (§4.6, Fig. 13).
    Wander "wander" {
        reference_rpm: f64 = 13.0, "rpm", Range(1.0, WheelRpm::MAX), Printed("§4.10 (V)"), "Wheel speed ahead and in reverse.";
        reverse_s: f64 = 6.0, "s", Range(0.1, 60.0), Printed("§4.6"), "How long it reverses while turning.";
        pause_s: f64 = 2.0, "s", Range(0.0, 60.0), Printed("§5.2"), "How long it then stands.";
        rear_check: bool = true, "", Switch, Ours, "End the reversing at an obstacle behind.";
        sides: String = "alternate".to_owned(), "", OneOf(&["alternate", "right", "left"]), Ours, "Which way it turns while reversing.";
    }
}

config_section! {
    /// Teleoperation over the network.
    Teleop "teleop" {
        max_rpm: f64 = 23.0, "rpm", Range(1.0, WheelRpm::MAX), Ours, "Setpoints are cut to this: 0.2 m/s, so that two trucks head-on can both stop.";
        lifetime_ms: u32 = 200, "ms", Range(20.0, 200.0), Ours, "How long a setpoint lives on the robot's own clock.";
    }
}

config_section! {
    /// Odometry (§4.9).
    Odometry "odometry" {
        keep_pose: bool = true, "", Switch, Ours, "Keep pose and yaw when the remote control hands over to automatic.";
    }
}

/// All constants of one vehicle.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleConfig {
    /// The body.
    pub geometry: Geometry,
    /// The encoder.
    pub encoder: Encoder,
    /// The speed controller.
    pub speed: Speed,
    /// The steering servos.
    pub steering: SteeringServos,
    /// The range finders.
    pub infrared: Infrared,
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
}

impl VehicleConfig {
    /// Every parameter with its present value, section by section.
    #[must_use]
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut all = self.geometry.parameters();
        all.extend(self.encoder.parameters());
        all.extend(self.speed.parameters());
        all.extend(self.steering.parameters());
        all.extend(self.infrared.parameters());
        all.extend(self.obstacle.parameters());
        all.extend(self.goto.parameters());
        all.extend(self.wander.parameters());
        all.extend(self.teleop.parameters());
        all.extend(self.odometry.parameters());
        all
    }

    /// Checks each parameter against its range, then what only holds between two of them.
    ///
    /// # Errors
    /// The first violation, naming field, value and what is allowed.
    pub fn validate(&self) -> Result<(), ConfigError> {
        crate::config::validate(&self.parameters())?;
        let admitted_rpm = self.admitted_mps() / self.mps_per_rpm();
        for (name, rpm) in [
            ("goto.reference_rpm", self.goto.reference_rpm),
            ("wander.reference_rpm", self.wander.reference_rpm),
            ("teleop.max_rpm", self.teleop.max_rpm),
        ] {
            if rpm > admitted_rpm {
                return Err(ConfigError::Conflict {
                    name: name.into(),
                    value: format!("{rpm:?}"),
                    reason: format!(
                        "the {} cm obstacle rule stops in time only up to {admitted_rpm:.1} rpm; \
                         raise obstacle.threshold_cm for more",
                        self.obstacle.threshold_cm
                    ),
                });
            }
        }
        Ok(())
    }

    /// Metres per second at one wheel rpm.
    #[must_use]
    pub fn mps_per_rpm(&self) -> f64 {
        PI * self.geometry.wheel_diameter_m / 60.0
    }

    /// The fastest speed that the obstacle rule can stop from without contact, in m/s: what is left
    /// of the threshold above the sensor's blind zone, over the reaction time of the whole path.
    #[must_use]
    pub fn admitted_mps(&self) -> f64 {
        let room_m = (self.obstacle.threshold_cm - self.infrared.near_cm) / 100.0;
        room_m.max(0.0) / self.obstacle.reaction_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_speed_that_the_obstacle_rule_cannot_stop_is_refused() {
        let mut config = VehicleConfig::default();
        config.teleop.max_rpm = 60.0;
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("teleop.max_rpm") && error.contains("threshold_cm"), "{error}");
        config.obstacle.threshold_cm = 40.0;
        config.validate().unwrap();
    }
}
