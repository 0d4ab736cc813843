//! Which tasks no robot may be given, and why: the one rule for all reasons.
//!
//! * An emergency stop of all robots suspends the dispatcher as a whole. It is in the ledger, and ends with
//!   `activate`, never by itself: the first reset of a robot shall not set the fleet in motion.
//! * A task is of the map that the fleet had when it was submitted. While the fleet has a map of another
//!   *name*, its tasks wait: for that map, or for `adopt`. A map of the same name and another hash is a new
//!   version of it, for which tasks go on.
//!
//! What a robot has of a suspended task is withdrawn, and the task is queued again when the robot has confirmed.

use crate::task::{Task, TaskMap};
use serde::{Deserialize, Serialize};
use xtb_protocol::Name;
use xtb_protocol::messages::{MapHash, SuspensionCause};

/// An emergency stop of all robots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FleetStop {
    /// Who called for it; `None` = nobody knows.
    pub by: Option<Name>,
    /// When, in ms since 1970.
    pub at_ms: u64,
}

/// A map of the fleet.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct KnownMap {
    /// What it is called: another name is another place.
    pub name: String,
    /// Which version of it.
    pub hash: MapHash,
    /// Since when the fleet has it, in ms since 1970.
    pub since_ms: u64,
}

/// What holds now.
#[derive(Debug, Clone, Copy, Default)]
pub struct SuspensionState<'a> {
    /// The emergency stop of all robots after which nobody has activated the dispatcher.
    pub stop: Option<&'a FleetStop>,
    /// The fleet's map.
    pub map: Option<&'a KnownMap>,
}

impl SuspensionState<'_> {
    /// Why a task is suspended; `None` = it is not.
    #[must_use]
    pub fn cause(&self, task: &Task) -> Option<SuspensionCause> {
        match self.stop {
            Some(stop) => Some(SuspensionCause::FleetStop { by: stop.by.clone() }),
            None => self.other_map(task),
        }
    }

    /// Whether a task is of another map than the fleet has.
    #[must_use]
    pub fn other_map(&self, task: &Task) -> Option<SuspensionCause> {
        let now = &self.map?.name;
        let is_other = match &task.map {
            TaskMap::Named(of) => of != now,
            TaskMap::Unknown => true,
            TaskMap::NoMap => false,
        };
        is_other.then(|| {
            let of = task.map.name().map(str::to_owned);
            SuspensionCause::OtherMap { of, now: now.clone() }
        })
    }
}
