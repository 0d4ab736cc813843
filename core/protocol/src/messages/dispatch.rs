//! Tasks, and what people and programs say to the dispatcher about them.

use super::{LinkLoss, Message, angle, bounded, coordinate};
use crate::codec::CodecError;
use crate::keys::Name;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;
use uuid::Uuid;

/// Points of a route at most.
pub const MAX_POINTS: usize = 100;
/// Tasks of one submission at most, all of which are taken or none.
pub const MAX_SUBMISSION: usize = 500;
/// Highest priority.
pub const MAX_PRIORITY: u8 = 9;
/// A list of tasks may be long.
const MAX_BYTES: usize = 16 * 1024 * 1024;

/// What a task is called: `t17`. Counted by the ledger, never given twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct TaskId(u64);

/// A text that is no task's id.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0:?} is not a task: t and a number, such as t17")]
pub struct NoTaskId(String);

impl TaskId {
    /// The task of this number.
    #[must_use]
    pub const fn new(number: u64) -> Self {
        Self(number)
    }

    /// Its number.
    #[must_use]
    pub const fn number(self) -> u64 {
        self.0
    }
}

impl fmt::Display for TaskId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "t{}", self.0)
    }
}

impl std::str::FromStr for TaskId {
    type Err = NoTaskId;

    fn from_str(text: &str) -> Result<Self, NoTaskId> {
        let number = text.strip_prefix('t').filter(|digits| digits.bytes().all(|b| b.is_ascii_digit()));
        let number = number.and_then(|digits| digits.parse().ok());
        number.map(Self).ok_or_else(|| NoTaskId(text.chars().take(40).collect()))
    }
}

impl TryFrom<String> for TaskId {
    type Error = NoTaskId;

    fn try_from(text: String) -> Result<Self, NoTaskId> {
        text.parse()
    }
}

impl From<TaskId> for String {
    fn from(id: TaskId) -> Self {
        id.to_string()
    }
}

/// A place to drive to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Yaw on arrival, counter-clockwise from +x; `None` = any.
    #[serde(default)]
    pub yaw_rad: Option<f64>,
}

fn one() -> u32 {
    1
}

/// What is to be done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TaskKind {
    /// Drive to a point.
    Goto {
        /// Where to.
        to: Waypoint,
    },
    /// Drive along points.
    Route {
        /// In this order.
        points: Vec<Waypoint>,
        /// How often.
        #[serde(default = "one")]
        loops: u32,
        /// How long to stand at each, in s.
        #[serde(default)]
        dwell_s: f64,
    },
    /// Drive along points again and again.
    Patrol {
        /// In this order.
        points: Vec<Waypoint>,
        /// How long to stand at each, in s.
        #[serde(default)]
        dwell_s: f64,
        /// How long altogether, in s; `None` = until cancelled.
        #[serde(default)]
        for_s: Option<f64>,
    },
    /// Wander.
    Wander {
        /// How long, in s.
        for_s: f64,
    },
}

impl TaskKind {
    /// Its name on the wire.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Goto { .. } => "goto",
            Self::Route { .. } => "route",
            Self::Patrol { .. } => "patrol",
            Self::Wander { .. } => "wander",
        }
    }

    /// The points of one round; none of a wander.
    #[must_use]
    pub fn points(&self) -> &[Waypoint] {
        match self {
            Self::Goto { to } => std::slice::from_ref(to),
            Self::Route { points, .. } | Self::Patrol { points, .. } => points,
            Self::Wander { .. } => &[],
        }
    }
}

/// Who may do a task.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Who {
    /// Any robot.
    #[default]
    Any,
    /// This one.
    Robot(Name),
    /// One that bears this tag in the roster.
    Tag(String),
    /// One whose factsheet names this capability.
    Able(String),
}

/// What becomes of a task whose robot somebody else has taken over, or told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OnTakeover {
    /// After the grace period it is queued again, for any robot.
    #[default]
    Requeue,
    /// It waits for this robot, and goes on once that is given back.
    Resume,
    /// It has failed.
    Fail,
}

fn priority() -> u8 {
    5
}

fn retries() -> u32 {
    2
}

fn finish_s() -> f64 {
    300.0
}

fn grace_s() -> f64 {
    30.0
}

/// A task as it is submitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskSpec {
    /// What is to be done.
    pub kind: TaskKind,
    /// 0 = when nothing else is to be done, 9 = first.
    #[serde(default = "priority")]
    pub priority: u8,
    /// When it must be done, in ms since 1970; else it has failed.
    #[serde(default)]
    pub deadline_ms: Option<u64>,
    /// Who may do it.
    #[serde(default)]
    pub who: Who,
    /// How often it is begun anew after it has failed on a robot.
    #[serde(default = "retries")]
    pub retries: u32,
    /// What its robot does when it does not hear the dispatcher.
    #[serde(default)]
    pub on_link_loss: LinkLoss,
    /// How long one drive may take with [`LinkLoss::Finish`], in s.
    #[serde(default = "finish_s")]
    pub finish_s: f64,
    /// When somebody else takes its robot.
    #[serde(default)]
    pub on_takeover: OnTakeover,
    /// How long it waits for a robot that is gone or taken, in s.
    #[serde(default = "grace_s")]
    pub grace_s: f64,
}

