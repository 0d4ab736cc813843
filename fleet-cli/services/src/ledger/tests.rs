//! Opening, refusing, writing and compacting.

mod anew;
mod copying;
mod damage;
mod queue;

use super::*;
use serde_json::{Value, json};
use std::os::unix::fs::PermissionsExt;
use tempfile::TempDir;
use xtb_client::Error;

type Open = Result<(Ledger<Value>, Recovered<Value>), LedgerError>;

struct Place {
    folder: TempDir,
}

impl Place {
    /// Where waiting for the disk takes no time, if there is such a place.
    fn new() -> Self {
        let folder = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir());
        Self { folder: folder.unwrap() }
    }

    fn path(&self) -> PathBuf {
        self.folder.path().join("lab.ledger")
    }

    fn beside(&self, end: &str) -> PathBuf {
        beside(&self.path(), end)
    }

    fn open(&self) -> Open {
        Ledger::create_or_open(&self.path(), "lab")
    }

    /// A ledger with records 1 to `last`, as if closed.
    fn filled(last: u64) -> Self {
        let place = Self::new();
        let (mut ledger, _) = place.open().unwrap();
        for n in 1..=last {
            ledger.append(&[task(n)]).unwrap();
        }
        place
    }

    fn fault(&self) -> LedgerFault {
        self.open().unwrap_err().fault
    }
}

fn task(n: u64) -> Value {
    json!({"task": n, "x_m": n as f64 / 10.0, "why": "größer"})
}

fn records<R>(recovered: Recovered<R>) -> Vec<R> {
    recovered.rows.into_iter().map(|row| row.record).collect()
}

fn tasks(last: u64) -> Vec<Value> {
    (1..=last).map(task).collect()
}

