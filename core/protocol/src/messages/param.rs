//! Settings of a robot that may change while it runs: what they are, changes, and who made them.

use super::{Lease, Message, bounded, finite};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Settings of one request at most.
pub const MAX_PARAMS: usize = 64;
/// Changes that a robot remembers, the oldest is forgotten first.
pub const MAX_PARAM_CHANGES: usize = 64;

/// When a setting may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ParamWhen {
    /// At any time.
    Always,
    /// While nothing is under way.
    Standing,
}

/// A change that makes the robot more careful, and therefore needs no control of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ParamCareful {
    /// None does.
    No,
    /// A lower value does.
    Lower,
}

/// A setting and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamValue {
    /// As in the robot's settings file, such as `navigation.drive.limit_mps`.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// In its unit.
    pub value: f64,
}

/// What is asked of a robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ParamBody {
    /// Its settings that may change, and the last changes.
    List {},
    /// Change these, all or none.
    Set {
        /// 1 to [`MAX_PARAMS`].
        values: Vec<ParamValue>,
    },
    /// Write those that were changed into its own settings file.
    Save {},
}

/// One question to a robot about its settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamRequest {
    /// Chosen by the client.
    pub id: Uuid,
    /// The client's lease, where one is needed.
    #[serde(default)]
    pub lease: Option<Lease>,
    /// What is asked.
    pub body: ParamBody,
}

impl Message for ParamRequest {
    const NAME: &'static str = "ParamRequest";

    fn validate(&self) -> Result<(), CodecError> {
        let ParamBody::Set { values } = &self.body else { return Ok(()) };
        bounded("values", values.len() as f64, 1.0, MAX_PARAMS as f64, "")?;
        values.iter().try_for_each(|value| finite("value", Some(value.value)))
    }
}

/// A setting that may change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamInfo {
    /// As in the settings file.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// In force.
    pub value: f64,
    /// What it was when the robot started, or when it was saved last.
    pub saved: f64,
    /// Its unit.
    #[serde(deserialize_with = "text::read")]
    pub unit: String,
    /// Least value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// When it may change.
    pub when: ParamWhen,
    /// Which change needs no control of the robot.
    pub careful: ParamCareful,
    /// What it is.
    #[serde(deserialize_with = "text::read")]
    pub about: String,
}

/// A change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamChange {
    /// When, on the robot's monotonic clock.
    pub tick_ms: u64,
    /// How long ago that was when the robot answered, in ms.
    pub age_ms: u64,
    /// By whom.
    pub by: Name,
    /// Of what.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// Before.
    pub from: f64,
    /// After.
    pub to: f64,
}

/// Why a robot refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ParamCode {
    /// Not a message of ours, or of another version.
    Malformed,
    /// No setting of this name may change while the robot runs.
    UnknownParam,
    /// Out of its range.
    OutOfRange,
    /// It does not go with the other settings, or the vehicle could not stop in time.
    Conflict,
    /// Something is under way, and this setting changes only while nothing is.
    Driving,
    /// This change needs control of the robot.
    LeaseRequired,
    /// The lease is not the present one.
    LeaseLost,
    /// The robot was started without a settings file.
    NoFile,
    /// The settings file could not be written.
    SaveFailed,
    /// Too many questions wait.
    Overloaded,
}

/// A refusal: nothing was changed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamError {
    /// For programs.
    pub code: ParamCode,
    /// What was wrong.
    #[serde(deserialize_with = "text::read")]
    pub message: String,
    /// What to do.
    #[serde(deserialize_with = "text::read")]
    pub hint: String,
}

/// A robot's settings that may change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamList {
    /// All of them, in the order of the settings file.
    pub params: Vec<ParamInfo>,
    /// The last changes since boot, oldest first.
    pub changes: Vec<ParamChange>,
}

/// What came of a question.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum ParamOutcome {
    /// Done; the settings as they are now.
    Ok(ParamList),
    /// Refused.
    Error(ParamError),
}

/// A robot's answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ParamReply {
    /// The question's; nil if it could not be read.
    pub id: Uuid,
    /// What came of it.
    pub result: ParamOutcome,
}

impl Message for ParamReply {
    const NAME: &'static str = "ParamReply";
    const MAX_BYTES: usize = 64 * 1024;

    fn validate(&self) -> Result<(), CodecError> {
        let ParamOutcome::Ok(list) = &self.result else { return Ok(()) };
        bounded("params", list.params.len() as f64, 0.0, MAX_PARAMS as f64, "")?;
        bounded("changes", list.changes.len() as f64, 0.0, MAX_PARAM_CHANGES as f64, "")?;
        let of_params = list.params.iter().flat_map(|it| [it.value, it.saved, it.min, it.max]);
        let of_changes = list.changes.iter().flat_map(|it| [it.from, it.to]);
        of_params.chain(of_changes).try_for_each(|value| finite("value", Some(value)))
    }
}

impl ParamReply {
    /// A refusal.
    #[must_use]
    pub fn refused(id: Uuid, code: ParamCode, message: impl Into<String>, hint: &str) -> Self {
        let error = ParamError { code, message: message.into(), hint: hint.to_owned() };
        Self { id, result: ParamOutcome::Error(error) }
    }
}
