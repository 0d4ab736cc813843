//! A task as the ledger knows it: its drives, its robot, its state and how it came to it.
//!
//! ```text
//!   queued ──► assigned ──► running ◄──► blocked        done
//!     ▲  ▲        │  └──────────┴──────────┴──────────► failed
//!     │  └────────┴── robot gone, latched, refused, stuck ▲
//!     │           └── taken over, told to stop ─► held ───┤
//!     └── resume ── paused ◄── pause                      │ deadline
//!                        any ──► cancelling ──► cancelled ┘
//! ```

use crate::transition::{TaskEnding, TaskUpdate};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use uuid::Uuid;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Assignment, MAX_LEG, TaskAction, TaskHistory, TaskId, TaskKind, TaskSpec, TaskState, TaskStep, TaskView,
    Waypoint,
};

/// Steps of a history that are kept; of more, those after the first are left out.
pub const MAX_STEPS: usize = 64;

/// A wander that goes on lasts at least so long, in s, however little is left: it ends as every drive does, by its
/// robot. Chosen, not measured.
const SHORTEST_WANDER_S: f64 = 1.0;

/// Characters of a reason that are kept: robots may say more.
pub const MAX_REASON: usize = 400;

/// For which map a task was submitted.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskMap {
    /// By a program that did not write that down.
    #[default]
    Unknown,
    /// While no map was known. The first one that is takes such tasks along.
    NoMap,
    /// For this one.
    Named(String),
}

impl TaskMap {
    /// Its name, if it has one.
    #[must_use]
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Named(name) => Some(name),
            Self::Unknown | Self::NoMap => None,
        }
    }
}

/// On which robot a task is, under which number.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Assigned {
    /// The robot.
    pub robot: Name,
    /// Number of the assignment.
    pub seq: u64,
    /// When, in ms since 1970.
    pub at_ms: u64,
}

/// A task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Task {
    /// Its name.
    pub id: TaskId,
    /// As submitted.
    pub spec: TaskSpec,
    /// By whom.
    pub by: Name,
    /// Id of the submission.
    pub key: Uuid,
    /// When, in ms since 1970.
    pub submitted_ms: u64,
    /// For which map.
    #[serde(default)]
    pub map: TaskMap,
    /// How it stands.
    pub state: TaskState,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
    /// Why, where that is not plain.
    pub reason: Option<String>,
    /// The robot that has it now. A paused or cancelling task has one until that has confirmed.
    pub assigned: Option<Assigned>,
    /// The robot that had it last.
    pub last: Option<Assigned>,
    /// Who holds its robot; only while it is held.
    pub held_by: Option<Name>,
    /// How it ends once its robot has confirmed; only while it is cancelling.
    pub ending: Option<TaskEnding>,
    /// Not to be assigned before this, in ms since 1970.
    pub not_before_ms: u64,
    /// Since when it waits for a robot without having run, in ms since 1970: what it ages by.
    pub waiting_since_ms: u64,
    /// Drives that are done.
    pub legs_done: u32,
    /// When the last one was done, in ms since 1970.
    pub reached_ms: u64,
    /// When it first ran, in ms since 1970.
    pub began_ms: Option<u64>,
    /// How often it has failed on a robot since it was submitted or retried.
    pub failures: u32,
    /// Its history, oldest first.
    pub steps: VecDeque<TaskStep>,
    /// Steps that were left out after the first.
    pub left_out: u64,
}

impl Task {
    /// A task that has just been taken.
    #[must_use]
    pub fn new(id: TaskId, by: Name, key: Uuid, spec: TaskSpec, map: TaskMap, at_ms: u64) -> Self {
        let mut task = Self {
            id,
            spec,
            by,
            key,
            submitted_ms: at_ms,
            map,
            state: TaskState::Queued,
            since_ms: at_ms,
            reason: None,
            assigned: None,
            last: None,
            held_by: None,
            ending: None,
            not_before_ms: 0,
            waiting_since_ms: at_ms,
            legs_done: 0,
            reached_ms: 0,
            began_ms: None,
            failures: 0,
            steps: VecDeque::new(),
            left_out: 0,
        };
        task.note(at_ms, None);
        task
    }

    /// Drives altogether; `None` = until its time is up.
    #[must_use]
    pub fn legs(&self) -> Option<u32> {
        match &self.spec.kind {
            TaskKind::Goto { .. } | TaskKind::Wander { .. } => Some(1),
            TaskKind::Route { points, loops, .. } => {
                let points = u32::try_from(points.len()).unwrap_or(u32::MAX);
                Some(points.saturating_mul(*loops).min(MAX_LEG))
            }
            TaskKind::Patrol { .. } => None,
        }
    }

    /// Whether `done` drives are all, at this time.
    #[must_use]
    pub fn is_all(&self, done: u32, now_ms: u64) -> bool {
        match (&self.spec.kind, self.legs()) {
            (_, Some(legs)) => done >= legs,
            (TaskKind::Patrol { for_s: Some(for_s), .. }, None) => {
                let began_ms = self.began_ms.unwrap_or(now_ms);
                now_ms.saturating_sub(began_ms) as f64 >= for_s * 1000.0 || done >= MAX_LEG
            }
            (_, None) => done >= MAX_LEG,
        }
    }

