//! Seeds of bad weather, crashes at every write, and the proof that breaches are noticed.

use crate::model::{Off, Weather, World};
use xtb_dispatch::task_store::record::{LedgerEntry, Record};
use xtb_dispatch::transition::{TaskEnding, TaskUpdate};

fn first_breach(weather: Weather, seeds: std::ops::Range<u64>) -> Option<(u64, String)> {
    seeds.into_iter().find_map(|seed| Some((seed, World::new(seed, weather).run().err()?)))
}

#[test]
fn a_thousand_storms_lose_and_double_nothing() {
    assert_eq!(first_breach(Weather::STORM, 0..700), None);
    assert_eq!(first_breach(Weather { slow_ms: 6000, loss: 0.2, ..Weather::STORM }, 700..1000), None);
}

/// A storm in which nothing happens proves nothing.
#[test]
fn storms_bring_about_every_change() {
    let mut observed = std::collections::BTreeSet::new();
    for seed in 0..60 {
        let mut world = World::new(seed, Weather::STORM);
        world.run().unwrap();
        observed.extend(world.ledger.iter().map(kind));
    }
    let all = [
        "activated",
        "adopted",
        "assigned",
        "blocked",
        "cancelling",
        "done",
        "ended: cancelled",
        "failed",
        "held",
        "let go",
        "map",
        "opened",
        "paused",
        "queued",
        "queued after a failure",
        "reached",
        "running",
        "submitted",
        "suspended",
    ];
    assert_eq!(observed.into_iter().collect::<Vec<_>>(), all);
}

fn kind(entry: &LedgerEntry) -> &'static str {
    let change = match &entry.record {
        Record::Opened { .. } => return "opened",
        Record::Submitted { .. } => return "submitted",
        Record::Assigned { .. } => return "assigned",
        Record::Reached { .. } => return "reached",
        Record::Extended { .. } => return "extended",
        Record::Suspended { .. } => return "suspended",
        Record::Activated { .. } => return "activated",
        Record::Map { .. } => return "map",
        Record::Adopted { .. } => return "adopted",
        Record::Term { .. } => return "term",
        Record::Pair { .. } => return "pair",
        Record::Snapshot(_) => return "snapshot",
        Record::Became { change, .. } => change,
    };
    match change {
        TaskUpdate::Running => "running",
        TaskUpdate::Blocked => "blocked",
        TaskUpdate::Held { .. } => "held",
        TaskUpdate::Queued { failed: false, .. } => "queued",
        TaskUpdate::Queued { failed: true, .. } => "queued after a failure",
        TaskUpdate::Paused => "paused",
        TaskUpdate::LetGo => "let go",
        TaskUpdate::Cancelling { .. } => "cancelling",
        TaskUpdate::Ended { ending: TaskEnding::Done } => "done",
        TaskUpdate::Ended { ending: TaskEnding::Failed } => "failed",
        TaskUpdate::Ended { ending: TaskEnding::Cancelled } => "ended: cancelled",
    }
}

#[test]
fn a_crash_at_every_write_before_and_after_it_is_durable() {
    for seed in 0..3 {
        let mut calm = World::new(seed, Weather::CALM);
        calm.run().unwrap();
        for write in 1..=calm.writes {
            for durable in [false, true] {
                let weather = Weather { crash_at: Some((write, durable)), ..Weather::CALM };
                let mut world = World::new(seed, weather);
                let ran = world.run();
                assert_eq!((ran, world.crashes), (Ok(()), 1), "seed {seed} write {write} durable {durable}");
            }
        }
    }
}

#[test]
fn a_full_disk_at_every_write() {
    for seed in 0..3 {
        let mut calm = World::new(seed, Weather::CALM);
        calm.run().unwrap();
        for write in 1..=calm.writes {
            let mut world = World::new(seed, Weather { full_at: Some(write), ..Weather::CALM });
            assert_eq!(world.run(), Ok(()), "seed {seed} write {write}");
        }
    }
}

#[test]
fn a_dispatcher_that_answers_before_the_ledger_is_caught() {
    let weather = Weather { off: Off::Durability, ..Weather::STORM };
    assert!(first_breach(weather, 0..50).is_some());
}

#[test]
fn robots_that_take_assignments_in_any_order_are_caught() {
    let weather = Weather { off: Off::Fence, loss: 0.3, slow_ms: 6000, ..Weather::STORM };
    assert!(first_breach(weather, 0..300).is_some());
}

#[test]
fn a_task_that_is_given_away_too_early_is_caught() {
    let weather = Weather { off: Off::Grace, ..Weather::STORM };
    assert!(first_breach(weather, 0..300).is_some());
}

#[test]
fn clients_that_ask_again_with_a_new_id_are_caught() {
    let weather = Weather { off: Off::SameId, ..Weather::STORM };
    assert!(first_breach(weather, 0..50).is_some());
}
