//! Which axles steer: how tightly a car turns, and which point of it its pose means.
//!
//! The pose is that of the *reference point*: the one that moves along the yaw, never sideways, so that odometry
//! (§4.9) and paths hold for it. One motor drives both axles in either case.
//!
//! ```text
//!   both axles:   rear ─┐     ●     ┌─ front     ● midway between the axles   R = L / (2 tan δ)
//!                       └───────────┘
//!   front axle:   rear ─●───────────┐─ front     ● the rear axle's middle     R = L / tan δ
//! ```

use super::VehicleConfig;
use crate::config::{Allowed, Value};
use serde::{Deserialize, Serialize};

/// Which axles steer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Drivetrain {
    /// Both, in opposite directions by the same angle (§2.1): the XTB.
    #[default]
    BothAxles,
    /// The front one alone, as on most cars. The output of the rear servo stays at its centre.
    FrontAxle,
}

impl Drivetrain {
    /// What stands in TOML.
    pub const WORDS: [&'static str; 2] = ["both_axles", "front_axle"];

    /// The word in TOML.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::BothAxles => Self::WORDS[0],
            Self::FrontAxle => Self::WORDS[1],
        }
    }

    /// The way of the rear servo, against its own direction, where the front one is moved by so many counts.
    #[must_use]
    pub fn rear_counts(self, front_counts: f64) -> f64 {
        match self {
            Self::BothAxles => front_counts,
            Self::FrontAxle => 0.0,
        }
    }

    /// From the reference point ahead to the front axle, in m: the radius of a circle is this over the tangent of
    /// the wheels' angle.
    #[must_use]
    pub fn lever_m(self, wheelbase_m: f64) -> f64 {
        match self {
            Self::BothAxles => wheelbase_m / 2.0,
            Self::FrontAxle => wheelbase_m,
        }
    }

    /// From the reference point ahead to the point midway between the axles, in m.
    #[must_use]
    pub fn midway_m(self, wheelbase_m: f64) -> f64 {
        match self {
            Self::BothAxles => 0.0,
            Self::FrontAxle => wheelbase_m / 2.0,
        }
    }

    /// The part of the way that the encoder counts which the reference point goes, with wheels turned by an angle
    /// of this tangent: the motor turns as the mean of both axles, and each wheel rolls along the arc of its own
    /// angle.
    #[must_use]
    pub fn way_part(self, tan: f64) -> f64 {
        let cos = 1.0 / (1.0 + tan * tan).sqrt();
        match self {
            Self::BothAxles => cos,
            Self::FrontAxle => 2.0 * cos / (1.0 + cos),
        }
    }
}

impl Value for Drivetrain {
    fn to_toml(&self) -> String {
        format!("\"{}\"", self.word())
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        true
    }
}

impl VehicleConfig {
    /// From the reference point to the front bumper, in m.
    #[must_use]
    pub fn front_m(&self) -> f64 {
        self.geometry.body_length_m / 2.0 + self.body_ahead_m()
    }

    /// From the reference point back to the rear bumper, in m.
    #[must_use]
    pub fn rear_m(&self) -> f64 {
        self.geometry.body_length_m / 2.0 - self.body_ahead_m()
    }

    /// From the reference point ahead to the middle of the body, in m.
    #[must_use]
    pub fn body_ahead_m(&self) -> f64 {
        self.drivetrain.midway_m(self.geometry.wheelbase_m) + self.geometry.body_ahead_m
    }

    /// Radius of the reference point's smallest circle, in m.
    #[must_use]
    pub fn turning_radius_m(&self) -> f64 {
        self.drivetrain.lever_m(self.geometry.wheelbase_m) / libm::tan(self.steering.stop_deg.to_radians())
    }

    /// The angle of the steered wheels on a circle of this curvature, in rad; both + or both −.
    #[must_use]
    pub fn wheels_rad(&self, curvature_per_m: f64) -> f64 {
        libm::atan(curvature_per_m * self.drivetrain.lever_m(self.geometry.wheelbase_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_front_steered_car_turns_twice_as_wide_about_its_rear_axle() {
        let mut car = VehicleConfig::default();
        let (both_m, front_m) = (car.turning_radius_m(), car.front_m());
        assert!((both_m - 0.3929).abs() < 1e-4 && front_m == 0.25 && car.rear_m() == 0.25);
        car.drivetrain = Drivetrain::FrontAxle;
        assert!((car.turning_radius_m() - 2.0 * both_m).abs() < 1e-12);
        assert!((car.front_m() - (0.25 + 0.143)).abs() < 1e-12);
        assert!((car.rear_m() - (0.25 - 0.143)).abs() < 1e-12);
        let tightest = car.wheels_rad(1.0 / car.turning_radius_m());
        assert!((tightest.to_degrees() - car.steering.stop_deg).abs() < 1e-9);
    }

    #[test]
    fn a_body_that_stands_out_further_ahead_moves_both_bumpers() {
        let mut car = VehicleConfig::default();
        car.geometry.body_ahead_m = 0.05;
        assert!((car.front_m() - 0.30).abs() < 1e-12 && (car.rear_m() - 0.20).abs() < 1e-12);
    }
}
