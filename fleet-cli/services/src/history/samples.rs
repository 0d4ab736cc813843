//! What each robot did since the last time that somebody asked: pure, states and tasks in, samples out.

use crate::dispatch::usage::{Last, Since};
use std::collections::BTreeMap;
use xtb_client::text::reasons;
use xtb_protocol::Name;
use xtb_protocol::messages::{RobotState, StopReason, TaskState, TaskStep};

/// What a robot did in a while.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ActivitySample {
    /// Heard for so long, in s.
    pub heard_s: f64,
    /// With a task or a goal for so long, in s.
    pub active_s: f64,
    /// Driving for so long, in s.
    pub driving_s: f64,
    /// Way, in m.
    pub driven_m: f64,
    /// Tasks that it brought to their end.
    pub done: u64,
    /// Tasks that failed on it.
    pub failed: u64,
    /// Lowest voltage of its battery.
    pub battery_min_v: Option<f64>,
    /// The last voltage.
    pub battery_v: Option<f64>,
    /// How often it stopped, by reason.
    pub stops: BTreeMap<String, u64>,
}

/// A robot as it was last.
#[derive(Debug, Clone, Copy)]
struct Known {
    last: Last,
    /// Why it stands, where that was counted.
    stopped: Option<StopReason>,
}

/// All robots.
#[derive(Debug, Default)]
pub struct Samples {
    known: BTreeMap<Name, Known>,
    due: BTreeMap<Name, ActivitySample>,
}

impl Samples {
    /// A robot's state, and whether it has a task.
    pub fn look(&mut self, state: &RobotState, has_task: bool) {
        let sample = entry(&mut self.due, &state.robot);
        let before = self.known.get(&state.robot).copied();
        if let Some(Since { took_s, driven_m, drives }) = before.and_then(|before| before.last.since(state)) {
            let has_goal = state.goal.as_ref().is_some_and(|goal| !goal.status.is_final());
            sample.heard_s += took_s;
            sample.driven_m += driven_m;
            sample.active_s += if has_task || has_goal { took_s } else { 0.0 };
            sample.driving_s += if drives { took_s } else { 0.0 };
        }
        if let Some(volts) = state.battery_v {
            sample.battery_v = Some(volts);
            sample.battery_min_v = Some(sample.battery_min_v.map_or(volts, |least| least.min(volts)));
        }
        // What needs nobody is part of driving: it neither is a stop nor ends one.
        let reason = state.stopped_because.iter().find(|reason| reason.remedy().is_some());
        let was = before.and_then(|before| before.stopped);
        let stopped = if state.stopped_because.is_empty() { None } else { reason.copied().or(was) };
        // A robot that stood when it was first seen has not stopped now.
        if let Some(reason) = stopped.filter(|_| before.is_some() && stopped != was) {
            *sample.stops.entry(reasons::name(&reason)).or_default() += 1;
        }
        self.known.insert(state.robot.clone(), Known { last: Last::of(state), stopped });
    }

    /// A task has changed.
    pub fn task(&mut self, step: &TaskStep) {
        let Some(robot) = &step.robot else { return };
        match step.state {
            TaskState::Done => entry(&mut self.due, robot).done += 1,
            TaskState::Failed => entry(&mut self.due, robot).failed += 1,
            _ => {}
        }
    }

    /// What has come together since the last time.
    pub fn take(&mut self) -> Vec<(Name, ActivitySample)> {
        let due = std::mem::take(&mut self.due);
        due.into_iter().filter(|(_, sample)| *sample != ActivitySample::default()).collect()
    }
}

fn entry<'a>(due: &'a mut BTreeMap<Name, ActivitySample>, robot: &Name) -> &'a mut ActivitySample {
    if !due.contains_key(robot) {
        due.insert(robot.clone(), ActivitySample::default());
    }
    due.entry(robot.clone()).or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{self, name};

    fn state(tick_ms: u64, y_m: f64, speed_mps: f64, why: &[StopReason]) -> RobotState {
        let mut state = fake::state("xtb-1");
        (state.tick_ms, state.pose.y_m, state.speed_mps) = (tick_ms, y_m, Some(speed_mps));
        state.stopped_because = why.to_vec();
        state
    }

    #[test]
    fn a_stop_counts_once_and_planning_is_none() {
        use StopReason::{GoalReached, NoCommand, Planning, WayBlocked};
        let mut samples = Samples::default();
        samples.look(&state(0, 0.0, 0.0, &[NoCommand]), false);
        samples.look(&state(500, 0.0, 0.0, &[Planning]), true);
        samples.look(&state(1000, 0.2, 0.4, &[]), true);
        samples.look(&state(1500, 0.3, 0.0, &[WayBlocked]), true);
        samples.look(&state(2000, 0.3, 0.0, &[Planning]), true);
        samples.look(&state(2500, 0.3, 0.0, &[WayBlocked]), true);
        samples.look(&state(3000, 0.4, 0.4, &[]), true);
        samples.look(&state(3500, 0.4, 0.0, &[GoalReached]), false);
        let [(robot, sample)] = samples.take().try_into().unwrap();
        assert_eq!(robot, name("xtb-1"));
        let stops: Vec<_> = sample.stops.iter().map(|(reason, count)| (reason.as_str(), *count)).collect();
        assert_eq!(stops, [("goal_reached", 1), ("way_blocked", 1)]);
        assert_eq!((sample.heard_s, sample.active_s, sample.driving_s), (3.5, 3.0, 1.0));
        assert!((sample.driven_m - 0.3).abs() < 1e-9, "{sample:?}");
        assert_eq!(samples.take(), [], "it was taken");
    }

    #[test]
    fn the_lowest_and_the_last_voltage_are_kept() {
        let mut samples = Samples::default();
        for (tick_ms, volts) in [(0, None), (1, Some(7.4)), (2, Some(7.1)), (3, Some(7.3)), (4, None)] {
            let mut state = state(tick_ms, 0.0, 0.0, &[]);
            state.battery_v = volts;
            samples.look(&state, false);
        }
        let sample = &samples.take()[0].1;
        assert_eq!((sample.battery_min_v, sample.battery_v), (Some(7.1), Some(7.3)));
    }
}
