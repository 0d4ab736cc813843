//! The tables of a ledger file, their versions, and how one becomes the next.

use super::error::LedgerFault;
use crc::{CRC_32_ISO_HDLC, Crc};
use rusqlite::Connection;
use std::time::Duration;

/// Says in the file's head that it is a ledger: `XTBL`.
pub(super) const APPLICATION_ID: u32 = 0x5854_424c;

/// Step n leads from schema n to schema n + 1. Never edited, only continued.
pub(super) const STEPS: [&str; 1] = ["
    CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT, WITHOUT ROWID;
    CREATE TABLE records (
        seq INTEGER PRIMARY KEY,
        at_ms INTEGER NOT NULL,
        kind TEXT NOT NULL CHECK (kind IN ('record', 'snapshot')),
        body TEXT NOT NULL,
        crc INTEGER NOT NULL
    ) STRICT;
"];

/// Somebody who reads a log that a kill left behind holds it up for a moment at most.
pub(super) const BUSY: Duration = Duration::from_secs(5);

const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// CRC-32 as zlib has it.
pub(super) fn check_sum(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// A record's check sum: over `SEQ AT_MS KIND ` and the body.
pub(super) fn record_sum(seq: u64, at_ms: i64, kind: &str, body: &str) -> u32 {
    let mut digest = CRC.digest();
    digest.update(format!("{seq} {at_ms} {kind} ").as_bytes());
    digest.update(body.as_bytes());
    digest.finalize()
}

/// What every connection that writes is set to: a commit is on the disk before it returns. It keeps 256 KiB of the
/// file in memory, not 2 MiB: all is read once, and written at the end.
pub(super) fn set_up(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(BUSY)?;
    connection.execute_batch(
        "PRAGMA synchronous = FULL;
         PRAGMA fullfsync = ON;
         PRAGMA checkpoint_fullfsync = ON;
         PRAGMA cell_size_check = ON;
         PRAGMA trusted_schema = OFF;
         PRAGMA journal_size_limit = 8388608;
         PRAGMA cache_size = -256;",
    )
}

/// The file's schema.
///
/// # Errors
/// The file is no ledger, or one of a newer program.
pub(super) fn version(connection: &Connection, known: usize) -> Result<u32, LedgerFault> {
    let number = |pragma: &str| {
        let read = connection.pragma_query_value(None, pragma, |row| row.get::<_, u32>(0));
        read.map_err(|error| LedgerFault::sqlite("reading the head", error))
    };
    let id = number("application_id")?;
    if id != APPLICATION_ID {
        return Err(LedgerFault::NotALedger { what: format!("its application id is {id:#x}") });
    }
    let (found, known) = (number("user_version")?, known as u32);
    match found {
        0 => Err(LedgerFault::NotALedger { what: "it has no schema".into() }),
        found if found > known => Err(LedgerFault::Newer { found, known }),
        found => Ok(found),
    }
}

/// Brings a file to the newest schema: all steps that it lacks, or none.
///
/// # Errors
/// A step fails; the file is as before.
pub(super) fn migrate(connection: &mut Connection, from: u32, steps: &[&str]) -> Result<(), LedgerFault> {
    let run = |connection: &mut Connection| {
        let transaction = connection.transaction()?;
        for step in steps.iter().skip(from as usize) {
            transaction.execute_batch(step)?;
        }
        transaction.pragma_update(None, "user_version", steps.len() as u32)?;
        transaction.commit()
    };
    if from as usize == steps.len() {
        return Ok(());
    }
    run(connection).map_err(|error| LedgerFault::sqlite("updating its schema", error))
}

/// Makes the tables of a new file.
pub(super) fn create(connection: &mut Connection, fleet: &str) -> Result<(), LedgerFault> {
    let fault = |error| LedgerFault::sqlite("creating the tables", error);
    let head = format!(
        "PRAGMA page_size = 4096; PRAGMA auto_vacuum = INCREMENTAL; PRAGMA application_id = {APPLICATION_ID};"
    );
    connection.execute_batch(&head).map_err(fault)?;
    migrate(connection, 0, &STEPS)?;
    let put = "INSERT INTO about (name, value) VALUES ('fleet', ?1)";
    connection.execute(put, [fleet]).map_err(fault)?;
    connection.pragma_update(None, "journal_mode", "WAL").map_err(fault)
}

/// Whose it is.
pub(super) fn fleet(connection: &Connection) -> Result<String, LedgerFault> {
    let read = connection
        .query_row("SELECT value FROM about WHERE name = 'fleet'", [], |row| row.get::<_, String>(0));
    read.map_err(|error| match error {
        rusqlite::Error::QueryReturnedNoRows => LedgerFault::NotALedger { what: "it names no fleet".into() },
        error => LedgerFault::sqlite("reading the fleet's name", error),
    })
}