#[test]
fn what_was_appended_is_there_after_opening_again() {
    let place = Place::new();
    let (mut ledger, recovered) = place.open().unwrap();
    assert!(recovered.created);
    assert_eq!(ledger.append(&[task(1), task(2)]).unwrap(), 2);
    assert_eq!(ledger.append(&[task(3)]).unwrap(), 3);
    drop(ledger);
    let (ledger, recovered) = place.open().unwrap();
    assert!(!recovered.created);
    assert_eq!(ledger.last_seq(), 3);
    assert_eq!(recovered.rows.iter().map(|row| row.seq).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(recovered.rows.iter().all(|row| row.at_ms > 1_600_000_000_000 && !row.snapshot));
    assert_eq!(records(recovered), tasks(3));
}

#[test]
fn a_snapshot_replaces_all_before_it_and_numbers_go_on() {
    let place = Place::new();
    let (mut ledger, _) = place.open().unwrap();
    for n in 1..=2000 {
        ledger.append(&vec![task(n); 4]).unwrap();
    }
    let long = fs::metadata(place.path()).unwrap().len();
    let whole = json!({"all": "of it"});
    assert_eq!(ledger.compact(&whole).unwrap(), 8001);
    let short = fs::metadata(place.path()).unwrap().len();
    assert!(short < long / 4, "{long} bytes before, {short} after");
    assert_eq!(ledger.append(&[task(1)]).unwrap(), 8002);
    drop(ledger);
    let (_, recovered) = place.open().unwrap();
    assert!(recovered.rows[0].snapshot && recovered.rows[0].seq == 8001);
    assert_eq!(records(recovered), [whole, task(1)]);
}

#[test]
fn a_second_dispatcher_is_refused_with_the_holders_process() {
    let place = Place::filled(1);
    let first = place.open().unwrap();
    let error = place.open().unwrap_err();
    assert!(matches!(error.fault, LedgerFault::Held { pid: Some(pid) } if pid == std::process::id()));
    let failure = Error::from(error);
    assert!(failure.message.contains(&format!("process {}", std::process::id())), "{failure}");
    drop(first);
    assert_eq!(records(place.open().unwrap().1), tasks(1));
}

#[test]
fn an_empty_file_is_refused_and_not_filled() {
    let place = Place::new();
    fs::write(place.path(), "").unwrap();
    assert!(matches!(place.fault(), LedgerFault::Empty));
    assert!(matches!(read(&place.path()).unwrap_err().fault, LedgerFault::Empty));
    assert_eq!(fs::metadata(place.path()).unwrap().len(), 0);
}

#[test]
fn what_is_no_ledger_is_refused_and_not_touched() {
    let place = Place::new();
    let text = "fleet = \"lab\"\n".repeat(100);
    fs::write(place.path(), &text).unwrap();
    assert!(matches!(place.fault(), LedgerFault::NotALedger { .. }));
    assert_eq!(fs::read_to_string(place.path()).unwrap(), text);
    fs::remove_file(place.path()).unwrap();
    Connection::open(place.path()).unwrap().execute_batch("CREATE TABLE t (a)").unwrap();
    assert!(matches!(place.fault(), LedgerFault::NotALedger { .. }));
    fs::remove_file(place.path()).unwrap();
    fs::create_dir(place.path()).unwrap();
    assert!(matches!(place.fault(), LedgerFault::NotALedger { .. }));
}

#[test]
fn another_fleets_ledger_is_refused_by_name() {
    let place = Place::filled(2);
    let error = Ledger::<Value>::create_or_open(&place.path(), "yard").unwrap_err();
    assert!(error.to_string().contains("`lab`"), "{error}");
    assert!(error.hint().contains("--fleet lab"));
    assert_eq!(records(place.open().unwrap().1), tasks(2));
}

#[test]
fn a_newer_schema_is_refused_by_number() {
    let place = Place::filled(1);
    Connection::open(place.path()).unwrap().pragma_update(None, "user_version", 7).unwrap();
    assert!(matches!(place.fault(), LedgerFault::Newer { found: 7, known: 1 }));
    assert!(matches!(read(&place.path()).unwrap_err().fault, LedgerFault::Newer { found: 7, .. }));
}

#[test]
fn a_ledger_that_was_there_and_is_gone_does_not_begin_anew() {
    let place = Place::filled(3);
    fs::remove_file(place.path()).unwrap();
    assert!(matches!(place.fault(), LedgerFault::Gone { acknowledged: 3 }));
    assert!(!place.path().exists());
    fs::remove_file(place.beside("-lock")).unwrap();
    fs::write(place.beside("-wal"), "something").unwrap();
    assert!(matches!(place.fault(), LedgerFault::LogAlone { .. }));
    fs::remove_file(place.beside("-wal")).unwrap();
    fs::remove_file(place.beside("-lock")).unwrap();
    assert!(place.open().unwrap().1.created);
}

#[test]
fn a_backup_that_is_too_old_is_refused_until_the_lock_file_is_removed() {
    let place = Place::filled(3);
    let backup = fs::read(place.path()).unwrap();
    let (mut ledger, _) = place.open().unwrap();
    ledger.append(&[task(4), task(5)]).unwrap();
    drop(ledger);
    fs::write(place.path(), backup).unwrap();
    let lost = [Damage::Lost { acknowledged: 5, found: 3 }];
    assert_eq!(read(&place.path()).unwrap().damage, lost);
    assert!(matches!(place.fault(), LedgerFault::Damaged(damage) if damage == lost[0]));
    fs::remove_file(place.beside("-lock")).unwrap();
    assert_eq!(records(place.open().unwrap().1), tasks(3));
}

#[test]
fn a_draft_that_a_kill_left_behind_is_no_ledger() {
    let place = Place::new();
    fs::write(place.beside("-new"), "half").unwrap();
    let (mut ledger, recovered) = place.open().unwrap();
    assert!(recovered.created);
    ledger.append(&[task(1)]).unwrap();
    assert!(!place.beside("-new").exists());
}

#[test]
fn records_of_a_newer_program_are_named_and_left_alone() {
    #[derive(Debug, Serialize, serde::Deserialize)]
    enum Known {
        Queued { task: u64 },
    }
    let place = Place::filled(2);
    let error = Ledger::<Known>::create_or_open(&place.path(), "lab").unwrap_err();
    assert!(matches!(error.fault, LedgerFault::Meaning { seq: 1, .. }), "{error}");
    assert_eq!(records(place.open().unwrap().1), tasks(2));
}

#[test]
fn a_record_that_is_too_long_is_refused_and_the_next_one_taken() {
    let place = Place::new();
    let (mut ledger, _) = place.open().unwrap();
    let long = Value::String("x".repeat(MAX_RECORD_BYTES));
    let error = ledger.append(&[task(1), long]).unwrap_err();
    assert!(matches!(error.fault, LedgerFault::TooLong { .. }));
    assert_eq!(ledger.append(&[task(1)]).unwrap(), 1);
}

#[test]
fn it_is_read_while_it_is_written() {
    let place = Place::new();
    let (mut ledger, _) = place.open().unwrap();
    for n in 1..=50 {
        ledger.append(&[task(n)]).unwrap();
        let reading = read(&place.path()).unwrap();
        assert_eq!(reading.damage, []);
        assert_eq!(reading.fleet.as_deref(), Some("lab"));
        let rows = reading.rows.into_iter().map(|row| row.decode().unwrap().record);
        assert_eq!(rows.collect::<Vec<Value>>(), tasks(n));
    }
}

#[test]
fn a_backup_taken_while_it_is_written_is_a_ledger() {
    let place = Place::new();
    let (mut ledger, _) = place.open().unwrap();
    ledger.append(&tasks(700)).unwrap();
    let copy = Place::new();
    backup(&place.path(), &copy.path()).unwrap();
    ledger.append(&[task(701)]).unwrap();
    assert_eq!(records(copy.open().unwrap().1), tasks(700));
    // Never over something.
    backup(&place.path(), &copy.path()).unwrap_err();
    assert_eq!(records(copy.open().unwrap().1), tasks(700));
}

#[test]
fn reading_what_is_not_there_makes_nothing() {
    let place = Place::new();
    assert!(matches!(read(&place.path()).unwrap_err().fault, LedgerFault::Io { .. }));
    assert_eq!(fs::read_dir(place.folder.path()).unwrap().count(), 0);
}

#[test]
fn somebody_who_writes_past_the_lock_is_noticed() {
    let place = Place::filled(1);
    let (mut ledger, _) = place.open().unwrap();
    fs::remove_file(place.beside("-lock")).unwrap();
    let (mut other, _) = place.open().unwrap();
    other.append(&[task(2)]).unwrap();
    let error = ledger.append(&[task(3)]).unwrap_err();
    assert!(matches!(error.fault, LedgerFault::Overtaken { seq: 2 }), "{error}");
    drop((ledger, other));
    assert_eq!(records(place.open().unwrap().1), tasks(2));
}

#[test]
fn a_file_of_an_older_schema_is_brought_on_as_a_whole_or_not_at_all() {
    let place = Place::filled(2);
    let mut connection = Connection::open(place.path()).unwrap();
    let steps = [schema::STEPS[0], "ALTER TABLE records ADD COLUMN robot TEXT"];
    let broken = [steps[0], steps[1], "ALTER TABLE missing ADD COLUMN robot TEXT"];
    schema::migrate(&mut connection, 1, &broken).unwrap_err();
    assert_eq!(schema::version(&connection, 3).unwrap(), 1);
    connection.prepare("SELECT robot FROM records").unwrap_err();
    schema::migrate(&mut connection, 1, &steps).unwrap();
    assert_eq!(schema::version(&connection, 2).unwrap(), 2);
    connection.prepare("SELECT robot FROM records").unwrap();
    assert_eq!(export::rows(&connection).unwrap().len(), 2);
}

#[test]
fn what_may_not_be_written_is_said_and_read_all_the_same() {
    let place = Place::filled(2);
    let (mut ledger, _) = place.open().unwrap();
    ledger.connection.pragma_update(None, "query_only", true).unwrap();
    let error = ledger.append(&[task(3)]).unwrap_err();
    assert!(matches!(error.fault, LedgerFault::ReadOnly { .. }), "{error}");
    assert_eq!(read(&place.path()).unwrap().rows.len(), 2);
    ledger.connection.pragma_update(None, "query_only", false).unwrap();
    assert_eq!(ledger.append(&[task(3)]).unwrap(), 3);
}

#[test]
#[allow(clippy::print_stderr)]
fn a_file_and_a_folder_that_may_not_be_written_are_said_and_read_all_the_same() {
    let place = Place::filled(2);
    let allow = |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    allow(&place.path(), 0o444);
    allow(place.folder.path(), 0o555);
    if fs::write(place.beside("-probe"), "").is_ok() {
        return eprintln!("skipped, as this user may write everything");
    }
    assert!(matches!(place.fault(), LedgerFault::ReadOnly { .. }));
    assert_eq!(read(&place.path()).unwrap().rows.len(), 2);
    let other = place.folder.path().join("other.ledger");
    let error = Ledger::<Value>::create_or_open(&other, "lab").unwrap_err();
    assert!(matches!(error.fault, LedgerFault::ReadOnly { .. }), "{error}");
    allow(place.folder.path(), 0o755);
    allow(&place.path(), 0o644);
    assert_eq!(records(place.open().unwrap().1), tasks(2));
}
