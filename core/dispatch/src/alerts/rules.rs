//! What needs a person, and when: the rules, their thresholds and their words.
//!
//! Words and remedies are those of [`texts`], as every screen has them.

use super::RobotPresence;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Alert, AlertKind, BatteryLevel, Fault, Latch, MAX_ALERT_TEXT, RobotState, StopReason, Suspension,
    SuspensionCause, TaskEvent, TaskState, texts,
};

/// A robot that is not heard for this long is silent: nothing is known of it. As [`Settings::silent_ms`].
///
/// [`Settings::silent_ms`]: crate::Settings::silent_ms
pub(super) const SILENT_MS: u64 = 1_500;

/// For these reasons a robot with a goal gets nowhere by itself; it is not blocked while it plans or changes direction.
const HINDERS: [StopReason; 8] = [
    StopReason::WayBlocked,
    StopReason::ObstacleFront,
    StopReason::ObstacleRear,
    StopReason::PoseUncertain,
    StopReason::InKeepOut,
    StopReason::Stalled,
    StopReason::WaitingForTraffic,
    StopReason::GivingWay,
];

/// Which rules are on, and their thresholds; times in ms, `None` = the rule is off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rules {
    /// A stop is latched.
    pub latched: bool,
    /// A robot is not heard for this long.
    pub gone_ms: Option<u64>,
    /// A task failed for good.
    pub task_failed: bool,
    /// A battery is at this level or lower.
    pub battery: Option<BatteryLevel>,
    /// A robot with a goal gets nowhere for this long.
    pub blocked_ms: Option<u64>,
    /// The dispatcher assigns nothing, or not all.
    pub suspended: bool,
    /// A robot has another map than the fleet for this long.
    pub map_mismatch_ms: Option<u64>,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            latched: true,
            // Robots that restart are away for some seconds. Chosen, not measured, as the other times.
            gone_ms: Some(10_000),
            task_failed: true,
            battery: Some(BatteryLevel::Warn),
            blocked_ms: Some(60_000),
            suspended: true,
            // A map that is changed reaches all robots within its 30 s.
            map_mismatch_ms: Some(40_000),
        }
    }
}

/// A battery's level as files and messages write it.
const fn level_name(level: BatteryLevel) -> &'static str {
    match level {
        BatteryLevel::Unknown => "unknown",
        BatteryLevel::Ok => "ok",
        BatteryLevel::Warn => "warn",
        BatteryLevel::Finish => "finish",
        BatteryLevel::Critical => "critical",
    }
}

/// Whose alert a condition is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Cause {
    pub(super) kind: AlertKind,
    pub(super) robot: Option<Name>,
    pub(super) subject: Option<String>,
}

impl Cause {
    pub(super) fn of(alert: &Alert) -> Self {
        // A task is not told by its robot: when it is queued again it has none.
        let robot = alert.robot.clone().filter(|_| alert.kind != AlertKind::TaskFailed);
        Self { kind: alert.kind, robot, subject: alert.subject.clone() }
    }

    pub(super) fn of_task(event: &TaskEvent) -> Self {
        Self { kind: AlertKind::TaskFailed, robot: None, subject: Some(event.task.to_string()) }
    }

    fn of_robot(kind: AlertKind, robot: &Name, subject: Option<String>) -> Self {
        Self { kind, robot: Some(robot.clone()), subject }
    }
}

/// Something that holds now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Condition {
    pub(super) cause: Cause,
    /// Which robot the alert names.
    pub(super) robot: Option<Name>,
    /// It has to hold for this long.
    pub(super) after_ms: u64,
    pub(super) text: String,
    pub(super) remedy: String,
}

impl Rules {
    /// What a robot's state says.
    pub(super) fn of_state(&self, state: &RobotState) -> Vec<Condition> {
        let mut found = Vec::new();
        if self.latched {
            found.extend(state.latches.iter().map(|latch| Condition {
                cause: Cause::of_robot(AlertKind::Latched, &state.robot, Some(latch.latch.to_string())),
                robot: Some(state.robot.clone()),
                after_ms: 0,
                text: format!("{} latched: {}, by {}", state.robot, latch.latch.text(), latch.by),
                remedy: latch.remedy(state),
            }));
        }
        found.extend(self.of_battery(state));
        found.extend(self.of_standstill(state));
        found.extend(self.of_map(state));
        found
    }

