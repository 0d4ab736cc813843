//! What each robot did while the dispatcher ran: tasks, metres, and how its time was spent.

use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use xtb_control::speed::STANDS_MPS;
use xtb_protocol::Name;
use xtb_protocol::messages::{RobotState, TaskState, TaskStep};

/// A robot that moved this much between two looks was set there, by a fix or by hand.
const LEAP_M: f64 = 0.5;
/// States further apart than this count as this: whoever did not look does not know.
const LONGEST_LOOK_MS: u64 = 2_000;

/// How a robot spent its time, in s, and what came of it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, JsonSchema)]
pub struct Spent {
    /// Tasks that it brought to their end.
    pub done: u64,
    /// Tasks that failed on it for good.
    pub failed: u64,
    /// As its own poses have it.
    pub distance_m: f64,
    /// With a task, and driving.
    pub busy_s: f64,
    /// With a task, and standing.
    pub waiting_s: f64,
    /// Without a task.
    pub idle_s: f64,
}

/// All robots, by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct Usage {
    /// What each did.
    pub robots: BTreeMap<Name, Spent>,
    /// Tasks that failed while no robot had them: by their deadline, or for a new map.
    pub failed_unassigned: u64,
    /// Tasks that have ended in any way, on a robot or not.
    #[serde(skip)]
    pub ended: u64,
    #[serde(skip)]
    last: BTreeMap<Name, Last>,
}

/// A robot at its last state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Last {
    epoch: u64,
    tick_ms: u64,
    x_m: f64,
    y_m: f64,
}

/// What it did since then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Since {
    /// How long that took, in s.
    pub(crate) took_s: f64,
    /// How far it drove, in m.
    pub(crate) driven_m: f64,
    /// Whether it drives now.
    pub(crate) drives: bool,
}

impl Last {
    pub(crate) fn of(state: &RobotState) -> Self {
        let RobotState { epoch, tick_ms, .. } = *state;
        Self { epoch, tick_ms, x_m: state.pose.x_m, y_m: state.pose.y_m }
    }

    /// What it did until this state; `None` = it has restarted.
    pub(crate) fn since(&self, state: &RobotState) -> Option<Since> {
        let now = Self::of(state);
        let took_ms = now.tick_ms.saturating_sub(self.tick_ms).min(LONGEST_LOOK_MS);
        let driven_m = (now.x_m - self.x_m).hypot(now.y_m - self.y_m);
        let drives = state.speed_mps.is_some_and(|speed_mps| speed_mps.abs() > STANDS_MPS);
        // Fixes shift the pose of a robot that stands.
        let driven_m = if drives && driven_m < LEAP_M { driven_m } else { 0.0 };
        (now.epoch == self.epoch).then_some(Since { took_s: took_ms as f64 / 1000.0, driven_m, drives })
    }
}

impl Usage {
    /// A robot's state, and whether it has a task. Time is the robot's: simulated for simulated ones.
    pub fn look(&mut self, state: &RobotState, has_task: bool) {
        let spent = self.robots.entry(state.robot.clone()).or_default();
        let last = self.last.insert(state.robot.clone(), Last::of(state));
        let Some(since) = last.and_then(|last| last.since(state)) else { return };
        let Since { took_s, driven_m, drives } = since;
        spent.distance_m += driven_m;
        match (has_task, drives) {
            (true, true) => spent.busy_s += took_s,
            (true, false) => spent.waiting_s += took_s,
            (false, _) => spent.idle_s += took_s,
        }
    }

    /// A task has changed.
    pub fn step(&mut self, step: &TaskStep) {
        self.ended += u64::from(step.state.is_final());
        let Some(robot) = &step.robot else {
            self.failed_unassigned += u64::from(step.state == TaskState::Failed);
            return;
        };
        let spent = self.robots.entry(robot.clone()).or_default();
        match step.state {
            TaskState::Done => spent.done += 1,
            TaskState::Failed => spent.failed += 1,
            _ => {}
        }
    }

    /// Whether a task has failed, on a robot or before it had one.
    #[must_use]
    pub fn has_failed(&self) -> bool {
        self.failed_unassigned > 0 || self.robots.values().any(|spent| spent.failed > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::TaskState;

    fn name() -> Name {
        Name::new("xtb-1").unwrap()
    }

    fn look(usage: &mut Usage, (epoch, tick_ms): (u64, u64), y_m: f64, speed_mps: f64, has_task: bool) {
        let mut state = xtb_client::fake::state("xtb-1");
        (state.epoch, state.tick_ms, state.pose.y_m) = (epoch, tick_ms, y_m);
        state.speed_mps = Some(speed_mps);
        usage.look(&state, has_task);
    }

    #[test]
    fn time_goes_where_the_robot_spent_it() {
        let mut usage = Usage::default();
        look(&mut usage, (1, 0), 0.0, 0.0, false);
        look(&mut usage, (1, 500), 0.0, 0.0, false);
        look(&mut usage, (1, 1000), 0.2, 0.4, true);
        look(&mut usage, (1, 1250), 0.25, 0.0, true);
        let spent = usage.robots[&name()];
        assert_eq!((spent.idle_s, spent.busy_s, spent.waiting_s), (0.5, 0.5, 0.25));
        assert!((spent.distance_m - 0.2).abs() < 1e-9, "it stood while a fix shifted it");
        // A robot that restarted, was set elsewhere, or was not heard for long has not driven that.
        look(&mut usage, (2, 10), 5.0, 0.4, true);
        look(&mut usage, (2, 20), 8.0, 0.4, true);
        look(&mut usage, (2, 60_020), 8.1, 0.4, true);
        let spent = usage.robots[&name()];
        assert!((spent.distance_m - 0.3).abs() < 1e-9, "{spent:?}");
        assert!((spent.busy_s - 2.51).abs() < 1e-9, "{spent:?}");
    }

    #[test]
    fn a_task_counts_for_the_robot_that_ended_it() {
        let mut usage = Usage::default();
        let step = |state, robot| TaskStep { at_ms: 1, state, robot, legs_done: 0, reason: None };
        usage.step(&step(TaskState::Running, Some(name())));
        usage.step(&step(TaskState::Done, Some(name())));
        usage.step(&step(TaskState::Cancelled, None));
        assert_eq!(usage.robots[&name()], Spent { done: 1, ..Spent::default() });
        assert!(!usage.has_failed());
    }

    #[test]
    fn a_task_that_fails_in_the_queue_counts_as_ended_and_as_failed() {
        let mut usage = Usage::default();
        let step = |state| TaskStep { at_ms: 1, state, robot: None, legs_done: 0, reason: None };
        usage.step(&step(TaskState::Queued));
        assert_eq!((usage.ended, usage.has_failed()), (0, false));
        usage.step(&step(TaskState::Failed));
        assert_eq!((usage.ended, usage.failed_unassigned, usage.has_failed()), (1, 1, true));
        assert!(usage.robots.is_empty());
    }
}
