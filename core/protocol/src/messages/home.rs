//! Which robots are at a dock or on the way to one by themselves, and why.

use super::{Message, TaskId, bounded, finite};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Most robots of one message.
const MAX_ROBOTS: usize = 4096;

/// How a robot stands with its battery, or without a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum HomeStatus {
    /// It goes there, or will as soon as it is free.
    OnTheWay,
    /// At a dock, and not full enough to work.
    Charging,
    /// At a dock, and full enough to work.
    Charged,
    /// At a dock, and its voltage does not rise.
    NotCharging,
    /// At a parking or waiting place.
    Parked,
    /// It goes to a dock when its task is done.
    AfterTask,
    /// All docks that it may use are taken.
    WaitsForDock,
    /// It needs a dock and cannot drive, or its drives there fail: somebody has to help.
    NeedsHelp,
}

/// A robot that is at a place or has to go to one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotHome {
    /// Which.
    pub robot: Name,
    /// How it stands.
    pub status: HomeStatus,
    /// Where it is or goes; `None` = nowhere yet.
    pub place: Option<Name>,
    /// The dispatcher's task that takes it there.
    pub task: Option<TaskId>,
    /// What its battery measures, in V; `None` = it does not.
    pub battery_v: Option<f64>,
    /// Why, in words; empty where the status says all.
    #[serde(default, deserialize_with = "text::read")]
    pub why: String,
}

/// All such robots of a fleet, by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FleetHomes {
    /// Whether the dispatcher sends robots to docks at all.
    pub active: bool,
    /// The robots; the others work, or have nothing to do.
    pub robots: Vec<RobotHome>,
}

impl Message for FleetHomes {
    const NAME: &'static str = "FleetHomes";
    const MAX_BYTES: usize = 2 * 1024 * 1024;

    fn validate(&self) -> Result<(), CodecError> {
        bounded("robots", self.robots.len() as f64, 0.0, MAX_ROBOTS as f64, "")?;
        self.robots.iter().try_for_each(|robot| finite("battery_v", robot.battery_v))
    }
}
