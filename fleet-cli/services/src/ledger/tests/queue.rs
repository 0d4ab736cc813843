//! The thread in front of a ledger: one commit for many, bounds, and disks that are full.

use super::*;

fn started(place: &Place, queue: usize) -> LedgerWriter {
    LedgerWriter::start(place.open().unwrap().0, queue).unwrap()
}

/// A ledger of which nothing more than a few pages fits on its disk.
fn crowded(place: &Place) -> Ledger<Value> {
    let (ledger, _) = place.open().unwrap();
    let pages: i64 = ledger.connection.pragma_query_value(None, "page_count", |row| row.get(0)).unwrap();
    limit(&ledger, pages + 4);
    ledger
}

fn limit(ledger: &Ledger<Value>, pages: i64) {
    let set = |row: &rusqlite::Row<'_>| row.get::<_, i64>(0);
    ledger.connection.pragma_update_and_check(None, "max_page_count", pages, set).unwrap();
}

fn large(n: u64) -> Value {
    json!({"task": n, "points": vec![0.125; 1000]})
}

#[test]
fn submissions_are_answered_in_order_and_are_there() {
    let place = Place::new();
    let writer = started(&place, QUEUE);
    let tickets: Vec<PendingWrite> = (1..=200).map(|n| writer.submit(&[task(n)]).unwrap()).collect();
    let answers: Vec<u64> =
        tickets.into_iter().map(|ticket| ticket.blocking_recv().unwrap().unwrap()).collect();
    assert_eq!(answers, (1..=200).collect::<Vec<u64>>());
    let counters = writer.counters();
    assert_eq!((counters.records, counters.failed, counters.queue), (200, 0, 0));
    assert!(counters.commits < 200, "{} commits for 200 submissions", counters.commits);
    assert!(counters.queue_high_water > 1 && counters.bytes > 200 * 10);
    drop(writer);
    assert_eq!(records(place.open().unwrap().1), tasks(200));
}

#[test]
fn what_waits_is_written_when_the_writer_goes() {
    let place = Place::new();
    let writer = started(&place, QUEUE);
    for n in 1..=100 {
        drop(writer.submit(&[task(n)]).unwrap());
    }
    drop(writer);
    assert_eq!(records(place.open().unwrap().1), tasks(100));
}

#[test]
fn a_snapshot_in_the_queue_replaces_what_was_submitted_before_it_only() {
    let place = Place::new();
    let writer = started(&place, QUEUE);
    let before = writer.submit(&[task(1), task(2)]).unwrap();
    let snapshot = writer.compact(&json!("two tasks")).unwrap();
    let after = writer.submit(&[task(3)]).unwrap();
    let answers = [before, snapshot, after].map(|ticket| ticket.blocking_recv().unwrap().unwrap());
    assert_eq!(answers, [2, 3, 4]);
    drop(writer);
    assert_eq!(records(place.open().unwrap().1), [json!("two tasks"), task(3)]);
}

#[test]
fn a_queue_that_is_full_refuses_and_counts() {
    let place = Place::new();
    let (ledger, _) = place.open().unwrap();
    // Somebody else in the file's way: commits wait, and so does the queue.
    let other = Connection::open(place.path()).unwrap();
    other.execute_batch("BEGIN IMMEDIATE").unwrap();
    let writer = LedgerWriter::start(ledger, 4).unwrap();
    let mut tickets = Vec::new();
    let refused = (1..=100).find_map(|_| match writer.submit(&[task(tickets.len() as u64 + 1)]) {
        Ok(ticket) => {
            tickets.push(ticket);
            None
        }
        Err(refused) => Some(refused),
    });
    assert!(matches!(refused, Some(Refused::Busy { .. })), "{refused:?}");
    assert_eq!(writer.counters().refused, 1);
    other.execute_batch("COMMIT").unwrap();
    let last = tickets.len() as u64;
    for ticket in tickets {
        ticket.blocking_recv().unwrap().unwrap();
    }
    drop(writer);
    assert_eq!(records(place.open().unwrap().1), tasks(last));
}

#[test]
fn a_full_disk_is_said_and_the_ledger_goes_on_when_there_is_room() {
    let place = Place::filled(3);
    let mut ledger = crowded(&place);
    let mut written = 3;
    let error = loop {
        match ledger.append(&[large(written + 1)]) {
            Ok(seq) => written = seq,
            Err(error) => break error,
        }
    };
    assert!(matches!(error.fault, LedgerFault::Full { .. }), "{error}");
    assert!(error.hint().contains("free disk space"));
    // Half a group is nothing.
    ledger.append(&[task(0), large(0), large(0), large(0), large(0)]).unwrap_err();
    assert_eq!(ledger.last_seq(), written);
    limit(&ledger, 10_000);
    assert_eq!(ledger.append(&[task(written + 1)]).unwrap(), written + 1);
    drop(ledger);
    let (_, recovered) = place.open().unwrap();
    let expected = (1..=3).map(task).chain((4..=written).map(large)).chain([task(written + 1)]);
    assert_eq!(records(recovered), expected.collect::<Vec<Value>>());
}

#[test]
fn nothing_is_written_behind_a_failure_until_the_owner_knows() {
    let place = Place::filled(1);
    let writer = LedgerWriter::start(crowded(&place), QUEUE).unwrap();
    let too_much: Vec<Value> = (0..20).map(large).collect();
    let failed = writer.submit(&too_much).unwrap().blocking_recv().unwrap().unwrap_err();
    assert!(matches!(failed.error.fault, LedgerFault::Full { .. }) && !failed.behind);
    let behind = writer.submit(&[task(2)]).unwrap().blocking_recv().unwrap().unwrap_err();
    assert!(behind.behind && behind.failure == failed.failure);
    writer.resume(&failed).unwrap();
    assert_eq!(writer.submit(&[task(2)]).unwrap().blocking_recv().unwrap().unwrap(), 2);
    let again = writer.submit(&too_much).unwrap().blocking_recv().unwrap().unwrap_err();
    // News of the first failure says nothing about the second.
    writer.resume(&behind).unwrap();
    assert!(writer.submit(&[task(3)]).unwrap().blocking_recv().unwrap().unwrap_err().behind);
    writer.resume(&again).unwrap();
    assert_eq!(writer.submit(&[task(3)]).unwrap().blocking_recv().unwrap().unwrap(), 3);
    let counters = writer.counters();
    assert_eq!(counters.failed, 4);
    assert!(counters.last_error.unwrap().contains("no space left"));
    assert!(counters.last_error_age_ms.is_some());
    drop(writer);
    assert_eq!(records(place.open().unwrap().1), tasks(3));
}

#[test]
fn a_record_that_cannot_be_written_down_disturbs_nobody() {
    let place = Place::new();
    let writer = started(&place, QUEUE);
    let long = Value::String("x".repeat(MAX_RECORD_BYTES));
    assert!(matches!(writer.submit(&[long]), Err(Refused::Record(_))));
    assert_eq!(writer.submit(&[task(1)]).unwrap().blocking_recv().unwrap().unwrap(), 1);
    assert_eq!(writer.counters().failed, 0);
}
