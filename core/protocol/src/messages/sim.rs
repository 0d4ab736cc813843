//! What only a simulator can say; always JSON.

use super::Message;
use crate::keys::Name;
use crate::text;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
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
    /// By name.
    pub robots: BTreeMap<Name, TruthRobot>,
}

impl Message for Truth {
    const NAME: &'static str = "Truth";
    const MAX_BYTES: usize = MAX_BYTES;
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

/// Which robots should be there.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Roster {
    /// In the order of their names' numbers.
    pub robots: Vec<RosterEntry>,
}

impl Message for Roster {
    const NAME: &'static str = "Roster";
    const MAX_BYTES: usize = MAX_BYTES;
}