    /// Where a drive goes; `None` for a wander.
    #[must_use]
    pub fn point(&self, leg: u32) -> Option<&Waypoint> {
        let points = self.spec.kind.points();
        (!points.is_empty()).then(|| &points[leg as usize % points.len()])
    }

    /// What a robot that is asked now shall do for a drive.
    #[must_use]
    pub fn action(&self, leg: u32, now_ms: u64) -> TaskAction {
        match (self.point(leg), &self.spec.kind) {
            (Some(&Waypoint { x_m, y_m, yaw_rad }), _) => TaskAction::Goto { x_m, y_m, yaw_rad, via: None },
            (None, TaskKind::Wander { for_s }) => {
                TaskAction::Wander { for_s: self.wander_left_s(*for_s, now_ms) }
            }
            (None, _) => TaskAction::Wander { for_s: 0.0 },
        }
    }

    /// What is left of a wander: its time runs from when it first ran, as that of a patrol.
    fn wander_left_s(&self, for_s: f64, now_ms: u64) -> f64 {
        match now_ms.saturating_sub(self.began_ms.unwrap_or(now_ms)) {
            0 => for_s,
            gone_ms => (for_s - gone_ms as f64 / 1000.0).max(SHORTEST_WANDER_S),
        }
    }

    /// How long one drive may take without us, in s: a wander at least as long as it lasts.
    #[must_use]
    pub fn finish_s(&self) -> f64 {
        match self.spec.kind {
            TaskKind::Wander { for_s } => self.spec.finish_s.max(for_s),
            _ => self.spec.finish_s,
        }
    }

    /// The drive that is to be done now, as its robot shall know it.
    #[must_use]
    pub fn assignment(&self, ledger: u64) -> Option<Assignment> {
        let Assigned { seq, .. } = self.assigned.as_ref()?;
        Some(Assignment { ledger, task: self.id, assign_seq: *seq, leg: self.legs_done })
    }

    /// The drive after that, if it is to be done without a stop in between.
    #[must_use]
    pub fn next_leg(&self, ledger: u64, now_ms: u64) -> Option<Assignment> {
        let passes = match self.spec.kind {
            TaskKind::Route { dwell_s, .. } | TaskKind::Patrol { dwell_s, for_s: None, .. } => dwell_s == 0.0,
            // When the time of a patrol is up, it ends at the point that it has reached.
            TaskKind::Patrol { .. } | TaskKind::Goto { .. } | TaskKind::Wander { .. } => false,
        };
        let leg = self.legs_done + 1;
        let present = self.assignment(ledger).filter(|_| passes && !self.is_all(leg, now_ms))?;
        Some(Assignment { leg, ..present })
    }

    /// Until when it stands at the point it has reached, in ms since 1970.
    #[must_use]
    pub fn dwells_until_ms(&self) -> u64 {
        let dwell_s = match self.spec.kind {
            TaskKind::Route { dwell_s, .. } | TaskKind::Patrol { dwell_s, .. } => dwell_s,
            TaskKind::Goto { .. } | TaskKind::Wander { .. } => 0.0,
        };
        if self.legs_done == 0 { 0 } else { self.reached_ms.saturating_add((dwell_s * 1000.0) as u64) }
    }

    /// How long it waits for its robot, in ms.
    #[must_use]
    pub fn grace_ms(&self) -> u64 {
        (self.spec.grace_s * 1000.0) as u64
    }

    /// Its robot shall drive for it.
    #[must_use]
    pub fn wants_to_drive(&self) -> bool {
        matches!(self.state, TaskState::Assigned | TaskState::Running | TaskState::Blocked)
    }

    /// Its robot shall stop for it, and has not confirmed yet.
    #[must_use]
    pub fn wants_to_end(&self) -> bool {
        matches!(self.state, TaskState::Paused | TaskState::Cancelling) && self.assigned.is_some()
    }

    /// Its robot shall not drive for it.
    #[must_use]
    pub fn must_stop(&self) -> bool {
        self.wants_to_end() || (self.state == TaskState::Held && self.assigned.is_some())
    }

    /// How it ends: at once, or when its robot has confirmed.
    #[must_use]
    pub fn end(&self, ending: TaskEnding) -> TaskUpdate {
        match self.assigned {
            Some(_) => TaskUpdate::Cancelling { then: ending },
            None => TaskUpdate::Ended { ending },
        }
    }

    /// A robot was chosen.
    pub(crate) fn assign(&mut self, at_ms: u64, robot: Name, seq: u64) {
        self.assigned = Some(Assigned { robot, seq, at_ms });
        self.set_state(at_ms, TaskState::Assigned, None);
    }

    /// A drive is done.
    pub(crate) fn reach(&mut self, at_ms: u64, leg: u32) {
        (self.legs_done, self.reached_ms) = (leg + 1, at_ms);
        self.note(at_ms, None);
    }

