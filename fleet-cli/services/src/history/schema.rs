//! The tables of a history file, and how it is opened.

use super::{HistoryError, configure, failed};
use rusqlite::{Connection, OpenFlags};
use std::path::Path;
use std::time::Duration;

/// Says in the file's head that it is a history: `XTBH`.
const APPLICATION_ID: u32 = 0x5854_4248;
/// Version of the tables.
const VERSION: u32 = 1;
/// Somebody who reads the file holds it up for a moment at most.
pub(super) const BUSY: Duration = Duration::from_secs(2);

const TABLES: &str = "
    CREATE TABLE events (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        at_ms INTEGER NOT NULL,
        robot TEXT,
        kind TEXT NOT NULL,
        about TEXT,
        text TEXT NOT NULL,
        epoch INTEGER,
        seq INTEGER
    ) STRICT;
    CREATE UNIQUE INDEX events_once ON events (robot, epoch, seq);
    CREATE INDEX events_at ON events (at_ms);
    CREATE TABLE samples (
        from_ms INTEGER NOT NULL,
        robot TEXT NOT NULL,
        heard_s REAL NOT NULL,
        active_s REAL NOT NULL,
        driving_s REAL NOT NULL,
        driven_m REAL NOT NULL,
        done INTEGER NOT NULL,
        failed INTEGER NOT NULL,
        battery_min_v REAL,
        battery_v REAL,
        PRIMARY KEY (from_ms, robot)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE stops (
        from_ms INTEGER NOT NULL,
        robot TEXT NOT NULL,
        reason TEXT NOT NULL,
        count INTEGER NOT NULL,
        PRIMARY KEY (from_ms, robot, reason)
    ) STRICT, WITHOUT ROWID;
    CREATE TABLE alerts (id INTEGER PRIMARY KEY, body TEXT NOT NULL) STRICT;
";

/// Opens a history to write, or begins one.
pub(super) fn open(path: &Path) -> Result<Connection, HistoryError> {
    let mut connection = Connection::open(path).map_err(failed(path, "opening it"))?;
    configure(&connection).map_err(failed(path, "setting it up"))?;
    match heads(&connection).map_err(failed(path, "reading its head"))? {
        (0, 0) if is_empty(&connection).map_err(failed(path, "reading it"))? => {
            create(&mut connection).map_err(failed(path, "creating its tables"))?;
        }
        (APPLICATION_ID, VERSION) => {}
        (APPLICATION_ID, version) => {
            let what = format!("its version is {version}, this program's {VERSION}");
            return Err(HistoryError::NotOurs { path: path.to_owned(), what });
        }
        (id, _) => {
            let what = format!("its application id is {id:#x}");
            return Err(HistoryError::NotOurs { path: path.to_owned(), what });
        }
    }
    Ok(connection)
}

/// The same file, to read only.
pub(super) fn open_to_read(path: &Path) -> Result<Connection, HistoryError> {
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(path, flags).map_err(failed(path, "opening it to read"))?;
    connection.busy_timeout(BUSY).map_err(failed(path, "setting it up"))?;
    Ok(connection)
}

fn heads(connection: &Connection) -> rusqlite::Result<(u32, u32)> {
    let head = |name| connection.pragma_query_value(None, name, |row| row.get(0));
    Ok((head("application_id")?, head("user_version")?))
}

fn is_empty(connection: &Connection) -> rusqlite::Result<bool> {
    connection.query_row("SELECT count(*) = 0 FROM sqlite_schema", [], |row| row.get(0))
}

fn create(connection: &mut Connection) -> rusqlite::Result<()> {
    connection.execute_batch("PRAGMA auto_vacuum = INCREMENTAL;")?;
    connection.pragma_update(None, "journal_mode", "WAL")?;
    let transaction = connection.transaction()?;
    transaction.execute_batch(TABLES)?;
    transaction.pragma_update(None, "application_id", APPLICATION_ID)?;
    transaction.pragma_update(None, "user_version", VERSION)?;
    transaction.commit()
}