impl TaskSpec {
    /// A task with the usual values.
    #[must_use]
    pub fn new(kind: TaskKind) -> Self {
        Self {
            kind,
            priority: priority(),
            deadline_ms: None,
            who: Who::Any,
            retries: retries(),
            on_link_loss: LinkLoss::Halt,
            finish_s: finish_s(),
            on_takeover: OnTakeover::Requeue,
            grace_s: grace_s(),
        }
    }

    /// Checks what the type cannot hold.
    ///
    /// # Errors
    /// The first value that is out of range, and its range.
    pub fn validate(&self) -> Result<(), CodecError> {
        const DAY_S: f64 = 86_400.0;
        for point in self.kind.points() {
            coordinate("x_m", point.x_m)?;
            coordinate("y_m", point.y_m)?;
            point.yaw_rad.map_or(Ok(()), |yaw_rad| angle("yaw_rad", yaw_rad))?;
        }
        match &self.kind {
            TaskKind::Goto { .. } => {}
            TaskKind::Route { points, loops, dwell_s } => {
                bounded("points", points.len() as f64, 1.0, MAX_POINTS as f64, "")?;
                bounded("loops", f64::from(*loops), 1.0, 10_000.0, "")?;
                bounded("dwell_s", *dwell_s, 0.0, DAY_S, "s")?;
            }
            TaskKind::Patrol { points, dwell_s, for_s } => {
                bounded("points", points.len() as f64, 1.0, MAX_POINTS as f64, "")?;
                bounded("dwell_s", *dwell_s, 0.0, DAY_S, "s")?;
                for_s.map_or(Ok(()), |for_s| bounded("for_s", for_s, 0.0, 100.0 * DAY_S, "s"))?;
            }
            TaskKind::Wander { for_s } => bounded("for_s", *for_s, 0.0, DAY_S, "s")?,
        }
        if let Who::Tag(word) | Who::Able(word) = &self.who {
            bounded("length of a tag", word.len() as f64, 1.0, 64.0, "")?;
        }
        bounded("priority", f64::from(self.priority), 0.0, f64::from(MAX_PRIORITY), "")?;
        bounded("retries", f64::from(self.retries), 0.0, 100.0, "")?;
        bounded("finish_s", self.finish_s, 0.0, DAY_S, "s")?;
        bounded("grace_s", self.grace_s, 0.0, DAY_S, "s")
    }
}

/// How a task stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskState {
    /// Waits for a robot.
    Queued,
    /// A robot is chosen and not under way yet.
    Assigned,
    /// Its robot is under way, or stands at a point as it should.
    Running,
    /// Something is in its robot's way.
    Blocked,
    /// Its robot was taken over or told to stop.
    Held,
    /// Somebody has put it aside, until `resume`.
    Paused,
    /// It ends as soon as its robot has confirmed.
    Cancelling,
    /// Done.
    Done,
    /// Could not be done.
    Failed,
    /// Somebody has ended it.
    Cancelled,
}

impl TaskState {
    /// Whether it has ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        matches!(self, Self::Done | Self::Failed | Self::Cancelled)
    }
}

/// What is asked of the dispatcher.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DispatchBody {
    /// Take these, all or none.
    Submit {
        /// 1 to [`MAX_SUBMISSION`].
        tasks: Vec<TaskSpec>,
    },
    /// End them; the answer comes when their robots have confirmed.
    Cancel {
        /// Which.
        tasks: Vec<TaskId>,
    },
    /// Put them aside; their robots stop.
    Pause {
        /// Which.
        tasks: Vec<TaskId>,
    },
    /// Let go on what is paused or held.
    Resume {
        /// Which.
        tasks: Vec<TaskId>,
    },
    /// Queue again what has failed or was cancelled, from where it was.
    Retry {
        /// Which.
        tasks: Vec<TaskId>,
    },
    /// One task with its history.
    Show {
        /// Which.
        task: TaskId,
    },
    /// End all that have not ended.
    CancelAll {},
}

/// One question to the dispatcher. The same id again, from the same client, submits nothing twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DispatchRequest {
    /// Chosen by the client.
    pub id: Uuid,
    /// What is asked.
    pub body: DispatchBody,
}

