//! Beginning a new ledger where one is: that one is kept aside, whole.
//!
//! ```text
//!   lock held ── FILE-wal ► ASIDE-wal ── FILE ► ASIDE ── note 0 ── new FILE
//! ```
//! A kill in between leaves either a file without its log or no file, and a note of what was acknowledged: the
//! next start refuses both, unless it is to begin anew as well.

use super::error::LedgerFault;
use super::holder::{Holder, beside};
use super::{Ledger, LedgerError, schema, sync_folder};
use rusqlite::{Connection, OpenFlags};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, UNIX_EPOCH};

const DOING: &str = "moving the previous ledger away";
/// Where SQLite's head has the application's id.
const ID_AT: usize = 68;
/// Ledgers put aside within the same second.
const MOST_IN_A_SECOND: usize = 100;

impl<R: Serialize + DeserializeOwned> Ledger<R> {
    /// Begins a new ledger at `now_ms`, in ms since 1970. Gives the path of the one that was put aside, if there
    /// was one: it can be read and opened there, also if it was damaged or a newer program's.
    ///
    /// # Errors
    /// Another process holds it; there is something else, or another fleet's; the system refuses.
    pub fn begin_anew(path: &Path, fleet: &str, now_ms: u64) -> Result<(Self, Option<PathBuf>), LedgerError> {
        Self::anew(path, fleet, now_ms).map_err(|fault| fault.of(path))
    }

    fn anew(path: &Path, fleet: &str, now_ms: u64) -> Result<(Self, Option<PathBuf>), LedgerFault> {
        let (holder, _) = Holder::take(path)?;
        let aside = if is_there(path)? {
            is_ours(path, fleet)?;
            let aside = name(path, now_ms)?;
            move_to(path, &aside).map_err(|error| LedgerFault::io(DOING, error))?;
            Some(aside)
        } else {
            None
        };
        holder.note_and_sync(0).map_err(|error| LedgerFault::io("writing the lock file", error))?;
        let (ledger, _) = Self::open_held(path, fleet, holder, Some(0))?;
        Ok((ledger, aside))
    }
}

fn is_there(path: &Path) -> Result<bool, LedgerFault> {
    path.try_exists().map_err(|error| LedgerFault::io("looking for it", error))
}

/// Nothing but a ledger of this fleet is moved. One whose fleet cannot be read any more counts as that.
fn is_ours(path: &Path, fleet: &str) -> Result<(), LedgerFault> {
    let mut head = Vec::new();
    if !path.metadata().is_ok_and(|found| found.is_file()) {
        return Err(LedgerFault::NotALedger { what: "it is not a file".into() });
    }
    let read = File::open(path).and_then(|file| file.take(100).read_to_end(&mut head));
    read.map_err(|error| LedgerFault::io("reading the head", error))?;
    if head.is_empty() {
        return Ok(());
    }
    if head.get(ID_AT..ID_AT + 4) != Some(schema::APPLICATION_ID.to_be_bytes().as_slice()) {
        return Err(LedgerFault::NotALedger { what: "it has no ledger signature".into() });
    }
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let found = Connection::open_with_flags(path, flags).ok().and_then(|read| schema::fleet(&read).ok());
    match found {
        Some(found) if found != fleet => Err(LedgerFault::OtherFleet { found, expected: fleet.to_owned() }),
        _ => Ok(()),
    }
}

/// `lab.before-20261122T161500Z.ledger` beside `lab.ledger`.
fn name(path: &Path, now_ms: u64) -> Result<PathBuf, LedgerFault> {
    let time = humantime::format_rfc3339_seconds(UNIX_EPOCH + Duration::from_millis(now_ms)).to_string();
    let time: String = time.chars().filter(|sign| !matches!(sign, '-' | ':')).collect();
    let text = |part: Option<&std::ffi::OsStr>| part.map(|part| part.to_string_lossy().into_owned());
    let stem = text(path.file_stem()).unwrap_or_default();
    let ending = text(path.extension()).map(|ending| format!(".{ending}")).unwrap_or_default();
    let mut names = (1..=MOST_IN_A_SECOND).map(|n| {
        let again = if n == 1 { String::new() } else { format!("-{n}") };
        path.with_file_name(format!("{stem}.before-{time}{again}{ending}"))
    });
    let free = names.find(|aside| !aside.exists() && !beside(aside, "-wal").exists());
    free.ok_or_else(|| LedgerFault::io(DOING, io::Error::from(io::ErrorKind::AlreadyExists)))
}

/// The log first: a ledger without its log is noticed, a log without its ledger would be another one's.
fn move_to(path: &Path, aside: &Path) -> io::Result<()> {
    let missing_is_fine = |done: io::Result<()>| match done {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        done => done,
    };
    missing_is_fine(fs::rename(beside(path, "-wal"), beside(aside, "-wal")))?;
    missing_is_fine(fs::remove_file(beside(path, "-shm")))?;
    fs::rename(path, aside)?;
    sync_folder(path)
}
