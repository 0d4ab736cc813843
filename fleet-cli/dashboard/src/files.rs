//! Files that the server reads again when they change: bounded, and only when they are other ones.

use std::io;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;

/// A longer one is neither a registry nor a certificate.
const MAX: u64 = 4 * 1024 * 1024;

/// Changes with the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stamp {
    inode: u64,
    length: u64,
    seconds: i64,
    nanoseconds: i64,
}

/// `None` = it is not there.
pub(super) fn stamp(path: &Path) -> Option<Stamp> {
    let about = std::fs::metadata(path).ok()?;
    let (inode, length) = (about.ino(), about.len());
    Some(Stamp { inode, length, seconds: about.mtime(), nanoseconds: about.mtime_nsec() })
}

/// The text of a file.
///
/// # Errors
/// It cannot be read, is none, or is too long.
pub(super) fn read(path: &Path) -> io::Result<String> {
    let about = std::fs::metadata(path)?;
    if !about.is_file() || about.len() > MAX {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "not a regular file, or too long"));
    }
    std::fs::read_to_string(path)
}
