//! Goals, as a robot's state shows them.

use super::{LinkLoss, Via};
use crate::keys::Name;
use crate::text;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// What kind of goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GoalKind {
    /// To a point.
    Goto,
    /// Wander.
    Wander,
}

/// The life of a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum GoalStatus {
    /// Taken, not yet begun.
    Accepted,
    /// Under way.
    Running,
    /// An obstacle in the driving direction.
    Blocked,
    /// Done.
    Reached,
    /// Ended by `stop`, `cancel` or teleoperation.
    Cancelled,
    /// Ended by a newer goal.
    Replaced,
    /// Could not be done.
    Failed,
    /// The robot restarted.
    Interrupted,
}

impl GoalStatus {
    /// Whether the goal has ended.
    #[must_use]
    pub fn is_final(self) -> bool {
        !matches!(self, Self::Accepted | Self::Running | Self::Blocked)
    }
}

/// The present or last goal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GoalState {
    /// Its request's id.
    pub id: Uuid,
    /// What kind.
    pub kind: GoalKind,
    /// East, in m; `None` for wander.
    pub x_m: Option<f64>,
    /// North, in m; `None` for wander.
    pub y_m: Option<f64>,
    /// Yaw on arrival, where one was asked for.
    pub yaw_rad: Option<f64>,
    /// How it is driven to; `None` for wander.
    pub via: Option<Via>,
    /// How it stands.
    pub status: GoalStatus,
    /// Still to go, in a straight line.
    pub distance_m: Option<f64>,
    /// Since it has this status.
    pub age_ms: u64,
    /// Why it has this status, where that is not plain.
    #[serde(default, deserialize_with = "text::read_option")]
    pub reason: Option<String>,
    /// Who sent it.
    pub by: Name,
    /// What it does when its client falls silent.
    pub on_link_loss: LinkLoss,
}

/// How an earlier goal ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct GoalEnd {
    /// Its request's id.
    pub id: Uuid,
    /// As what.
    pub status: GoalStatus,
}
