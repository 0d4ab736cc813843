//! The files of a recording: FILE, then FILE with -2, -3 … before its ending as each becomes too long.

use super::recorder::{FileRecord, Recorder, RecordingCounts};
use super::{BEGAN, COUNTS};
use crate::error::Error;
use crate::output::Output;
use mcap::records::Metadata;
use mcap::{McapError, McapResult};
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// Of `fleet-cli`: all crates of the workspace have the same.
const VERSION: &str = env!("CARGO_PKG_VERSION");

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
    output: Output,
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
    told: RecordingCounts,
}

impl McapWriter {
    /// Makes the first file, and writes its beginning through to the disk.
    ///
    /// # Errors
    /// [`Error::Exists`] or [`Error::Write`].
    pub fn create(settings: McapSettings, at_ns: u64) -> Result<Self, Error> {
        let path = settings.path.clone();
        let made = make(&path, settings.force);
        let file = made.map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => Error::Exists(path.clone()),
            _ => cannot_write(&path, &error.into()),
        })?;
        let reel = Reel::begin(&settings, &path, file, 1, at_ns).map_err(|e| cannot_write(&path, &e))?;
        let told = RecordingCounts::default();
        Ok(Self { settings, reel, number: 1, finished_bytes: 0, paths: vec![path], told })
    }

    /// Writes records into the present file.
    ///
    /// # Errors
    /// [`Error::Write`]: the disk is full or gone.
    pub fn write(&mut self, records: Vec<FileRecord>) -> Result<(), Error> {
        let reel = &mut self.reel;
        records.into_iter().try_for_each(|record| reel.write(record)).map_err(|e| self.failed(&e))
    }

    /// Closes the chunk, so that whatever happens to this program what is in it is safe; begins the next
    /// file if this one is long enough.
    ///
    /// # Errors
    /// [`Error::Write`]: the disk is full or gone.
    pub fn flush(
        &mut self,
        recorder: &mut Recorder,
        counts: RecordingCounts,
        at_ns: u64,
    ) -> Result<(), Error> {
        let bad = |counts: &RecordingCounts| (counts.dropped, counts.unreadable);
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

    fn turn(&mut self, recorder: &mut Recorder, counts: RecordingCounts, at_ns: u64) -> Result<(), Error> {
        self.finish(counts)?;
        let (path, file) = self.next_file()?;
        let begun = Reel::begin(&self.settings, &path, file, self.number, at_ns);
        self.reel = begun.map_err(|error| cannot_write(&path, &error))?;
        self.paths.push(path);
        self.write(recorder.next_file(at_ns))
    }

    /// The next number whose file is not there yet.
    fn next_file(&mut self) -> Result<(PathBuf, File), Error> {
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
    /// [`Error::Write`]: the disk is full or gone.
    pub fn finish(&mut self, counts: RecordingCounts) -> Result<(), Error> {
        let bytes = self.reel.finish(&counts).map_err(|e| self.failed(&e))?;
        self.finished_bytes += bytes;
        Ok(())
    }

    /// Bytes on the disk, of all files.
    ///
    /// # Errors
    /// [`Error::Io`]: the disk is gone.
    pub fn bytes(&self) -> Result<u64, Error> {
        Ok(self.finished_bytes + self.reel.output.file.metadata()?.len())
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

    fn failed(&self, error: &McapError) -> Error {
        cannot_write(&self.reel.path, error)
    }
}

impl Reel {
    fn begin(settings: &McapSettings, path: &Path, file: File, number: u32, at_ns: u64) -> McapResult<Self> {
        let output = Output::begin(file, format!("fleet-cli {VERSION}"))?;
        let mut reel = Self { path: path.to_owned(), output, topics: BTreeMap::new() };
        let about = [
            ("version", VERSION.to_owned()),
            ("fleet", settings.fleet.clone()),
            ("keys", settings.keys.join(" ")),
            ("file", number.to_string()),
            ("began_ns", at_ns.to_string()),
        ];
        reel.tell(BEGAN, about.map(|(name, value)| (name.to_owned(), value)).into())?;
        reel.flush()?;
        Ok(reel)
    }

    fn write(&mut self, record: FileRecord) -> McapResult<()> {
        match record {
            FileRecord::Topic { number, name, schema } => {
                self.topics.insert(number, self.output.topic(&name, schema)?);
            }
            FileRecord::Message { topic, sequence, log_ns, data } => {
                let channel = *self.topics.get(&topic).ok_or(McapError::UnknownChannel(sequence, topic))?;
                self.output.message(channel, sequence, log_ns, &data)?;
            }
        }
        Ok(())
    }

    fn tell(&mut self, name: &str, metadata: BTreeMap<String, String>) -> McapResult<()> {
        self.output.writer.write_metadata(&Metadata { name: name.to_owned(), metadata })
    }

    /// How long the file is now.
    fn flush(&mut self) -> McapResult<u64> {
        self.output.writer.flush()?;
        self.output.file.sync_data()?;
        Ok(self.output.file.metadata()?.len())
    }

    fn finish(&mut self, counts: &RecordingCounts) -> McapResult<u64> {
        self.tell(COUNTS, counted(counts))?;
        self.output.finish()?;
        Ok(self.output.file.metadata()?.len())
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

fn counted(counts: &RecordingCounts) -> BTreeMap<String, String> {
    let RecordingCounts { messages, derived, repeated, unreadable, dropped } = counts;
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

fn cannot_write(path: &Path, error: &McapError) -> Error {
    let (reason, full) = match error {
        McapError::Io(error) => (error.to_string(), error.kind() == io::ErrorKind::StorageFull),
        other => (other.to_string(), false),
    };
    Error::Write { path: path.to_owned(), reason, full }
}

#[cfg(test)]
mod tests;
