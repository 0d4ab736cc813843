//! Reads a recording of the fleet from its beginning, message by message, with memory for one chunk
//! only. A file that was cut is read up to the cut.

use super::schemas::{is_derived, presence_of};
use super::{BEGAN, COUNTS};
use crate::bounds::{self, beside};
use crate::error::Error;
use crate::input::Input;
use mcap::records::Record;
use mcap::sans_io::LinearReaderOptions;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use xtb_client::messages::{AnyMessage, Unreadable};
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, Key};

/// A message as it was recorded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recorded {
    /// Its topic: the Zenoh key, or that of something derived.
    pub topic: String,
    /// The name of its schema.
    pub schema: String,
    /// When it came, in ns since 1970.
    pub log_ns: u64,
    /// JSON.
    pub data: Vec<u8>,
}

/// From when to when a recording goes, in ns since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimeSpan {
    /// The first message.
    pub began_ns: u64,
    /// The last one.
    pub ended_ns: u64,
}

impl TimeSpan {
    /// How long it is.
    #[must_use]
    pub fn duration_ns(self) -> u64 {
        self.ended_ns.saturating_sub(self.began_ns)
    }
}

/// A recording that is being read.
pub struct RecordingReader {
    input: Input,
    path: PathBuf,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, (String, String)>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
}

impl RecordingReader {
    /// Opens a recording at its beginning.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(path: &Path) -> Result<Self, Error> {
        Self::with(path, bounds::reader_options())
    }

    fn with(path: &Path, options: LinearReaderOptions) -> Result<Self, Error> {
        Ok(Self {
            input: Input::open(path, options)?,
            path: path.to_owned(),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            metadata: BTreeMap::new(),
        })
    }

    /// The next message; `None` at the end, or where the file breaks off.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Excess`] or [`Error::Mcap`]. A cut is no error.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, Error> {
        while let Some(record) = self.next_record()? {
            if let Record::Message { header, data } = record {
                bounds::json(&data)?;
                let (topic, schema) = self.channels.get(&header.channel_id).cloned().unwrap_or_default();
                return Ok(Some(Recorded {
                    topic,
                    schema,
                    log_ns: header.log_time,
                    data: data.into_owned(),
                }));
            }
        }
        Ok(None)
    }

    /// The next record of the data; schemas, channels and metadata are remembered on the way.
    fn next_record(&mut self) -> Result<Option<Record<'static>>, Error> {
        while let Some(record) = self.input.next_record()? {
            match record {
                Record::Schema { header, .. } => {
                    bounds::name(&header.name, beside(&self.schemas, &header.id))?;
                    self.schemas.insert(header.id, header.name);
                }
                Record::Channel(channel) => {
                    bounds::name(&channel.topic, beside(&self.channels, &channel.id))?;
                    let schema = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    self.channels.insert(channel.id, (channel.topic, schema));
                }
                // Others are none of ours.
                Record::Metadata(metadata) if [BEGAN, COUNTS].contains(&metadata.name.as_str()) => {
                    self.metadata.insert(metadata.name, metadata.metadata);
                }
                record => return Ok(Some(record)),
            }
        }
        Ok(None)
    }

    /// Metadata of this name, as far as it was read; of several the last.
    #[must_use]
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.metadata.get(name)
    }

    /// The fleet that was recorded; known after the first message.
    #[must_use]
    pub fn fleet(&self) -> Option<&str> {
        self.metadata(BEGAN)?.get("fleet").map(String::as_str)
    }

    /// Why it breaks off, if it does: the reader's words.
    #[must_use]
    pub fn cut_because(&self) -> Option<&str> {
        self.input.cut_because()
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// From when to when a recording goes, without looking into its chunks.
///
/// # Errors
/// It cannot be read, or holds no message.
pub fn span(path: &Path) -> Result<TimeSpan, Error> {
    let mut reader = RecordingReader::with(path, bounds::reader_options().with_emit_chunks(true))?;
    let mut found: Option<TimeSpan> = None;
    while let Some(record) = reader.next_record()? {
        let (began_ns, ended_ns) = match record {
            Record::Chunk { header, .. } => (header.message_start_time, header.message_end_time),
            Record::Message { header, .. } => (header.log_time, header.log_time),
            _ => continue,
        };
        let so_far = found.unwrap_or(TimeSpan { began_ns, ended_ns });
        found = Some(TimeSpan {
            began_ns: so_far.began_ns.min(began_ns),
            ended_ns: so_far.ended_ns.max(ended_ns),
        });
    }
    found.ok_or(Error::Empty)
}

/// At its beginning, and whose recording it is.
///
/// # Errors
/// It cannot be read, or is no recording of a fleet.
pub fn begin(path: &Path) -> Result<(RecordingReader, Name), Error> {
    let mut first = RecordingReader::open(path)?;
    let message = first.next_message()?.ok_or(Error::Empty)?;
    let told = first.fleet().and_then(|fleet| Name::new(fleet).ok());
    let fleet = told.or_else(|| Some(Key::parse(&message.topic)?.fleet)).ok_or(Error::NotOfAFleet)?;
    Ok((RecordingReader::open(path)?, fleet))
}

/// One message as screens take it; `None` for what is derived of others.
#[must_use]
pub fn read(recorded: &Recorded) -> Option<Result<(Key, AnyMessage), Unreadable>> {
    if is_derived(&recorded.schema) {
        return None;
    }
    let Some(key) = Key::parse(&recorded.topic) else { return Some(Err(Unreadable::Foreign)) };
    let news = match key.channel {
        Channel::Alive | Channel::TrafficAlive | Channel::DispatchAlive => {
            presence_of(&recorded.data).map(AnyMessage::Alive).ok_or(Unreadable::Presence)
        }
        _ => AnyMessage::of_json(&key.channel, &recorded.data),
    };
    Some(news.map(|news| (key, news)))
}
