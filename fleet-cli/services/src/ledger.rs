//! The dispatcher's ledger: a file in which every record is on the disk before it is acknowledged.
//!
//! A record is any serde value, kept as JSON text with a number (1, 2, 3 … without gaps, for ever), the wall
//! clock's time and a check sum. A snapshot is a record that replaces all before it. What the file promises,
//! and what it does when the disk is full or damaged, is told in `docs/ledger.md`; it never begins anew by
//! itself where something was.
//!
//! [`Ledger`] writes and waits for the disk; [`LedgerWriter`] does so on a thread, many submissions to a commit;
//! [`read`] reads beside a running dispatcher, and what is left of a damaged file; [`LedgerReader`] hands records on
//! to a stand-by's copy.

mod anew;
mod copy;
mod error;
mod export;
mod holder;
mod schema;
#[cfg(test)]
mod tests;
mod wal;
mod writer;

pub use copy::{CopyStanding, LedgerReader};
pub use error::{Damage, LedgerError, LedgerFault};
pub use export::{LedgerReading, StoredRow, backup, read};
pub use writer::{LedgerCounters, LedgerWriteError, LedgerWriter, PendingWrite, QUEUE, Refused};

use holder::{Holder, beside};
use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags, params};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{self, File};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Longest record, in bytes of JSON.
pub const MAX_RECORD_BYTES: usize = 1 << 20;
/// Longest snapshot, in bytes of JSON.
pub const MAX_SNAPSHOT_BYTES: usize = 256 << 20;

/// A ledger held by this process, until it is dropped.
#[derive(Debug)]
pub struct Ledger<R> {
    path: PathBuf,
    connection: Connection,
    holder: Holder,
    last_seq: u64,
    /// A commit failed: what it left in the log has to go.
    tail_unsure: bool,
    marks_missed: u64,
    records: PhantomData<fn(R) -> R>,
}

/// A record as it was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LedgerRow<R> {
    /// Its number.
    pub seq: u64,
    /// When it was written, by the wall clock, in ms since 1970.
    pub at_ms: i64,
    /// Whether it replaces all before it.
    pub snapshot: bool,
    /// What was written.
    pub record: R,
}

/// What a ledger held when it was opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Recovered<R> {
    /// It is new: there was none.
    pub created: bool,
    /// From the last snapshot on, which is the first if there is one; without a gap.
    pub rows: Vec<LedgerRow<R>>,
}

/// What is to be written, as JSON.
#[derive(Debug)]
struct Body {
    text: String,
    snapshot: bool,
}

impl Body {
    fn of(record: &impl Serialize, snapshot: bool) -> Result<Self, LedgerFault> {
        let text = serde_json::to_string(record).map_err(LedgerFault::Encode)?;
        let most = if snapshot { MAX_SNAPSHOT_BYTES } else { MAX_RECORD_BYTES };
        if text.len() > most {
            return Err(LedgerFault::TooLong { bytes: text.len(), most });
        }
        Ok(Self { text, snapshot })
    }
}

impl<R: Serialize + DeserializeOwned> Ledger<R> {
    /// Takes a fleet's ledger, or begins one where none ever was, and reads it as a whole.
    ///
    /// # Errors
    /// Another process holds it; there is something else, another fleet's, a newer program's or a damaged
    /// ledger; it was there and is gone; the system refuses. Nothing is changed then.
    pub fn create_or_open(path: &Path, fleet: &str) -> Result<(Self, Recovered<R>), LedgerError> {
        Self::open_or_make(path, fleet).map_err(|fault| fault.of(path))
    }

    /// Writes records, all or none; when it returns they are on the disk.
    ///
    /// Gives the number of the last one.
    ///
    /// # Errors
    /// Disk full, not writable, other errors of files; a record too long. None of the records counts as
    /// written then, and the ledger can be used further.
    pub fn append(&mut self, records: &[R]) -> Result<u64, LedgerError> {
        let bodies: Result<Vec<Body>, LedgerFault> =
            records.iter().map(|record| Body::of(record, false)).collect();
        let written = bodies.and_then(|bodies| self.write(&bodies));
        written.map_err(|fault| fault.of(&self.path))
    }

    /// Writes a record that replaces all before it, and gives back the room that they took.
    ///
    /// # Errors
    /// As [`Ledger::append`]; all that was there is there then.
    pub fn compact(&mut self, snapshot: &R) -> Result<u64, LedgerError> {
        let written = Body::of(snapshot, true).and_then(|body| self.write(&[body]));
        written.map_err(|fault| fault.of(&self.path))
    }

