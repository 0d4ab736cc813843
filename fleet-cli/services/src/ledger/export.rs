//! Reads a ledger without writing it: beside a running dispatcher, or what is left of a damaged one.

use super::error::{Damage, LedgerError, LedgerFault};
use super::{LedgerRow, holder, schema};
use rusqlite::types::ValueRef;
use rusqlite::{Connection, ErrorCode, OpenFlags};
use serde::de::DeserializeOwned;
use std::fs::{self, File};
use std::io;
use std::path::Path;

/// A row as it stands in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredRow {
    /// Its number.
    pub seq: u64,
    /// When it was written, by the wall clock, in ms since 1970.
    pub at_ms: i64,
    /// Whether it replaces all before it.
    pub snapshot: bool,
    /// The record as JSON.
    pub body: String,
    /// Whether its check sum is right.
    pub intact: bool,
}

/// What could be read of a ledger.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LedgerReading {
    /// Whose it is, if that can be read.
    pub fleet: Option<String>,
    /// All rows that can be read, in their order: also those that are not intact.
    pub rows: Vec<StoredRow>,
    /// What is wrong; empty if nothing is.
    pub damage: Vec<Damage>,
}

impl StoredRow {
    /// The record that it is.
    ///
    /// # Errors
    /// The text is not such a record.
    pub fn decode<R: DeserializeOwned>(self) -> Result<LedgerRow<R>, LedgerFault> {
        let record = serde_json::from_str(&self.body);
        let record = record.map_err(|source| LedgerFault::Meaning { seq: self.seq, source })?;
        Ok(LedgerRow { seq: self.seq, at_ms: self.at_ms, snapshot: self.snapshot, record })
    }
}

/// Reads a ledger as it is now; a running dispatcher is neither disturbed nor waited for.
///
/// # Errors
/// There is none, it is something else, or a newer program's; nothing at all can be read.
pub fn read(path: &Path) -> Result<LedgerReading, LedgerError> {
    // Before the rows: a dispatcher that goes on meanwhile must not look as if it had lost some.
    let acknowledged = holder::acknowledged(path);
    let reading = open(path).and_then(|connection| {
        let mut damage = Vec::new();
        let rows = salvage(&connection, &mut damage)?;
        gaps(&rows, &mut damage);
        let found = rows.last().map_or(0, |row| row.seq);
        if let Some(acknowledged) = acknowledged.filter(|acknowledged| *acknowledged > found) {
            damage.push(Damage::Lost { acknowledged, found });
        }
        Ok(LedgerReading { fleet: schema::fleet(&connection).ok(), rows, damage })
    });
    reading.map_err(|fault| fault.of(path))
}

/// Copies a ledger as it is now into a new file; a running dispatcher is neither disturbed nor waited for.
///
/// # Errors
/// As [`read`]; or the copy exists already or cannot be written: what it left is to be removed then.
pub fn backup(path: &Path, to: &Path) -> Result<(), LedgerError> {
    let doing = "writing the copy";
    let copy = || {
        if fs::metadata(to).is_ok_and(|copy| copy.len() > 0) {
            return Err(LedgerFault::io(doing, io::ErrorKind::AlreadyExists.into()));
        }
        let connection = open(path)?;
        // From the root on, so that no name looks like a URI.
        let to = std::path::absolute(to).map_err(|error| LedgerFault::io(doing, error))?;
        let copied = connection.execute("VACUUM INTO ?1", [to.to_string_lossy()]);
        copied.map_err(|error| LedgerFault::sqlite(doing, error))?;
        // SQLite does not wait for the disk here.
        let synced = File::open(&to).and_then(|copy| copy.sync_all()).and_then(|()| super::sync_folder(&to));
        synced.map_err(|error| LedgerFault::io(doing, error))
    };
    copy().map_err(|fault| fault.of(path))
}

/// The name of a kind of record, as the file has it.
pub(super) fn kind(snapshot: bool) -> &'static str {
    if snapshot { "snapshot" } else { "record" }
}

/// All rows in their order.
pub(super) fn rows(connection: &Connection) -> Result<Vec<StoredRow>, LedgerFault> {
    let mut rows = Vec::new();
    match each(connection, true, |row| rows.push(row)) {
        Ok(()) => Ok(rows),
        Err(error) => Err(LedgerFault::sqlite("reading", error)),
    }
}

