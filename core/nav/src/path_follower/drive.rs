//! What a step of the follower gets and decides: limits in, speed, curvature and status out.

use xtb_control::{Command, Steering, VehicleConfig, WheelRpm};

/// What counts as reached.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalTolerance {
    /// Along x and along y each, in m.
    pub position_m: f64,
    /// In rad; `None` = any yaw will do.
    pub yaw_rad: Option<f64>,
}

impl Default for GoalTolerance {
    /// The memorandum's box (§4.10), and 15°.
    fn default() -> Self {
        Self { position_m: 0.20, yaw_rad: Some(15_f64.to_radians()) }
    }
}

/// What may be driven now.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveLimits {
    /// As far as this along the path, in m; beyond the path's end = all of it.
    pub way_m: f64,
    /// No faster than this, in m/s; 0 = stand.
    pub cruise_mps: f64,
    /// Room between the body and what stands around, here and a little ahead, in m.
    pub clearance_m: f64,
    /// The body may swing so far to either side, to look between its beams; 0 = not at all.
    pub swing_rad: f64,
}

/// Why it gets nowhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stuck {
    /// The wheels do not turn although they are asked to: an obstacle, or a drive that is held.
    NoMotion,
    /// The wheels turn, but the truck does not get on.
    NoProgress,
    /// It stands at the path's end, outside the tolerance.
    Missed,
    /// The pose, the speed or a limit is no number.
    NotANumber,
}

/// How it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FollowerStatus {
    /// Under way.
    Following,
    /// Stands where the gear changes, turning its wheels.
    AtCusp,
    /// Stands at the end of what is released.
    AtReleaseEnd,
    /// Stands at the goal, within the tolerance.
    Reached,
    /// Too far off the path, and stopping.
    Deviated {
        /// From the path, in m.
        m: f64,
        /// Against the path's heading, in rad.
        heading_rad: f64,
    },
    /// Gets nowhere; it goes on asking, since what holds it may go away.
    Stuck(Stuck),
}

/// What a step decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveCommand {
    /// Of the wheels, negative = astern.
    pub speed_mps: f64,
    /// + = left, as in [`crate::geometry::Piece`].
    pub curvature_per_m: f64,
    /// How far along the path, in m; never beyond the next change of gear.
    pub way_m: f64,
    /// Way to the next stop, in m; negative = overshot.
    pub left_m: f64,
    /// Beside the path, + = to its left (seen along the yaw), in m.
    pub cross_m: f64,
    /// Yaw against the path's, in rad.
    pub heading_rad: f64,
    /// How it goes.
    pub status: FollowerStatus,
}

impl DriveCommand {
    /// As a command for the first level of this vehicle.
    #[must_use]
    pub fn command(&self, vehicle: &VehicleConfig) -> Command {
        let (rpm, steering) = setpoint(self.speed_mps, self.curvature_per_m, vehicle);
        Command::Follow { rpm, steering }
    }
}

/// How this vehicle's wheels turn and stand for a speed (in m/s, negative = astern) and a curvature (+ = left), cut
/// down to what they can.
#[must_use]
pub fn setpoint(speed_mps: f64, curvature_per_m: f64, vehicle: &VehicleConfig) -> (WheelRpm, Steering) {
    let rpm = (speed_mps / vehicle.mps_per_rpm()).clamp(-WheelRpm::MAX, WheelRpm::MAX);
    let wheels_rad = vehicle.wheels_rad(curvature_per_m);
    let steering = (-wheels_rad / vehicle.steering.stop_deg.to_radians()).clamp(-1.0, 1.0);
    (
        WheelRpm::try_from(rpm).unwrap_or(WheelRpm::ZERO),
        Steering::try_from(steering).unwrap_or(Steering::CENTRED),
    )
}
