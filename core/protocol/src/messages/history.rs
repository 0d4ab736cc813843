//! The fleet's history, which the dispatcher keeps: events with wall time, and what each robot did.

use super::{Message, bounded, finite};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Events of one answer at most.
pub const MAX_HISTORY_PAGE: u32 = 500;
/// Longest text that events are searched for, in bytes.
pub const MAX_SEARCH: usize = 100;
/// Longest answer, in bytes: a page of the longest events, or 1,024 robots with each reason.
const MAX_BYTES: usize = 4 * 1024 * 1024;

/// What kind of event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum HistoryKind {
    /// A robot's agent began to run.
    Started,
    /// A robot's mode changed.
    Mode,
    /// A goal changed its status.
    Goal,
    /// Control of a robot changed hands.
    Lease,
    /// Something broke, or works again.
    Fault,
    /// A stop was latched, or reset.
    Latch,
    /// A task changed.
    Task,
    /// A robot came or went.
    Presence,
    /// An alert was raised, acknowledged or ended.
    Alert,
}

impl HistoryKind {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::Started,
        Self::Mode,
        Self::Goal,
        Self::Lease,
        Self::Fault,
        Self::Latch,
        Self::Task,
        Self::Presence,
        Self::Alert,
    ];

    /// As files and messages write it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Started => "started",
            Self::Mode => "mode",
            Self::Goal => "goal",
            Self::Lease => "lease",
            Self::Fault => "fault",
            Self::Latch => "latch",
            Self::Task => "task",
            Self::Presence => "presence",
            Self::Alert => "alert",
        }
    }
}

/// An event as the history keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct HistoryEvent {
    /// Its place in the history; grows.
    pub id: u64,
    /// When, in ms since 1970, by the dispatcher's clock.
    pub at_ms: u64,
    /// Which robot; `None` = none.
    pub robot: Option<Name>,
    /// What kind.
    pub kind: HistoryKind,
    /// What exactly: the goal's id, the task, the latch, the fault, the alert's number.
    #[serde(default, deserialize_with = "text::read_option")]
    pub about: Option<String>,
    /// In words.
    #[serde(deserialize_with = "text::read")]
    pub text: String,
}

/// From where on a page goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum HistoryPlace {
    /// The first that follow this id.
    After(u64),
    /// The last before this id.
    Before(u64),
    /// The last of all.
    Newest,
}

/// What is asked of the history.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum HistoryRequest {
    /// A page of events.
    Events {
        /// From where.
        place: HistoryPlace,
        /// At most so many; 1 to [`MAX_HISTORY_PAGE`].
        limit: u32,
        /// Not before this, in ms since 1970.
        #[serde(default)]
        since_ms: Option<u64>,
        /// Only of this robot.
        #[serde(default)]
        robot: Option<Name>,
        /// Only of these kinds; empty = all.
        #[serde(default)]
        kinds: Vec<HistoryKind>,
        /// Only with this in their words, upper or lower case; at most [`MAX_SEARCH`] bytes.
        #[serde(default, deserialize_with = "text::read_option")]
        search: Option<String>,
    },
    /// What each robot did between two times, in ms since 1970.
    Report {
        /// From then.
        from_ms: u64,
        /// Until then.
        to_ms: u64,
    },
}

impl Message for HistoryRequest {
    const NAME: &'static str = "HistoryRequest";

    fn validate(&self) -> Result<(), CodecError> {
        let Self::Events { limit, kinds, search, .. } = self else { return Ok(()) };
        bounded("limit", f64::from(*limit), 1.0, f64::from(MAX_HISTORY_PAGE), "")?;
        bounded("kinds", kinds.len() as f64, 0.0, HistoryKind::ALL.len() as f64, "")?;
        let search = search.as_ref().map_or(0, String::len);
        bounded("bytes of search", search as f64, 0.0, MAX_SEARCH as f64, "")
    }
}

/// How often a robot stopped for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StopCount {
    /// The reason's name, such as `way_blocked`.
    #[serde(deserialize_with = "text::read")]
    pub reason: String,
    /// How often.
    pub count: u64,
}

/// What a robot did. Times are by the robot's clock: simulated for simulated ones.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct RobotReport {
    /// Who.
    pub robot: Name,
    /// Heard for so long, in s.
    pub heard_s: f64,
    /// With a task or a goal for so long, in s.
    pub active_s: f64,
    /// Driving for so long, in s.
    pub driving_s: f64,
    /// Way as its own poses have it, in m.
    pub driven_m: f64,
    /// Tasks that it brought to their end.
    pub done: u64,
    /// Tasks that failed on it for good.
    pub failed: u64,
    /// Stops by reason, the most frequent first.
    pub stops: Vec<StopCount>,
    /// Lowest voltage of its battery; `None` = not measured.
    pub battery_min_v: Option<f64>,
    /// The last voltage.
    pub battery_v: Option<f64>,
}

/// What the history has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum HistoryReply {
    /// A page, oldest first.
    Events {
        /// The dispatcher's clock, in ms since 1970.
        now_ms: u64,
        /// The events.
        events: Vec<HistoryEvent>,
        /// Whether there are more beyond it.
        more: bool,
    },
    /// What each robot did.
    Report {
        /// By name.
        robots: Vec<RobotReport>,
    },
    /// It cannot be read.
    Failed {
        /// Why.
        #[serde(deserialize_with = "text::read")]
        message: String,
    },
}

impl Message for HistoryReply {
    const NAME: &'static str = "HistoryReply";
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        let Self::Report { robots } = self else { return Ok(()) };
        robots.iter().try_for_each(|robot| {
            let RobotReport { heard_s, active_s, driving_s, driven_m, .. } = robot;
            [*heard_s, *active_s, *driving_s, *driven_m]
                .into_iter()
                .try_for_each(|value| finite("report", Some(value)))?;
            finite("battery_min_v", robot.battery_min_v)?;
            finite("battery_v", robot.battery_v)
        })
    }
}
