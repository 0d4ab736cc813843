//! Transitions of a task: what changes its state, and what its robot's reports come to.

use serde::{Deserialize, Serialize};
use xtb_protocol::Name;
use xtb_protocol::messages::SuspensionCause;

/// How a task that is being cancelled shall end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaskEnding {
    /// Somebody has ended it.
    Cancelled,
    /// Its deadline is over.
    Failed,
    /// A patrol's time is over.
    Done,
}

/// What becomes of a task.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TaskUpdate {
    /// Its robot is under way.
    Running,
    /// Something is in its robot's way.
    Blocked,
    /// Its robot was taken over by this client, or told to stop (`None`).
    Held {
        /// Who.
        by: Option<Name>,
    },
    /// It waits for a robot again.
    Queued {
        /// Not before this, in ms since 1970.
        not_before_ms: u64,
        /// Whether that is one failure more.
        failed: bool,
    },
    /// Put aside. Its robot, if it has one, has to confirm yet.
    Paused,
    /// The robot has confirmed that it does not drive for it any more.
    LetGo,
    /// Ends as soon as its robot has confirmed.
    Cancelling {
        /// As what.
        then: TaskEnding,
    },
    /// Over.
    Ended {
        /// As what.
        ending: TaskEnding,
    },
}

/// What became of a task, as its robot shows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TaskOutcome {
    /// Its drive is done.
    Reached,
    /// Its state changes.
    Changed(TaskUpdate, Option<String>),
    /// It needs a new number on the same robot: the old one will not begin any more.
    Renew,
}

impl TaskOutcome {
    /// Back to the queue; the robot gets no task for a while.
    pub(crate) fn queued(now_ms: u64, why: String) -> Self {
        Self::Changed(TaskUpdate::Queued { not_before_ms: now_ms, failed: false }, Some(why))
    }

    /// No fault of the robot: it may have the task again at once.
    pub(crate) fn suspended(cause: &SuspensionCause) -> Self {
        Self::Changed(TaskUpdate::Queued { not_before_ms: 0, failed: false }, Some(cause.text()))
    }
}
