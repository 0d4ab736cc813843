//! A write that was torn or lost, at each place of the log and of the file.

use super::*;

const COMMITS: u64 = 12;

/// Copies of what a kill leaves, taken while the ledger was open, and what had been acknowledged.
struct Remains {
    file: Vec<u8>,
    log: Vec<u8>,
    lock: Vec<u8>,
    /// The log's length when each record had been acknowledged.
    ends: Vec<usize>,
}

impl Remains {
    /// One commit a record; the first of them pass through the log into the file.
    fn of(records: u64, in_file: u64) -> Self {
        let place = Place::new();
        let (mut ledger, _) = place.open().unwrap();
        let mut ends = Vec::new();
        for n in 1..=records {
            ledger.append(&[task(n)]).unwrap();
            if n == in_file {
                ledger.empty_log();
            }
            ends.push(fs::metadata(place.beside("-wal")).unwrap().len() as usize);
        }
        let [file, log, lock] = ["", "-wal", "-lock"].map(|end| fs::read(place.beside(end)).unwrap());
        Self { file, log, lock, ends }
    }

    fn put(&self, marked: bool) -> Place {
        let place = Place::new();
        fs::write(place.path(), &self.file).unwrap();
        fs::write(place.beside("-wal"), &self.log).unwrap();
        if marked {
            fs::write(place.beside("-lock"), &self.lock).unwrap();
        }
        place
    }

    fn opened(&self, marked: bool) -> Result<Vec<Value>, LedgerFault> {
        let place = self.put(marked);
        place.open().map(|(_, recovered)| records(recovered)).map_err(|error| error.fault)
    }

    /// Each 64 bytes of the log and around each border of a page in it.
    fn places(&self) -> Vec<usize> {
        let page = 4096 + 24;
        let borders = (32..self.log.len() + 1).step_by(page).flat_map(|at| [at - 1, at, at + 1, at + 24]);
        let mut places: Vec<usize> = (0..self.log.len()).step_by(64).chain(borders).collect();
        places.retain(|at| *at < self.log.len());
        places.sort_unstable();
        places.dedup();
        places
    }
}

fn is_typed(fault: &LedgerFault) -> bool {
    matches!(fault, LedgerFault::Damaged(_) | LedgerFault::NotALedger { .. } | LedgerFault::Newer { .. })
}

#[test]
fn a_kill_costs_nothing() {
    let remains = Remains::of(COMMITS, 4);
    assert_eq!(remains.opened(true).unwrap(), tasks(COMMITS));
    assert_eq!(remains.opened(false).unwrap(), tasks(COMMITS));
}

#[test]
fn a_log_cut_anywhere_keeps_what_was_acknowledged_before_the_cut() {
    let mut remains = Remains::of(COMMITS, 0);
    let whole = remains.log.clone();
    for cut in remains.places() {
        remains.log = whole[..cut].to_vec();
        let there = remains.ends.iter().filter(|end| **end <= cut).count() as u64;
        // As after a power cut that took the note of what was acknowledged too.
        assert_eq!(remains.opened(false).unwrap(), tasks(there), "cut at {cut}");
        if there < COMMITS {
            let lost = Damage::Lost { acknowledged: COMMITS, found: there };
            let fault = remains.opened(true).unwrap_err();
            assert!(
                matches!(&fault, LedgerFault::Damaged(damage) if *damage == lost),
                "cut at {cut}: {fault}"
            );
        }
    }
}

#[test]
fn a_ledger_that_is_refused_stays_as_it_was_found() {
    let mut remains = Remains::of(COMMITS, 3);
    let last = remains.log.len() - 100;
    for at in [last, 32 + 4096 + 24 + 100] {
        let before = remains.log[at];
        remains.log[at] ^= 1;
        let place = remains.put(true);
        assert!(is_typed(&place.fault()));
        assert_eq!(fs::read(place.path()).unwrap(), remains.file);
        assert_eq!(fs::read(place.beside("-wal")).unwrap(), remains.log);
        remains.log[at] = before;
    }
}

#[test]
fn a_log_zeroed_from_anywhere_on_keeps_what_was_acknowledged_before() {
    let mut remains = Remains::of(COMMITS, 0);
    let whole = remains.log.clone();
    for from in remains.places() {
        remains.log = whole.clone();
        remains.log[from..].fill(0);
        if remains.log == whole {
            continue; // its last check sum may end with zeros by chance
        }
        let fault = remains.opened(true).err();
        assert!(fault.is_some_and(|fault| is_typed(&fault)), "zero from {from}");
        match remains.opened(false) {
            Ok(found) => {
                // What was zero already is not lost.
                let lost_from = whole[from..].iter().position(|byte| *byte != 0).map_or(from, |at| from + at);
                let there = remains.ends.iter().filter(|end| **end <= lost_from).count() as u64;
                assert_eq!(found, tasks(there), "zero from {from}");
            }
            // The head was on the disk before any page.
            Err(fault) => assert!(from < 32 && is_typed(&fault), "zero from {from}: {fault}"),
        }
    }
}

#[test]
fn a_bit_flipped_anywhere_in_the_log_never_loses_an_acknowledged_record_silently() {
    let mut remains = Remains::of(COMMITS, 3);
    let whole = remains.log.clone();
    let last_two = remains.ends[COMMITS as usize - 3];
    for at in remains.places() {
        remains.log = whole.clone();
        remains.log[at] ^= 0x10;
        let fault = remains.opened(true).err();
        assert!(fault.is_some_and(|fault| is_typed(&fault)), "bit at {at}");
        match remains.opened(false) {
            // Not to be told from an end that was torn; what is promised is the lock file's.
            Ok(found) => assert!(at >= last_two && found.len() as u64 >= COMMITS - 2, "bit at {at}"),
            Err(fault) => assert!(is_typed(&fault), "bit at {at}: {fault}"),
        }
    }
}

