//! A stand-by's ledger: what it has of the dispatcher's, and what its records add up to.

use super::super::store::{Store, unreadable, wall_ms};
use crate::ledger::{Ledger, MAX_SNAPSHOT_BYTES};
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::task_store::record::VERSION;
use xtb_dispatch::{DispatcherSettings, LedgerEntry, Record, TaskStore};
use xtb_protocol::messages::{CopiedRecord, StandbyReply, StandbyRequest};
use xtb_protocol::{Name, Uuid};

/// The copy, held by this process.
pub(super) struct CopiedLedger {
    fleet: Name,
    ledger: Ledger<LedgerEntry>,
    book: TaskStore,
    id: u64,
    /// All of its records came from a dispatcher that it followed.
    copied: bool,
    /// The first bytes of the next record, and its number.
    begun: (u64, String),
}

impl CopiedLedger {
    /// A ledger that is held, and becomes a copy with the first records that it gets.
    pub(super) fn new(store: Store, fleet: Name) -> Result<Self> {
        let Store { ledger, entries, copy, .. } = store;
        let read = TaskStore::replay(DispatcherSettings::default().keep_ended, entries);
        let book = read.map_err(|error| unreadable(ledger.path(), &error))?;
        let id = copy.unwrap_or_else(|| (Uuid::new_v4().as_u128() >> 80) as u64);
        let copied = copy.is_some() || ledger.last_seq() == 0;
        Ok(Self { fleet, ledger, book, id, copied, begun: (0, String::new()) })
    }

    /// Number of the copy.
    pub(super) fn id(&self) -> u64 {
        self.id
    }

    /// What it has, as the next question says it.
    pub(super) fn question(&self, witnesses: u32) -> Result<StandbyRequest> {
        let last = self.ledger.last_seq();
        Ok(StandbyRequest::Follow {
            copy: self.id,
            copied: self.copied,
            ledger: self.book.ledger().unwrap_or_default(),
            term: self.book.term(),
            last,
            sum: self.ledger.last_sum()?,
            offset: self.begun.1.len() as u64,
            witnesses,
        })
    }

    /// Whether the answer is from an earlier dispatcher than the one that wrote this ledger; that one ends when
    /// it has the question.
    pub(super) fn is_ahead_of(&self, reply: &StandbyReply) -> bool {
        !self.copied && reply.term < self.book.term()
    }

    /// Whether all of its records came from a dispatcher that it followed.
    pub(super) fn is_copied(&self) -> bool {
        self.copied
    }

    /// Whether it is the ledger of a dispatcher that had no stand-by at its end: nobody has taken over since.
    pub(super) fn is_last(&self) -> bool {
        !self.copied && self.book.ledger().is_some() && self.book.pair().is_none()
    }

    /// # Errors
    /// This is a copy of another ledger.
    pub(super) fn check_ledger(&self, number: u64) -> Result<()> {
        match self.book.ledger().filter(|own| *own != number) {
            None => Ok(()),
            Some(own) => {
                let path = self.ledger.path().display();
                let message = format!("ledger {path} has number {own}, the dispatcher's has number {number}");
                Err(Error::new(ErrorKind::Failed, message)
                    .hint("choose another file with --ledger: it is made if it does not exist"))
            }
        }
    }

    /// Puts this ledger aside and begins an empty one; where the previous one is.
    pub(super) fn begin_anew(self) -> Result<(Self, Option<PathBuf>)> {
        let Self { fleet, ledger, id, .. } = self;
        let path = ledger.path().to_owned();
        drop(ledger);
        let (mut ledger, aside) = Ledger::<LedgerEntry>::begin_anew(&path, fleet.as_str(), wall_ms())?;
        ledger.set_copy_id(Some(id))?;
        let book = TaskStore::new(DispatcherSettings::default().keep_ended);
        Ok((Self { fleet, ledger, book, id, copied: true, begun: (0, String::new()) }, aside))
    }

    /// Records that follow; when it returns they are on the disk.
    pub(super) fn take(&mut self, mut records: Vec<CopiedRecord>) -> Result<()> {
        if !self.copied || self.ledger.copy_id()?.is_none() {
            self.ledger.set_copy_id(Some(self.id))?;
            self.copied = true;
        }
        let begun = std::mem::take(&mut self.begun);
        let Some(first) = records.first_mut() else { return Ok(()) };
        if first.bytes > MAX_SNAPSHOT_BYTES as u64 {
            let what = format!("{} bytes are more than a ledger takes", first.bytes);
            return Err(wrong(self.ledger.path(), first.seq, &what));
        }
        if first.seq == begun.0 {
            first.body.insert_str(0, &begun.1);
        } else if !begun.1.is_empty() {
            return Ok(()); // Another record has replaced it: it is asked for from its beginning.
        }
        if (first.body.len() as u64) < first.bytes {
            self.begun = (first.seq, std::mem::take(&mut first.body));
            return Ok(());
        }
        for record in &records {
            self.apply(record)?;
        }
        self.ledger.copy(records)?;
        Ok(())
    }

    fn apply(&mut self, record: &CopiedRecord) -> Result<()> {
        let wrong = |what: &str| wrong(self.ledger.path(), record.seq, what);
        let entry = LedgerEntry::from_json(&record.body).map_err(|error| wrong(&error.to_string()))?;
        // SQLite's numbers have a sign.
        let is_it = entry.n == record.seq && i64::try_from(entry.n).is_ok();
        if !is_it || matches!(entry.record, Record::Snapshot(_)) != record.snapshot {
            return Err(wrong("it is not what it is said to be"));
        }
        self.book.apply(&entry).map_err(|error| wrong(&error.to_string()))
    }

