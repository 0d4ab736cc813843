//! The protocol's names in words for people.

use serde::Serialize;
use xtb_protocol::messages::StopReason;

/// The name of a unit variant as it travels in JSON, such as `goal_reached`.
pub fn name(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(serde_json::Value::String(name)) => name,
        Ok(other) => other.to_string(),
        Err(error) => error.to_string(),
    }
}

/// All reasons in one line.
pub fn reasons(all: &[StopReason]) -> String {
    all.iter().map(|reason| reason.text()).collect::<Vec<_>>().join(", ")
}
