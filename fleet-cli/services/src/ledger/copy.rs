//! A ledger that is a copy of another one: its records come with their numbers, and the file says that they do.
//! [`Reader`] reads, beside the writer, what such a copy lacks.

use super::error::{Damage, LedgerError, LedgerFault};
use super::{Body, Ledger, export, schema};
use rusqlite::{Connection, OptionalExtension, params};
use std::path::{Path, PathBuf};
use xtb_protocol::messages::CopiedRecord;

impl<R> Ledger<R> {
    /// Number of this copy; `None` = it is nobody's copy.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn copy_id(&self) -> Result<Option<u64>, LedgerError> {
        let query = "SELECT value FROM about WHERE name = 'copy'";
        let read = self.connection.query_row(query, [], |row| row.get::<_, String>(0)).optional();
        let text = read.map_err(|error| LedgerFault::sqlite("reading", error).of(&self.path))?;
        Ok(text.and_then(|text| text.parse().ok()))
    }

    /// Says of the file that it is this copy, or none any more; on the disk when it returns.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn set_copy_id(&mut self, copy: Option<u64>) -> Result<(), LedgerError> {
        let done = match copy {
            Some(copy) => {
                let put = "INSERT OR REPLACE INTO about (name, value) VALUES ('copy', ?1)";
                self.connection.execute(put, [copy.to_string()])
            }
            None => self.connection.execute("DELETE FROM about WHERE name = 'copy'", []),
        };
        done.map(drop).map_err(|error| LedgerFault::sqlite("writing", error).of(&self.path))
    }

    /// Check sum of the last record's JSON; 0 if there is none.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn last_sum(&self) -> Result<u32, LedgerError> {
        let sum = sum_of(&self.connection, self.last_seq);
        sum.map(Option::unwrap_or_default)
            .map_err(|error| LedgerFault::sqlite("reading", error).of(&self.path))
    }

    /// Writes whole records of another ledger under their own numbers, all or none; when it returns they are on
    /// the disk. A snapshot as the first one may have any later number: it replaces what is here.
    ///
    /// # Errors
    /// As [`Ledger::append`]; or they do not follow those that are here.
    pub fn copy(&mut self, records: Vec<CopiedRecord>) -> Result<u64, LedgerError> {
        self.copy_all(records).map_err(|fault| fault.of(&self.path))
    }

    fn copy_all(&mut self, records: Vec<CopiedRecord>) -> Result<u64, LedgerFault> {
        let before = self.last_seq;
        let Some(first) = records.first() else { return Ok(before) };
        let from = if first.snapshot && first.seq > before { first.seq } else { before + 1 };
        for (expected, record) in (from..).zip(&records) {
            if record.seq != expected {
                return Err(LedgerFault::Damaged(Damage::Gap { expected, found: record.seq }));
            }
        }
        let body = |record: CopiedRecord| Body { text: record.body, snapshot: record.snapshot };
        let bodies: Vec<Body> = records.into_iter().map(body).collect();
        self.last_seq = from - 1;
        self.write(&bodies).inspect_err(|_| self.last_seq = before)
    }
}

/// How the asker's last record stands in this ledger.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CopyStanding {
    /// It is there, or the asker has none.
    Same,
    /// A snapshot has replaced it.
    Replaced,
    /// It is another one, or comes later than the last.
    Other,
}

/// Reads a ledger for its copies.
#[derive(Debug)]
pub struct LedgerReader {
    path: PathBuf,
    connection: Connection,
}

impl LedgerReader {
    /// Opens a ledger that this process holds.
    ///
    /// # Errors
    /// As [`super::read`].
    pub fn open(path: &Path) -> Result<Self, LedgerError> {
        let connection = export::open(path).map_err(|fault| fault.of(path))?;
        Ok(Self { path: path.to_owned(), connection })
    }

    /// What follows record `last`, whose JSON has this check sum: as many records as take `most` bytes, or a
    /// piece of a longer one, from its byte `offset` on.
    ///
    /// # Errors
    /// The file cannot be read, or is damaged.
    pub fn page(
        &self,
        last: u64,
        sum: u32,
        offset: u64,
        most: usize,
    ) -> Result<(CopyStanding, Vec<CopiedRecord>), LedgerError> {
        self.read_page(last, sum, offset, most).map_err(|fault| fault.of(&self.path))
    }

    fn read_page(
        &self,
        last: u64,
        sum: u32,
        offset: u64,
        most: usize,
    ) -> Result<(CopyStanding, Vec<CopiedRecord>), LedgerFault> {
        let fault = |error| LedgerFault::sqlite("reading", error);
        // One transaction: a snapshot between two queries would hide records.
        let reading = self.connection.unchecked_transaction().map_err(fault)?;
        let history = history(&reading, last, sum).map_err(fault)?;
        if history == CopyStanding::Other {
            return Ok((history, Vec::new()));
        }
        let query = "SELECT seq, at_ms, kind, body, crc FROM records WHERE seq > ?1 ORDER BY seq";
        let mut query = reading.prepare(query).map_err(fault)?;
        let mut rows = query.query(params![last as i64]).map_err(fault)?;
        let (mut records, mut room) = (Vec::new(), most);
        while let Some(row) = rows.next().map_err(fault)? {
            let (seq, at_ms) = (row.get::<_, i64>(0).map_err(fault)? as u64, row.get(1).map_err(fault)?);
            let (kind, body): (String, String) = (row.get(2).map_err(fault)?, row.get(3).map_err(fault)?);
            if row.get::<_, i64>(4).map_err(fault)? != i64::from(schema::record_sum(seq, at_ms, &kind, &body))
            {
                return Err(LedgerFault::Damaged(Damage::Record { seq }));
            }
            if !records.is_empty() && body.len() > room {
                break;
            }
            let from = if records.is_empty() { usize::try_from(offset).unwrap_or(usize::MAX) } else { 0 };
            let piece = piece(&body, from, room);
            room -= piece.len();
            let is_whole = from + piece.len() >= body.len();
            let (snapshot, bytes) = (kind == export::kind(true), body.len() as u64);
            records.push(CopiedRecord { seq, snapshot, bytes, body: piece.to_owned() });
            if !is_whole || room == 0 {
                break;
            }
        }
        Ok((history, records))
    }
}

fn sum_of(connection: &Connection, seq: u64) -> rusqlite::Result<Option<u32>> {
    let query = "SELECT body FROM records WHERE seq = ?1";
    let body = connection.query_row(query, params![seq as i64], |row| row.get::<_, String>(0)).optional()?;
    Ok(body.map(|body| schema::check_sum(body.as_bytes())))
}

fn history(connection: &Connection, last: u64, sum: u32) -> rusqlite::Result<CopyStanding> {
    if last == 0 || sum_of(connection, last)? == Some(sum) {
        return Ok(CopyStanding::Same);
    }
    let query = "SELECT seq FROM records ORDER BY seq LIMIT 1";
    let first = connection.query_row(query, [], |row| row.get::<_, i64>(0)).optional()?;
    Ok(if first.is_some_and(|first| first as u64 > last) {
        CopyStanding::Replaced
    } else {
        CopyStanding::Other
    })
}

/// At most `most` bytes of a text from a byte on, without half a character; all of none if that is behind its end.
fn piece(text: &str, from: usize, most: usize) -> &str {
    let Some(rest) = text.get(from..) else { return "" };
    let end = (0..=most.min(rest.len())).rev().find(|end| rest.is_char_boundary(*end));
    &rest[..end.unwrap_or(0)]
}
