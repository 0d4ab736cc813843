//! What a robot tells those near it, for the rule by which they give way to each other.

use super::nav::Track;
use super::state::{MAX_REPORTED_MPS, reported};
use super::{Message, bounded, finite};
use crate::keys::Name;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Who tells a robot where to go.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum NearRole {
    /// It drives to a planned goal on its own and keeps to the rule.
    Alone,
    /// A person, traffic control, or the memorandum's own rules: it gives way to nobody.
    Driven,
    /// Nobody: it has no goal, or is latched.
    Parked,
}

/// The path of a robot's goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NearWay {
    /// All of it.
    pub track: Track,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released, in m.
    pub release_m: f64,
}

/// Where a robot is, and which way it goes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct NearState {
    /// Who says this.
    pub robot: Name,
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x.
    pub yaw_rad: f64,
    /// + = ahead.
    pub speed_mps: f64,
    /// Who tells it where to go.
    pub role: NearRole,
    /// Its path; `None` while there is none.
    pub way: Option<NearWay>,
    /// For whom it waits.
    pub waits_for: Option<Name>,
}

impl Message for NearState {
    const NAME: &'static str = "NearState";

    fn speaker(&self) -> Option<&Name> {
        Some(&self.robot)
    }

    fn validate(&self) -> Result<(), CodecError> {
        reported("x_m", Some(self.x_m))?;
        reported("y_m", Some(self.y_m))?;
        finite("yaw_rad", Some(self.yaw_rad))?;
        bounded("speed_mps", self.speed_mps, -MAX_REPORTED_MPS, MAX_REPORTED_MPS, "m/s")?;
        let Some(way) = &self.way else { return Ok(()) };
        finite("done_m", Some(way.done_m))?;
        finite("release_m", Some(way.release_m))?;
        way.track.validate()
    }
}
