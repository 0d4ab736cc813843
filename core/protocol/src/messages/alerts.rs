//! Alerts: what needs a person. The dispatcher raises and ends them, people acknowledge them by name.

use super::{Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Most alerts that are kept, ended ones included.
pub const MAX_ALERTS: usize = 500;
/// Longest text and longest remedy of an alert, in bytes.
pub const MAX_ALERT_TEXT: usize = 1000;
/// Longest name of a person, in bytes.
pub const MAX_PERSON: usize = 64;

/// What an alert is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum AlertKind {
    /// A stop is latched.
    Latched,
    /// A robot that should be there is not heard.
    Gone,
    /// A task failed for good.
    TaskFailed,
    /// A battery is low.
    Battery,
    /// A robot gets nowhere.
    Blocked,
    /// The dispatcher assigns nothing, or not all.
    Suspended,
    /// A robot has another map than the fleet.
    MapMismatch,
}

/// How an alert stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum AlertState {
    /// Nobody has acknowledged it.
    Open,
    /// Somebody has; what it is about still holds.
    Acknowledged,
    /// What it was about holds no more.
    Ended,
}

/// Who has acknowledged an alert, and when.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Acknowledged {
    /// The client; with identities the router lets nobody use the name of another.
    pub by: Name,
    /// Who that is by its own account, such as `alice@desk`: of clients without an identity.
    #[serde(default, deserialize_with = "text::read_option")]
    pub person: Option<String>,
    /// When, in ms since 1970.
    pub at_ms: u64,
}

impl Acknowledged {
    /// Who, in words: `alice-3f9a1c`, `cli-77ab01 (bob@desk)`.
    #[must_use]
    pub fn who(&self) -> String {
        match &self.person {
            Some(person) => format!("{} ({person})", self.by),
            None => self.by.to_string(),
        }
    }
}

/// Something that needs a person.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Alert {
    /// Counts the alerts of a ledger, from 1.
    pub id: u64,
    /// What it is about.
    pub kind: AlertKind,
    /// Which robot; `None` = the dispatcher, or a task that no robot had.
    pub robot: Option<Name>,
    /// What exactly: the latch, the battery's level, the task; `None` = the kind says it all.
    #[serde(default, deserialize_with = "text::read_option")]
    pub subject: Option<String>,
    /// In words.
    #[serde(deserialize_with = "text::read")]
    pub text: String,
    /// What a person does about it.
    #[serde(deserialize_with = "text::read")]
    pub remedy: String,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
    /// Who has acknowledged it; `None` = nobody.
    #[serde(default)]
    pub acknowledged: Option<Acknowledged>,
    /// When it ended, in ms since 1970; `None` = it has not.
    #[serde(default)]
    pub ended_ms: Option<u64>,
}

impl Alert {
    /// How it stands.
    #[must_use]
    pub fn state(&self) -> AlertState {
        match (self.ended_ms, &self.acknowledged) {
            (Some(_), _) => AlertState::Ended,
            (None, Some(_)) => AlertState::Acknowledged,
            (None, None) => AlertState::Open,
        }
    }

    /// Whether it still needs somebody.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.state() == AlertState::Open
    }
}

/// All alerts that are kept, oldest first.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FleetAlerts {
    /// When, in ms since 1970.
    pub at_ms: u64,
    /// At most [`MAX_ALERTS`].
    pub alerts: Vec<Alert>,
    /// Alerts that were dropped since the dispatcher began, because the list was full of ones that had not ended.
    #[serde(default)]
    pub left_out: u64,
}

impl FleetAlerts {
    /// Those that nobody has acknowledged.
    pub fn open(&self) -> impl Iterator<Item = &Alert> {
        self.alerts.iter().filter(|alert| alert.is_open())
    }
}

impl Message for FleetAlerts {
    const NAME: &'static str = "FleetAlerts";
    const MAX_BYTES: usize = 4 * 1024 * 1024;

    fn validate(&self) -> Result<(), CodecError> {
        bounded("alerts", self.alerts.len() as f64, 0.0, MAX_ALERTS as f64, "")
    }
}

/// Which alerts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum AckBody {
    /// These.
    Alerts {
        /// 1 to [`MAX_ALERTS`].
        ids: Vec<u64>,
    },
    /// All that are open.
    All {},
}

/// A person has seen alerts. The same again changes nothing.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AckRequest {
    /// Which.
    pub body: AckBody,
    /// Who it is, where the client has no identity; at most [`MAX_PERSON`] bytes.
    #[serde(default, deserialize_with = "text::read_option")]
    pub person: Option<String>,
}

impl Message for AckRequest {
    const NAME: &'static str = "AckRequest";

    fn validate(&self) -> Result<(), CodecError> {
        if let AckBody::Alerts { ids } = &self.body {
            bounded("ids", ids.len() as f64, 1.0, MAX_ALERTS as f64, "")?;
        }
        let person = self.person.as_ref().map_or(1, String::len);
        bounded("bytes of person", person as f64, 1.0, MAX_PERSON as f64, "")
    }
}

/// What became of each.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct AckReply {
    /// Acknowledged now.
    pub acknowledged: Vec<u64>,
    /// Acknowledged or ended before.
    pub before: Vec<u64>,
    /// Not in the list.
    pub unknown: Vec<u64>,
}

impl Message for AckReply {
    const NAME: &'static str = "AckReply";
}
