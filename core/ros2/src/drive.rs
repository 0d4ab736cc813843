//! A velocity of ROS as a setpoint of a car: forward speed, and curvature within the turning circle.
//!
//! A car cannot turn on the spot: a turn without speed stands, and says so. What is cut down is said too; the words
//! are for `/diagnostics`.

use crate::types::Twist;
use thiserror::Error;
use xtb_control::{Steering, VehicleConfig, WheelRpm};
use xtb_nav::path_follower::setpoint;

/// Slower than this is standing, in m/s.
const STANDING_MPS: f64 = 0.001;
/// Turning more slowly than this without speed is none, in rad/s.
const TURNING_RADPS: f64 = 0.001;
/// Curvature may be asked for beyond the circle by this part before it is said: senders round.
const ROUNDING: f64 = 1.001;

/// What a car is asked for: as `Setpoint` has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Of the wheels, negative = astern.
    pub rpm: WheelRpm,
    /// + = right.
    pub steering: Steering,
    /// What of the velocity is not driven as it was asked for.
    pub notice: Option<Notice>,
}

impl Drive {
    fn standing(notice: Option<Notice>) -> Self {
        Self { rpm: WheelRpm::ZERO, steering: Steering::CENTRED, notice }
    }
}

/// Why a velocity is not driven as it was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum Notice {
    /// A number that is none: it stands.
    #[error("the velocity is not finite: standing")]
    NotFinite,
    /// It stands.
    #[error("a car cannot turn on the spot: {yaw_rate_radps:.2} rad/s at 0 m/s; it needs a speed to turn")]
    TurnOnTheSpot {
        /// Asked for.
        yaw_rate_radps: f64,
    },
    /// It drives along its smallest circle.
    #[error("a radius of {radius_m:.2} m was asked for, the smallest is {smallest_m:.2} m")]
    TooTight {
        /// Asked for.
        radius_m: f64,
        /// Driven.
        smallest_m: f64,
    },
    /// It drives as fast as it may.
    #[error("{asked_mps:.2} m/s were asked for, at most {most_mps:.2} m/s are driven")]
    TooFast {
        /// Asked for.
        asked_mps: f64,
        /// Driven.
        most_mps: f64,
    },
    /// Sideways, up or leaning: left out.
    #[error(
        "a car drives ahead and turns about the vertical only: the other parts of the velocity are left out"
    )]
    OtherAxes,
}

/// A vehicle that follows velocities.
#[derive(Debug, Clone)]
pub struct VelocityLimits {
    vehicle: VehicleConfig,
    smallest_radius_m: f64,
}

