//! Why the robot stands: there is always an answer.

use super::{Agent, STICK_NEUTRAL_COUNTS, TurnView};
use crate::faults::stops;
use xtb_control::Mode;
use xtb_protocol::messages::{Latch, StopReason};

impl Agent {
    /// Why the robot stands, what weighs most first: latches, faults, then whoever drives. Empty while
    /// the motor is driven, and never otherwise.
    #[must_use]
    pub fn stopped_because(&self, view: TurnView<'_>) -> Vec<StopReason> {
        if !view.neutral {
            return Vec::new();
        }
        let mut reasons: Vec<StopReason> = self.latches.all().map(Latch::reason).collect();
        reasons.extend(self.faults.present().filter_map(stops));
        reasons.extend(of_mode(self.idle_because, view));
        reasons.extend(self.stands_on_its_path());
        reasons.extend(self.wander_stop_reason());
        if view.over_speed {
            reasons.push(StopReason::OverSpeed);
        }
        if view.outputs.blocked {
            let ahead = view.outputs.demanded > 0.0;
            reasons.push(if ahead { StopReason::ObstacleFront } else { StopReason::ObstacleRear });
        }
        if reasons.is_empty() {
            reasons.push(between(view));
        }
        let mut told = Vec::with_capacity(reasons.len());
        reasons.retain(|reason| {
            !told.contains(reason) && {
                told.push(*reason);
                true
            }
        });
        reasons
    }
}

/// Why the one who drives does not.
fn of_mode(idle_because: StopReason, view: TurnView<'_>) -> Option<StopReason> {
    let outputs = view.outputs;
    match outputs.mode {
        Mode::Idle => Some(idle_because),
        Mode::Wander if outputs.reference_rpm == 0.0 => Some(StopReason::WanderPause),
        Mode::Teleop if outputs.reference_rpm == 0.0 => Some(StopReason::SetpointZero),
        Mode::Manual if outputs.demanded.abs() <= STICK_NEUTRAL_COUNTS => Some(StopReason::RemoteNeutral),
        Mode::Fault => Some(StopReason::RemoteLost),
        _ => None,
    }
}

/// The motor is neutral for a moment within an ordinary drive.
fn between(view: TurnView<'_>) -> StopReason {
    let outputs = view.outputs;
    match outputs.rpm {
        rpm if rpm * outputs.demanded < 0.0 => StopReason::ChangingDirection,
        0.0 => StopReason::Starting,
        _ => StopReason::Coasting,
    }
}
