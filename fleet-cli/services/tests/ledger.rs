//! The ledger of a process that is killed, and on a disk that is full.

#![allow(clippy::unwrap_used)]

use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use xtb_dispatch::dispatcher::DispatcherIdentity;
use xtb_dispatch::{Dispatcher, DispatcherSettings, Effect, LedgerEntry};
use xtb_protocol::Name;
use xtb_protocol::messages::{TaskId, TaskState};
use xtb_services::dispatch::store::Store;
use xtb_services::ledger::{Ledger, LedgerFault, LedgerWriter, Recovered, read};

const LEDGER: &str = "XTB_TEST_LEDGER";
/// How often to kill; 50 unless this variable says more.
const ROUNDS: &str = "XTB_KILL_ROUNDS";
/// Records between two snapshots, so that kills come into these too.
const COMPACT_EVERY: u64 = 300;
/// Submissions on their way at a time.
const IN_FLIGHT: usize = 8;

/// Says its own number, so that none can stand for another.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    number: u64,
    text: String,
}

impl Record {
    fn new(number: u64) -> Self {
        Self { number, text: format!("{number} ").repeat(1 + number as usize % 40) }
    }

    fn is_right(&self, seq: u64) -> bool {
        self.number == seq && self.text == Self::new(seq).text
    }
}

/// The process that is killed: says `opened N`, and `acknowledged N` for each record.
#[test]
#[ignore = "the child of the next test"]
fn writes_until_it_is_killed() {
    let Ok(path) = std::env::var(LEDGER) else {
        panic!("only as a child, with {LEDGER}");
    };
    let (ledger, recovered) = Ledger::<Record>::create_or_open(Path::new(&path), "lab").unwrap();
    assert!(recovered.rows.iter().all(|row| row.record.is_right(row.seq)));
    let mut number = ledger.last_seq();
    let mut out = std::io::stdout();
    writeln!(out, "\nopened {number}").unwrap();
    let writer = LedgerWriter::start(ledger, 64).unwrap();
    let mut waiting = VecDeque::new();
    loop {
        number += 1;
        let record = Record::new(number);
        let compact = number.is_multiple_of(COMPACT_EVERY);
        let ticket = if compact { writer.compact(&record) } else { writer.submit(&[record]) };
        waiting.push_back(ticket.unwrap());
        if waiting.len() == IN_FLIGHT {
            let seq = waiting.pop_front().unwrap().blocking_recv().unwrap().unwrap();
            writeln!(out, "acknowledged {seq}").unwrap();
        }
    }
}

/// Any sequence will do, as long as it is another each time.
fn random(state: &mut u64, below: u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) % below
}

/// Lets a child write until some time after its n-th line, kills it, and gives the last number acknowledged.
fn round(path: &Path, lines: u64, then: Duration) -> u64 {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "writes_until_it_is_killed", "--ignored", "--nocapture"])
        .env(LEDGER, path)
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    let number = |line: &str| {
        let words = line.strip_prefix("acknowledged ").or(line.strip_prefix("opened "));
        words.and_then(|number| number.parse::<u64>().ok())
    };
    let mut last = 0;
    let mut read = 0;
    while read < lines {
        let line = said.next().expect("the child goes on until it is killed").unwrap();
        if let Some(number) = number(&line) {
            (last, read) = (last.max(number), read + 1);
        }
    }
    let begun = Instant::now();
    while begun.elapsed() < then {
        std::hint::spin_loop();
    }
    child.kill().unwrap();
    child.wait().unwrap();
    // What it had said by then was said.
    let rest = said.map_while(Result::ok).filter_map(|line| number(&line));
    rest.fold(last, u64::max)
}

#[test]
#[allow(clippy::print_stderr)]
fn every_record_acknowledged_before_a_kill_is_there() {
    let rounds = std::env::var(ROUNDS).ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(50);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.ledger");
    let (mut state, mut acknowledged) = (6, 0);
    for n in 0..rounds {
        // Every eighth while it opens, the others while it writes.
        let lines = if n % 8 == 7 { 0 } else { 1 + random(&mut state, 120) };
        let then = Duration::from_micros(random(&mut state, if lines == 0 { 30_000 } else { 3000 }));
        acknowledged = round(&path, lines, then).max(acknowledged);
        if !path.exists() {
            assert_eq!(acknowledged, 0, "round {n}");
            continue;
        }
        let reading = read(&path).unwrap();
        assert_eq!(reading.damage, [], "round {n}");
        let last = reading.rows.last().map_or(0, |row| row.seq);
        assert!(last >= acknowledged, "round {n}: {acknowledged} acknowledged, {last} there");
        for row in reading.rows {
            let row = row.decode::<Record>().unwrap();
            assert!(row.record.is_right(row.seq), "round {n}: {row:?}");
        }
        let (ledger, recovered) = Ledger::<Record>::create_or_open(&path, "lab").unwrap();
        assert_eq!(ledger.last_seq(), last, "round {n}");
        assert!(recovered.rows.len() as u64 <= COMPACT_EVERY + 1 || last < COMPACT_EVERY);
    }
    assert!(acknowledged > rounds, "only {acknowledged} records in {rounds} rounds");
    eprintln!("{rounds} kills, {acknowledged} records acknowledged, none lost");
}

