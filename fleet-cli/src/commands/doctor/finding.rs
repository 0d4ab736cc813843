//! What the doctor has found, and how bad it is.

use schemars::JsonSchema;
use serde::Serialize;
use xtb_protocol::Name;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Level {
    /// As it should be.
    Ok,
    /// Worth a look.
    Warning,
    /// Something does not work.
    Problem,
}

/// One thing that was looked at.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub(super) struct Finding {
    /// How bad it is.
    pub(super) level: Level,
    /// What was looked at.
    pub(super) topic: &'static str,
    /// On which robot; `None` = the fleet's.
    pub(super) robot: Option<Name>,
    /// In words.
    pub(super) text: String,
    /// What to do about it.
    pub(super) hint: Option<String>,
}

impl Finding {
    pub(super) fn ok(topic: &'static str, text: impl Into<String>) -> Self {
        Self { level: Level::Ok, topic, robot: None, text: text.into(), hint: None }
    }

    pub(super) fn warning(topic: &'static str, text: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { level: Level::Warning, topic, robot: None, text: text.into(), hint: Some(hint.into()) }
    }

    pub(super) fn problem(topic: &'static str, text: impl Into<String>, hint: impl Into<String>) -> Self {
        Self { level: Level::Problem, ..Self::warning(topic, text, hint) }
    }

    pub(super) fn of(self, robot: &Name) -> Self {
        Self { robot: Some(robot.clone()), ..self }
    }
}
