//! Why the dispatcher assigns no task, or not these.

use crate::keys::Name;
use crate::text;
use serde::{Deserialize, Serialize};

/// Why tasks are suspended.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SuspensionCause {
    /// An emergency stop of all robots: nothing is assigned, until `activate`.
    FleetStop {
        /// Who called for it; `None` = nobody knows.
        by: Option<Name>,
    },
    /// Tasks were submitted for another map than the fleet has now: they wait for that map, or for `adopt`.
    OtherMap {
        /// Theirs; `None` = the ledger is older than such names.
        #[serde(default, deserialize_with = "text::read_option")]
        of: Option<String>,
        /// The fleet's.
        #[serde(deserialize_with = "text::read")]
        now: String,
    },
}

/// Tasks that no robot is given, although it could do them.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Suspension {
    /// Why.
    pub cause: SuspensionCause,
    /// Since when, in ms since 1970; of another map: since the dispatcher was told of it.
    pub since_ms: u64,
    /// Tasks that have not ended and wait for it.
    pub tasks: u64,
}

impl SuspensionCause {
    /// Why a task waits, in words.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::FleetStop { by: Some(by) } => {
                format!("the dispatcher is suspended: emergency stop of all robots by {by}")
            }
            Self::FleetStop { by: None } => {
                "the dispatcher is suspended: emergency stop of all robots".to_owned()
            }
            Self::OtherMap { of: Some(of), now } => {
                format!("suspended: the task belongs to map {of}, the fleet's map is {now}")
            }
            Self::OtherMap { of: None, now } => {
                format!("suspended: the map of the task is unknown, the fleet's map is {now}")
            }
        }
    }

    /// What ends it.
    #[must_use]
    pub fn remedy(&self) -> &'static str {
        match self {
            Self::FleetStop { .. } => "`fleet-cli dispatch activate` resumes the assignment of tasks",
            Self::OtherMap { .. } => {
                "`fleet-cli dispatch adopt` adopts them for this map; `fleet-cli cancel` cancels them; \
                 --fresh of `dispatch serve` and `sim` starts a new ledger"
            }
        }
    }
}

impl Suspension {
    /// What is suspended and why, in words.
    #[must_use]
    pub fn text(&self) -> String {
        let open = match self.tasks {
            1 => "1 open task".to_owned(),
            tasks => format!("{tasks} open tasks"),
        };
        let (is, waits) = if self.tasks == 1 { ("is", "waits") } else { ("are", "wait") };
        match &self.cause {
            SuspensionCause::FleetStop { .. } => format!("{}; {open} {waits}", self.cause.text()),
            SuspensionCause::OtherMap { of: Some(of), now } => {
                format!("{open} of map {of} {is} suspended: the fleet's map is {now}")
            }
            SuspensionCause::OtherMap { of: None, now } => {
                format!("{open} of an unknown map {is} suspended: the fleet's map is {now}")
            }
        }
    }
}