    fn open_or_make(path: &Path, fleet: &str) -> Result<(Self, Recovered<R>), LedgerFault> {
        let (holder, mark) = Holder::take(path)?;
        Self::open_held(path, fleet, holder, mark)
    }

    fn open_held(
        path: &Path,
        fleet: &str,
        holder: Holder,
        mark: Option<u64>,
    ) -> Result<(Self, Recovered<R>), LedgerFault> {
        let created = match fs::metadata(path) {
            Ok(file) if file.is_dir() => return Err(LedgerFault::NotALedger { what: "a folder".into() }),
            Ok(file) if file.len() == 0 => return Err(LedgerFault::Empty),
            Ok(_) => false,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                make(path, fleet, mark)?;
                true
            }
            Err(error) => return Err(LedgerFault::io("looking for it", error)),
        };
        wal::check(&beside(path, "-wal"))?;
        let connection = connect(path, fleet)?;
        let rows = whole(export::rows(&connection)?)?;
        let last_seq = rows.last().map_or(0, |row| row.seq);
        if let Some(acknowledged) = mark.filter(|mark| *mark > last_seq) {
            return Err(LedgerFault::Damaged(Damage::Lost { acknowledged, found: last_seq }));
        }
        let rows = rows.into_iter().map(StoredRow::decode).collect::<Result<_, _>>()?;
        holder.note_and_sync(last_seq).map_err(|error| LedgerFault::io("writing the lock file", error))?;
        keep_log(&connection, false).map_err(|error| LedgerFault::sqlite("opening it", error))?;
        let (path, records) = (path.to_owned(), PhantomData);
        let mut ledger =
            Self { path, connection, holder, last_seq, tail_unsure: false, marks_missed: 0, records };
        ledger.empty_log();
        Ok((ledger, Recovered { created, rows }))
    }
}

impl<R> Ledger<R> {
    /// The number of the last record; 0 if there is none.
    #[must_use]
    pub fn last_seq(&self) -> u64 {
        self.last_seq
    }

    /// Which file it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Acknowledged records whose number could not be noted in the lock file; see [`Damage::Lost`].
    #[must_use]
    pub fn marks_missed(&self) -> u64 {
        self.marks_missed
    }

    /// One transaction. A snapshot replaces all before it.
    fn write(&mut self, bodies: &[Body]) -> Result<u64, LedgerFault> {
        if bodies.is_empty() {
            return Ok(self.last_seq);
        }
        if std::mem::take(&mut self.tail_unsure) {
            self.empty_log();
        }
        let last = self.last_seq + bodies.len() as u64;
        if let Err(error) = self.commit(bodies) {
            self.tail_unsure = true;
            let taken = error.sqlite_error_code() == Some(rusqlite::ErrorCode::ConstraintViolation);
            let seq = self.last_seq + 1;
            return Err(if taken {
                LedgerFault::Overtaken { seq }
            } else {
                LedgerFault::sqlite("writing", error)
            });
        }
        self.last_seq = last;
        let noted = if bodies.iter().any(|body| body.snapshot) {
            self.shrink();
            self.holder.note_and_sync(last)
        } else {
            self.holder.note(last)
        };
        // The records are on the disk all the same; what is missed is a check at the next opening.
        self.marks_missed += u64::from(noted.is_err());
        Ok(last)
    }

    fn commit(&mut self, bodies: &[Body]) -> rusqlite::Result<()> {
        let at_ms = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_millis() as i64);
        let transaction =
            self.connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate)?;
        {
            let put = "INSERT INTO records (seq, at_ms, kind, body, crc) VALUES (?1, ?2, ?3, ?4, ?5)";
            let mut put = transaction.prepare(put)?;
            for (seq, Body { text, snapshot }) in (self.last_seq + 1..).zip(bodies) {
                let kind = export::kind(*snapshot);
                let crc = schema::record_sum(seq, at_ms, kind, text);
                put.execute(params![seq as i64, at_ms, kind, text, crc])?;
                if *snapshot {
                    transaction.execute("DELETE FROM records WHERE seq < ?1", [seq as i64])?;
                }
            }
        }
        transaction.commit()
    }

    /// Gives free pages back to the disk. No harm if that fails: they are used again.
    fn shrink(&mut self) {
        let _ = self.free_pages();
        self.empty_log();
    }

    fn free_pages(&mut self) -> rusqlite::Result<()> {
        let mut vacuum = self.connection.prepare("PRAGMA incremental_vacuum")?;
        let mut pages = vacuum.query([])?;
        while pages.next()?.is_some() {}
        Ok(())
    }

    /// Brings the log into the file and makes it empty. Not now if somebody reads, or the disk is full:
    /// the log remains in force then, and SQLite tries again by itself every 1000 pages.
    fn empty_log(&mut self) {
        let wait = |time| self.connection.busy_timeout(time);
        let _ = wait(Duration::ZERO);
        let _ = self.connection.query_row("PRAGMA wal_checkpoint(TRUNCATE)", [], |_| Ok(()));
        let _ = wait(schema::BUSY);
    }
}

