//! Reads a recording of the fleet from its beginning, message by message, with memory for one chunk
//! only. A file that was cut is read up to the cut.

use super::{BEGAN, COUNTS};
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use robot_agent::files::{self, FileError};
use robot_agent::recording::bounds::{self, Excess};
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file is not a recording, or is damaged.
#[derive(Debug, Error)]
pub enum ReadError {
    /// It cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It cannot be opened, or is no file.
    #[error(transparent)]
    File(#[from] FileError),
    /// It holds more of something than any recording does.
    #[error(transparent)]
    Excess(#[from] Excess),
    /// It is not MCAP, or damaged.
    #[error("{0}")]
    Mcap(#[from] McapError),
    /// It is MCAP without a message.
    #[error("it has no messages")]
    Empty,
    /// It is MCAP, but nothing of a fleet.
    #[error("not a recording of a fleet")]
    Foreign,
}

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
pub struct Span {
    /// The first message.
    pub began_ns: u64,
    /// The last one.
    pub ended_ns: u64,
}

impl Span {
    /// How long it is.
    #[must_use]
    pub fn duration_ns(self) -> u64 {
        self.ended_ns.saturating_sub(self.began_ns)
    }
}

/// A recording that is being read.
pub struct Reader {
    file: File,
    path: PathBuf,
    reader: LinearReader,
    schemas: HashMap<u16, String>,
    channels: HashMap<u16, (String, String)>,
    metadata: BTreeMap<String, BTreeMap<String, String>>,
    cut: Option<String>,
    over: bool,
}

impl Reader {
    /// Opens a recording at its beginning.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::with(path, bounds::reader_options())
    }

    fn with(path: &Path, options: LinearReaderOptions) -> Result<Self, ReadError> {
        Ok(Self {
            file: files::open(path)?,
            path: path.to_owned(),
            reader: LinearReader::new_with_options(options),
            schemas: HashMap::new(),
            channels: HashMap::new(),
            metadata: BTreeMap::new(),
            cut: None,
            over: false,
        })
    }

    /// The next message; `None` at the end, or where the file breaks off.
    ///
    /// # Errors
    /// [`ReadError::Io`] or [`ReadError::Mcap`]. A cut is no error.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, ReadError> {
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
    fn next_record(&mut self) -> Result<Option<Record<'static>>, ReadError> {
        while !self.over {
            let event = match self.reader.next_event() {
                None => return Ok(self.cut(&McapError::UnexpectedEof)),
                Some(Err(error)) if breaks_off(&error) => return Ok(self.cut(&error)),
                Some(Err(error)) => return Err(error.into()),
                Some(Ok(event)) => event,
            };
            let (data, opcode) = match event {
                LinearReadEvent::ReadRequest(need) => {
                    let read = self.file.read(self.reader.insert(need))?;
                    self.reader.notify_read(read);
                    continue;
                }
                LinearReadEvent::Record { data, opcode } => (data, opcode),
            };
            bounds::record(opcode, data.len())?;
            match mcap::parse_record(opcode, data)?.into_owned() {
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
                // After the data come indexes only; a file that has got so far is complete.
                Record::DataEnd(_) => self.over = true,
                record => return Ok(Some(record)),
            }
        }
        Ok(None)
    }

    /// The file ends before its data do.
    fn cut(&mut self, error: &McapError) -> Option<Record<'static>> {
        self.over = true;
        self.cut = Some(error.to_string());
        None
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
        self.cut.as_deref()
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
/// Every [`ReadError`].
pub fn span(path: &Path) -> Result<Span, ReadError> {
    let mut reader = Reader::with(path, bounds::reader_options().with_emit_chunks(true))?;
    let mut found: Option<Span> = None;
    while let Some(record) = reader.next_record()? {
        let (began_ns, ended_ns) = match record {
            Record::Chunk { header, .. } => (header.message_start_time, header.message_end_time),
            Record::Message { header, .. } => (header.log_time, header.log_time),
            _ => continue,
        };
        let so_far = found.unwrap_or(Span { began_ns, ended_ns });
        found =
            Some(Span { began_ns: so_far.began_ns.min(began_ns), ended_ns: so_far.ended_ns.max(ended_ns) });
    }
    found.ok_or(ReadError::Empty)
}

/// How many are known beside this one.
fn beside<K: Eq + std::hash::Hash, V>(known: &HashMap<K, V>, id: &K) -> usize {
    known.len() - usize::from(known.contains_key(id))
}

/// Whether a reader's error means that the file ends too early, and not that it is damaged.
fn breaks_off(error: &McapError) -> bool {
    match error {
        McapError::UnexpectedEof | McapError::UnexpectedEoc => true,
        // So a chunk begins that was still being written.
        McapError::RecordTooLarge { len: u64::MAX, .. } => true,
        McapError::Io(error) => error.kind() == io::ErrorKind::UnexpectedEof,
        _ => false,
    }
}
