//! The recording of a robot: every sample and every decision of its controller, for the recorder that writes it
//! ([`writer`]) and the replay that reads it ([`Recording`]).
//!
//! An MCAP file of JSON messages that Foxglove and Rerun open as it is; `docs/recording.md` is the
//! contract. The topics are under `xtb/<fleet>/<robot>/record/`:
//!
//! | topic | message |
//! | --- | --- |
//! | `config` | the first message: who, which version, the vehicle's constants as TOML |
//! | `gyro`, `encoder`, `adc`, `remote`, `command`, `obstacle` | `{"n": …,` then the line of the trace |
//! | `outputs` | `{"n": …, "sample_crc": …,` then what was decided, numbers in full |
//! | `event` | `{"n": …,` then the event: who has control, goals, latches |
//!
//! `n` counts the controller's steps since boot and pairs a sample with its decision; a gap means
//! that the recorder had to drop. `sample_crc` is the CRC-32 of the sample's message: a sample that
//! was altered afterwards is found even if it changes no decision.

pub mod events;
mod schemas;
pub mod writer;

use crate::bounds;
use crate::error::Error;
use crate::input::Input;
use crc::{CRC_32_ISO_HDLC, Crc};
use mcap::records::Record;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;
use xtb_control::{Sample, Stamp};
use xtb_protocol::trace::{TraceReader, exact_decision_line, sample_line};
use xtb_robot::step_log::Step;

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// The topic of the first message.
pub const CONFIG: &str = "config";
/// The topic of decisions.
pub const OUTPUTS: &str = "outputs";
/// The topic of settings that were changed while the robot ran.
pub const PARAMS: &str = "params";

/// The first message of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "Who recorded what")]
pub struct Header {
    /// Of the program that recorded.
    pub version: String,
    /// The fleet.
    pub fleet: String,
    /// The robot.
    pub robot: String,
    /// Random at boot.
    pub epoch: u64,
    /// Wall clock at the start, RFC 3339.
    pub started: String,
    /// The vehicle's constants in force, as a configuration file.
    pub vehicle_toml: String,
}

/// A sample's message.
#[must_use]
pub fn sample_message(step: &Step) -> String {
    with_number(step.number, "", &sample_line(step.t, &step.sample))
}

/// A decision's message; `sample` is the message of its sample.
#[must_use]
pub fn outputs_message(step: &Step, sample: &str) -> String {
    let crc = format!("\"sample_crc\":{},", checksum(sample.as_bytes()));
    with_number(step.number, &crc, &exact_decision_line(&step.outputs))
}

/// The check sum that a decision keeps of its sample's message.
#[must_use]
pub fn checksum(message: &[u8]) -> u32 {
    CRC.checksum(message)
}

/// Puts the step's number in front of an object's own fields.
fn with_number(number: u64, more: &str, object: &str) -> String {
    format!("{{\"n\":{number},{more}{}", object.get(1..).unwrap_or_default())
}

/// Takes a leading `"name":number,` off an object.
fn take_number<'a>(object: &'a str, name: &str) -> Option<(u64, &'a str)> {
    let rest = object.strip_prefix("\"")?.strip_prefix(name)?.strip_prefix("\":")?;
    let (number, rest) = rest.split_once(',')?;
    Some((number.parse().ok()?, rest))
}

/// A step as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedStep {
    /// Its place among all steps since boot.
    pub number: u64,
    /// The kind of its sample, as the topic names it.
    pub kind: String,
    /// The message of its sample.
    pub sample_message: String,
    /// The check sum that was recorded of it.
    pub sample_crc: u32,
    /// What was decided: the line of the trace, numbers in full.
    pub decision: String,
}

impl RecordedStep {
    /// The sample.
    ///
    /// # Errors
    /// What is wrong with its message.
    pub fn sample(&self) -> Result<(Stamp, Sample), String> {
        let line = self.trace_line().ok_or("its message does not begin with its number")?;
        TraceReader::default().line(&line).map_err(|error| error.to_string())
    }

