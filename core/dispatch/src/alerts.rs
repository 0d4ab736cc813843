//! What needs a person: rules over what the dispatcher sees, and the list that they make.
//!
//! ```text
//!   states, tasks, presence, suspensions ──► rules ──► conditions ──► AlertBook ──► FleetAlerts
//!   a person acknowledges ──────────────────────────────────────────► AlertBook ──► changes, one by one
//! ```
//!
//! A *condition* is what a rule finds now; its *cause* says which alert is its. An alert is raised when its condition
//! has held long enough, once, and ends when the condition is over. Of a robot that is not heard nothing is known: its
//! alerts stay as they are, and none but "gone" is raised. Times are ms since 1970 and never go back within a run.

mod rules;

pub use rules::Rules;

use crate::tracked_robot::TrackedRobot;
use rules::{Cause, Condition};
use std::collections::{BTreeMap, VecDeque};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    AckBody, AckReply, AckRequest, Acknowledged, Alert, AlertKind, FleetAlerts, MAX_ALERTS, RobotState,
    Suspension, TaskEvent, TaskState,
};

/// Ended alerts that stay readable; the oldest are forgotten first.
const KEEP_ENDED: usize = 100;
/// A robot that gets nowhere may move a little now and then: what was blocked is free after this long.
const BLOCKED_LINGERS_MS: u64 = 3_000;

/// What is known of a robot's presence.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RobotPresence {
    /// The roster names it.
    pub expected: bool,
    /// It has said something in this run.
    pub met: bool,
    /// When its last state came; before the first, when we began to listen.
    pub last_heard_ms: u64,
}

impl From<&TrackedRobot> for RobotPresence {
    fn from(robot: &TrackedRobot) -> Self {
        Self { expected: robot.in_roster, met: robot.observed.is_some(), last_heard_ms: robot.last_heard_ms }
    }
}

/// What has become of an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AlertStep {
    /// It is new.
    Raised,
    /// A person has acknowledged it.
    Acknowledged,
    /// What it was about is over.
    Ended,
}

impl AlertStep {
    /// As programs read it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Raised => "raised",
            Self::Acknowledged => "acknowledged",
            Self::Ended => "ended",
        }
    }
}

/// A change of the list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AlertChange {
    /// What has become of it.
    pub step: AlertStep,
    /// As it is now.
    pub alert: Alert,
}

/// A condition over time.
#[derive(Debug, Clone, Copy)]
struct Watched {
    since_ms: u64,
    seen_ms: u64,
    /// Its alert; `None` = it has not held long enough, or there was no room.
    alert: Option<u64>,
    /// There was no room.
    dropped: bool,
}

/// All alerts, and what may become one.
#[derive(Debug)]
pub struct AlertBook {
    rules: Rules,
    alerts: VecDeque<Alert>,
    last_id: u64,
    left_out: u64,
    watched: BTreeMap<Cause, Watched>,
    /// What each robot's last state says.
    of_states: BTreeMap<Name, Vec<Condition>>,
    changes: VecDeque<AlertChange>,
}

impl AlertBook {
    /// Goes on with the alerts of the run before, oldest first.
    #[must_use]
    pub fn new(now_ms: u64, rules: Rules, kept: impl IntoIterator<Item = Alert>) -> Self {
        let alerts: VecDeque<Alert> = kept.into_iter().collect();
        let open = alerts.iter().filter(|alert| alert.ended_ms.is_none());
        let watched = open.map(|alert| {
            let known = Some(alert.id);
            let since_ms = alert.since_ms;
            (Cause::of(alert), Watched { since_ms, seen_ms: now_ms, alert: known, dropped: false })
        });
        Self {
            rules,
            last_id: alerts.iter().map(|alert| alert.id).max().unwrap_or(0),
            left_out: 0,
            watched: watched.collect(),
            of_states: BTreeMap::new(),
            changes: VecDeque::new(),
            alerts,
        }
    }

    /// A robot's state.
    pub fn state(&mut self, state: &RobotState) {
        let conditions = self.rules.of_state(state);
        match self.of_states.get_mut(&state.robot) {
            Some(before) => *before = conditions,
            None => drop(self.of_states.insert(state.robot.clone(), conditions)),
        }
    }

    /// A task has changed.
    pub fn task(&mut self, now_ms: u64, event: &TaskEvent) {
        let cause = Cause::of_task(event);
        if event.step.state != TaskState::Failed {
            // It was queued again.
            if let Some(id) = self.watched.remove(&cause).and_then(|watched| watched.alert) {
                self.end(now_ms, id);
            }
        } else if let Some(condition) = self.rules.of_task(event) {
            self.hold(now_ms, condition);
        }
    }

    /// Raises and ends what is due. `robots` are all that are known, and what is known of their presence.
    pub fn step<'a>(
        &mut self,
        now_ms: u64,
        robots: impl IntoIterator<Item = (&'a Name, RobotPresence)>,
        suspended: &[Suspension],
    ) {
        let robots: BTreeMap<&Name, RobotPresence> = robots.into_iter().collect();
        let silent = |name: &Name| {
            robots.get(name).is_none_or(|it| now_ms.saturating_sub(it.last_heard_ms) >= rules::SILENT_MS)
        };
        let mut found: Vec<Condition> = self.rules.of_suspensions(suspended);
        found.extend(robots.iter().filter_map(|(name, it)| self.rules.of_presence(now_ms, name, *it)));
        let heard = self.of_states.iter().filter(|(name, _)| !silent(name));
        found.extend(heard.flat_map(|(_, conditions)| conditions.iter().cloned()));
        for condition in found {
            self.hold(now_ms, condition);
        }
        let over: Vec<Cause> = self
            .watched
            .iter()
            .filter(|(cause, watched)| {
                let lingers_ms = if cause.kind == AlertKind::Blocked { BLOCKED_LINGERS_MS } else { 0 };
                let unseen = now_ms.saturating_sub(watched.seen_ms) > lingers_ms;
                unseen && self.is_over(cause, watched, &robots, &silent)
            })
            .map(|(cause, _)| cause.clone())
            .collect();
        for cause in over {
            if let Some(id) = self.watched.remove(&cause).and_then(|watched| watched.alert) {
                self.end(now_ms, id);
            }
        }
    }

