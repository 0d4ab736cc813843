//! What only a simulator can say; always JSON.

use super::{Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::frames::MapPose;

/// Thousands of robots; nothing of this goes to one.
const MAX_BYTES: usize = 1024 * 1024;

/// Where a truck really is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct TruthRobot {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x.
    pub yaw_rad: f64,
    /// + = ahead.
    pub speed_mps: f64,
    /// What the board gives the motor now.
    pub motor_counts: u16,
    /// Simulated time since which that is neutral; `None` while it is not.
    pub neutral_since_s: Option<f64>,
    /// Touches so far.
    pub contacts: u64,
}

/// Ground truth of all trucks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Truth {
    /// Simulated time.
    pub t_s: f64,
    /// Real time since the simulator started, in s, when this was sent: how late it comes shows beside others. `None` =
    /// from a log, or from a program that does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub real_s: Option<f64>,
    /// By name.
    pub robots: BTreeMap<Name, TruthRobot>,
}

impl Message for Truth {
    const NAME: &'static str = "Truth";
    const MAX_BYTES: usize = MAX_BYTES;
}

/// A simulator that runs at less than this part of the speed that was asked for is overloaded.
pub const SLOW_BELOW: f64 = 0.9;
/// Fastest world there can be, × real time.
const MAX_SPEED: f64 = 1e6;

/// How the simulator runs. Its robots live in its time: where that is slow, so are they.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct SimStats {
    /// Simulated time.
    pub t_s: f64,
    /// What was asked for (`--speed`), × real time.
    pub speed: f64,
    /// Simulated over real time, over the last seconds; `None` = not measured yet.
    pub real_time_factor: Option<f64>,
    /// Number of its first robot, where others have the rest of the fleet; `None` = it has all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<u32>,
}

impl SimStats {
    /// Whether it runs at less than [`SLOW_BELOW`] of its speed. Not known is not slow.
    #[must_use]
    pub fn is_slow(&self) -> bool {
        self.real_time_factor.is_some_and(|factor| factor < SLOW_BELOW * self.speed)
    }

    /// Of several simulators of a fleet the one that is farthest behind the speed that was asked of it.
    pub fn slowest(all: impl IntoIterator<Item = Self>) -> Option<Self> {
        let share =
            |stats: &Self| stats.real_time_factor.map_or(f64::INFINITY, |factor| factor / stats.speed);
        all.into_iter().min_by(|a, b| share(a).total_cmp(&share(b)))
    }
}

impl Message for SimStats {
    const NAME: &'static str = "SimStats";

    fn validate(&self) -> Result<(), CodecError> {
        bounded("t_s", self.t_s, 0.0, f64::MAX, "s")?;
        bounded("speed", self.speed, f64::MIN_POSITIVE, MAX_SPEED, "")?;
        bounded("real_time_factor", self.real_time_factor.unwrap_or(0.0), 0.0, MAX_SPEED, "")
    }
}

/// A robot that should be there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RosterEntry {
    /// Its name.
    pub name: Name,
    /// What it can do or belongs to.
    #[serde(default, deserialize_with = "text::read_list")]
    pub tags: Vec<String>,
    /// Where it starts.
    #[serde(default)]
    pub start_pose: Option<MapPose>,
}

/// Robots of a roster at most: the largest fleet that programs have room for, and twice what a simulator has.
pub const MAX_ROSTER: usize = 1024;

/// Which robots should be there.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Roster {
    /// In the order of their names' numbers; at most [`MAX_ROSTER`], each once.
    pub robots: Vec<RosterEntry>,
}

impl Message for Roster {
    const NAME: &'static str = "Roster";
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        bounded("robots", self.robots.len() as f64, 0.0, MAX_ROSTER as f64, "")?;
        let mut names = BTreeSet::new();
        match self.robots.iter().find(|entry| !names.insert(&entry.name)) {
            None => Ok(()),
            Some(entry) => {
                let reason = format!("{} stands in it more than once", entry.name);
                Err(CodecError::Malformed { name: Self::NAME, reason })
            }
        }
    }
}