    /// The sample as a line of the trace.
    #[must_use]
    pub fn trace_line(&self) -> Option<String> {
        let (_, rest) = take_number(self.sample_message.strip_prefix('{')?, "n")?;
        Some(format!("{{{rest}"))
    }
}

/// How a recording ends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingEnding {
    /// The recorder finished it.
    Complete,
    /// It breaks off; the reader's words.
    Cut(String),
}

/// Reads a recording's steps, one after another; needs memory for one chunk only.
pub struct Recording {
    input: Input,
    topics: HashMap<u16, String>,
    header: Option<Header>,
    pending: Option<(u64, String, String)>,
    messages: u64,
}

impl Recording {
    /// Opens a recording and reads its header.
    ///
    /// # Errors
    /// It cannot be read, or is none.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let mut recording = Self {
            input: Input::open_strictly(path)?,
            topics: HashMap::new(),
            header: None,
            pending: None,
            messages: 0,
        };
        let Some((topic, message)) = recording.next_message()? else {
            return Err(Error::NotOfARobot("it holds no message".into()));
        };
        if topic != CONFIG {
            return Err(Error::NotOfARobot(format!("its first message is {topic:?}, not its header")));
        }
        let header = serde_json::from_str(&message)
            .map_err(|error| Error::NotOfARobot(format!("its header: {error}")))?;
        recording.header = Some(header);
        Ok(recording)
    }

    /// Who recorded what.
    #[must_use]
    pub fn header(&self) -> Option<&Header> {
        self.header.as_ref()
    }

    /// How it ends; known once [`Recording::next_step`] has given `None`.
    #[must_use]
    pub fn ending(&self) -> RecordingEnding {
        self.input
            .cut_because()
            .map_or(RecordingEnding::Complete, |words| RecordingEnding::Cut(words.to_owned()))
    }

    /// The next step; `None` at the end, or where the recording breaks off.
    ///
    /// # Errors
    /// A message that is none of a step. A cut is no error.
    pub fn next_step(&mut self) -> Result<Option<RecordedStep>, Error> {
        while let Some((topic, message)) = self.next_message()? {
            let number_of = |message: &str| {
                take_number(message.strip_prefix('{')?, "n").map(|(n, rest)| (n, rest.to_owned()))
            };
            let bad = |reason: &str| Error::Message { number: self.messages, reason: reason.into() };
            let (number, rest) = number_of(&message).ok_or_else(|| bad("a message without its number"))?;
            if topic == events::EVENTS || topic == PARAMS {
                continue;
            }
            if topic != OUTPUTS {
                self.pending = Some((number, topic, message));
                continue;
            }
            let Some((_, kind, sample_message)) = self.pending.take().filter(|(n, ..)| *n == number) else {
                return Err(Error::Message { number, reason: "its sample is missing".into() });
            };
            let (sample_crc, rest) = take_number(&rest, "sample_crc")
                .ok_or_else(|| Error::Message { number, reason: "no sample_crc".into() })?;
            let decision = format!("{{{rest}");
            let sample_crc = sample_crc as u32;
            return Ok(Some(RecordedStep { number, kind, sample_message, sample_crc, decision }));
        }
        Ok(None)
    }

    /// The last part of the next message's topic, and its text.
    fn next_message(&mut self) -> Result<Option<(String, String)>, Error> {
        Ok(self.next_timed()?.map(|(topic, _, text)| (topic, text)))
    }

    /// The same with its time since boot, in ns.
    fn next_timed(&mut self) -> Result<Option<(String, u64, String)>, Error> {
        while let Some(record) = self.input.next_record()? {
            match record {
                Record::Channel(channel) => {
                    let topic = channel.topic.rsplit('/').next().unwrap_or_default();
                    bounds::name(topic, bounds::beside(&self.topics, &channel.id))?;
                    self.topics.insert(channel.id, topic.to_owned());
                }
                Record::Message { header, data } => {
                    bounds::json(&data)?;
                    self.messages += 1;
                    let text = String::from_utf8_lossy(&data).into_owned();
                    let topic = self.topics.get(&header.channel_id).cloned().unwrap_or_default();
                    return Ok(Some((topic, header.log_time, text)));
                }
                _ => {}
            }
        }
        Ok(None)
    }
}