    fn of_battery(&self, state: &RobotState) -> Option<Condition> {
        let level = state.battery_level;
        let latched = state.latches.iter().any(|latch| latch.latch == Latch::BatteryCritical);
        // The latch says the same.
        if level < self.battery? || (latched && self.latched) {
            return None;
        }
        let fault = if level == BatteryLevel::Critical { Fault::BatteryCritical } else { Fault::BatteryLow };
        let volts = state.battery_v.map(|volts| format!(" ({volts:.1} V)")).unwrap_or_default();
        Some(Condition {
            cause: Cause::of_robot(AlertKind::Battery, &state.robot, Some(level_name(level).to_owned())),
            robot: Some(state.robot.clone()),
            after_ms: 0,
            text: format!("{} {}{volts}", state.robot, fault.text()),
            remedy: fault.remedy().to_owned(),
        })
    }

    fn of_standstill(&self, state: &RobotState) -> Option<Condition> {
        let after_ms = self.blocked_ms?;
        let under_way = state.goal.as_ref().is_some_and(|goal| !goal.status.is_final());
        if !under_way || !state.latches.is_empty() {
            return None;
        }
        let reason = state.stopped_because.iter().find(|reason| HINDERS.contains(reason))?;
        Some(Condition {
            cause: Cause::of_robot(AlertKind::Blocked, &state.robot, None),
            robot: Some(state.robot.clone()),
            after_ms,
            text: format!("{} makes no progress for {} s: {}", state.robot, after_ms / 1000, reason.text()),
            remedy: texts::for_robot(reason.remedy().unwrap_or_default(), &state.robot),
        })
    }

    fn of_map(&self, state: &RobotState) -> Option<Condition> {
        let after_ms = self.map_mismatch_ms?;
        let map = state.nav.map.as_ref()?;
        let fleets = map.fleet_hash.as_ref()?;
        Some(Condition {
            cause: Cause::of_robot(AlertKind::MapMismatch, &state.robot, None),
            robot: Some(state.robot.clone()),
            after_ms,
            text: format!(
                "{} has another map than the fleet: {} ({}), not {fleets}; no planned goals",
                state.robot, map.name, map.hash
            ),
            remedy: format!("stop {0} so that it takes the fleet's map; else restart its agent", state.robot),
        })
    }

    /// What a change of a task says.
    pub(super) fn of_task(&self, event: &TaskEvent) -> Option<Condition> {
        if !self.task_failed || event.step.state != TaskState::Failed {
            return None;
        }
        let (task, step) = (event.task, &event.step);
        let on = step.robot.as_ref().map(|robot| format!(" on {robot}")).unwrap_or_default();
        let why = step.reason.as_ref().map(|why| format!(": {why}")).unwrap_or_default();
        Some(Condition {
            cause: Cause::of_task(event),
            robot: step.robot.clone(),
            after_ms: 0,
            text: format!("task {task} failed{on}{why}"),
            remedy: format!(
                "`fleet-cli task {task}` shows its history; `fleet-cli retry {task}` queues it again"
            ),
        })
    }

    /// What a robot's silence says.
    pub(super) fn of_presence(&self, now_ms: u64, name: &Name, it: RobotPresence) -> Option<Condition> {
        let after_ms = self.gone_ms?.max(SILENT_MS);
        let silent_ms = now_ms.saturating_sub(it.last_heard_ms);
        if silent_ms < after_ms || !(it.expected || it.met) {
            return None;
        }
        let network = StopReason::LinkLost.remedy().unwrap_or_default();
        Some(Condition {
            cause: Cause::of_robot(AlertKind::Gone, name, None),
            robot: Some(name.clone()),
            after_ms: 0,
            text: format!("{name} is missing: no message for {} s", after_ms / 1000),
            remedy: format!("check whether it is switched on; {}", texts::for_robot(network, name)),
        })
    }

    /// What the dispatcher has suspended.
    pub(super) fn of_suspensions(&self, suspended: &[Suspension]) -> Vec<Condition> {
        let of = |one: &Suspension| {
            let subject = match &one.cause {
                SuspensionCause::FleetStop { .. } => "fleet_stop".to_owned(),
                SuspensionCause::OtherMap { of, .. } => {
                    format!("tasks of map {}", of.as_deref().unwrap_or("unknown"))
                }
            };
            Condition {
                cause: Cause { kind: AlertKind::Suspended, robot: None, subject: Some(subject) },
                robot: None,
                after_ms: 0,
                text: one.text(),
                remedy: one.cause.remedy().to_owned(),
            }
        };
        if self.suspended { suspended.iter().map(of).collect() } else { Vec::new() }
    }
}

/// As long as a text may be: a robot's words can be longer.
pub(super) fn cut(mut text: String) -> String {
    if text.len() > MAX_ALERT_TEXT {
        let most = MAX_ALERT_TEXT - '…'.len_utf8();
        let end = (0..=most).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
        text.truncate(end);
        text.push('…');
    }
    text
}
