//! What people and programs say to the dispatcher about tasks, and what it answers.

use super::task::{MAX_POINTS, points_in_range};
use super::{Message, Suspension, TaskId, TaskSpec, TaskState, Waypoint, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Tasks of one submission at most, all of which are taken or none.
pub const MAX_SUBMISSION: usize = 500;
/// Longest question or answer, in bytes.
const MAX_BYTES: usize = 4 * 1024 * 1024;
/// Tasks of one [`TaskList`], or changes of one [`DispatchReply`], take at most this many bytes of JSON;
/// postcard is shorter. The others are left out, and counted.
pub const PAGE_BYTES: usize = 1024 * 1024;

/// What is asked of the dispatcher.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// Assign tasks again after an emergency stop of all robots.
    Activate {},
    /// Take the tasks of other maps over to the one that the fleet has now.
    Adopt {},
    /// How the dispatcher stands, without its tasks.
    Status {},
    /// More points for a route that has not ended. The same again changes nothing.
    Extend {
        /// Which.
        task: TaskId,
        /// Points that it has without these. If it has others than the client believes, the request is refused
        /// as [`DispatchCode::Stale`].
        after: u32,
        /// What follows them; 1 to [`MAX_POINTS`] altogether.
        points: Vec<Waypoint>,
    },
}

/// One question to the dispatcher. The same id again, from the same client, submits nothing twice.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DispatchRequest {
    /// Chosen by the client.
    pub id: Uuid,
    /// What is asked.
    pub body: DispatchBody,
}

impl Message for DispatchRequest {
    const NAME: &'static str = "DispatchRequest";
    const VERSION: u32 = 3;
    const PREVIOUS: Option<fn(&Self) -> bool> =
        Some(|request| !matches!(request.body, DispatchBody::Extend { .. }));
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
            DispatchBody::Extend { after, points, .. } => {
                points_in_range(points)?;
                bounded("after", f64::from(*after), 0.0, MAX_POINTS as f64, "")?;
                bounded("points", points.len() as f64, 1.0, MAX_POINTS as f64, "")?;
                1
            }
            DispatchBody::CancelAll {}
            | DispatchBody::Show { .. }
            | DispatchBody::Activate {}
            | DispatchBody::Adopt {}
            | DispatchBody::Status {} => 1,
        };
        bounded("tasks", count as f64, 1.0, MAX_SUBMISSION as f64, "")
    }
}

/// Why the dispatcher refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// The task has other points than the client believes, or would have too many.
    Stale,
}

/// A refusal, for people and programs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DispatchError {
    /// For programs.
    pub code: DispatchCode,
    /// What was wrong; names the task of a submission where one is to blame.
    #[serde(deserialize_with = "text::read")]
    pub message: String,
    /// What to do.
    #[serde(deserialize_with = "text::read")]
    pub hint: String,
}

/// What became of one task of a request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TaskChange {
    /// Which.
    pub id: TaskId,
    /// How it stands now; `None` = there is no such task.
    pub state: Option<TaskState>,
    /// Why it is not as asked.
    pub error: Option<DispatchError>,
}

/// Which tasks were taken over to the fleet's map.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Adopted {
    /// The map; `None` = the fleet has none.
    #[serde(default, deserialize_with = "text::read_option")]
    pub map: Option<String>,
    /// Those that were of another one, oldest first.
    pub tasks: Vec<TaskId>,
}

/// How the dispatcher stands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DispatchStatus {
    /// Number of the ledger.
    pub ledger: u64,
    /// Why the ledger cannot be written now, if it cannot.
    #[serde(default, deserialize_with = "text::read_option")]
    pub ledger_failed: Option<String>,
    /// The map that tasks are taken for; `None` = no map is known.
    #[serde(default, deserialize_with = "text::read_option")]
    pub map: Option<String>,
    /// Tasks that are remembered.
    pub tasks: u64,
    /// Those of them that have not ended.
    pub open: u64,
    /// Those of them that a robot has.
    pub assigned: u64,
    /// Robots that are heard now.
    pub robots: u64,
}

