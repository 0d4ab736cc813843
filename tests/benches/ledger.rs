//! Durable submissions per second, beside plain SQLite commits of the same rows.
//!
//! `cargo bench -p fleet-tests --bench ledger`: both on the same disk with the same settings, in turns, so
//! that the ratio does not depend on the machine. A submitter sends the next record when the last one is
//! on the disk; plain SQLite has one connection that its submitters take in turns, a commit a record.

use rusqlite::{Connection, params};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use xtb_services::ledger::{Ledger, LedgerWriter, QUEUE};

const SUBMITTERS: [usize; 3] = [1, 8, 64];
/// Each way is measured this often, in turns; the median counts.
const TURNS: usize = 5;
const EACH: Duration = Duration::from_millis(1000);

fn task(n: u64) -> Value {
    json!({"queued": {"task": n, "goto": {"x_m": 1.5, "y_m": 2.0, "yaw_rad": null}, "priority": 3,
           "robot": null, "deadline_ms": null, "retry": {"times": 2}, "on_link_loss": "halt"}})
}

/// How many of them are done a second by so many at once.
fn rate(submitters: usize, one: impl Fn(u64) + Sync) -> f64 {
    let done = AtomicU64::new(0);
    let begun = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..submitters {
            scope.spawn(|| {
                while begun.elapsed() < EACH {
                    one(done.fetch_add(1, Ordering::Relaxed));
                }
            });
        }
    });
    done.load(Ordering::Relaxed) as f64 / begun.elapsed().as_secs_f64()
}

fn ledger(folder: &Path, submitters: usize) -> (f64, f64) {
    let path = folder.join("bench.ledger");
    let (ledger, _) = Ledger::<Value>::create_or_open(&path, "bench").expect("a ledger");
    let writer = LedgerWriter::start(ledger, QUEUE).expect("a thread");
    let rate = rate(submitters, |n| {
        let ticket = writer.submit(&[task(n)]).expect("room in the queue");
        ticket.blocking_recv().expect("an answer").expect("written");
    });
    let counters = writer.counters();
    (rate, counters.records as f64 / counters.commits as f64)
}

fn plain(folder: &Path, submitters: usize) -> f64 {
    let connection = Connection::open(folder.join("plain.db")).expect("a file");
    let settings = "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;
        CREATE TABLE IF NOT EXISTS records (seq INTEGER PRIMARY KEY, at_ms INTEGER, body TEXT) STRICT;";
    connection.execute_batch(settings).expect("a table");
    let connection = Mutex::new(connection);
    rate(submitters, |n| {
        let body = task(n).to_string();
        let put = "INSERT INTO records (at_ms, body) VALUES (?1, ?2)";
        let connection = connection.lock().expect("nobody panics");
        connection.execute(put, params![n as i64, body]).expect("written");
    })
}

/// How long a dispatcher waits for its ledger when it starts.
fn opening(records: u64) -> Duration {
    let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
    let path = folder.path().join("bench.ledger");
    let (mut ledger, _) = Ledger::create_or_open(&path, "bench").expect("a ledger");
    for from in (0..records).step_by(1000) {
        ledger.append(&(from..from + 1000).map(task).collect::<Vec<Value>>()).expect("written");
    }
    drop(ledger);
    let begun = Instant::now();
    let (_, recovered) = Ledger::<Value>::create_or_open(&path, "bench").expect("a ledger");
    assert_eq!(recovered.rows.len() as u64, records);
    begun.elapsed()
}

fn median(mut rates: Vec<f64>) -> f64 {
    rates.sort_by(f64::total_cmp);
    rates[rates.len() / 2]
}

#[allow(clippy::print_stdout)]
fn main() {
    println!("submitters   ledger /s   records a commit   plain SQLite /s   ratio");
    for submitters in SUBMITTERS {
        let (mut ours, mut theirs, mut group) = (Vec::new(), Vec::new(), 0.0);
        for _ in 0..TURNS {
            let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).expect("a folder");
            let (rate, records) = ledger(folder.path(), submitters);
            ours.push(rate);
            group = records;
            theirs.push(plain(folder.path(), submitters));
        }
        let (ours, theirs) = (median(ours), median(theirs));
        println!("{submitters:10}   {ours:9.0}   {group:16.1}   {theirs:15.0}   {:5.2}", ours / theirs);
    }
    for records in [10_000, 100_000] {
        println!("opening a ledger of {records} records: {} ms", opening(records).as_millis());
    }
}
