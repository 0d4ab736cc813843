//! What has to outlive a restart: the order, the task that drives it, and what was asked for at once.

use crate::action::ActionState;
use crate::header::Serial;
use crate::incoming::Order;
use crate::order::{ActiveOrder, digest};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use uuid::Uuid;
use xtb_protocol::messages::TaskId;

/// Version of a record's layout.
const VERSION: u32 = 1;

/// A task of the dispatcher that drives nodes of the base.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Which one of the order, from 0.
    pub number: u32,
    /// Its task.
    pub task: TaskId,
    /// The ledger that it stands in; `None` = not known yet.
    pub ledger: Option<u64>,
    /// Points that it has.
    pub points: u32,
    /// Those of them that count as traversed.
    pub traversed: u32,
    /// The dispatcher has refused more points: it has ended, or somebody else has added some. Only that says so: the
    /// points may be in it already, and driven, if an answer was lost.
    pub closed: bool,
}

/// Everything of a robot that a restart needs.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct OrderRecord {
    /// The order that was accepted last.
    pub order: ActiveOrder,
    /// An order or update that fits and is not in the dispatcher's ledger yet.
    pub pending: Option<Order>,
    /// What drives the base.
    pub part: Option<Part>,
    /// Parts that the order has had.
    pub parts: u32,
    /// Instant actions, oldest first.
    pub actions: Vec<ActionState>,
    /// `startPause` came last.
    pub paused: bool,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    v: u32,
    record: OrderRecord,
}

impl OrderRecord {
    /// As it is kept.
    #[must_use]
    pub fn to_json(&self) -> String {
        let saved = Saved { v: VERSION, record: self.clone() };
        serde_json::to_string(&saved).unwrap_or_default()
    }

    /// As it was kept.
    ///
    /// # Errors
    /// It is no record, or one of a later program.
    pub fn from_json(text: &str) -> Result<Self, String> {
        let Saved { v, record } = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if v == VERSION { Ok(record) } else { Err(format!("version {v}, this program reads {VERSION}")) }
    }
}

/// The id of a part's submission: the same for the same order, also after a restart that has lost its record, so that
/// the dispatcher takes it once.
#[must_use]
pub fn submission_id(serial: &Serial, order: &Order, part: u32) -> Uuid {
    let mut hash = Sha256::new();
    let (content, part) = (digest(order), part.to_string());
    for text in [&serial.manufacturer, serial.robot.as_str(), &order.order_id, &content, &part] {
        hash.update((text.len() as u64).to_be_bytes());
        hash.update(text);
    }
    let mut bytes = [0; 16];
    bytes.copy_from_slice(&hash.finalize()[..16]);
    uuid::Builder::from_custom_bytes(bytes).into_uuid()
}
