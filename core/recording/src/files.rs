//! The only way to read a file, a regular one and no more of it than a limit, and to put another in its place.
//!
//! What a file is called may come out of another file, and either may be wrong or meant badly: a device that
//! never ends, a pipe to which nobody writes, a folder, a file that is longer than the memory.

use rustix::fs::OFlags;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io::{self, BufRead, Read, Write};
use std::os::unix::fs::{FileTypeExt, OpenOptionsExt, PermissionsExt};
use std::path::Path;
use thiserror::Error;

/// Longest file of settings, tasks, points or readings, and longest description of a map, in bytes.
pub const MAX_TEXT: usize = 4 << 20;
/// Longest image of a map, in bytes: four for each cell of the largest.
pub const MAX_IMAGE: usize = 64 << 20;
/// Longest line of a trace, in bytes.
pub const MAX_LINE: usize = 64 << 10;

/// Why a file was not read.
#[derive(Debug, Error)]
pub enum FileError {
    /// The system's own words.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It is something else than a file.
    #[error("it is {kind}, not a file")]
    NotAFile {
        /// With its article, such as `a folder`.
        kind: &'static str,
    },
    /// It is longer than anything of its kind.
    #[error("it is longer than the limit of {limit} bytes")]
    TooLong {
        /// The limit.
        limit: usize,
    },
    /// It is no text.
    #[error("it is not text (UTF-8)")]
    NotText,
}

impl FileError {
    /// Whether there is no such file.
    #[must_use]
    pub fn is_missing(&self) -> bool {
        matches!(self, Self::Io(error) if error.kind() == io::ErrorKind::NotFound)
    }
}

impl From<FileError> for io::Error {
    fn from(error: FileError) -> Self {
        match error {
            FileError::Io(error) => error,
            error => Self::other(error),
        }
    }
}

/// Opens a regular file for reading; nothing else is waited for.
///
/// # Errors
/// [`FileError::Io`] or [`FileError::NotAFile`].
pub fn open(path: &Path) -> Result<File, FileError> {
    // Opening a pipe would wait for its writer, and opening a device may do something.
    let kind = std::fs::metadata(path)?.file_type();
    regular(kind)?;
    let flags = i32::try_from(OFlags::NONBLOCK.bits()).unwrap_or_default();
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
    regular(file.metadata()?.file_type())?;
    Ok(file)
}

fn regular(kind: std::fs::FileType) -> Result<(), FileError> {
    let kind = match kind {
        kind if kind.is_file() => return Ok(()),
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a pipe",
        kind if kind.is_socket() => "a socket",
        _ => "a device",
    };
    Err(FileError::NotAFile { kind })
}

/// A whole file of at most `limit` bytes.
///
/// # Errors
/// Every [`FileError`] but [`FileError::NotText`].
pub fn bytes(path: &Path, limit: usize) -> Result<Vec<u8>, FileError> {
    let file = open(path)?;
    let mut bytes = Vec::new();
    file.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limit { Err(FileError::TooLong { limit }) } else { Ok(bytes) }
}

/// A whole text file of at most `limit` bytes.
///
/// # Errors
/// Every [`FileError`].
pub fn text(path: &Path, limit: usize) -> Result<String, FileError> {
    String::from_utf8(bytes(path, limit)?).map_err(|_| FileError::NotText)
}

/// The next line without its end, of at most `limit` bytes; `None` = there is none.
///
/// # Errors
/// [`FileError::Io`], [`FileError::TooLong`] or [`FileError::NotText`].
pub fn line(from: &mut impl BufRead, limit: usize) -> Result<Option<String>, FileError> {
    let mut line = Vec::new();
    from.take(limit as u64 + 1).read_until(b'\n', &mut line)?;
    if line.is_empty() {
        return Ok(None);
    }
    if line.pop_if(|last| *last == b'\n').is_some() {
        let _ = line.pop_if(|last| *last == b'\r');
    } else if line.len() > limit {
        return Err(FileError::TooLong { limit });
    }
    String::from_utf8(line).map(Some).map_err(|_| FileError::NotText)
}

/// Writes beside the file, which is made if it is missing, then takes its name: a power cut leaves the old one or the
/// new one. A link stays one, and the file's rights stay; a new one may be read by everybody.
///
/// # Errors
/// The system's words; nothing has changed.
pub fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let path = match path.canonicalize() {
        Ok(real) => real,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let rights = fs::metadata(&path).map(|file| file.permissions());
    let mut file = tempfile::Builder::new().prefix(".new-").tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().set_permissions(rights.unwrap_or_else(|_| Permissions::from_mode(0o644)))?;
    file.as_file().sync_all()?;
    file.persist(&path).map(drop).map_err(|error| error.error)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_its_limit_and_a_longer_one_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        std::fs::write(&path, "12345").unwrap();
        assert_eq!(text(&path, 5).unwrap(), "12345");
        let error = text(&path, 4).unwrap_err();
        assert_eq!(error.to_string(), "it is longer than the limit of 4 bytes");
        std::fs::write(&path, [0xFF]).unwrap();
        assert!(matches!(text(&path, 5), Err(FileError::NotText)));
        assert!(bytes(&folder.path().join("b"), 5).unwrap_err().is_missing());
        // A file with a hole is as long as it says.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert!(matches!(bytes(&path, 1000), Err(FileError::TooLong { limit: 1000 })));
    }

    #[test]
    fn devices_pipes_and_folders_are_named_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/zero", &link).unwrap();
        for (path, kind) in [
            (folder.path(), "a folder"),
            (&pipe, "a pipe"),
            (Path::new("/dev/zero"), "a device"),
            (&link, "a device"),
        ] {
            let error = bytes(path, 1000).unwrap_err();
            assert_eq!(error.to_string(), format!("it is {kind}, not a file"), "{}", path.display());
        }
    }

    #[test]
    fn lines_are_read_one_by_one_and_one_without_an_end_ends_it() {
        let mut lines = &b"one\r\ntwo\n\nlast"[..];
        for expected in ["one", "two", "", "last"] {
            assert_eq!(line(&mut lines, 4).unwrap().unwrap(), expected);
        }
        assert!(line(&mut lines, 4).unwrap().is_none());
        let mut endless = io::BufReader::new(io::repeat(b'x'));
        assert!(matches!(line(&mut endless, 1000), Err(FileError::TooLong { limit: 1000 })));
        assert!(matches!(line(&mut &b"\xFF\n"[..], 9), Err(FileError::NotText)));
    }
}
