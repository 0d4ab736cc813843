//! JSON Schemas of a robot's topics; `docs/recording.md` has them in words.

use super::CONFIG;
use crate::schema::Schema;

/// Kinds of samples, each with a topic of its own.
pub(super) const KINDS: [&str; 5] = ["gyro", "encoder", "adc", "remote", "command"];

/// What the messages of a topic look like.
pub(super) fn of(topic: &str) -> Schema {
    let text = match topic {
        CONFIG => include_str!("config.schema.json"),
        "gyro" => include_str!("gyro.schema.json"),
        "encoder" => include_str!("encoder.schema.json"),
        "adc" => include_str!("adc.schema.json"),
        "remote" => include_str!("remote.schema.json"),
        "command" => include_str!("command.schema.json"),
        _ => include_str!("outputs.schema.json"),
    };
    Schema { name: format!("xtb.record.{topic}"), text: text.as_bytes().to_vec() }
}