impl<R> Drop for Ledger<R> {
    fn drop(&mut self) {
        let _ = self.holder.note_and_sync(self.last_seq);
    }
}

/// A new file, under another name until it is whole: a kill in between leaves no half ledger.
fn make(path: &Path, fleet: &str, mark: Option<u64>) -> Result<(), LedgerFault> {
    if let Some(acknowledged) = mark.filter(|mark| *mark > 0) {
        return Err(LedgerFault::Gone { acknowledged });
    }
    let log = beside(path, "-wal");
    if fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
        return Err(LedgerFault::LogAlone { log });
    }
    let doing = "creating the file";
    let draft = beside(path, "-new");
    for end in ["", "-wal", "-shm", "-journal"] {
        match fs::remove_file(beside(&draft, end)) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(LedgerFault::io(doing, error));
            }
            _ => {}
        }
    }
    let mut connection = Connection::open(&draft).map_err(|error| LedgerFault::sqlite(doing, error))?;
    schema::create(&mut connection, fleet)?;
    connection.close().map_err(|(_, error)| LedgerFault::sqlite(doing, error))?;
    let steps = || {
        File::open(&draft)?.sync_all()?;
        fs::rename(&draft, path)?;
        sync_folder(path)
    };
    steps().map_err(|error| LedgerFault::io(doing, error))
}

/// Makes a file's name in its folder outlive a power cut.
pub(crate) fn sync_folder(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    File::open(folder.unwrap_or(Path::new(".")))?.sync_all()
}

/// Opens what is there, if it is this fleet's and whole.
fn connect(path: &Path, fleet: &str) -> Result<Connection, LedgerFault> {
    let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let doing = "opening it";
    let fault = |error| LedgerFault::sqlite(doing, error);
    let mut connection = Connection::open_with_flags(path, flags).map_err(fault)?;
    keep_log(&connection, true).map_err(fault)?;
    schema::set_up(&connection).map_err(fault)?;
    let version = schema::version(&connection, schema::STEPS.len())?;
    if connection.is_readonly("main").map_err(fault)? {
        return Err(LedgerFault::ReadOnly { doing });
    }
    let found = schema::fleet(&connection)?;
    if found != fleet {
        return Err(LedgerFault::OtherFleet { found, expected: fleet.to_owned() });
    }
    let check = |row: &rusqlite::Row<'_>| row.get::<_, String>(0);
    let said = connection.query_row("PRAGMA quick_check(1)", [], check).map_err(fault)?;
    if said != "ok" {
        return Err(LedgerFault::Damaged(Damage::Structure(said)));
    }
    schema::migrate(&mut connection, version, &schema::STEPS)?;
    let mode: String =
        connection.pragma_update_and_check(None, "journal_mode", "WAL", |row| row.get(0)).map_err(fault)?;
    if mode != "wal" {
        return Err(LedgerFault::ReadOnly { doing: "enabling the log" });
    }
    Ok(connection)
}

/// Whether closing leaves the log as it is, even what SQLite does not see in it: so that a ledger that is
/// refused stays as it was found.
fn keep_log(connection: &Connection, keep: bool) -> rusqlite::Result<()> {
    connection.set_db_config(DbConfig::SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, keep).map(|_| ())
}

/// Every row intact and none missing.
fn whole(rows: Vec<StoredRow>) -> Result<Vec<StoredRow>, LedgerFault> {
    let mut damage = Vec::new();
    export::gaps(&rows, &mut damage);
    match damage.into_iter().next() {
        Some(damage) => Err(LedgerFault::Damaged(damage)),
        None => Ok(rows),
    }
}
