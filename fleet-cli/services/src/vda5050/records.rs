//! Where orders are kept: a file a robot, written beside and renamed, so that a kill leaves the old or the new one.

use super::failed;
use crate::ledger::sync_folder;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xtb_bus::private_file;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_recording::files;
use xtb_vda5050::incoming::MAX_BYTES;
use xtb_vda5050::record::OrderRecord;

/// Longest file that is read, in bytes: two orders and what belongs to them.
const MOST_BYTES: usize = 8 * MAX_BYTES;

/// The folder of all robots' orders, held by this process alone.
#[derive(Debug, Clone)]
pub(super) struct Records {
    folder: PathBuf,
    /// Locked until the process ends.
    _lock: Arc<File>,
}

impl Records {
    /// Takes the folder, and makes it if there is none.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: it cannot be used; [`ErrorKind::Failed`]: another bridge uses it.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let cannot = |error: io::Error| failed(format!("cannot use {}: {error}", folder.display()));
        fs::create_dir_all(folder).map_err(cannot)?;
        let lock = folder.join("lock");
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(lock).map_err(cannot)?;
        match file.try_lock() {
            Ok(()) => Ok(Self { folder: folder.to_owned(), _lock: Arc::new(file) }),
            Err(TryLockError::WouldBlock) => {
                let message = format!("another bridge uses {}", folder.display());
                Err(Error::new(ErrorKind::Failed, message)
                    .hint("end that one, or give another folder with --state"))
            }
            Err(TryLockError::Error(error)) => Err(cannot(error)),
        }
    }

    fn path(&self, robot: &Name) -> PathBuf {
        self.folder.join(format!("{robot}.json"))
    }

    /// What was kept of a robot.
    ///
    /// # Errors
    /// A file that cannot be read, or is none of ours: nothing is guessed.
    pub(super) fn read(&self, robot: &Name) -> Result<OrderRecord> {
        let path = self.path(robot);
        let cannot = |what: String| {
            failed(format!("{}: {what}", path.display()))
                .hint("look into it; without the file the robot begins without an order")
        };
        match files::text(&path, MOST_BYTES) {
            Ok(text) => OrderRecord::from_json(&text).map_err(cannot),
            Err(error) if error.is_missing() => Ok(OrderRecord::default()),
            Err(error) => Err(cannot(error.to_string())),
        }
    }

    /// Keeps this of a robot, on the disk when it returns. Waits for the disk: not for an async task.
    ///
    /// # Errors
    /// What was kept before is kept still.
    pub(super) fn write(&self, robot: &Name, record: &str) -> io::Result<()> {
        let path = self.path(robot);
        private_file::write(&path, record.as_bytes())?;
        sync_folder(&path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> Name {
        Name::new("xtb-1").unwrap()
    }

    #[test]
    fn what_is_kept_is_read_again_and_what_is_none_of_ours_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let records = Records::open(&folder.path().join("a/b")).unwrap();
        assert_eq!(records.read(&robot()).unwrap(), OrderRecord::default());
        let record = OrderRecord { paused: true, ..OrderRecord::default() };
        records.write(&robot(), &record.to_json()).unwrap();
        assert_eq!(records.read(&robot()).unwrap(), record);
        records.write(&robot(), "{").unwrap();
        assert!(records.read(&robot()).unwrap_err().message.contains("xtb-1.json"));
        records.write(&robot(), &"x".repeat(MOST_BYTES + 1)).unwrap();
        assert!(records.read(&robot()).is_err());
    }

    #[test]
    fn one_bridge_uses_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let first = Records::open(folder.path()).unwrap();
        assert!(Records::open(folder.path()).unwrap_err().message.contains("another bridge"));
        drop(first);
        Records::open(folder.path()).unwrap();
    }
}