/// A disk of its own, until it is dropped.
struct Disk {
    folder: tempfile::TempDir,
}

impl Disk {
    fn small() -> Result<Self, String> {
        let folder = tempfile::tempdir().unwrap();
        let mut mount = Command::new("mount");
        mount.args(["-t", "tmpfs", "-o", "size=512k", "tmpfs"]).arg(folder.path());
        match mount.output() {
            Ok(done) if done.status.success() => Ok(Self { folder }),
            Ok(done) => Err(String::from_utf8_lossy(&done.stderr).trim().to_owned()),
            Err(error) => Err(error.to_string()),
        }
    }
}

impl Drop for Disk {
    fn drop(&mut self) {
        let _ = Command::new("umount").arg(self.folder.path()).status();
    }
}

#[test]
#[allow(clippy::print_stderr)]
fn a_disk_that_is_really_full_loses_nothing() {
    let disk = match Disk::small() {
        Ok(disk) => disk,
        Err(why) => return eprintln!("skipped, as no disk can be mounted here: {why}"),
    };
    let path = disk.folder.path().join("lab.ledger");
    let ballast = disk.folder.path().join("ballast");
    fs::write(&ballast, vec![1; 128 << 10]).unwrap();
    let (mut ledger, _) = Ledger::create_or_open(&path, "lab").unwrap();
    let error = loop {
        if let Err(error) = ledger.append(&[Record::new(ledger.last_seq() + 1)]) {
            break error;
        }
    };
    assert!(matches!(error.fault, LedgerFault::Full { .. }), "{error}");
    let written = ledger.last_seq();
    assert!(written > 10);
    assert_eq!(read(&path).unwrap().rows.len() as u64, written);
    // A dispatcher that starts on a full disk says so, or comes up with everything.
    drop(ledger);
    if let Ok((ledger, recovered)) = Ledger::<Record>::create_or_open(&path, "lab") {
        assert_eq!((ledger.last_seq(), recovered.rows.len() as u64), (written, written));
    }
    fs::remove_file(&ballast).unwrap();
    let (mut ledger, recovered): (_, Recovered<Record>) = Ledger::create_or_open(&path, "lab").unwrap();
    assert!(recovered.rows.iter().all(|row| row.record.is_right(row.seq)));
    assert_eq!(ledger.append(&[Record::new(written + 1)]).unwrap(), written + 1);
    assert_eq!(read(&path).unwrap().rows.len() as u64, written + 1);
}

/// What a dispatcher of schema 1 wrote, and left when it was ended. The file is never made anew: a later program
/// has to bring it to its own schema.
#[test]
fn the_ledger_of_a_dispatcher_of_schema_1_is_opened_and_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("lab.ledger");
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/ledgers/v1.ledger"), &path).unwrap();
    assert_eq!(read(&path).unwrap().rows.len(), 47, "it cannot be exported");

    let store = Store::open(&path, &Name::new("lab").unwrap()).unwrap();
    assert!(!store.created);
    let now_ms = store.entries.last().unwrap().at_ms;
    let mut dispatcher = dispatcher(now_ms, store.entries);
    use TaskState::{Cancelled, Done, Failed, Paused, Running};
    let tasks: Vec<_> =
        dispatcher.store().tasks().map(|task| (task.id.number(), task.state, task.legs_done)).collect();
    let expected =
        [(Done, 1), (Cancelled, 1), (Cancelled, 0), (Done, 4), (Paused, 4), (Failed, 0), (Running, 0)];
    assert_eq!(tasks, (1..).zip(expected).map(|(n, (state, legs))| (n, state, legs)).collect::<Vec<_>>());
    let failed = dispatcher.store().task(TaskId::new(6)).unwrap();
    assert_eq!(failed.reason.as_deref(), Some("xtb-2 was told to stop"));

    assert!(dispatcher.compact(now_ms));
    let Some(Effect::Write(write)) = dispatcher.next_effect() else { panic!("no write") };
    let mut ledger = store.ledger;
    assert_eq!(ledger.compact(&write.entries[0]).unwrap(), 48);
    drop(ledger);
    let again = Store::open(&path, &Name::new("lab").unwrap()).unwrap();
    dispatcher.written(now_ms, write.id).unwrap();
    assert_eq!(self::dispatcher(now_ms, again.entries).store(), dispatcher.store());
}

fn dispatcher(now_ms: u64, entries: Vec<LedgerEntry>) -> Dispatcher {
    let identity = DispatcherIdentity { me: Name::new("dispatch").unwrap(), ledger: 1, run: 1 };
    Dispatcher::recover(now_ms, identity, DispatcherSettings::default(), entries).unwrap()
}