impl VelocityLimits {
    /// The car of these settings; no faster than teleoperation.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        Self { vehicle: vehicle.clone(), smallest_radius_m: xtb_nav::Car::of(vehicle).radius_m }
    }

    /// What this velocity asks of it. If several things are cut down, the one is said that changes most.
    #[must_use]
    pub fn drive(&self, twist: &Twist) -> Drive {
        let Twist { linear, angular } = twist;
        let all = [linear.x, linear.y, linear.z, angular.x, angular.y, angular.z];
        if !all.iter().all(|part| part.is_finite()) {
            return Drive::standing(Some(Notice::NotFinite));
        }
        let (speed_mps, yaw_rate_radps) = (linear.x, angular.z);
        let other = [linear.y, linear.z, angular.x, angular.y].iter().any(|part| part.abs() > STANDING_MPS);
        let other = other.then_some(Notice::OtherAxes);
        if speed_mps.abs() < STANDING_MPS {
            let turns = yaw_rate_radps.abs() >= TURNING_RADPS;
            return Drive::standing(turns.then_some(Notice::TurnOnTheSpot { yaw_rate_radps }).or(other));
        }
        let curvature_per_m = yaw_rate_radps / speed_mps;
        let smallest_m = self.smallest_radius_m;
        let tight = curvature_per_m.abs() * smallest_m > ROUNDING;
        let tight = tight.then(|| Notice::TooTight { radius_m: 1.0 / curvature_per_m.abs(), smallest_m });
        let most_rpm = self.vehicle.teleop.max_rpm;
        let most_mps = most_rpm * self.vehicle.mps_per_rpm();
        let fast = speed_mps.abs() > most_mps * ROUNDING;
        let fast = fast.then_some(Notice::TooFast { asked_mps: speed_mps, most_mps });
        let (rpm, steering) = setpoint(speed_mps, curvature_per_m, &self.vehicle);
        match WheelRpm::try_from(rpm.get().clamp(-most_rpm, most_rpm)) {
            Ok(rpm) => Drive { rpm, steering, notice: tight.or(fast).or(other) },
            Err(_) => Drive::standing(Some(Notice::NotFinite)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::types::Vector3;
    use proptest::prelude::*;
    use xtb_nav::path_follower::{DriveCommand, FollowerStatus};

    fn car() -> VelocityLimits {
        VelocityLimits::of(&VehicleConfig::default())
    }

    fn drive(speed_mps: f64, yaw_rate_radps: f64) -> Drive {
        let linear = Vector3 { x: speed_mps, ..Vector3::default() };
        let angular = Vector3 { z: yaw_rate_radps, ..Vector3::default() };
        car().drive(&Twist { linear, angular })
    }

    #[test]
    fn ahead_is_ahead_and_left_is_left() {
        let straight = drive(0.15, 0.0);
        assert!((straight.rpm.get() - 0.15 / VehicleConfig::default().mps_per_rpm()).abs() < 1e-9);
        assert_eq!((straight.steering.get().abs(), straight.notice), (0.0, None));
        assert!(drive(0.15, 0.1).steering.get() < 0.0, "to the left");
        let astern = drive(-0.15, 0.1);
        assert!(
            astern.rpm.get() < 0.0 && astern.steering.get() > 0.0,
            "astern to turn left: wheels to the right"
        );
    }

    #[test]
    fn the_circle_at_full_lock_is_the_smallest() {
        let radius_m = car().smallest_radius_m;
        assert!((radius_m - xtb_nav::Car::of(&VehicleConfig::default()).radius_m).abs() < 1e-12);
        let lock = drive(0.1, 0.1 / radius_m);
        assert!((lock.steering.get() + 1.0).abs() < 1e-9 && lock.notice.is_none(), "{lock:?}");
        let tight = drive(0.1, 0.2 / radius_m);
        assert_eq!(tight.steering.get(), -1.0);
        assert!(matches!(tight.notice, Some(Notice::TooTight { .. })), "{tight:?}");
    }

    #[test]
    fn a_turn_on_the_spot_stands_and_says_so() {
        let turn = drive(0.0, 0.5);
        assert_eq!((turn.rpm.get(), turn.steering.get()), (0.0, 0.0));
        assert!(turn.notice.unwrap().to_string().contains("cannot turn on the spot: 0.50 rad/s"));
        assert_eq!(drive(0.0, 0.0).notice, None);
    }

    #[test]
    fn what_is_too_fast_or_no_number_is_cut_down() {
        let fast = drive(3.0, 0.0);
        assert_eq!(fast.rpm.get(), VehicleConfig::default().teleop.max_rpm);
        assert!(matches!(fast.notice, Some(Notice::TooFast { .. })));
        assert_eq!(drive(f64::NAN, 0.0).notice, Some(Notice::NotFinite));
        let linear = Vector3 { x: 0.1, y: 0.1, z: 0.0 };
        let sideways = car().drive(&Twist { linear, ..Twist::default() });
        assert!(sideways.rpm.get() > 0.0 && sideways.notice == Some(Notice::OtherAxes));
    }

    proptest! {
        #[test]
        fn it_drives_as_the_path_follower_would(speed_mps in -0.2..0.2_f64, curvature_per_m in -2.0..2.0_f64) {
            prop_assume!(speed_mps.abs() > 0.01);
            let command = DriveCommand {
                speed_mps, curvature_per_m, way_m: 0.0, left_m: 0.0, cross_m: 0.0, heading_rad: 0.0,
                status: FollowerStatus::Following,
            };
            let xtb_control::Command::Follow { rpm, steering } = command.command(&VehicleConfig::default()) else {
                panic!("the follower follows");
            };
            let ours = drive(speed_mps, curvature_per_m * speed_mps);
            let limit = VehicleConfig::default().teleop.max_rpm;
            prop_assert!((ours.rpm.get() - rpm.get().clamp(-limit, limit)).abs() < 1e-9);
            prop_assert!((ours.steering.get() - steering.get()).abs() < 1e-9);
        }

        #[test]
        fn nothing_is_out_of_range(x: f64, y: f64, z: f64) {
            let drive = car().drive(&Twist { linear: Vector3 { x, y, z: 0.0 }, angular: Vector3 { x: 0.0, y: 0.0, z } });
            prop_assert!(drive.rpm.get().abs() <= VehicleConfig::default().teleop.max_rpm);
        }
    }
}