    /// It has more points after so many; `false` = it is no route that is driven once, or has another number.
    pub(crate) fn extend(&mut self, at_ms: u64, after: u32, more: &[Waypoint], by: &Name) -> bool {
        let TaskKind::Route { points, loops: 1, .. } = &mut self.spec.kind else { return false };
        if points.len() != after as usize {
            return false;
        }
        points.extend_from_slice(more);
        let why = format!("{} points added by {by}, {} altogether", more.len(), points.len());
        self.note(at_ms, Some(why));
        true
    }

    /// It was taken over to another map.
    pub(crate) fn adopt(&mut self, at_ms: u64, map: &str, by: &Name) {
        let named = TaskMap::Named(map.to_owned());
        if self.map != named {
            self.map = named;
            self.note(at_ms, Some(format!("adopted for map {map} by {by}")));
        }
    }

    /// Its state changes.
    pub(crate) fn apply(&mut self, at_ms: u64, change: &TaskUpdate, why: Option<&str>) {
        let why = why.map(str::to_owned);
        match change {
            TaskUpdate::Running => {
                self.began_ms = self.began_ms.or(Some(at_ms));
                self.set_state(at_ms, TaskState::Running, why);
            }
            TaskUpdate::Blocked => self.set_state(at_ms, TaskState::Blocked, why),
            TaskUpdate::Held { by } => {
                self.set_state(at_ms, TaskState::Held, why);
                self.held_by = by.clone();
            }
            TaskUpdate::Queued { not_before_ms, failed } => {
                self.not_before_ms = *not_before_ms;
                self.failures = if self.state.is_final() { 0 } else { self.failures + u32::from(*failed) };
                if self.state.is_final() {
                    self.began_ms = None;
                }
                self.waiting_since_ms = at_ms;
                self.set_state(at_ms, TaskState::Queued, why);
                self.release();
            }
            TaskUpdate::Paused => self.set_state(at_ms, TaskState::Paused, why),
            TaskUpdate::LetGo => self.release(),
            TaskUpdate::Cancelling { then } => {
                self.set_state(at_ms, TaskState::Cancelling, why);
                self.ending = Some(*then);
            }
            TaskUpdate::Ended { ending } => {
                let state = match ending {
                    TaskEnding::Cancelled => TaskState::Cancelled,
                    TaskEnding::Failed => TaskState::Failed,
                    TaskEnding::Done => TaskState::Done,
                };
                let why = why.or_else(|| self.ending.and(self.reason.clone()));
                self.set_state(at_ms, state, why);
                self.release();
            }
        }
    }

    fn release(&mut self) {
        if let Some(assigned) = self.assigned.take() {
            self.last = Some(assigned);
        }
    }

    fn set_state(&mut self, at_ms: u64, state: TaskState, reason: Option<String>) {
        let reason = reason.map(|reason| match reason.char_indices().nth(MAX_REASON) {
            Some((end, _)) => format!("{}…", &reason[..end]),
            None => reason,
        });
        (self.state, self.since_ms, self.reason) = (state, at_ms, reason.clone());
        (self.held_by, self.ending) = (None, None);
        self.note(at_ms, reason);
    }

    fn note(&mut self, at_ms: u64, reason: Option<String>) {
        if self.steps.len() == MAX_STEPS {
            self.steps.remove(1);
            self.left_out += 1;
        }
        // What is done without a robot was reached by the last one, which was back later.
        let last = self.last.as_ref().filter(|_| self.state == TaskState::Done);
        let robot = self.assigned.as_ref().or(last).map(|assigned| assigned.robot.clone());
        self.steps.push_back(TaskStep { at_ms, state: self.state, robot, legs_done: self.legs_done, reason });
    }

    /// The robot that has it, or had it when it ended.
    #[must_use]
    pub fn robot(&self) -> Option<&Name> {
        match self.state.is_final() {
            true => self.steps.back()?.robot.as_ref(),
            false => self.assigned.as_ref().map(|assigned| &assigned.robot),
        }
    }

    /// Points that it has yet to drive to; none of a wander.
    #[must_use]
    pub fn points_left(&self) -> &[Waypoint] {
        let points = self.spec.kind.points();
        let left = self.legs().map_or(u32::MAX, |legs| legs.saturating_sub(self.legs_done));
        let once = usize::try_from(left).is_ok_and(|left| left < points.len());
        if once { &points[points.len() - left as usize..] } else { points }
    }

    /// As lists show it.
    #[must_use]
    pub fn view(&self) -> TaskView {
        TaskView {
            id: self.id,
            state: self.state,
            since_ms: self.since_ms,
            reason: self.reason.clone(),
            robot: self.robot().cloned(),
            map: self.map.name().map(str::to_owned),
            legs_done: self.legs_done,
            legs: self.legs(),
            failures: self.failures,
            by: self.by.clone(),
            submitted_ms: self.submitted_ms,
            spec: self.spec.clone(),
        }
    }

    /// With its history.
    #[must_use]
    pub fn history(&self) -> TaskHistory {
        TaskHistory {
            task: self.view(),
            steps: self.steps.iter().cloned().collect(),
            left_out: self.left_out,
        }
    }
}
