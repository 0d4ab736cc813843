//! JSON Schemas of everything that a recording holds: made from the types themselves, or Foxglove's own
//! for what is drawn for it.
//!
//! Foxglove reads `properties` whose type is one word, and refuses a channel for any other. So what may
//! be null, or is one of several, stands below `allOf`, where validators look and Foxglove does not: the
//! schema stays whole, and Foxglove shows such fields all the same.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;
use xtb_client::messages::AnyMessage;
use xtb_protocol::messages::{
    About, DispatchRequest, Estop, Event, Fix, FleetMap, LogRequest, Message, Request, RobotState, Roster,
    Route, Sensors, Setpoint, SimStats, TaskEvent, TaskList, TrafficState, Truth,
};

/// What all of Foxglove's own begin with.
const WELL_KNOWN: &str = "foxglove.";
/// Presence has no message of its own on the wire.
const PRESENCE: &str = "Alive";

/// A schema under its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// `xtb.RobotState`, or Foxglove's name of it.
    pub name: String,
    /// JSON Schema.
    pub text: Vec<u8>,
}

/// Presence as recordings hold it: Zenoh's liveliness carries no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, serde::Deserialize)]
pub(crate) struct Presence {
    alive: bool,
}

impl Presence {
    pub(crate) fn new(alive: bool) -> Self {
        Self { alive }
    }
}

/// The presence that a recorded message tells of.
pub(crate) fn presence_of(json: &[u8]) -> Option<bool> {
    serde_json::from_slice::<Presence>(json).ok().map(|presence| presence.alive)
}

static ALL: LazyLock<Vec<Schema>> = LazyLock::new(|| {
    let presence = json!({
        "title": PRESENCE, "type": "object",
        "properties": {"alive": {"type": "boolean", "description": "Whether it is there."}},
        "required": ["alive"],
    });
    vec![
        wire::<RobotState>(),
        wire::<Sensors>(),
        wire::<Event>(),
        wire::<About>(),
        wire::<Request>(),
        wire::<Setpoint>(),
        wire::<Estop>(),
        wire::<Fix>(),
        wire::<Route>(),
        wire::<TrafficState>(),
        wire::<FleetMap>(),
        wire::<Truth>(),
        wire::<Roster>(),
        wire::<SimStats>(),
        wire::<DispatchRequest>(),
        wire::<LogRequest>(),
        wire::<TaskList>(),
        wire::<TaskEvent>(),
        Schema { name: wire_name(PRESENCE), text: presence.to_string().into_bytes() },
        well_known("PoseInFrame", include_str!("schemas/foxglove/PoseInFrame.json")),
        well_known("SceneUpdate", include_str!("schemas/foxglove/SceneUpdate.json")),
        well_known("Log", include_str!("schemas/foxglove/Log.json")),
    ]
});

/// All of them.
#[must_use]
pub fn all() -> &'static [Schema] {
    &ALL
}

/// The schema of a message's type; `None` for a type that nobody knows.
#[must_use]
pub fn of(name: &str) -> Option<&'static Schema> {
    ALL.iter().find(|schema| schema.name == name)
}

/// The name of a message's schema.
#[must_use]
pub fn name_of(news: &AnyMessage) -> String {
    wire_name(news.name())
}

fn wire_name(name: &str) -> String {
    format!("xtb.{name}")
}

/// Whether messages of this schema are made from others: who plays a recording passes them by.
#[must_use]
pub fn is_derived(name: &str) -> bool {
    name.starts_with(WELL_KNOWN)
}

fn wire<M: Message + JsonSchema>() -> Schema {
    Schema { name: wire_name(M::NAME), text: text::<M>() }
}

fn well_known(name: &str, text: &str) -> Schema {
    Schema { name: format!("{WELL_KNOWN}{name}"), text: text.trim().as_bytes().to_vec() }
}

fn text<T: JsonSchema>() -> Vec<u8> {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|it| it.inline_subschemas = true);
    let mut schema = settings.into_generator().into_root_schema_for::<T>().to_value();
    simplify(&mut schema);
    // A message that is one of several objects is an object all the same.
    if let Value::Object(schema) = &mut schema {
        schema.entry("type").or_insert_with(|| "object".into());
        schema.entry("properties").or_insert_with(|| json!({}));
    }
    schema.to_string().into_bytes()
}

/// Brings a schema into the form that the module's words describe, from the inside out.
fn simplify(schema: &mut Value) {
    match schema {
        Value::Array(parts) => parts.iter_mut().for_each(simplify),
        Value::Object(schema) => {
            schema.values_mut().for_each(simplify);
            // A recording outlives the program: a later one may have more fields.
            if schema.get("additionalProperties").is_some_and(Value::is_boolean) {
                schema.remove("additionalProperties");
            }
            name_variants(schema);
            set_apart(schema);
        }
        _ => {}
    }
}

/// An enum of names only is a text, one of these.
fn name_variants(schema: &mut Map<String, Value>) {
    let Some(Value::Array(variants)) = schema.get("oneOf") else { return };
    let names = |variant: &Value| match (variant.get("const"), variant.get("enum")) {
        (Some(name @ Value::String(_)), _) => Some(vec![name.clone()]),
        (None, Some(Value::Array(names))) => Some(names.clone()),
        _ => None,
    };
    let Some(names) = variants.iter().map(names).collect::<Option<Vec<_>>>() else { return };
    schema.remove("oneOf");
    schema.insert("type".into(), "string".into());
    schema.insert("enum".into(), Value::Array(names.concat()));
}

/// Moves what has not one plain type below `allOf`.
fn set_apart(schema: &mut Map<String, Value>) {
    if schema.get("type") != Some(&Value::from("object")) {
        return;
    }
    let Some(Value::Object(properties)) = schema.remove("properties") else { return };
    let (plain, apart): (Map<_, _>, Map<_, _>) = properties.into_iter().partition(|(_, it)| is_plain(it));
    schema.insert("properties".into(), Value::Object(plain));
    if !apart.is_empty() {
        schema.insert("allOf".into(), json!([{ "properties": apart }]));
    }
}

fn is_plain(schema: &Value) -> bool {
    match schema.get("type").and_then(Value::as_str) {
        Some("boolean" | "string" | "number" | "integer") => true,
        Some("object") => schema.get("properties").is_some(),
        Some("array") => schema.get("items").is_some_and(is_plain),
        _ => false,
    }
}

#[cfg(test)]
mod tests;
