//! JSON Schemas of a robot's topics, made from the types that are written; `docs/recording.md` has them in
//! words.

use super::events::EVENTS;
use super::{CONFIG, Header, OUTPUTS, PARAMS};
use crate::schema::{self, Schema};
use serde_json::{Value, json};
use xtb_protocol::messages::{Event, ParamChange};
use xtb_protocol::trace::{decision_schema, sample_schema};

/// Kinds of samples, each with a topic of its own, and what they hold.
pub(super) const KINDS: [(&str, &str); 6] = [
    ("gyro", "Raw Euler counts, 360/65536 deg each"),
    ("encoder", "Pulses in the window that just closed"),
    ("adc", "Converter counts"),
    ("remote", "Time counts of 1.6 us; null = no pulse"),
    ("command", "What the level above asked for"),
    ("obstacle", "How near an obstacle is from now on"),
];

/// What the first message looks like.
pub(super) fn config() -> Schema {
    topic(CONFIG, schema::generator().into_root_schema_for::<Header>().to_value())
}

/// What decisions look like.
pub(super) fn outputs() -> Schema {
    let mut line = decision_schema(schema::generator()).to_value();
    line["title"] = "What one step decided".into();
    number(&mut line, "n", "Counts the controller's steps since boot.");
    number(&mut line, "sample_crc", "CRC-32 of the whole message of the sample.");
    topic(OUTPUTS, line)
}

/// What events look like.
pub(super) fn events() -> Schema {
    let mut line = schema::generator().into_root_schema_for::<Event>().to_value();
    number(&mut line, "n", "Number of the last step before it.");
    topic(EVENTS, line)
}

/// What changed settings look like.
pub(super) fn params() -> Schema {
    let mut line = schema::generator().into_root_schema_for::<ParamChange>().to_value();
    number(&mut line, "n", "Number of the last step before it.");
    topic(PARAMS, line)
}

/// What samples of this kind look like.
pub(super) fn sample(kind: &str, title: &str) -> Schema {
    let mut line = sample_schema(schema::generator()).to_value();
    line["title"] = title.into();
    // Of all the kinds that a line of the trace may have, its messages have this one.
    if let Some(fields) = line["properties"].as_object_mut() {
        fields.retain(|name, _| name == kind || KINDS.iter().all(|(other, _)| name != other));
    }
    require(&mut line, kind);
    number(&mut line, "n", "Counts the controller's steps since boot.");
    topic(kind, line)
}

fn topic(name: &str, schema: Value) -> Schema {
    Schema { name: format!("xtb.record.{name}"), text: schema::text(schema) }
}

/// A whole number that a message has before the fields of its line.
fn number(line: &mut Value, name: &str, description: &str) {
    line["properties"][name] = json!({ "type": "integer", "minimum": 0, "description": description });
    require(line, name);
}

fn require(line: &mut Value, name: &str) {
    if let Some(required) = line["required"].as_array_mut() {
        required.push(name.into());
    }
}

#[cfg(test)]
mod tests;
