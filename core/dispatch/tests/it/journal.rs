//! The ledger's entries: versions, gaps, snapshots.

use crate::model::{Weather, World};
use xtb_dispatch::task_store::ReplayError;
use xtb_dispatch::task_store::record::EntryError;
use xtb_dispatch::{Effect, LedgerEntry, Record, TaskStore};

fn ledger() -> (Vec<LedgerEntry>, TaskStore) {
    let mut world = World::new(3, Weather::CALM);
    world.run().unwrap();
    let store = world.dispatcher.as_ref().unwrap().store().clone();
    (world.ledger, store)
}

#[test]
fn a_ledger_read_again_is_the_same_book() {
    let (entries, store) = ledger();
    let read = entries.iter().map(|entry| LedgerEntry::from_json(&entry.to_json().unwrap()).unwrap());
    assert_eq!(TaskStore::replay(2000, read).unwrap(), store);
}

#[test]
fn a_snapshot_stands_in_the_place_of_all_before_it() {
    let (entries, store) = ledger();
    for cut in [1, 2, entries.len() / 2, entries.len()] {
        let mut world = World::new(3, Weather::CALM);
        world.ledger = entries[..cut].to_vec();
        world.crash();
        world.restart();
        let now = world.dispatcher.as_ref().unwrap().store().clone();
        let record = Record::Snapshot(Box::new(now));
        let snapshot = LedgerEntry { v: 1, n: cut as u64, at_ms: world.now_ms, record };
        let snapshot = LedgerEntry::from_json(&snapshot.to_json().unwrap()).unwrap();
        let rest = entries[cut..].iter().cloned();
        assert_eq!(TaskStore::replay(2000, std::iter::once(snapshot).chain(rest)).unwrap(), store, "{cut}");
    }
}

#[test]
fn a_snapshot_that_is_written_has_a_number_of_its_own_and_nothing_changes_by_it() {
    let mut world = World::new(3, Weather::CALM);
    world.run().unwrap();
    let (now_ms, entries) = (world.now_ms, world.ledger.len() as u64);
    let mut dispatcher = world.dispatcher.take().unwrap();
    while dispatcher.next_effect().is_some() {}
    let tasks = dispatcher.list(now_ms).tasks;
    assert!(dispatcher.compact(now_ms) && !dispatcher.compact(now_ms), "one at a time");
    let Some(Effect::Write(write)) = dispatcher.next_effect() else { panic!("no write") };
    assert_eq!(write.entries.iter().map(|entry| entry.n).collect::<Vec<_>>(), [entries + 1]);
    // One that fails has never been.
    dispatcher.not_written(now_ms, write.id, "full");
    assert!(!dispatcher.compact(now_ms), "the ledger is not tried again at once");
    let later_ms = now_ms + 60_000;
    assert!(dispatcher.compact(later_ms));
    let Some(Effect::Write(write)) = dispatcher.next_effect() else { panic!("no write") };
    dispatcher.written(later_ms, write.id).unwrap();
    assert_eq!(dispatcher.list(now_ms).tasks, tasks);
    assert_eq!(dispatcher.store().next_n(), entries + 2);
    let read = write.entries.iter().map(|entry| LedgerEntry::from_json(&entry.to_json().unwrap()).unwrap());
    assert_eq!(&TaskStore::replay(2000, read).unwrap(), dispatcher.store());
}

#[test]
fn what_is_missing_or_twice_or_out_of_place_is_refused() {
    let (entries, _) = ledger();
    let gap: Vec<LedgerEntry> = entries.iter().filter(|entry| entry.n != 4).cloned().collect();
    assert_eq!(TaskStore::replay(9, gap).unwrap_err(), ReplayError::Gap { expected: 4, got: 5 });
    let twice = entries[..3].iter().chain(&entries[2..]).cloned();
    assert_eq!(TaskStore::replay(9, twice).unwrap_err(), ReplayError::Gap { expected: 4, got: 3 });
    let headless: Vec<LedgerEntry> =
        entries[1..].iter().zip(1..).map(|(entry, n)| LedgerEntry { n, ..entry.clone() }).collect();
    assert_eq!(TaskStore::replay(9, headless).unwrap_err(), ReplayError::NoBeginning);
}

