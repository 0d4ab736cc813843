//! What is published, and when: a state when something has changed, at most each 100 ms, at least each 30 s.

use super::{Effect, Topic, Vehicle};
use crate::action::Wish;
use crate::header::Connection;
use crate::operating::drives;
use crate::problem::{Level, error};
use crate::state::{CONTINUOUS, View};
use crate::{factsheet, state};
use serde_json::{Map, Value};
use xtb_protocol::messages::TaskState;

/// Between two states at least, in ms.
const AT_MOST_MS: u64 = 100;
/// Between two states at most, in ms.
const AT_LEAST_MS: u64 = 30_000;
/// The same while the robot drives, so that its position is known.
const DRIVING_MS: u64 = 1000;

/// What was published last.
#[derive(Debug, Clone, Default)]
pub(super) struct Published {
    /// Messages of each topic so far.
    ids: [u32; 3],
    connection: Option<Connection>,
    state: Value,
    state_ms: u64,
    wants_state: bool,
    wants_factsheet: bool,
    factsheet: Value,
}

impl Published {
    pub(super) fn want_state(&mut self) {
        self.wants_state = true;
    }

    pub(super) fn want_factsheet(&mut self) {
        self.wants_factsheet = true;
    }

    pub(super) fn set_back(&mut self) {
        self.state_ms = 0;
    }

    fn next_id(&mut self, topic: Topic) -> u32 {
        let id = &mut self.ids[topic as usize];
        let now = *id;
        *id = id.wrapping_add(1);
        now
    }
}

impl Vehicle {
    /// The broker hears it again, and has none of what was said: everything is said once more.
    pub fn connected(&mut self) {
        let ids = self.published.ids;
        self.published = Published { ids, wants_state: true, wants_factsheet: true, ..Published::default() };
    }

    /// What the broker shall say when it does not hear from the robot any more.
    #[must_use]
    pub fn will(&self, now_ms: u64) -> Value {
        self.serial.connection(0, now_ms, Connection::Broken)
    }

    /// The last word of a bridge that is ended.
    #[must_use]
    pub fn offline(&mut self, now_ms: u64) -> Value {
        let id = self.published.next_id(Topic::Connection);
        self.serial.connection(id, now_ms, Connection::Offline)
    }

    pub(super) fn publish(&mut self, now_ms: u64) -> Vec<Effect> {
        let mut effects = Vec::new();
        if self.robot.is_none() {
            return effects; // what the broker retains of it still holds
        }
        let connection = if self.present { Connection::Online } else { Connection::Broken };
        if self.published.connection != Some(connection) {
            self.published.connection = Some(connection);
            let id = self.published.next_id(Topic::Connection);
            effects.push(Effect::Publish(Topic::Connection, self.serial.connection(id, now_ms, connection)));
        }
        if !self.present {
            return effects;
        }
        let sheet = factsheet::compose(&self.serial, &self.version, self.body);
        if !self.version.is_empty() && (self.published.wants_factsheet || self.published.factsheet != sheet) {
            self.published.wants_factsheet = false;
            self.published.factsheet.clone_from(&sheet);
            effects.push(self.message(now_ms, Topic::Factsheet, sheet));
        }
        effects.extend(self.state(now_ms).map(|state| self.message(now_ms, Topic::State, state)));
        effects
    }

    fn message(&mut self, now_ms: u64, topic: Topic, body: Value) -> Effect {
        let id = self.published.next_id(topic);
        let mut message: Map<String, Value> = self.serial.header(id, now_ms);
        if let Value::Object(body) = body {
            message.extend(body);
        }
        Effect::Publish(topic, Value::Object(message))
    }

    /// The state, if it is time for one.
    fn state(&mut self, now_ms: u64) -> Option<Value> {
        let since_ms = now_ms.saturating_sub(self.published.state_ms);
        if since_ms < AT_MOST_MS {
            return None;
        }
        let robot = self.robot.as_ref()?;
        let errors = self.errors();
        let task = self.seen.as_ref().map(|seen| seen.state);
        let view = View { serial: &self.serial, record: &self.record, robot, task, errors: &errors };
        let state = state::compose(view);
        let mut lasting = state.clone();
        if let Value::Object(fields) = &mut lasting {
            CONTINUOUS.iter().for_each(|field| drop(fields.remove(*field)));
        }
        let every_ms = if drives(robot) { DRIVING_MS } else { AT_LEAST_MS };
        if !self.published.wants_state && lasting == self.published.state && since_ms < every_ms {
            return None;
        }
        (self.published.wants_state, self.published.state, self.published.state_ms) =
            (false, lasting, now_ms);
        Some(state)
    }

    /// What was refused, and what keeps the order from going on.
    fn errors(&self) -> Vec<Value> {
        let protocol = self.serial.protocol;
        let mut errors: Vec<Value> = self.problems.iter().map(|problem| problem.error(protocol)).collect();
        if let Some(why) = &self.unreachable {
            let name = (protocol.pick("dispatcherUnreachable", "DISPATCHER_UNREACHABLE"), Level::Urgent);
            let hint = "`fleet-cli dispatch status`; what was asked for is tried again";
            errors.push(error(protocol, name, why, Some(hint), &[]));
        }
        let order = &self.record.order;
        if let Some(seen) = self.seen.as_ref().filter(|_| order.base() > 0) {
            let why = seen.reason.as_deref().unwrap_or("no reason is known");
            let node = order.nodes.first().map_or("", |node| node.node_id.as_str());
            let (name, level) = match seen.state {
                TaskState::Failed => (protocol.pick("nodeUnreachable", "NODE_UNREACHABLE"), Level::Critical),
                TaskState::Cancelled if self.wishes(&Wish::Cancel) => return errors,
                TaskState::Cancelled => (protocol.pick("taskCancelled", "TASK_CANCELLED"), Level::Critical),
                TaskState::Blocked => (protocol.pick("pathBlocked", "PATH_BLOCKED"), Level::Warning),
                _ => return errors,
            };
            let hint = (level == Level::Critical).then_some("the order is kept: send cancelOrder");
            errors.push(error(protocol, (name, level), why, hint, &[("nodeId".to_owned(), node.to_owned())]));
        }
        errors
    }
}
