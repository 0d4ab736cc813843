//! What a recording holds of what comes in. Pure: items with their times in, records out; files are
//! [`mcap_writer`](super::mcap_writer)'s, clocks and threads the program's.
//!
//! A message becomes one record on the topic of its key, and up to two on derived topics: the pose of
//! its robot, and the fleet's scene or log, for viewers that know Foxglove's messages only.

use super::drawing::{self, Painter};
use super::schemas::{self, Presence};
use super::{LOG_TOPIC, SCENE_TOPIC};
use crate::schema::Schema;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use xtb_client::messages::AnyMessage;
use xtb_client::subscription::Item;
use xtb_protocol::keys::{Channel, Key};

/// Topics at most: anybody can make up a client's name.
const MOST_TOPICS: usize = 4096;

/// What belongs into a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum FileRecord {
    /// A topic, before its first message.
    Topic {
        /// Its number.
        number: u16,
        /// Its name.
        name: String,
        /// What its messages look like.
        schema: &'static Schema,
    },
    /// A message on a topic.
    Message {
        /// The topic's number.
        topic: u16,
        /// Counts the messages of this topic.
        sequence: u32,
        /// When it came, in ns since 1970.
        log_ns: u64,
        /// JSON.
        data: Vec<u8>,
    },
}

/// What was and was not kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, JsonSchema)]
pub struct RecordingCounts {
    /// Messages and changes of presence.
    pub messages: u64,
    /// Poses, scenes and lines of the log that were made of them.
    pub derived: u64,
    /// Messages that were written again at the beginning of a further file, because they still held.
    pub repeated: u64,
    /// Messages that cannot be read (of other programs, or another release), or on more than 4096 keys.
    pub unreadable: u64,
    /// Messages that came faster than they could be written.
    pub dropped: u64,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Topic {
    number: u16,
    sequence: u32,
    schema: &'static Schema,
    /// Its last message, if that still holds in the next file.
    holds: Option<Vec<u8>>,
}

/// The recording so far.
#[derive(Debug, Default)]
pub struct Recorder {
    topics: BTreeMap<String, Topic>,
    painter: Painter,
    counts: RecordingCounts,
}

impl Recorder {
    /// What came in at `at_ns` since 1970.
    pub fn take(&mut self, at_ns: u64, item: &Item) -> Vec<FileRecord> {
        match AnyMessage::of(item) {
            // The state says the same, once and not once a cell.
            Ok((_, AnyMessage::Near(_))) => Vec::new(),
            Ok((key, news)) => self.keep(at_ns, item, &key, &news),
            Err(error) => {
                tracing::debug!("not recorded: {error}");
                self.counts.unreadable += 1;
                Vec::new()
            }
        }
    }

    /// A message as it was read.
    fn keep(&mut self, at_ns: u64, item: &Item, key: &Key, news: &AnyMessage) -> Vec<FileRecord> {
        let mut records = Vec::new();
        let name = match item {
            Item::Message(incoming) => &incoming.key,
            Item::Presence(key, _) => key,
        };
        let data = match news {
            AnyMessage::Alive(alive) => json(&Presence::new(*alive)),
            news => json(news),
        };
        if !self.write(at_ns, name, &schemas::name_of(news), data, holds(&key.channel), &mut records) {
            self.counts.unreadable += 1;
            return records;
        }
        self.counts.messages += 1;
        self.derive(at_ns, name, key, news, &mut records);
        records
    }

    fn derive(
        &mut self,
        at_ns: u64,
        name: &str,
        key: &Key,
        news: &AnyMessage,
        records: &mut Vec<FileRecord>,
    ) {
        let mut made = Vec::new();
        if let AnyMessage::State(state) = news {
            let pose = json(&drawing::pose(at_ns, state));
            made.push((format!("{name}/pose"), "foxglove.PoseInFrame", pose, false));
        }
        if let Some(update) = self.painter.draw(at_ns, key, news) {
            let is_map = matches!(news, AnyMessage::Map(_));
            made.push((SCENE_TOPIC.to_owned(), "foxglove.SceneUpdate", json(&update), is_map));
        }
        if let Some(line) = drawing::log(at_ns, key, news) {
            made.push((LOG_TOPIC.to_owned(), "foxglove.Log", json(&line), false));
        }
        for (topic, schema, data, holds) in made {
            if self.write(at_ns, &topic, schema, data, holds, records) {
                self.counts.derived += 1;
            }
        }
    }

    /// A message on a topic, which is made known first; false = there is no room for the topic.
    fn write(
        &mut self,
        log_ns: u64,
        name: &str,
        schema: &str,
        data: Vec<u8>,
        holds: bool,
        records: &mut Vec<FileRecord>,
    ) -> bool {
        if !self.topics.contains_key(name) {
            let Some(schema) = schemas::of(schema) else { return false };
            let number = self.topics.len();
            let Some(number) = u16::try_from(number).ok().filter(|_| number < MOST_TOPICS) else {
                return false;
            };
            records.push(FileRecord::Topic { number, name: name.to_owned(), schema });
            self.topics.insert(name.to_owned(), Topic { number, sequence: 0, schema, holds: None });
        }
        let Some(topic) = self.topics.get_mut(name) else { return false };
        if holds {
            topic.holds = Some(data.clone());
        }
        records.push(FileRecord::Message { topic: topic.number, sequence: topic.sequence, log_ns, data });
        topic.sequence = topic.sequence.wrapping_add(1);
        true
    }

    /// What a further file begins with: all topics, and what still holds, so that it can be shown
    /// without the files before it.
    pub fn next_file(&mut self, at_ns: u64) -> Vec<FileRecord> {
        self.painter.forget();
        let topic = |(name, it): (&String, &Topic)| FileRecord::Topic {
            number: it.number,
            name: name.clone(),
            schema: it.schema,
        };
        let mut records: Vec<FileRecord> = self.topics.iter().map(topic).collect();
        for it in self.topics.values_mut() {
            let Some(data) = it.holds.clone() else { continue };
            records.push(FileRecord::Message {
                topic: it.number,
                sequence: it.sequence,
                log_ns: at_ns,
                data,
            });
            it.sequence = it.sequence.wrapping_add(1);
            self.counts.repeated += 1;
        }
        records
    }

    /// What was and was not kept; drops are counted where they happen.
    #[must_use]
    pub fn counts(&self) -> RecordingCounts {
        self.counts
    }
}

/// Whether the last message of a channel holds until the next one.
fn holds(channel: &Channel) -> bool {
    matches!(
        channel,
        Channel::Alive
            | Channel::TrafficAlive
            | Channel::DispatchAlive
            | Channel::About
            | Channel::Map
            | Channel::Places
            | Channel::DispatchTasks
            | Channel::DispatchAlerts
            | Channel::SimRoster
    )
}

/// Everything that goes over the lines has been JSON: it is finite, and its keys are texts.
fn json(value: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(value).unwrap_or_else(|error| {
        tracing::warn!("not recorded: {error}");
        b"null".to_vec()
    })
}

#[cfg(test)]
mod tests;
