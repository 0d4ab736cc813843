//! The goals of `navigate_to_pose`, as the clients of an action see them. Pure bookkeeping: what the robot does is
//! told, who is to be answered is returned.
//!
//! ```text
//!  accept ─► ACCEPTED ──executing──► EXECUTING ──end──► SUCCEEDED, ABORTED
//!                └──────── cancel ───────┴──► CANCELING ──end──► CANCELED, SUCCEEDED, ABORTED
//! ```
//! One goal runs at a time: accepting another one aborts it. A result is answered when its goal has ended, not
//! before; ended goals are kept for a while for those who ask late.
//!
//! How the I/O uses it: a `send_goal` request goes to the robot as a goto; if the robot takes it, [`Goals::accept`], else
//! the response says no and nothing has changed. `get_result`: [`Goals::wait`]. `cancel_goal`: [`Goals::cancel`], and the
//! goal that it returns is cancelled on the robot. What the robot's state says of the goal: [`Goals::progress`]. After
//! each of these, [`Goals::status`] is published if it has changed.

use crate::types::{
    CancelCode, CancelGoalRequest, CancelGoalResponse, ERROR_UNKNOWN, GetResultResponse, GoalId, GoalInfo,
    GoalStatusArray, GoalStatusEntry, Status, Time,
};
use xtb_protocol::messages::GoalStatus;

/// Most goals that are remembered; of more, those that ended first are forgotten.
pub const MOST_GOALS: usize = 16;
/// Most requests for a result that wait, over all goals; one more is answered at once, without a result.
pub const MOST_WAITING: usize = 32;
/// For so long an ended goal is remembered, in s: as long as a client may take to ask. Chosen, not measured.
pub const KEPT_S: i64 = 900;

/// The id and the stamp of a request that mean "none".
const NO_GOAL: GoalId = [0; 16];

impl Status {
    /// Whether the goal has ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Succeeded | Self::Canceled | Self::Aborted)
    }
}

/// A request for a result, to be answered with this.
#[derive(Debug)]
pub struct Answer<W> {
    /// Who asked.
    pub to: W,
    /// What is said.
    pub response: GetResultResponse,
}

/// Why a goal was not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotAccepted {
    /// Its id is that of a goal that is known already, or none.
    #[error("this goal id is taken, or none")]
    Id,
}

/// The goals of one robot. `W` is whatever answers a request, such as a query of Zenoh.
#[derive(Debug)]
pub struct Goals<W> {
    /// In the order in which they were accepted; only the last one may not have ended.
    goals: Vec<Goal<W>>,
    turned_away: u64,
}

#[derive(Debug)]
struct Goal<W> {
    id: GoalId,
    accepted: Time,
    status: Status,
    /// When it ended.
    ended: Option<Time>,
    message: String,
    waiting: Vec<W>,
}

impl<W> Default for Goals<W> {
    fn default() -> Self {
        Self { goals: Vec::new(), turned_away: 0 }
    }
}

impl<W> Goals<W> {
    /// The robot has taken this goal. The one before it is aborted; whoever waited for that is returned.
    ///
    /// # Errors
    /// [`NotAccepted`]; nothing has changed then. To be asked beforehand: [`Goals::is_new`].
    pub fn accept(&mut self, now: &Time, id: GoalId) -> Result<Vec<Answer<W>>, NotAccepted> {
        if !self.is_new(&id) {
            return Err(NotAccepted::Id);
        }
        let preempted = self.active().map(|(active, _)| active);
        let answers =
            preempted.map(|active| self.end(now, &active, Status::Aborted, "replaced by a newer goal"));
        self.goals.retain(|goal| {
            goal.ended
                .as_ref()
                .is_none_or(|ended| now.ns().saturating_sub(ended.ns()) <= KEPT_S * 1_000_000_000)
        });
        if self.goals.len() >= MOST_GOALS {
            self.goals.remove(0);
        }
        let (status, ended) = (Status::Accepted, None);
        let (message, waiting) = (String::new(), Vec::new());
        self.goals.push(Goal { id, accepted: now.clone(), status, ended, message, waiting });
        Ok(answers.unwrap_or_default())
    }

    /// Whether a goal may have this id.
    #[must_use]
    pub fn is_new(&self, id: &GoalId) -> bool {
        *id != NO_GOAL && self.goals.iter().all(|goal| goal.id != *id)
    }

    /// The goal that has not ended, and how it stands.
    #[must_use]
    pub fn active(&self) -> Option<(GoalId, Status)> {
        self.goals.last().filter(|goal| !goal.status.is_final()).map(|goal| (goal.id, goal.status))
    }

