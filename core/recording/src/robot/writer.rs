//! The file of a robot's steps while it is written: its name, its header, and what a step becomes.

use super::{CONFIG, Header, OUTPUTS, PARAMS, events, outputs_message, sample_message, schemas, with_number};
use crate::error::Error;
use crate::output::Output;
use crate::schema::Schema;
use mcap::{McapError, McapResult};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_protocol::keys::{Name, RobotKeys};
use xtb_protocol::messages::{Event, ParamChange, RecordingName};
use xtb_protocol::trace::kind;
use xtb_robot::step_log::Step;

/// `DIR/xtb-1-20041201T120000Z.mcap`, with a number if that exists; `time` is written as in there.
///
/// # Errors
/// The time is not written so.
pub fn fresh_path(folder: &Path, robot: &Name, time: &str) -> io::Result<PathBuf> {
    let unnamed = || io::Error::other(format!("a recording cannot be named after {time:?}"));
    for number in 1.. {
        let name = RecordingName::new(robot, time, number).ok_or_else(unnamed)?;
        let path = folder.join(name.as_str());
        if !path.exists() {
            return Ok(path);
        }
    }
    Err(unnamed())
}

/// The file.
pub struct StepWriter {
    output: Output,
    kinds: BTreeMap<&'static str, u16>,
    outputs: u16,
    events: u16,
    /// Settings that were changed, once there is one.
    params: Option<u16>,
    params_topic: String,
    /// Number of the last step.
    last: u64,
}

impl StepWriter {
    /// Makes the file and writes its header through to the disk.
    ///
    /// # Errors
    /// [`Error::Mcap`]: it is there already, or cannot be written.
    pub fn create(path: &Path, header: &Header, keys: &RobotKeys) -> Result<Self, Error> {
        Self::begin(path, header, keys).map_err(Error::from)
    }

    fn begin(path: &Path, header: &Header, keys: &RobotKeys) -> McapResult<Self> {
        let file = File::create_new(path)?;
        let mut output = Output::begin(file, format!("robot-agent {}", header.version))?;
        let mut channel = |name: &str, schema: Schema| output.topic(&keys.record(name), &schema);
        let config = channel(CONFIG, schemas::config())?;
        let outputs = channel(OUTPUTS, schemas::outputs())?;
        let events = channel(events::EVENTS, schemas::events())?;
        let kinds = schemas::KINDS
            .into_iter()
            .map(|(kind, title)| Ok((kind, channel(kind, schemas::sample(kind, title))?)));
        let kinds = kinds.collect::<McapResult<_>>()?;
        let text = serde_json::to_vec(header).map_err(io::Error::from)?;
        output.message(config, 0, 0, &text)?;
        output.writer.flush()?;
        output.file.sync_all()?;
        let params_topic = keys.record(PARAMS);
        Ok(Self { output, kinds, outputs, events, params: None, params_topic, last: 0 })
    }

    /// Writes a step: its sample, and what was decided.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn write(&mut self, step: &Step) -> Result<(), Error> {
        let sample = sample_message(step);
        let outputs = outputs_message(step, &sample);
        let (sequence, log_ns) = (step.number as u32, step.t.ns());
        if let Some(kind) = self.kinds.get(kind(&step.sample)) {
            self.output.message(*kind, sequence, log_ns, sample.as_bytes())?;
        }
        self.output.message(self.outputs, sequence, log_ns, outputs.as_bytes())?;
        self.last = step.number;
        Ok(())
    }

    /// Writes an event, of this moment since boot.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn write_event(&mut self, t: Stamp, event: &Event) -> Result<(), Error> {
        let message = events::message(self.last, event).map_err(io::Error::from)?;
        self.output.message(self.events, event.seq as u32, t.ns(), message.as_bytes())?;
        Ok(())
    }

    /// Writes a changed setting, of this moment since boot; its topic begins with the first one.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn write_param(&mut self, t: Stamp, change: &ParamChange) -> Result<(), Error> {
        let channel = match self.params {
            Some(channel) => channel,
            None => *self.params.insert(self.output.topic(&self.params_topic, &schemas::params())?),
        };
        let text = serde_json::to_string(change).map_err(io::Error::from)?;
        let message = with_number(self.last, "", &text);
        self.output.message(channel, 0, t.ns(), message.as_bytes())?;
        Ok(())
    }

    /// Closes the chunk: what is in it can be read from now on, even if this program is killed.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn close_chunk(&mut self) -> Result<(), Error> {
        self.output.writer.flush().map_err(Error::from)
    }

    /// What sees the closed chunks onto the disk, from another thread.
    #[must_use]
    pub fn disk(&self) -> Disk {
        Disk(Arc::clone(&self.output.file))
    }

    /// Writes summary, statistics and index, and sees everything onto the disk.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn finish(&mut self) -> Result<(), Error> {
        self.output.finish().map_err(Error::from)
    }
}

/// Sees a file onto the disk, from whichever thread.
#[derive(Debug, Clone)]
pub struct Disk(Arc<File>);

impl Disk {
    /// Waits until the chunks that are closed are on the disk.
    ///
    /// # Errors
    /// [`Error::Mcap`]: the disk is full or gone.
    pub fn sync(&self) -> Result<(), Error> {
        self.0.sync_data().map_err(McapError::from)?;
        Ok(())
    }
}