#[test]
fn an_entry_of_a_later_program_or_none_at_all_is_refused() {
    let (entries, _) = ledger();
    let text = entries[0].to_json().unwrap();
    let later = text.replacen("\"v\":2", "\"v\":5", 1);
    assert_eq!(LedgerEntry::from_json(&later), Err(EntryError::Version { got: 5 }));
    for bad in ["", "{}", &text[..text.len() - 1], &text.replacen("\"n\"", "\"m\"", 1)] {
        assert!(matches!(LedgerEntry::from_json(bad), Err(EntryError::Malformed(_))), "{bad}");
    }
}

/// The layout of what stands on disks; this test is never edited to pass.
#[test]
fn the_entries_of_version_1() {
    for text in [
        r#"{"v":1,"n":1,"at_ms":5,"record":{"opened":{"ledger":7}}}"#,
        concat!(
            r#"{"v":1,"n":2,"at_ms":6,"record":{"submitted":{"task":"t1","by":"cli-7","key":"00000000-0000-"#,
            r#"0000-0000-000000000001","spec":{"kind":{"goto":{"to":{"x_m":1.5,"y_m":2.0,"yaw_rad":null}}},"#,
            r#""priority":5,"deadline_ms":null,"who":{"tag":"red"},"retries":2,"on_link_loss":"halt","#,
            r#""finish_s":300.0,"on_takeover":"requeue","grace_s":30.0}}}}"#
        ),
        r#"{"v":1,"n":3,"at_ms":7,"record":{"assigned":{"task":"t1","robot":"xtb-1","seq":1}}}"#,
        r#"{"v":1,"n":4,"at_ms":8,"record":{"became":{"task":"t1","change":"running","why":null}}}"#,
        r#"{"v":1,"n":5,"at_ms":9,"record":{"became":{"task":"t1","change":{"held":{"by":"cli-7"}},"why":"w"}}}"#,
        concat!(
            r#"{"v":1,"n":6,"at_ms":9,"record":{"became":{"task":"t1","change":{"queued":"#,
            r#"{"not_before_ms":9,"failed":true}},"why":"w"}}}"#
        ),
        r#"{"v":1,"n":7,"at_ms":9,"record":{"reached":{"task":"t1","seq":1,"leg":0}}}"#,
        concat!(
            r#"{"v":1,"n":8,"at_ms":9,"record":{"became":{"task":"t1","change":{"ended":"#,
            r#"{"ending":"done"}},"why":null}}}"#
        ),
    ] {
        assert_eq!(LedgerEntry::from_json(text).unwrap().to_json().unwrap(), text);
    }
}

/// The layout of what stands on disks; this test is never edited to pass.
#[test]
fn the_entries_that_version_2_added() {
    for text in [
        r#"{"v":2,"n":2,"at_ms":6,"record":{"suspended":{"by":"cli-7"}}}"#,
        r#"{"v":2,"n":2,"at_ms":6,"record":{"suspended":{"by":null}}}"#,
        r#"{"v":2,"n":3,"at_ms":7,"record":{"activated":{"by":"cli-7"}}}"#,
        r#"{"v":2,"n":4,"at_ms":8,"record":{"map":{"name":"lab","hash":"00000000000000ff"}}}"#,
        r#"{"v":2,"n":5,"at_ms":9,"record":{"adopted":{"map":"lab","by":"cli-7"}}}"#,
    ] {
        assert_eq!(LedgerEntry::from_json(text).unwrap().to_json().unwrap(), text);
    }
}

/// A snapshot of version 1 knew neither maps nor suspensions.
#[test]
fn a_snapshot_of_version_1_is_read() {
    let (_, store) = ledger();
    let record = Record::Snapshot(Box::new(store.clone()));
    let text = LedgerEntry { v: 1, n: 9, at_ms: 9, record }.to_json().unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let old = value["record"]["snapshot"].as_object_mut().unwrap();
    for field in ["stopped", "activated_ms", "map"] {
        assert!(old.remove(field).is_some(), "{field}");
    }
    let tasks = old["tasks"].as_object_mut().unwrap().values_mut();
    tasks.for_each(|task| drop(task.as_object_mut().unwrap().remove("map").unwrap()));
    let read = TaskStore::replay(2000, [LedgerEntry::from_json(&value.to_string()).unwrap()]).unwrap();
    assert_eq!((read.stopped(), read.map(), read.tasks().count()), (None, None, store.tasks().count()));
    assert!(read.tasks().all(|task| task.map == xtb_dispatch::task::TaskMap::Unknown));
}