/// Adds what is wrong with rows: check sums, and numbers that are missing.
pub(super) fn gaps(rows: &[StoredRow], damage: &mut Vec<Damage>) {
    let mut expected = 1;
    for (n, row) in rows.iter().enumerate() {
        if !row.intact {
            damage.push(Damage::Record { seq: row.seq });
        }
        // Only a snapshot may begin anywhere, and only as the first.
        if row.seq != expected && !(n == 0 && row.snapshot) {
            damage.push(Damage::Gap { expected, found: row.seq });
        }
        expected = row.seq + 1;
    }
}

/// From the front as far as it goes, and then from the back.
fn salvage(connection: &Connection, damage: &mut Vec<Damage>) -> Result<Vec<StoredRow>, LedgerFault> {
    let mut rows: Vec<StoredRow> = Vec::new();
    let Err(error) = each(connection, true, |row| rows.push(row)) else {
        return Ok(rows);
    };
    let fault = LedgerFault::sqlite("reading", error);
    let LedgerFault::Damaged(found) = fault else {
        return Err(fault);
    };
    damage.push(found);
    let last = rows.last().map(|row| row.seq);
    let mut back = Vec::new();
    // Ends where the front ended, or at the same damage: either way that is all there is.
    let _ = each(connection, false, |row| back.push(row));
    rows.extend(back.into_iter().rev().filter(|row| last.is_none_or(|last| row.seq > last)));
    Ok(rows)
}

fn each(connection: &Connection, forwards: bool, mut take: impl FnMut(StoredRow)) -> rusqlite::Result<()> {
    let order = if forwards { "ASC" } else { "DESC" };
    let query = format!("SELECT seq, at_ms, kind, body, crc FROM records ORDER BY seq {order}");
    let mut query = connection.prepare(&query)?;
    let mut rows = query.query([])?;
    while let Some(row) = rows.next()? {
        let number = |column| row.get_ref(column).map(|value| value.as_i64().unwrap_or(-1));
        // Damage may have made anything of them: what does not fit fails by its check sum.
        let (seq, at_ms, crc) = (u64::try_from(number(0)?).unwrap_or(0), number(1)?, number(4)?);
        let (kind_is, body) = (text(row.get_ref(2)?), text(row.get_ref(3)?));
        let intact = crc == i64::from(schema::record_sum(seq, at_ms, &kind_is, &body));
        take(StoredRow { seq, at_ms, snapshot: kind_is == kind(true), body, intact });
    }
    Ok(())
}

fn text(value: ValueRef<'_>) -> String {
    match value {
        ValueRef::Text(bytes) | ValueRef::Blob(bytes) => String::from_utf8_lossy(bytes).into_owned(),
        _ => String::new(),
    }
}

pub(super) fn open(path: &Path) -> Result<Connection, LedgerFault> {
    let file = fs::metadata(path).map_err(|error| LedgerFault::io("looking for it", error))?;
    if file.len() == 0 {
        return Err(LedgerFault::Empty);
    }
    let first = connect(path, "");
    // Without a log there is nothing to share with a writer; and in a folder that may not be written,
    // SQLite reads only what it is told will not change.
    let log = fs::metadata(holder::beside(path, "-wal")).is_ok_and(|log| log.len() > 0);
    match first {
        Err(error) if !log && needs_folder(&error) => connect(path, "&immutable=1"),
        first => first,
    }
    .map_err(|error| LedgerFault::sqlite("opening it", error))
    .and_then(|connection| schema::version(&connection, schema::STEPS.len()).map(|_| connection))
}

fn needs_folder(error: &rusqlite::Error) -> bool {
    matches!(error.sqlite_error_code(), Some(ErrorCode::CannotOpen | ErrorCode::ReadOnly))
}

fn connect(path: &Path, more: &str) -> rusqlite::Result<Connection> {
    let name = path.to_string_lossy();
    let name = name.replace('%', "%25").replace('?', "%3f").replace('#', "%23");
    let flags =
        OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(format!("file:{name}?mode=ro{more}"), flags)?;
    connection.busy_timeout(schema::BUSY)?;
    // Opening alone reads nothing.
    connection.pragma_query_value(None, "schema_version", |row| row.get::<_, i64>(0))?;
    Ok(connection)
}