    /// The same, as a dispatcher takes it.
    pub(super) fn into_store(self) -> Store {
        let n = self.book.next_n() - 1;
        let record = Record::Snapshot(Box::new(self.book));
        let entries = vec![LedgerEntry { v: VERSION, n, at_ms: wall_ms(), record }];
        let copy = self.copied.then_some(self.id);
        Store { ledger: self.ledger, entries, created: false, set_aside: None, copy }
    }
}

fn wrong(path: &Path, seq: u64, what: &str) -> Error {
    Error::new(ErrorKind::Failed, format!("record {seq} for ledger {}: {what}", path.display()))
        .hint("compare `fleet-cli --version` here and where the dispatcher runs")
}

#[cfg(test)]
mod tests {
    use super::super::super::store::Scratch;
    use super::*;
    use crate::ledger::LedgerReader;

    fn fleet() -> Name {
        Name::new("lab").unwrap()
    }

    fn entry(n: u64, record: Record) -> LedgerEntry {
        LedgerEntry { v: record.version(), n, at_ms: 5, record }
    }

    /// Copies all that follows, `most` bytes at a time.
    fn follow(reader: &LedgerReader, copy: &mut CopiedLedger, most: usize) {
        loop {
            let StandbyRequest::Follow { last, sum, offset, .. } = copy.question(0).unwrap() else {
                panic!()
            };
            let (_, records) = reader.page(last, sum, offset, most).unwrap();
            if records.is_empty() {
                return;
            }
            copy.take(records).unwrap();
        }
    }

    #[test]
    fn a_copy_that_takes_over_goes_on_in_the_next_term_with_the_same_numbers() {
        let (own, other) = (Scratch::new(), Scratch::new());
        let mut active = Store::open(own.path(), &fleet()).unwrap();
        let hash = "0123456789abcdef".parse().unwrap();
        let map = Record::Map { name: "lab".into(), hash };
        let records = [Record::Opened { ledger: 7 }, map, Record::Pair { copy: Some(9) }];
        let entries: Vec<LedgerEntry> = (1..).zip(records).map(|(n, record)| entry(n, record)).collect();
        active.ledger.append(&entries).unwrap();
        let reader = LedgerReader::open(own.path()).unwrap();
        for most in [10, 1 << 20] {
            let store = Store::open(other.path(), &fleet()).unwrap();
            let mut copy = CopiedLedger::new(store, fleet()).unwrap();
            follow(&reader, &mut copy, most);
            assert!(copy.check_ledger(7).is_ok() && copy.check_ledger(8).is_err());
            assert!(Store::open(own.path(), &fleet()).is_err(), "the dispatcher holds its own");
        }
        let store = Store::open(other.path(), &fleet()).unwrap();
        assert!(store.no_copy().is_err());
        let mut store = CopiedLedger::new(store, fleet()).unwrap().into_store();
        assert_eq!(store.raise_term().unwrap(), 1);
        store.end_copy().unwrap();
        drop(store);
        let store = Store::open(other.path(), &fleet()).unwrap();
        assert!(store.no_copy().is_ok());
        assert_eq!(store.entries[..3], entries);
        let book = TaskStore::replay(9, store.entries).unwrap();
        assert_eq!((book.term(), book.pair(), book.next_n()), (1, None, 5));
    }

    #[test]
    fn a_record_that_no_ledger_can_hold_is_refused() {
        let scratch = Scratch::new();
        let store = Store::open(scratch.path(), &fleet()).unwrap();
        let mut copy = CopiedLedger::new(store, fleet()).unwrap();
        let last = entry(u64::MAX, Record::Snapshot(Box::new(TaskStore::new(9))));
        let body = last.to_json().unwrap();
        for bytes in [body.len() as u64, 1 << 40] {
            let record = CopiedRecord { seq: u64::MAX, snapshot: true, bytes, body: body.clone() };
            assert!(copy.take(vec![record]).is_err(), "{bytes}");
        }
    }

    #[test]
    fn a_ledger_with_other_records_is_kept_beside_the_copy() {
        let scratch = Scratch::new();
        let mut store = Store::open(scratch.path(), &fleet()).unwrap();
        store.ledger.append(&[entry(1, Record::Opened { ledger: 7 })]).unwrap();
        drop(store);
        let store = Store::open(scratch.path(), &fleet()).unwrap();
        let copy = CopiedLedger::new(store, fleet()).unwrap();
        let StandbyRequest::Follow { copied, last, .. } = copy.question(0).unwrap() else { panic!() };
        assert_eq!((copied, last), (false, 1), "what it has was not copied");
        assert!(copy.is_last());
        let (copy, aside) = copy.begin_anew().unwrap();
        let StandbyRequest::Follow { copied, last, .. } = copy.question(0).unwrap() else { panic!() };
        assert_eq!((copied, last, copy.is_last()), (true, 0, false));
        let aside = aside.unwrap();
        assert_eq!(Store::open(&aside, &fleet()).unwrap().entries.len(), 1);
        for end in ["", "-wal", "-shm", "-lock"] {
            let mut name = aside.clone().into_os_string();
            name.push(end);
            let _ = std::fs::remove_file(name);
        }
    }
}
