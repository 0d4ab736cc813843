//! The end that reads, for both kinds of recordings: record by record, with memory for one chunk only. A file
//! that was cut is read up to the cut.

use crate::bounds;
use crate::error::Error;
use crate::files;
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// A file that is being read.
pub(crate) struct Input {
    file: File,
    reader: LinearReader,
    /// Whether it ends as a finished file does: if it breaks off all the same, it is damaged.
    finished: bool,
    cut: Option<String>,
    over: bool,
}

impl Input {
    /// Opens a file at its beginning. Wherever it breaks off, that is a cut.
    ///
    /// # Errors
    /// [`Error::File`].
    pub(crate) fn open(path: &Path, options: LinearReaderOptions) -> Result<Self, Error> {
        let (file, reader) = (files::open(path)?, LinearReader::new_with_options(options));
        Ok(Self { file, reader, finished: false, cut: None, over: false })
    }

    /// The same, but a file that was finished and breaks off, or whose data have not their check sum, is damaged.
    ///
    /// # Errors
    /// [`Error::File`] or [`Error::Io`].
    pub(crate) fn open_strictly(path: &Path) -> Result<Self, Error> {
        let mut input = Self::open(path, bounds::reader_options().with_validate_data_section_crc(true))?;
        input.finished = ends_with_magic(&mut input.file)?;
        Ok(input)
    }

    /// The next record of the data; `None` at their end, or where the file breaks off.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Excess`] or [`Error::Mcap`]. A cut is no error.
    pub(crate) fn next_record(&mut self) -> Result<Option<Record<'static>>, Error> {
        while !self.over {
            let event = match self.reader.next_event() {
                None => return self.cut(McapError::UnexpectedEof),
                Some(Err(error)) if breaks_off(&error) => return self.cut(error),
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
                // After the data come indexes only; a file that has got so far is complete.
                Record::DataEnd(_) => self.over = true,
                record => return Ok(Some(record)),
            }
        }
        Ok(None)
    }

    /// The file ends before its data do.
    fn cut(&mut self, error: McapError) -> Result<Option<Record<'static>>, Error> {
        if self.finished {
            return Err(error.into());
        }
        self.over = true;
        self.cut = Some(error.to_string());
        Ok(None)
    }

    /// Why it breaks off, if it does: the reader's words. Known once there is no next record.
    pub(crate) fn cut_because(&self) -> Option<&str> {
        self.cut.as_deref()
    }
}

/// Whether a file ends with MCAP's magic bytes; leaves it at its beginning.
fn ends_with_magic(file: &mut File) -> io::Result<bool> {
    let mut end = [0; mcap::MAGIC.len()];
    let long_enough = file.metadata()?.len() >= 2 * end.len() as u64;
    if long_enough {
        file.seek(SeekFrom::End(-(end.len() as i64)))?;
        file.read_exact(&mut end)?;
        file.rewind()?;
    }
    Ok(long_enough && end == mcap::MAGIC)
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