    /// Whether a condition that no rule finds now is over, and not just unknown.
    fn is_over(
        &self,
        cause: &Cause,
        watched: &Watched,
        robots: &BTreeMap<&Name, RobotPresence>,
        silent: &impl Fn(&Name) -> bool,
    ) -> bool {
        match (&cause.robot, cause.kind) {
            // What has failed stays so until it is acknowledged or queued again.
            (_, AlertKind::TaskFailed) => false,
            (None, _) => true,
            (Some(robot), _) if !silent(robot) && self.of_states.contains_key(robot) => true,
            // Nothing is known of it: what was not raised is forgotten, what a person has seen ends where nobody
            // expects the robot.
            (Some(robot), _) => match watched.alert {
                None => true,
                Some(id) => {
                    let expected = robots.get(robot).is_some_and(|it| it.expected);
                    !expected && self.get(id).is_none_or(|alert| alert.acknowledged.is_some())
                }
            },
        }
    }

    /// A condition holds.
    fn hold(&mut self, now_ms: u64, condition: Condition) {
        let Condition { cause, robot, after_ms, text, remedy } = condition;
        let new = Watched { since_ms: now_ms, seen_ms: now_ms, alert: None, dropped: false };
        let watched = self.watched.entry(cause.clone()).or_insert(new);
        watched.seen_ms = now_ms;
        let due = now_ms.saturating_sub(watched.since_ms) >= after_ms;
        if watched.alert.is_some() || watched.dropped || !due {
            return;
        }
        let since_ms = watched.since_ms;
        if !self.has_room() {
            self.left_out += 1;
            if cause.kind == AlertKind::TaskFailed {
                // It is told once.
                self.watched.remove(&cause);
            } else if let Some(watched) = self.watched.get_mut(&cause) {
                watched.dropped = true;
            }
            return;
        }
        self.last_id += 1;
        let alert = Alert {
            id: self.last_id,
            kind: cause.kind,
            robot,
            subject: cause.subject.clone(),
            text: rules::cut(text),
            remedy: rules::cut(remedy),
            since_ms,
            acknowledged: None,
            ended_ms: None,
        };
        if let Some(watched) = self.watched.get_mut(&cause) {
            watched.alert = Some(alert.id);
        }
        self.changes.push_back(AlertChange { step: AlertStep::Raised, alert: alert.clone() });
        self.alerts.push_back(alert);
    }

    /// Room for one more: an ended one goes for it.
    fn has_room(&mut self) -> bool {
        if self.alerts.len() < MAX_ALERTS {
            return true;
        }
        let ended = self.alerts.iter().position(|alert| alert.ended_ms.is_some());
        ended.and_then(|at| self.alerts.remove(at)).is_some()
    }

    fn get(&self, id: u64) -> Option<&Alert> {
        self.alerts.iter().find(|alert| alert.id == id)
    }

    fn end(&mut self, now_ms: u64, id: u64) {
        let open = |alert: &&mut Alert| alert.id == id && alert.ended_ms.is_none();
        let Some(alert) = self.alerts.iter_mut().find(open) else { return };
        alert.ended_ms = Some(now_ms);
        self.changes.push_back(AlertChange { step: AlertStep::Ended, alert: alert.clone() });
        let ended = self.alerts.iter().filter(|alert| alert.ended_ms.is_some()).count();
        if ended > KEEP_ENDED {
            let oldest = self.alerts.iter().position(|alert| alert.ended_ms.is_some());
            oldest.and_then(|at| self.alerts.remove(at));
        }
    }

    /// A person has seen alerts; `by` is their client. The same again changes nothing.
    pub fn acknowledge(&mut self, now_ms: u64, by: &Name, request: &AckRequest) -> AckReply {
        let ids: Vec<u64> = match &request.body {
            AckBody::Alerts { ids } => ids.clone(),
            AckBody::All {} => {
                self.alerts.iter().filter(|alert| alert.is_open()).map(|alert| alert.id).collect()
            }
        };
        let mut reply = AckReply::default();
        for id in ids {
            let Some(alert) = self.alerts.iter_mut().find(|alert| alert.id == id) else {
                reply.unknown.push(id);
                continue;
            };
            if !alert.is_open() {
                reply.before.push(id);
                continue;
            }
            let (by, person) = (by.clone(), request.person.clone());
            alert.acknowledged = Some(Acknowledged { by, person, at_ms: now_ms });
            if alert.kind == AlertKind::TaskFailed {
                // Nothing holds on: it has happened.
                alert.ended_ms = Some(now_ms);
                self.watched.remove(&Cause::of(alert));
            }
            self.changes.push_back(AlertChange { step: AlertStep::Acknowledged, alert: alert.clone() });
            reply.acknowledged.push(id);
        }
        reply
    }

    /// The next change that has to be told, oldest first.
    pub fn next_change(&mut self) -> Option<AlertChange> {
        self.changes.pop_front()
    }

    /// All of them.
    #[must_use]
    pub fn list(&self, now_ms: u64) -> FleetAlerts {
        FleetAlerts { at_ms: now_ms, alerts: self.alerts.iter().cloned().collect(), left_out: self.left_out }
    }
}
