//! Files that only their owner can read, with the CLI's errors; and the lock of a folder.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::Path;
use xtb_bus::private_file;
use xtb_client::{Error, ErrorKind, Result};

/// Makes a folder that only its owner can enter, if it is not there.
pub(super) fn private_folder(folder: &Path) -> Result<()> {
    private_file::folder(folder).map_err(failed(folder))
}

/// Writes a file that only its owner can read, in place of the one that is there.
///
/// # Errors
/// The system's words.
pub fn private(path: &Path, bytes: &[u8]) -> Result<()> {
    private_file::write(path, bytes).map_err(failed(path))
}

/// Waits until nobody else changes this folder; nobody does while the file is kept.
pub(super) fn lock(folder: &Path) -> Result<File> {
    let path = folder.join("lock");
    let open = || OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(&path);
    let file = open().map_err(failed(&path))?;
    file.lock().map_err(failed(&path))?;
    Ok(file)
}

pub(super) fn failed(path: &Path) -> impl FnOnce(io::Error) -> Error {
    let path = path.display().to_string();
    move |error| Error::new(ErrorKind::Failed, format!("cannot write {path}: {error}"))
}
