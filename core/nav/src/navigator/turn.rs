//! What a turn of the navigator knows, and what it decides.

use crate::geometry::Path;
use crate::localization::Estimate;
use xtb_control::infrared::BumperRanges;
use xtb_control::speed::STANDS_MPS;
use xtb_control::{Command, Steering, WheelRpm};
use xtb_protocol::messages::NavPhase;

/// Where to go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetPose {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// On arrival; `None` = any.
    pub yaw_rad: Option<f64>,
}

/// What a turn knows.
#[derive(Debug, Clone, Copy)]
pub struct Sensed<'a> {
    /// Where it is.
    pub estimate: &'a Estimate,
    /// Signed, in m/s.
    pub speed_mps: f64,
    /// The first level holds the motor because of an obstacle.
    pub blocked: bool,
    /// Front bumper, cm.
    pub ir_front_cm: &'a BumperRanges,
    /// Rear bumper, cm.
    pub ir_rear_cm: &'a BumperRanges,
    /// Whether the range finders have been read since the last turn.
    pub scanned: bool,
}

impl Sensed<'_> {
    pub(super) fn stands(&self) -> bool {
        self.speed_mps.abs() < STANDS_MPS
    }
}

/// Why it stands while its goal runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HoldReason {
    /// A path is being planned.
    Planning,
    /// At the end of what is released.
    WaitingForTraffic,
    /// Something unknown is in the way.
    WayBlocked,
    /// It does not know well enough where it is.
    PoseUncertain,
    /// Between two gears.
    AtCusp,
    /// Another robot goes first, and nobody coordinates.
    GivingWay,
}

/// What a turn decides.
#[derive(Debug, Clone, PartialEq)]
pub enum TurnDecision {
    /// For the first level; why, if it stands.
    Go(Command, Option<HoldReason>),
    /// The goal is reached.
    Reached,
    /// It cannot be reached.
    Failed(String),
}

/// Stands with straight wheels.
pub(super) fn stand(why: HoldReason) -> TurnDecision {
    TurnDecision::Go(Command::Follow { rpm: WheelRpm::ZERO, steering: Steering::CENTRED }, Some(why))
}

/// How a path is driven, for the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveProgress<'a> {
    /// `None` while there is none.
    pub path: Option<&'a Path>,
    /// Traffic control's number of it; 0 = its own, or none.
    pub plan: u64,
    /// What it is at.
    pub phase: NavPhase,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released, in m.
    pub release_m: f64,
    /// Beside it, in m, + = to its left.
    pub off_m: f64,
    /// Who has to pass first.
    pub waits_for: Option<&'a str>,
    /// Where something unknown is in the way, (x, y) in m.
    pub blocked_at: Option<[f64; 2]>,
    /// Paths for this goal so far.
    pub plans: u32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path_follower::FollowerSettings;
    use xtb_control::VehicleConfig;
    use xtb_control::speed::wheel_rpm;

    #[test]
    fn two_pulses_a_window_are_standing_and_for_the_follower_only_one() {
        let vehicle = VehicleConfig::default();
        let mps = |pulses: u32| wheel_rpm(&vehicle.encoder, pulses) * vehicle.mps_per_rpm();
        let follower_mps = FollowerSettings::default().standing_mps;
        assert!((mps(1)..mps(2)).contains(&follower_mps), "{follower_mps} m/s");
        assert!((mps(2)..mps(3)).contains(&STANDS_MPS), "{STANDS_MPS} m/s");
    }
}
