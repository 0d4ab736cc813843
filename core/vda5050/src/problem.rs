//! What is refused, and what is wrong with a robot: errors as a master control reads them.

use crate::protocol::Protocol;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use xtb_protocol::text;

/// Characters of a description or a reference that are kept.
const MAX_TEXT: usize = 300;

/// What a master control has to know of an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProblemKind {
    /// A message that cannot be read, or contradicts itself.
    Malformed,
    /// An order for another robot.
    Foreign,
    /// An update that is older than the present one.
    OutdatedUpdate,
    /// Another order under the same numbers.
    SameUpdate,
    /// An update that does not begin where the base ends.
    NotStitching,
    /// An update of an order that was cancelled.
    FollowingCancel,
    /// Another order, while one is not finished.
    OtherOrderActive,
    /// The first node is too far away.
    StartOutOfRange,
    /// A node cannot be reached.
    NoRoute,
    /// A node on another map than the fleet's.
    UnknownMap,
    /// An action on a node or an edge that no robot can do.
    UnsupportedAction,
    /// Something that the robot would have to ignore.
    UnsupportedParameter,
    /// More nodes than are kept.
    TooLarge,
    /// Somebody else drives the robot.
    NotAvailable,
    /// `cancelOrder` without an order.
    NoOrderToCancel,
    /// An instant action that is not known, or cannot be carried out.
    InvalidInstantAction,
}

/// How bad an error is, in the words of 3.0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// The robot goes on.
    Warning,
    /// The robot goes on, somebody should look.
    Urgent,
    /// The order does not go on.
    Critical,
    /// A person is needed.
    Fatal,
}

impl Level {
    /// As this version writes it: 2.x has two of them.
    #[must_use]
    pub fn text(self, protocol: Protocol) -> &'static str {
        match self {
            Self::Warning => "WARNING",
            Self::Urgent => protocol.pick("WARNING", "URGENT"),
            Self::Critical => protocol.pick("FATAL", "CRITICAL"),
            Self::Fatal => "FATAL",
        }
    }
}

impl ProblemKind {
    /// `errorType`.
    #[must_use]
    pub fn error_type(self, protocol: Protocol) -> &'static str {
        let (v2, v3) = match self {
            Self::Malformed | Self::Foreign => ("validationError", "VALIDATION_FAILURE"),
            Self::OutdatedUpdate => ("orderUpdateError", "OUTDATED_ORDER_UPDATE"),
            Self::SameUpdate => ("orderUpdateError", "SAME_ORDER_UPDATE_ID"),
            Self::NotStitching => ("orderUpdateError", "INVALID_ORDER"),
            Self::FollowingCancel => ("orderUpdateError", "ORDER_UPDATE_FOLLOWING_CANCEL"),
            Self::OtherOrderActive => ("orderError", "OTHER_ORDER_ACTIVE"),
            Self::StartOutOfRange => ("noRouteError", "START_NODE_OUT_OF_RANGE"),
            Self::NoRoute => ("noRouteError", "NO_ROUTE_TO_TARGET"),
            Self::UnknownMap => ("noRouteError", "UNKNOWN_MAP_ID"),
            Self::UnsupportedAction => ("orderError", "INVALID_ORDER_ACTION"),
            Self::UnsupportedParameter => ("orderError", "UNSUPPORTED_PARAMETER"),
            Self::TooLarge => ("orderError", "INSUFFICIENT_MEMORY"),
            Self::NotAvailable => ("orderError", "MOBILE_ROBOT_NOT_AVAILABLE"),
            Self::NoOrderToCancel => ("noOrderToCancel", "NO_ORDER_TO_CANCEL"),
            Self::InvalidInstantAction => ("instantActionError", "INVALID_INSTANT_ACTION"),
        };
        protocol.pick(v2, v3)
    }

    fn level(self) -> Level {
        match self {
            Self::UnsupportedParameter => Level::Critical,
            Self::TooLarge => Level::Urgent,
            _ => Level::Warning,
        }
    }
}

/// A refusal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Problem {
    /// Which.
    pub kind: ProblemKind,
    /// For people.
    pub text: String,
    /// `referenceKey` and `referenceValue`.
    pub references: Vec<(String, String)>,
}

impl Problem {
    /// A refusal without references.
    #[must_use]
    pub fn new(kind: ProblemKind, text: impl Into<String>) -> Self {
        Self { kind, text: text.into(), references: Vec::new() }
    }

    /// With one reference more.
    #[must_use]
    pub fn with(mut self, key: &str, value: impl ToString) -> Self {
        self.references.push((key.to_owned(), value.to_string()));
        self
    }

    /// As it stands in `errors`.
    #[must_use]
    pub fn error(&self, protocol: Protocol) -> Value {
        let level = self.kind.level();
        error(protocol, (self.kind.error_type(protocol), level), &self.text, None, &self.references)
    }
}

/// An entry of `errors`.
#[must_use]
pub fn error(
    protocol: Protocol,
    (name, level): (&str, Level),
    description: &str,
    hint: Option<&str>,
    references: &[(String, String)],
) -> Value {
    let references: Vec<Value> = references
        .iter()
        .map(|(key, value)| json!({"referenceKey": key, "referenceValue": shortened(value)}))
        .collect();
    let mut error = json!({
        "errorType": name,
        "errorLevel": level.text(protocol),
        "errorDescription": shortened(description),
        "errorReferences": references,
    });
    if let Some(hint) = hint {
        error["errorHint"] = json!(shortened(hint));
    }
    error
}

/// What came over the wire is repeated only in part, without control characters.
fn shortened(what: &str) -> String {
    text::escaped(what).chars().take(MAX_TEXT).collect()
}
