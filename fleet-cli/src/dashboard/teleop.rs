//! Driving by hand from a page.

use serde::{Deserialize, Serialize};
use xtb_protocol::Name;

/// Where the page's hand is, 20 times a second while something is held.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Hand {
    /// Counts the page's setpoints.
    pub(super) seq: u64,
    /// Number of the last frame that the page had when it made this.
    pub(super) seen: u64,
    /// −1..=1, + = ahead.
    pub(super) throttle: f64,
    /// −1..=1, + = right.
    pub(super) steering: f64,
}

/// How it stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Said {
    /// Whom.
    pub(super) robot: Name,
    /// Whether it goes on.
    pub(super) state: State,
    /// Why it has ended.
    pub(super) why: Option<String>,
}

/// Whether a page drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum State {
    /// Setpoints are forwarded.
    Driving,
    /// They are not.
    Ended,
}
