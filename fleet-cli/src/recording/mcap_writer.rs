//! The files of a recording: FILE, then FILE with -2, -3 … before its ending as each becomes too long.

use super::recorder::{Counts, Record, Recorder};
use super::{BEGAN, COUNTS};
use crate::error::{Failure, Kind, Result};
use mcap::records::{MessageHeader, Metadata};
use mcap::{McapError, WriteOptions, Writer};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

/// A chunk is closed when it has become this long, in bytes, if its time has not come before.
const CHUNK: u64 = 1 << 20;

/// What is written where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct McapSettings {
    /// The first file.
    pub path: PathBuf,
    /// Whether files that are there already may be overwritten.
    pub force: bool,
    /// A file that has become this long, in bytes, is finished, and the next one begun.
    pub max_bytes: u64,
    /// Who is recorded.
    pub fleet: String,
    /// Which key expressions.
    pub keys: Vec<String>,
}

/// A file that is being written.
struct Reel {
    path: PathBuf,
    file: File,
    writer: Writer<BufWriter<File>>,
    topics: BTreeMap<u16, u16>,
}

/// The files.
pub struct McapWriter {
    settings: McapSettings,
    reel: Reel,
    number: u32,
    /// Bytes of the files before this one.
    finished_bytes: u64,
    paths: Vec<PathBuf>,
    told: Counts,
}

impl McapWriter {
    /// Makes the first file, and writes its beginning through to the disk.
    ///
    /// # Errors
    /// [`Kind::Usage`]: it is there already; [`Kind::Failed`]: it cannot be written.
    pub fn create(settings: McapSettings, at_ns: u64) -> Result<Self> {
        let path = settings.path.clone();
        let made = make(&path, settings.force);
        let file = made.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => {
                Failure::new(Kind::Usage, format!("{} already exists", path.display()))
                    .hint("choose another file with --out, or overwrite it with --force")
            }
            _ => cannot_write(&path, &error.into()),
        })?;
        let reel = Reel::begin(&settings, &path, file, 1, at_ns).map_err(|e| cannot_write(&path, &e))?;
        let told = Counts::default();
        Ok(Self { settings, reel, number: 1, finished_bytes: 0, paths: vec![path], told })
    }

    /// Writes records into the present file.
    ///
    /// # Errors
    /// [`Kind::Failed`]: the disk is full or gone.
    pub fn write(&mut self, records: Vec<Record>) -> Result<()> {
        let reel = &mut self.reel;
        records.into_iter().try_for_each(|record| reel.write(record)).map_err(|e| self.failed(&e))
    }

    /// Closes the chunk, so that whatever happens to this program what is in it is safe; begins the next
    /// file if this one is long enough.
    ///
    /// # Errors
    /// [`Kind::Failed`]: the disk is full or gone.
    pub fn flush(&mut self, recorder: &mut Recorder, counts: Counts, at_ns: u64) -> Result<()> {
        let bad = |counts: &Counts| (counts.dropped, counts.unreadable);
        if bad(&counts) != bad(&self.told) {
            self.told = counts;
            self.reel.tell(COUNTS, counted(&counts)).map_err(|e| self.failed(&e))?;
        }
        let bytes = self.reel.flush().map_err(|e| self.failed(&e))?;
        if bytes >= self.settings.max_bytes {
            self.turn(recorder, counts, at_ns)?;
        }
        Ok(())
    }

    fn turn(&mut self, recorder: &mut Recorder, counts: Counts, at_ns: u64) -> Result<()> {
        self.finish(counts)?;
        let (path, file) = self.next_file()?;
        let begun = Reel::begin(&self.settings, &path, file, self.number, at_ns);
        self.reel = begun.map_err(|error| cannot_write(&path, &error))?;
        self.paths.push(path);
        self.write(recorder.next_file(at_ns))
    }

    /// The next number whose file is not there yet.
    fn next_file(&mut self) -> Result<(PathBuf, File)> {
        loop {
            self.number += 1;
            let path = numbered(&self.settings.path, self.number);
            match make(&path, self.settings.force) {
                Ok(file) => return Ok((path, file)),
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(cannot_write(&path, &error.into())),
            }
        }
    }

    /// Writes summary, statistics and index.
    ///
    /// # Errors
    /// [`Kind::Failed`]: the disk is full or gone.
    pub fn finish(&mut self, counts: Counts) -> Result<()> {
        let bytes = self.reel.finish(&counts).map_err(|e| self.failed(&e))?;
        self.finished_bytes += bytes;
        Ok(())
    }

    /// Bytes on the disk, of all files.
    ///
    /// # Errors
    /// [`Kind::Failed`]: the disk is gone.
    pub fn bytes(&self) -> Result<u64> {
        Ok(self.finished_bytes + self.reel.file.metadata()?.len())
    }

    /// Bytes of the files that are finished.
    #[must_use]
    pub fn finished_bytes(&self) -> u64 {
        self.finished_bytes
    }

    /// The files so far.
    #[must_use]
    pub fn paths(&self) -> &[PathBuf] {
        &self.paths
    }

    fn failed(&self, error: &McapError) -> Failure {
        cannot_write(&self.reel.path, error)
    }
}

