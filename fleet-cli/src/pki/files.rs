//! Files that only their owner can read, written whole or not at all; and the lock of a folder.

use std::fs::{self, DirBuilder, File, OpenOptions};
use std::io::{self, Write as _};
use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};

/// Makes a folder that only its owner can enter, if it is not there.
pub(super) fn private_folder(folder: &Path) -> Result<()> {
    if let Some(parent) = folder.parent().filter(|parent| !parent.as_os_str().is_empty()) {
        fs::create_dir_all(parent).map_err(failed(parent))?;
    }
    match DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(failed(folder)(error)),
        _ => Ok(()),
    }
}

/// Writes a file that only its owner can read, in place of the one that is there.
///
/// # Errors
/// The system's words.
pub fn private(path: &Path, bytes: &[u8]) -> Result<()> {
    beside(path, bytes).and_then(|new| fs::rename(new, path)).map_err(failed(path))
}

/// Writes it beside its place, to be renamed.
pub(super) fn beside(path: &Path, bytes: &[u8]) -> io::Result<std::path::PathBuf> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".new");
    let beside = path.with_file_name(name);
    match fs::remove_file(&beside) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
        _ => {}
    }
    let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&beside)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    Ok(beside)
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