#[test]
fn a_page_that_never_reached_the_disk_is_noticed() {
    let mut remains = Remains::of(COMMITS, 0);
    let whole = remains.log.clone();
    for page in (32..whole.len()).step_by(4096 + 24) {
        remains.log = whole.clone();
        remains.log[page..page + 4096 + 24].fill(0);
        let fault = remains.opened(true).err();
        assert!(fault.is_some_and(|fault| is_typed(&fault)), "page at {page}");
    }
}

#[test]
fn a_torn_commit_of_many_pages_is_not_damage() {
    let place = Place::filled(3);
    let (mut ledger, _) = place.open().unwrap();
    ledger.append(&[task(4)]).unwrap();
    let acknowledged = fs::read(place.beside("-lock")).unwrap();
    let synced = fs::metadata(place.beside("-wal")).unwrap().len() as usize;
    let long: Vec<Value> = (5..=400).map(task).collect();
    ledger.append(&long).unwrap();
    let [file, log] = ["", "-wal"].map(|end| fs::read(place.beside(end)).unwrap());
    let mut remains = Remains { file, log: Vec::new(), lock: acknowledged, ends: Vec::new() };
    let pages = (log.len() - synced) / (4096 + 24);
    assert!(pages > 5);
    for lost in 0..pages {
        // A disk may write pages in any order: all but this one.
        remains.log = log.clone();
        remains.log[synced + lost * (4096 + 24)..][..4096 + 24].fill(0);
        assert_eq!(remains.opened(true).unwrap(), tasks(4), "page {lost}");
    }
}

#[test]
fn what_an_earlier_round_left_in_the_log_is_neither_taken_for_records_nor_for_damage() {
    let place = Place::new();
    let (mut ledger, _) = place.open().unwrap();
    for n in 1..=30 {
        ledger.append(&[task(n)]).unwrap();
    }
    // All of it into the file, the log stays as long as it is and begins again.
    ledger.connection.query_row("PRAGMA wal_checkpoint(PASSIVE)", [], |_| Ok(())).unwrap();
    for n in 31..=36 {
        ledger.append(&[task(n)]).unwrap();
    }
    let [file, log, lock] = ["", "-wal", "-lock"].map(|end| fs::read(place.beside(end)).unwrap());
    let mut remains = Remains { file, log: log.clone(), lock, ends: Vec::new() };
    assert!(log.len() > 20 * (4096 + 24));
    assert_eq!(remains.opened(false).unwrap(), tasks(36));
    let page = |n: usize| 32 + n * (4096 + 24);
    for (at, harmless) in [(page(0) + 100, false), (page(2) + 9, false), (page(20) + 100, true)] {
        remains.log = log.clone();
        remains.log[at] ^= 1;
        match remains.opened(false) {
            Ok(found) => assert!(harmless && found == tasks(36), "bit at {at}"),
            Err(fault) => assert!(!harmless && is_typed(&fault), "bit at {at}: {fault}"),
        }
    }
}

#[test]
fn a_bit_flipped_anywhere_in_the_file_never_loses_a_record_silently() {
    let place = Place::filled(60);
    let [file, lock] = ["", "-lock"].map(|end| fs::read(place.beside(end)).unwrap());
    let mut remains = Remains { file: file.clone(), log: Vec::new(), lock, ends: Vec::new() };
    let mut noticed = 0;
    for at in (0..file.len()).step_by(37) {
        remains.file = file.clone();
        remains.file[at] ^= 0x04;
        match remains.opened(true) {
            Ok(found) => assert_eq!(found, tasks(60), "bit at {at}"),
            Err(fault) => {
                noticed += 1;
                let other = matches!(&fault, LedgerFault::OtherFleet { .. } | LedgerFault::Sqlite { .. });
                assert!(is_typed(&fault) || other, "bit at {at}: {fault}");
            }
        }
    }
    assert!(noticed > 20, "{noticed}");
}

#[test]
fn of_a_damaged_file_the_rest_is_read() {
    let place = Place::filled(500);
    let mut file = fs::read(place.path()).unwrap();
    let text = br#"{"task":250,"#;
    let at = file.windows(text.len()).position(|window| window == text).unwrap();
    file[at + 8] = b'9';
    fs::write(place.path(), &file).unwrap();
    let reading = read(&place.path()).unwrap();
    assert_eq!(reading.damage, [Damage::Record { seq: 250 }]);
    assert_eq!(reading.rows.len(), 500);
    assert!(matches!(place.fault(), LedgerFault::Damaged(Damage::Record { seq: 250 })));
    // The page's own structure as well: what is on other pages is still read, from both ends.
    let page = at / 4096 * 4096;
    file[page..page + 8].fill(0xff);
    fs::write(place.path(), &file).unwrap();
    let reading = read(&place.path()).unwrap();
    assert!(reading.rows.len() > 400 && reading.rows.len() < 500, "{}", reading.rows.len());
    assert!(matches!(reading.damage[..], [Damage::Structure(_), Damage::Gap { .. }]), "{:?}", reading.damage);
    assert_eq!(reading.rows.last().unwrap().seq, 500);
}
