//! What happened to a robot, one after the other.

use super::{Fault, GoalStatus, Latch, Message};
use crate::keys::Name;
use crate::text;
use serde::{Deserialize, Serialize};
use uuid::Uuid;
use xtb_control::Mode;

/// Something happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EventKind {
    /// The agent began to run.
    Started {
        /// Its version.
        #[serde(deserialize_with = "text::read")]
        version: String,
    },
    /// The controller's mode changed.
    Mode {
        /// Before.
        from: Mode,
        /// After.
        to: Mode,
    },
    /// A goal changed its status.
    Goal {
        /// Which.
        id: Uuid,
        /// To what.
        status: GoalStatus,
        /// Why, where that is not plain.
        #[serde(default, deserialize_with = "text::read_option")]
        reason: Option<String>,
    },
    /// The lease changed hands.
    Lease {
        /// To whom; `None` = free.
        holder: Option<Name>,
    },
    /// Something broke, or works again.
    Fault {
        /// What.
        fault: Fault,
        /// False: it works again.
        present: bool,
        /// The system's words, where there are any.
        #[serde(default, deserialize_with = "text::read_option")]
        detail: Option<String>,
    },
    /// A stop was latched, or reset.
    Latch {
        /// Which.
        latch: Latch,
        /// False: it was reset.
        set: bool,
        /// Who or what did so.
        #[serde(deserialize_with = "text::read")]
        by: String,
    },
}

/// An event with its place in the robot's history.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// Whose.
    pub robot: Name,
    /// Random at boot.
    pub epoch: u64,
    /// Counts the events of this boot.
    pub seq: u64,
    /// The robot's monotonic clock.
    pub tick_ms: u64,
    /// What happened.
    pub kind: EventKind,
}

impl Message for Event {
    const NAME: &'static str = "Event";
    const VERSION: u32 = 4;

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }
}
