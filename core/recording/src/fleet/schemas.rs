//! JSON Schemas of everything that a recording of the fleet holds: made from the types themselves, or
//! Foxglove's own, word for word, for what is drawn for it.

use crate::schema::{self, Schema};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;
use xtb_client::messages::AnyMessage;
use xtb_protocol::messages::{
    About, DispatchRequest, Estop, Event, Fix, FleetAlerts, FleetMap, FleetPlaces, LogRequest, Message,
    Request, RobotState, Roster, Route, Sensors, Setpoint, SimStats, TaskEvent, TaskList, TrafficState,
    Truth,
};

/// What all of Foxglove's own begin with.
const WELL_KNOWN: &str = "foxglove.";
/// Presence has no message of its own on the wire.
const PRESENCE: &str = "Alive";

/// Presence as recordings hold it: Zenoh's liveliness carries no message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = PRESENCE)]
pub(crate) struct Presence {
    /// Whether it is there.
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
        wire::<FleetPlaces>(),
        wire::<Truth>(),
        wire::<Roster>(),
        wire::<SimStats>(),
        wire::<DispatchRequest>(),
        wire::<LogRequest>(),
        wire::<TaskList>(),
        wire::<TaskEvent>(),
        wire::<FleetAlerts>(),
        made::<Presence>(PRESENCE),
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
    made::<M>(M::NAME)
}

fn made<T: JsonSchema>(name: &str) -> Schema {
    let schema = schema::generator().into_root_schema_for::<T>();
    Schema { name: wire_name(name), text: schema::text(schema.to_value()) }
}

fn well_known(name: &str, text: &str) -> Schema {
    Schema { name: format!("{WELL_KNOWN}{name}"), text: text.trim().as_bytes().to_vec() }
}

#[cfg(test)]
mod tests;
