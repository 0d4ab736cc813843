//! What the ledger holds: numbered entries, each one change, as JSON with a version. A snapshot is an entry
//! that holds the whole [`TaskStore`], so both are one module.

use super::TaskStore;
use crate::transition::TaskUpdate;
use serde::{Deserialize, Serialize};
use thiserror::Error;
use uuid::Uuid;
use xtb_protocol::Name;
use xtb_protocol::messages::{MapHash, TaskId, TaskSpec, Waypoint};

/// Version of the entries that this program writes. It reads this one and those before; a program that
/// knows less refuses the ledger. 2 added suspensions and maps, 3 stand-bys, 4 extensions. An entry has the lowest
/// version that can hold it, so that a ledger without stand-bys or extensions remains readable for a program that
/// knows none.
pub const VERSION: u32 = 4;
/// Of entries about stand-bys.
const OF_STANDBY: u32 = 3;
/// Of entries that say nothing of stand-bys or extensions.
const USUAL: u32 = 2;

/// One change of the store.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Record {
    /// The first one of a ledger.
    Opened {
        /// Random, at most 48 bits: goals on robots bear it.
        ledger: u64,
    },
    /// A task was taken.
    Submitted {
        /// Which.
        task: TaskId,
        /// By whom.
        by: Name,
        /// Id of the request, the same for all tasks of a submission.
        key: Uuid,
        /// What.
        spec: Box<TaskSpec>,
    },
    /// A robot was chosen.
    Assigned {
        /// For which task.
        task: TaskId,
        /// Which.
        robot: Name,
        /// Number of the assignment.
        seq: u64,
    },
    /// A drive is done.
    Reached {
        /// Of which task.
        task: TaskId,
        /// Under which assignment.
        seq: u64,
        /// Which drive.
        leg: u32,
    },
    /// A task's state changed.
    Became {
        /// Which.
        task: TaskId,
        /// What.
        change: TaskUpdate,
        /// Why, where that is not plain.
        why: Option<String>,
    },
    /// A route has more points.
    Extended {
        /// Which.
        task: TaskId,
        /// Points that it had before.
        after: u32,
        /// What follows them.
        points: Vec<Waypoint>,
        /// By whom.
        by: Name,
    },
    /// All robots were stopped: nothing is assigned from here on.
    Suspended {
        /// By whom, if that is known.
        by: Option<Name>,
    },
    /// Tasks are assigned again.
    Activated {
        /// By whom.
        by: Name,
    },
    /// The fleet has this map from here on.
    Map {
        /// What it is called.
        name: String,
        /// Which version of it.
        hash: MapHash,
    },
    /// All open tasks are of this map from here on.
    Adopted {
        /// Which.
        map: String,
        /// By whom.
        by: Name,
    },
    /// A stand-by has taken over: assignments have numbers of this term from here on, and nobody else has to
    /// have what is acknowledged.
    Term {
        /// Higher than all before.
        term: u32,
    },
    /// Who else has to have what is acknowledged from here on.
    Pair {
        /// Number of the stand-by's copy; `None` = nobody: the dispatcher is alone.
        copy: Option<u64>,
    },
    /// Everything so far, in place of all entries before.
    Snapshot(Box<TaskStore>),
}

impl Record {
    /// The version of an entry that holds it.
    #[must_use]
    pub fn version(&self) -> u32 {
        match self {
            Self::Extended { .. } => VERSION,
            Self::Term { .. } | Self::Pair { .. } => OF_STANDBY,
            Self::Snapshot(store) if store.pair().is_some() => OF_STANDBY,
            _ => USUAL,
        }
    }
}

/// A record with its place and time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LedgerEntry {
    /// Version of the layout.
    pub v: u32,
    /// Counts the entries of a ledger, without gaps, from 1.
    pub n: u64,
    /// When it was made, in ms since 1970.
    pub at_ms: u64,
    /// What changed.
    pub record: Record,
}

/// Why bytes are no entry.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EntryError {
    /// Written by a later program.
    #[error("an entry of version {got}; this program reads up to version {VERSION}: use the newer program")]
    Version {
        /// As read.
        got: u32,
    },
    /// Not JSON, or not ours.
    #[error("not an entry: {0}")]
    Malformed(String),
}

impl LedgerEntry {
    /// As the ledger keeps it.
    ///
    /// # Errors
    /// [`EntryError::Malformed`] if serde cannot write it.
    pub fn to_json(&self) -> Result<String, EntryError> {
        serde_json::to_string(self).map_err(|error| EntryError::Malformed(error.to_string()))
    }

    /// As it was kept.
    ///
    /// # Errors
    /// See [`EntryError`]; nothing is guessed.
    pub fn from_json(text: &str) -> Result<Self, EntryError> {
        #[derive(Deserialize)]
        struct Version {
            v: u32,
        }
        let malformed = |error: serde_json::Error| EntryError::Malformed(error.to_string());
        let Version { v } = serde_json::from_str(text).map_err(malformed)?;
        if v > VERSION || v == 0 {
            return Err(EntryError::Version { got: v });
        }
        serde_json::from_str(text).map_err(malformed)
    }
}