/// What the dispatcher answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum DispatchOutcome {
    /// Taken, and in the ledger; in the order of the submission.
    Submitted(Vec<TaskId>),
    /// What became of each task; of more than [`PAGE_BYTES`] first those that are not as asked.
    Changed(Vec<TaskChange>),
    /// The task and its history.
    Shown(Box<TaskHistory>),
    /// Nothing was done.
    Error(DispatchError),
    /// Tasks are assigned again; the suspension that this has ended, `None` = there was none.
    Activated(Option<Suspension>),
    /// What was taken over.
    Adopted(Adopted),
    /// How it stands.
    Status(DispatchStatus),
}

/// The answer to a request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct DispatchReply {
    /// The request's id; nil if it could not be read.
    pub id: Uuid,
    /// What came of it.
    pub result: DispatchOutcome,
    /// Changes that were made and are not in the answer, for want of room.
    #[serde(default)]
    pub left_out: u64,
    /// What is suspended; empty in the refusal of a question that could not be read.
    #[serde(default)]
    pub suspended: Vec<Suspension>,
}

impl Message for DispatchReply {
    const NAME: &'static str = "DispatchReply";
    const VERSION: u32 = 3;
    const PREVIOUS: Option<fn(&Self) -> bool> = Some(|reply| {
        let stale = |error: &DispatchError| error.code == DispatchCode::Stale;
        match &reply.result {
            DispatchOutcome::Error(error) => !stale(error),
            DispatchOutcome::Changed(changes) => {
                !changes.iter().any(|it| it.error.as_ref().is_some_and(stale))
            }
            _ => true,
        }
    });
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A task as lists show it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TaskView {
    /// Its name.
    pub id: TaskId,
    /// How it stands.
    pub state: TaskState,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
    /// Why, where that is not plain.
    #[serde(default, deserialize_with = "text::read_option")]
    pub reason: Option<String>,
    /// On which robot it is, or ended; `None` = on none.
    pub robot: Option<Name>,
    /// The map that it was submitted for; `None` = none was known then.
    #[serde(default, deserialize_with = "text::read_option")]
    pub map: Option<String>,
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

impl TaskView {
    /// The robot that has the task now. One that waits, is put aside or has ended is on none, whichever robot
    /// had it last.
    #[must_use]
    pub fn on(&self) -> Option<&Name> {
        use TaskState::{Assigned, Blocked, Cancelling, Held, Running};
        let is_on = matches!(self.state, Assigned | Running | Blocked | Held | Cancelling);
        self.robot.as_ref().filter(|_| is_on)
    }
}

/// One change in a task's life.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    #[serde(default, deserialize_with = "text::read_option")]
    pub reason: Option<String>,
}

/// A task and how it came to be so.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TaskHistory {
    /// As it is now.
    pub task: TaskView,
    /// Oldest first.
    pub steps: Vec<TaskStep>,
    /// Steps that were left out after the first, for want of room.
    pub left_out: u64,
}

/// Tasks that are remembered, oldest first: all of them, or as many as there is room for.
///
/// A page (`tasks?after=t17`) has those that follow `t17`; the next page begins after its last one. Ids only
/// grow, so that pages name each task once, as it was at the time of its page. What is published, and
/// answered without `after`, has those with a robot first, then the others that have not ended, then those
/// that ended last: of these what is published has 100 at most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TaskList {
    /// Number of the ledger.
    pub ledger: u64,
    /// When, in ms since 1970.
    pub at_ms: u64,
    /// Why the ledger cannot be written now, if it cannot.
    #[serde(default, deserialize_with = "text::read_option")]
    pub ledger_failed: Option<String>,
    /// The tasks.
    pub tasks: Vec<TaskView>,
    /// Tasks that are remembered and not in here: of a page, those that follow its last one.
    #[serde(default)]
    pub left_out: u64,
    /// What is suspended.
    #[serde(default)]
    pub suspended: Vec<Suspension>,
}

impl TaskList {
    /// The task that a robot has now. It has one at most.
    #[must_use]
    pub fn of_robot(&self, robot: &Name) -> Option<&TaskView> {
        self.tasks.iter().find(|task| task.on() == Some(robot))
    }
}

impl Message for TaskList {
    const NAME: &'static str = "TaskList";
    const VERSION: u32 = 2;
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A task has changed, and the ledger says so.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
