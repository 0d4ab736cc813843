//! What matters to the dispatcher of a robot's state.

use xtb_control::Mode;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{BatteryLevel, GoalStatus, Latch, MapState, RobotState, Via};
use xtb_protocol::{Name, Uuid};
use xtb_robot::faults::stops;

/// The present or last goal of a robot, or the end of an earlier one.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedGoal {
    /// Its id.
    pub id: Uuid,
    /// How it stands.
    pub status: GoalStatus,
    /// Why.
    pub reason: Option<String>,
    /// Who sent it, if it is the present or last one.
    pub by: Option<Name>,
    /// Whether it is driven to along a planned path.
    pub is_planned: bool,
}

/// What a robot last said of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedState {
    /// Which boot.
    pub epoch: u64,
    /// Number of the state in it.
    pub seq: u64,
    /// Where it is.
    pub pose: MapPose,
    /// Who holds its lease.
    pub holder: Option<Name>,
    /// Its goals, the present or last one first.
    pub goals: Vec<ObservedGoal>,
    /// Why it cannot drive, if so.
    pub unavailable: Option<String>,
    /// What its battery measures, in V; `None` = it does not.
    pub battery_v: Option<f64>,
    /// What that means.
    pub battery_level: BatteryLevel,
    /// How long it has stood, in ms; `None` = it drives.
    pub stopped_ms: Option<u64>,
    /// An emergency stop that is latched.
    pub estop: Option<ObservedEstop>,
    /// Which map it has.
    pub map: Option<MapState>,
}

/// An emergency stop that a robot shows as latched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObservedEstop {
    /// The client that called for it; `None` = something else.
    pub by: Option<Name>,
    /// Since it was latched, by the robot's clock.
    pub age_ms: u64,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
}

impl ObservedState {
    pub(super) fn of(now_ms: u64, state: &RobotState) -> Self {
        let present = state.goal.iter().map(|goal| ObservedGoal {
            id: goal.id,
            status: goal.status,
            reason: goal.reason.clone(),
            by: Some(goal.by.clone()),
            is_planned: goal.via == Some(Via::Planned),
        });
        let ended = state.ended_goals.iter();
        let ended = ended.map(|end| ObservedGoal {
            id: end.id,
            status: end.status,
            reason: None,
            by: None,
            is_planned: false,
        });
        let pose = &state.pose;
        let estop = state.latches.iter().find(|set| set.latch == Latch::Estop);
        let estop = estop.map(|set| ObservedEstop {
            by: Name::new(&set.by).ok(),
            age_ms: set.age_ms,
            since_ms: now_ms.saturating_sub(set.age_ms),
        });
        Self {
            epoch: state.epoch,
            seq: state.seq,
            pose: MapPose { x_m: pose.x_m, y_m: pose.y_m, yaw_rad: pose.yaw_rad },
            holder: state.lease.as_ref().map(|lease| lease.holder.clone()),
            goals: present.chain(ended).collect(),
            unavailable: unavailable(state),
            battery_v: state.battery_v,
            battery_level: state.battery_level,
            stopped_ms: state.stopped_age_ms,
            estop,
            map: state.nav.map.clone(),
        }
    }

    /// One that goes on is as old as it was thought to be before: a robot's clock may go slower than ours.
    pub(super) fn after(mut self, before: Option<&Self>) -> Self {
        let before = before
            .filter(|observed| observed.epoch == self.epoch)
            .and_then(|observed| observed.estop.as_ref());
        if let (Some(estop), Some(before)) = (&mut self.estop, before)
            && estop.by == before.by
            && estop.age_ms >= before.age_ms
        {
            estop.since_ms = estop.since_ms.min(before.since_ms);
        }
        self
    }

    /// The goal that runs, if one does.
    #[must_use]
    pub fn running(&self) -> Option<&ObservedGoal> {
        self.goals.first().filter(|goal| !goal.status.is_final())
    }

    /// A goal by its id.
    #[must_use]
    pub fn goal(&self, id: Uuid) -> Option<&ObservedGoal> {
        self.goals.iter().find(|goal| goal.id == id)
    }
}

fn unavailable(state: &RobotState) -> Option<String> {
    if let Some(latch) = state.latches.first() {
        return Some(format!("latched: {}", latch.latch));
    }
    if let Some(fault) = state.faults.iter().find(|fault| stops(fault.fault).is_some()) {
        return Some(format!("fault: {}", fault.fault));
    }
    match (state.mode, state.battery_level) {
        (Mode::Manual, _) => Some("remote control active".to_owned()),
        (_, BatteryLevel::Finish | BatteryLevel::Critical) => Some("battery low".to_owned()),
        _ => None,
    }
}