    /// What the robot says of this goal, `message` in words: reason and remedy of one that failed. Whoever waited for
    /// its end is returned. A goal that has ended stays as it ended.
    pub fn progress(&mut self, now: &Time, id: &GoalId, robot: GoalStatus, message: &str) -> Vec<Answer<W>> {
        let Some((_, before)) = self.active().filter(|(active, _)| active == id) else { return Vec::new() };
        let ended = match robot {
            GoalStatus::Accepted => return Vec::new(),
            GoalStatus::Running | GoalStatus::Blocked => {
                self.set(id, Status::Accepted, Status::Executing);
                return Vec::new();
            }
            GoalStatus::Reached => Status::Succeeded,
            GoalStatus::Cancelled if before == Status::Canceling => Status::Canceled,
            // Somebody else ended it: a stop, teleoperation, another client's goal.
            GoalStatus::Cancelled | GoalStatus::Replaced | GoalStatus::Failed | GoalStatus::Interrupted => {
                Status::Aborted
            }
        };
        self.end(now, id, ended, message)
    }

    /// What of these goals shall end: the response, and the goal that is to be cancelled on the robot.
    #[must_use]
    pub fn cancel(&mut self, request: &CancelGoalRequest) -> (CancelGoalResponse, Option<GoalId>) {
        let GoalInfo { goal_id, stamp } = &request.goal_info;
        let (one, until) = (*goal_id != NO_GOAL, stamp.ns() != 0);
        let chosen = |goal: &Goal<W>| {
            let all = !one && !until;
            all || (one && goal.id == *goal_id) || (until && goal.accepted.ns() <= stamp.ns())
        };
        let active = self.goals.last().filter(|goal| !goal.status.is_final() && chosen(goal));
        let info = active.map(|goal| GoalInfo { goal_id: goal.id, stamp: goal.accepted.clone() });
        let known = self.goals.iter().any(|goal| goal.id == *goal_id);
        let code = match (&info, one && !until) {
            (Some(_), _) | (None, false) => CancelCode::None,
            (None, true) if known => CancelCode::Terminated,
            (None, true) => CancelCode::UnknownGoal,
        };
        let id = info.as_ref().map(|info| info.goal_id);
        if let Some(id) = id {
            self.set(&id, Status::Accepted, Status::Canceling);
            self.set(&id, Status::Executing, Status::Canceling);
        }
        let response =
            CancelGoalResponse { return_code: code as i8, goals_canceling: info.into_iter().collect() };
        (response, id)
    }

    /// Somebody asks for a goal's result: answered at once if it has ended, is not known, or too many wait already.
    pub fn wait(&mut self, id: &GoalId, to: W) -> Option<Answer<W>> {
        let waiting: usize = self.goals.iter().map(|goal| goal.waiting.len()).sum();
        match self.goals.iter_mut().find(|goal| goal.id == *id) {
            None => Some(Answer { to, response: unknown("there is no such goal") }),
            Some(goal) if goal.status.is_final() => Some(Answer { to, response: goal.result() }),
            Some(_) if waiting >= MOST_WAITING => {
                self.turned_away += 1;
                Some(Answer { to, response: unknown("too many wait for results already") })
            }
            Some(goal) => {
                goal.waiting.push(to);
                None
            }
        }
    }

    /// The agent ends: the goal is aborted, and whoever waits is to be answered.
    pub fn shut_down(&mut self, now: &Time) -> Vec<Answer<W>> {
        let active = self.active().map(|(id, _)| id);
        active.map_or_else(Vec::new, |id| self.end(now, &id, Status::Aborted, "the robot's agent ends"))
    }

    /// How all goals stand.
    #[must_use]
    pub fn status(&self) -> GoalStatusArray {
        let entry = |goal: &Goal<W>| GoalStatusEntry {
            goal_info: GoalInfo { goal_id: goal.id, stamp: goal.accepted.clone() },
            status: goal.status as i8,
        };
        GoalStatusArray { status_list: self.goals.iter().map(entry).collect() }
    }

    /// Requests for a result that there was no room for.
    #[must_use]
    pub fn turned_away(&self) -> u64 {
        self.turned_away
    }

    fn set(&mut self, id: &GoalId, from: Status, to: Status) {
        for goal in self.goals.iter_mut().filter(|goal| goal.id == *id && goal.status == from) {
            goal.status = to;
        }
    }

    fn end(&mut self, now: &Time, id: &GoalId, status: Status, message: &str) -> Vec<Answer<W>> {
        let Some(goal) = self.goals.iter_mut().find(|goal| goal.id == *id) else { return Vec::new() };
        (goal.status, goal.ended) = (status, Some(now.clone()));
        message.clone_into(&mut goal.message);
        let response = goal.result();
        let waiting = std::mem::take(&mut goal.waiting).into_iter();
        waiting.map(|to| Answer { to, response: response.clone() }).collect()
    }
}

impl<W> Goal<W> {
    fn result(&self) -> GetResultResponse {
        let error_code = if self.status == Status::Aborted { ERROR_UNKNOWN } else { 0 };
        GetResultResponse { status: self.status as i8, error_code, error_msg: self.message.clone() }
    }
}

fn unknown(message: &str) -> GetResultResponse {
    GetResultResponse {
        status: Status::Unknown as i8,
        error_code: ERROR_UNKNOWN,
        error_msg: message.to_owned(),
    }
}

#[cfg(test)]
mod tests;