impl Reel {
    fn begin(
        settings: &McapSettings,
        path: &Path,
        file: File,
        number: u32,
        at_ns: u64,
    ) -> std::result::Result<Self, McapError> {
        let options = WriteOptions::new()
            .profile("")
            .library(format!("fleet-cli {}", env!("CARGO_PKG_VERSION")))
            .chunk_size(Some(CHUNK))
            .compression_threads(0);
        let writer = options.create(BufWriter::new(file.try_clone()?))?;
        let mut reel = Self { path: path.to_owned(), file, writer, topics: BTreeMap::new() };
        let about = [
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            ("fleet", settings.fleet.clone()),
            ("keys", settings.keys.join(" ")),
            ("file", number.to_string()),
            ("began_ns", at_ns.to_string()),
        ];
        reel.tell(BEGAN, about.map(|(name, value)| (name.to_owned(), value)).into())?;
        reel.flush()?;
        Ok(reel)
    }

    fn write(&mut self, record: Record) -> std::result::Result<(), McapError> {
        match record {
            Record::Topic { number, name, schema } => {
                let schema = self.writer.add_schema(&schema.name, "jsonschema", &schema.text)?;
                let channel = self.writer.add_channel(schema, &name, "json", &BTreeMap::new())?;
                self.topics.insert(number, channel);
            }
            Record::Message { topic, sequence, log_ns, data } => {
                let channel_id =
                    *self.topics.get(&topic).ok_or(McapError::UnknownChannel(sequence, topic))?;
                let header = MessageHeader { channel_id, sequence, log_time: log_ns, publish_time: log_ns };
                self.writer.write_to_known_channel(&header, &data)?;
            }
        }
        Ok(())
    }

    fn tell(&mut self, name: &str, metadata: BTreeMap<String, String>) -> std::result::Result<(), McapError> {
        self.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    /// How long the file is now.
    fn flush(&mut self) -> std::result::Result<u64, McapError> {
        self.writer.flush()?;
        self.file.sync_data()?;
        Ok(self.file.metadata()?.len())
    }

    fn finish(&mut self, counts: &Counts) -> std::result::Result<u64, McapError> {
        self.tell(COUNTS, counted(counts))?;
        self.writer.finish()?;
        self.file.sync_all()?;
        Ok(self.file.metadata()?.len())
    }
}

fn make(path: &Path, force: bool) -> io::Result<File> {
    if force { File::create(path) } else { File::create_new(path) }
}

/// `day.mcap` is followed by `day-2.mcap`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map_or_else(String::new, |it| format!(".{}", it.to_string_lossy()));
    path.with_file_name(format!("{stem}-{number}{ending}"))
}

fn counted(counts: &Counts) -> BTreeMap<String, String> {
    let Counts { messages, derived, repeated, unreadable, dropped } = counts;
    [
        ("messages", messages),
        ("derived", derived),
        ("repeated", repeated),
        ("unreadable", unreadable),
        ("dropped", dropped),
    ]
    .map(|(name, count)| (name.to_owned(), count.to_string()))
    .into()
}

fn cannot_write(path: &Path, error: &McapError) -> Failure {
    let (reason, full) = match error {
        McapError::Io(error) => (error.to_string(), error.kind() == io::ErrorKind::StorageFull),
        other => (other.to_string(), false),
    };
    let failure = Failure::new(Kind::Failed, format!("cannot write {}: {reason}", path.display()));
    match full {
        true => {
            failure.hint("the disk is full: the recording so far is readable; free space, then record again")
        }
        false => failure.hint("check that the folder exists and is writable"),
    }
}

#[cfg(test)]
mod tests;