impl Message for DispatchRequest {
    const NAME: &'static str = "DispatchRequest";
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        let count = match &self.body {
            DispatchBody::Submit { tasks } => {
                tasks.iter().try_for_each(TaskSpec::validate)?;
                tasks.len()
            }
            DispatchBody::Cancel { tasks }
            | DispatchBody::Pause { tasks }
            | DispatchBody::Resume { tasks }
            | DispatchBody::Retry { tasks } => tasks.len(),
            DispatchBody::CancelAll {} | DispatchBody::Show { .. } => 1,
        };
        bounded("tasks", count as f64, 1.0, MAX_SUBMISSION as f64, "")
    }
}

/// Why the dispatcher refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DispatchCode {
    /// Not a message of ours, or of another version.
    Malformed,
    /// A number that is not finite or out of its range.
    OutOfRange,
    /// As many tasks wait as the dispatcher takes.
    QueueFull,
    /// The roster does not know that robot.
    UnknownRobot,
    /// No robot of the roster bears that tag.
    UnknownTag,
    /// No robot that is there can do that.
    UnknownCapability,
    /// The deadline is over already.
    DeadlinePast,
    /// A point lies in a keep-out zone.
    KeepOut,
    /// A point is on top of something on the map, or off it.
    GoalBlocked,
    /// The ledger cannot be written: nothing is taken before it can.
    LedgerFailed,
    /// There is no such task.
    UnknownTask,
    /// The task's state does not allow that.
    WrongState,
    /// The robot has not confirmed yet; the task is ended as soon as it does.
    Unconfirmed,
    /// Too many questions wait for an answer.
    Overloaded,
}

/// A refusal, for people and programs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DispatchError {
    /// For programs.
    pub code: DispatchCode,
    /// What was wrong; names the task of a submission where one is to blame.
    pub message: String,
    /// What to do.
    pub hint: String,
}

/// What became of one task of a request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskChange {
    /// Which.
    pub id: TaskId,
    /// How it stands now; `None` = there is no such task.
    pub state: Option<TaskState>,
    /// Why it is not as asked.
    pub error: Option<DispatchError>,
}

/// What the dispatcher answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DispatchOutcome {
    /// Taken, and in the ledger; in the order of the submission.
    Submitted(Vec<TaskId>),
    /// What became of each task.
    Changed(Vec<TaskChange>),
    /// The task and its history.
    Shown(Box<TaskHistory>),
    /// Nothing was done.
    Error(DispatchError),
}

/// The answer to a request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DispatchReply {
    /// The request's id; nil if it could not be read.
    pub id: Uuid,
    /// What came of it.
    pub result: DispatchOutcome,
}

impl Message for DispatchReply {
    const NAME: &'static str = "DispatchReply";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A task as lists show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskView {
    /// Its name.
    pub id: TaskId,
    /// How it stands.
    pub state: TaskState,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
    /// Why, where that is not plain.
    pub reason: Option<String>,
    /// On which robot it is, or ended.
    pub robot: Option<Name>,
    /// Drives that are done.
    pub legs_done: u32,
    /// Drives altogether; `None` = until the time is up.
    pub legs: Option<u32>,
    /// How often it has failed on a robot.
    pub failures: u32,
    /// Who submitted it.
    pub by: Name,
    /// When, in ms since 1970.
    pub submitted_ms: u64,
    /// As submitted.
    pub spec: TaskSpec,
}

/// One change in a task's life.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskStep {
    /// When, in ms since 1970.
    pub at_ms: u64,
    /// To what.
    pub state: TaskState,
    /// On which robot.
    pub robot: Option<Name>,
    /// Drives that were done then.
    pub legs_done: u32,
    /// Why, where that is not plain.
    pub reason: Option<String>,
}

/// A task and how it came to be so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskHistory {
    /// As it is now.
    pub task: TaskView,
    /// Oldest first.
    pub steps: Vec<TaskStep>,
    /// Steps that were left out after the first, for want of room.
    pub left_out: u64,
}

/// All tasks that are remembered, oldest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskList {
    /// Number of the ledger.
    pub ledger: u64,
    /// When, in ms since 1970.
    pub at_ms: u64,
    /// Why the ledger cannot be written now, if it cannot.
    pub ledger_failed: Option<String>,
    /// The tasks.
    pub tasks: Vec<TaskView>,
}

impl Message for TaskList {
    const NAME: &'static str = "TaskList";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A task has changed, and the ledger says so.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaskEvent {
    /// Number of the ledger.
    pub ledger: u64,
    /// Number of the entry in it.
    pub entry: u64,
    /// Which task.
    pub task: TaskId,
    /// What.
    pub step: TaskStep,
}

impl Message for TaskEvent {
    const NAME: &'static str = "TaskEvent";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_is_called_t_and_a_number() {
        assert_eq!("t17".parse(), Ok(TaskId::new(17)));
        assert_eq!(TaskId::new(17).to_string(), "t17");
        for bad in ["", "t", "17", "t-1", "t+1", "T1", "t99999999999999999999"] {
            assert!(bad.parse::<TaskId>().is_err(), "{bad}");
        }
    }
}
