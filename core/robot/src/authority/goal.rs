//! A goal and its life: each change of status is reported once, and the last goal stays readable.
//!
//! ```text
//!   accepted ──► running ◄──► blocked
//!       └───────────┴────────────┴──► reached | cancelled | replaced | failed
//! ```
//! (`interrupted` is what a restarted robot says of a goal of its boot before.)

use xtb_control::Stamp;
use xtb_protocol::messages::{GoalKind, GoalState, GoalStatus, Lease, LinkLoss, Via};
use xtb_protocol::{Name, Uuid};

/// What a goal asks for, in the map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Target {
    /// Drive to a point.
    Point {
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
        /// Yaw on arrival, if one was asked for.
        yaw_rad: Option<f64>,
        /// How.
        via: Via,
    },
    /// Wander.
    Anywhere,
}

/// When a goal ends by the clock, and as what.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeLimit {
    /// Its end.
    pub at: Stamp,
    /// `Reached` for a wander that was to last so long, else `Failed`.
    pub then: GoalStatus,
}

/// The present or last goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Goal {
    /// Its request's id.
    pub id: Uuid,
    /// What is asked for.
    pub target: Target,
    /// How it stands.
    pub status: GoalStatus,
    /// Its end by the clock.
    pub limit: Option<TimeLimit>,
    /// Still to go, in m, as the controller last saw it.
    pub distance_m: Option<f64>,
    /// Since when it has its status.
    pub since: Stamp,
    /// Why it has it, where that is not plain.
    pub reason: Option<String>,
    /// Who sent it.
    pub by: Name,
    /// What it does when its client falls silent.
    pub on_link_loss: LinkLoss,
    /// Under which grant it runs.
    pub lease: Option<Lease>,
}

impl Goal {
    /// A goal that has just been accepted.
    #[must_use]
    pub fn accepted(now: Stamp, by: Name, id: Uuid, target: Target, on_link_loss: LinkLoss) -> Self {
        Self {
            id,
            target,
            status: GoalStatus::Accepted,
            limit: None,
            distance_m: None,
            since: now,
            reason: None,
            by,
            on_link_loss,
            lease: None,
        }
    }

    /// Its status becomes another one.
    pub fn becomes(&mut self, now: Stamp, status: GoalStatus, reason: Option<&str>) {
        (self.status, self.since, self.reason) = (status, now, reason.map(str::to_owned));
    }

    /// Whether the second level drives to it.
    #[must_use]
    pub fn is_planned(&self) -> bool {
        matches!(self.target, Target::Point { via: Via::Planned, .. })
    }

    /// For the state.
    #[must_use]
    pub fn state(&self, now: Stamp) -> GoalState {
        let (kind, x_m, y_m, yaw_rad, via) = match self.target {
            Target::Point { x_m, y_m, yaw_rad, via } => {
                (GoalKind::Goto, Some(x_m), Some(y_m), yaw_rad, Some(via))
            }
            Target::Anywhere => (GoalKind::Wander, None, None, None, None),
        };
        GoalState {
            id: self.id,
            kind,
            x_m,
            y_m,
            yaw_rad,
            via,
            status: self.status,
            distance_m: self.distance_m,
            age_ms: now.since_ms(self.since),
            reason: self.reason.clone(),
            by: self.by.clone(),
            on_link_loss: self.on_link_loss,
        }
    }
}
