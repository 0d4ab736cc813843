//! Tasks of the dispatcher: what is to be done, by whom, and how it stands.

use super::{LinkLoss, angle, bounded, coordinate, finish_s};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Points of a route at most.
pub const MAX_POINTS: usize = 100;
/// Highest priority.
pub const MAX_PRIORITY: u8 = 9;

/// What a task is called: `t17`. Counted by the ledger, never given twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Who {
    /// Any robot.
    #[default]
    Any,
    /// This one.
    Robot(Name),
    /// One that bears this tag in the roster.
    Tag(#[serde(deserialize_with = "text::read")] String),
    /// One whose factsheet names this capability.
    Able(#[serde(deserialize_with = "text::read")] String),
}

/// What becomes of a task whose robot somebody else has taken over, or told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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

fn grace_s() -> f64 {
    30.0
}

/// A task as it is submitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
        points_in_range(self.kind.points())?;
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

/// Whether points are where one can be asked to drive.
pub(super) fn points_in_range(points: &[Waypoint]) -> Result<(), CodecError> {
    points.iter().try_for_each(|point| {
        coordinate("x_m", point.x_m)?;
        coordinate("y_m", point.y_m)?;
        point.yaw_rad.map_or(Ok(()), |yaw_rad| angle("yaw_rad", yaw_rad))
    })
}

/// How a task stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
