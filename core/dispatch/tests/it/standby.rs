//! Two dispatchers with one ledger: the rules of a pair one by one, and in seeded storms of kills, splits and delays.

mod pair;

use crate::model::{Weather, World};
use pair::{Counts, Pair};
use std::collections::BTreeSet;
use xtb_dispatch::replication::{
    Active, Follow, Follower, Observed, StandbyDecision, Times, first_seq, term_of,
};
use xtb_dispatch::{LedgerEntry, Record, ReplayError, TaskStore};
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_ASSIGN_SEQ, MAX_TERM, Witnesses};

const TIMES: Times = Times {
    answer_ms: 200,
    silent_ms: 1_500,
    take_over_ms: 4_000,
    alone_ms: 5_000,
    doubt_ms: 500,
    step_ms: 100,
    heard_ms: 1_000,
    caught_up: 64,
};

fn robots(count: usize) -> BTreeSet<Name> {
    (1..=count).map(|number| Name::new(&format!("xtb-{number}")).unwrap()).collect()
}

fn entry(n: u64, record: Record) -> LedgerEntry {
    LedgerEntry { v: record.version(), n, at_ms: 5, record }
}

#[test]
fn the_times_of_a_pair_are_those_of_the_tests() {
    assert_eq!(Times::default(), TIMES);
}

#[test]
fn a_term_stands_above_the_assignments_in_their_numbers() {
    assert_eq!((term_of(1), term_of(first_seq(1) - 1), term_of(first_seq(1))), (0, 0, 1));
    assert_eq!((term_of(MAX_ASSIGN_SEQ), first_seq(MAX_TERM) <= MAX_ASSIGN_SEQ), (MAX_TERM, true));
}

#[test]
fn a_take_over_raises_the_numbers_of_assignments_and_ends_the_pair() {
    let mut world = World::new(3, Weather::CALM);
    world.run().unwrap();
    let mut store = world.dispatcher.as_ref().unwrap().store().clone();
    let n = store.next_n();
    store.apply(&entry(n, Record::Pair { copy: Some(9) })).unwrap();
    assert_eq!((store.term(), store.pair()), (0, Some(9)));
    store.apply(&entry(n + 1, Record::Term { term: 1 })).unwrap();
    assert_eq!((store.term(), store.pair(), store.next_seq()), (1, None, first_seq(1)));
    for term in [0, 1, MAX_TERM + 1] {
        let refused = store.apply(&entry(n + 2, Record::Term { term })).unwrap_err();
        assert!(matches!(refused, ReplayError::Impossible { .. }), "{term}: {refused}");
    }
    let snapshot = entry(n + 2, Record::Snapshot(Box::new(store.clone())));
    let read =
        TaskStore::replay(2000, [LedgerEntry::from_json(&snapshot.to_json().unwrap()).unwrap()]).unwrap();
    assert_eq!((read.term(), read.next_n()), (1, n + 3));
}

#[test]
fn entries_without_a_stand_by_remain_readable_for_a_program_that_knows_none() {
    let entry = entry(1, Record::Opened { ledger: 7 });
    assert_eq!(
        (entry.v, Record::Term { term: 1 }.version(), Record::Pair { copy: None }.version()),
        (2, 3, 3)
    );
}

/// Runs an active from `from_ms` for `for_ms`, in steps of 50 ms.
fn run(active: &mut Active, from_ms: u64, for_ms: u64, visible: &BTreeSet<Name>) {
    for now_ms in (from_ms..=from_ms + for_ms).step_by(50) {
        active.step(now_ms, visible);
    }
}

/// One that is paired with copy 9, which has record 10 and the witnesses.
fn paired(visible: &BTreeSet<Name>) -> Active {
    let mut active = Active::new(TIMES, 0, 10, 0, None);
    for version in [0, 1] {
        active.follows(0, Follow { copy: 9, last: 10, witnesses: version });
        assert!(!active.view(0).unwrap().paired || version == 1, "not before both know the witnesses");
        active.step(0, visible);
    }
    assert_eq!((active.paired(), active.acknowledged()), (Some(9), 10));
    active
}

#[test]
fn nothing_is_acknowledged_before_both_have_it() {
    let mut active = paired(&robots(3));
    active.wrote(12);
    assert_eq!(active.acknowledged(), 10);
    active.follows(50, Follow { copy: 8, last: 12, witnesses: 1 });
    assert_eq!(active.acknowledged(), 10, "another copy does not count");
    active.follows(50, Follow { copy: 9, last: 11, witnesses: 1 });
    assert_eq!(active.acknowledged(), 11);
}

#[test]
fn a_stand_by_that_lacks_what_was_acknowledged_alone_is_not_told_that_it_is_paired() {
    let mut active = Active::new(TIMES, 0, 40, 0, None);
    let is_paired = |active: &Active| active.view(0).is_some_and(|view| view.paired);
    active.follows(0, Follow { copy: 9, last: 10, witnesses: 0 });
    active.step(0, &robots(1));
    active.follows(0, Follow { copy: 9, last: 10, witnesses: 1 });
    active.wrote(41);
    assert_eq!((active.paired(), active.acknowledged(), is_paired(&active)), (Some(9), 10, false));
    active.follows(0, Follow { copy: 9, last: 40, witnesses: 1 });
    assert_eq!((active.acknowledged(), is_paired(&active)), (40, true));
}

#[test]
fn without_its_stand_by_a_dispatcher_goes_on_alone_only_where_most_robots_are() {
    for (seen, alone) in [(2, true), (1, false)] {
        let mut active = paired(&robots(3));
        active.wrote(12);
        run(&mut active, 50, 4_900, &robots(seen));
        assert_eq!((active.paired(), active.held()), (Some(9), None), "not yet");
        run(&mut active, 5_000, 200, &robots(seen));
        assert_eq!(active.paired().is_none(), alone, "{seen} of 3");
        assert_eq!((active.held().is_none(), active.acknowledged()), (alone, if alone { 12 } else { 10 }));
    }
}

#[test]
fn a_dispatcher_whose_stand_by_may_have_taken_over_waits_for_it_whoever_is_visible_later() {
    let mut active = paired(&robots(3));
    run(&mut active, 50, 2_000, &robots(3));
    run(&mut active, 2_100, 100, &robots(1));
    run(&mut active, 2_250, 4_000, &robots(3));
    assert!(active.paired() == Some(9) && active.held().is_some());
    active.follows(6_300, Follow { copy: 9, last: 10, witnesses: 1 });
    active.step(6_350, &robots(1));
    assert_eq!((active.paired(), active.held()), (Some(9), None), "its stand-by is back");
}

#[test]
fn a_dispatcher_that_was_held_up_listens_before_it_goes_on_alone() {
    let mut active = paired(&robots(3));
    active.step(60_000, &robots(3));
    run(&mut active, 60_050, 4_500, &robots(3));
    assert_eq!(active.paired(), Some(9));
    active.saw_term(1);
    assert_eq!(active.superseded(), Some(1));
}

#[test]
fn a_stand_by_that_ended_before_it_had_read_an_answer_is_not_waited_for() {
    let mut active = Active::new(TIMES, 0, 10, 0, None);
    active.follows(0, Follow { copy: 9, last: 10, witnesses: 0 });
    active.wrote(12);
    run(&mut active, 50, 6_000, &robots(3));
    assert_eq!((active.paired(), active.held(), active.acknowledged()), (None, None, 12));
    // It never wrote its number to its disk: it comes back with another one.
    active.follows(6_100, Follow { copy: 8, last: 12, witnesses: 0 });
    let witnesses = active.witnesses_for(0).unwrap();
    active.follows(6_200, Follow { copy: 8, last: 12, witnesses: witnesses.version });
    assert_eq!((active.paired(), active.view(6_200).map(|view| view.paired)), (Some(8), Some(true)));
}

#[test]
fn witnesses_that_a_stand_by_has_of_an_earlier_run_are_not_taken_for_those_of_this_one() {
    let first = paired(&robots(3)).witnesses_for(0).unwrap().version;
    let mut restarted = Active::new(TIMES, 60_000, 10, 0, Some(9));
    for now_ms in [60_000, 60_050] {
        restarted.follows(now_ms, Follow { copy: 9, last: 10, witnesses: first });
        restarted.step(now_ms, &BTreeSet::new());
    }
    assert_eq!(restarted.view(60_050).map(|view| view.paired), Some(false));
    run(&mut restarted, 60_100, 6_000, &robots(3));
    assert!(restarted.held().is_some(), "it may have taken over from the earlier run");
}

#[test]
fn a_stand_by_that_leaves_is_not_waited_for() {
    let mut active = paired(&robots(3));
    active.wrote(12);
    active.left(8);
    assert_eq!(active.acknowledged(), 10);
    active.left(9);
    assert_eq!((active.paired(), active.acknowledged()), (None, 12));
}

#[test]
fn a_stand_by_takes_over_only_from_the_silent_and_only_in_time() {
    let witnesses = || Some(Witnesses { version: 2, robots: robots(3).into_iter().collect() });
    let decide = |paired: bool, seen: &Observed, at_ms: u64| {
        let mut follower = Follower::new(TIMES, 0);
        follower.answered(0, 1, paired, witnesses());
        let mut decision = StandbyDecision::CatchingUp;
        for now_ms in (50..=at_ms).step_by(50) {
            decision = follower.step(now_ms, seen);
        }
        decision
    };
    let seen = Observed { present: false, robots: robots(2), hears: None };
    assert_eq!(decide(true, &seen, 1_450), StandbyDecision::Paired);
    assert_eq!(decide(true, &seen, 1_500), StandbyDecision::TakeOver);
    assert_eq!(decide(true, &seen, 4_000), StandbyDecision::TakeOver);
    assert_eq!(decide(true, &seen, 4_050), StandbyDecision::Stale, "the other may have gone on alone");
    assert_eq!(decide(false, &seen, 1_450), StandbyDecision::CatchingUp);
    assert_eq!(decide(false, &seen, 1_500), StandbyDecision::Stale);
    let hears = Name::new("xtb-1").ok();
    for seen in [
        Observed { present: true, ..seen.clone() },
        Observed { robots: robots(1), ..seen.clone() },
        Observed { hears, ..seen },
    ] {
        assert!(matches!(decide(true, &seen, 1_500), StandbyDecision::Waits(_)), "{seen:?}");
    }
}

#[test]
fn witnesses_of_an_earlier_run_do_not_count() {
    let mut follower = Follower::new(TIMES, 0);
    follower.answered(0, 1, true, Some(Witnesses { version: 2, robots: robots(1).into_iter().collect() }));
    follower.answered(10, 2, true, None);
    assert_eq!((follower.knows(), follower.step(50, &Observed::default())), (0, StandbyDecision::CatchingUp));
}

fn first_breach(times: Times, seeds: std::ops::Range<u64>) -> (Option<(u64, String)>, Counts) {
    let mut counts = Counts::default();
    let breach = seeds.into_iter().find_map(|seed| {
        let mut pair = Pair::new(seed, times);
        let ran = pair.run();
        counts.add(&pair.counts);
        Some((seed, ran.err()?))
    });
    (breach, counts)
}

#[test]
fn kills_splits_and_delays_lose_no_acknowledged_task_and_give_no_term_to_two() {
    let (breach, counts) = first_breach(TIMES, 0..300);
    assert_eq!(breach, None);
    // Storms in which nothing happens prove nothing.
    let Counts { acknowledged, taken_over, alone, held, begun_anew, left_alone } = counts;
    assert!(left_alone < 10, "{counts:?}");
    assert!(
        acknowledged > 1_000 && taken_over > 30 && alone > 30 && held > 0 && begun_anew > 0,
        "{counts:?}"
    );
}

#[test]
fn a_dispatcher_that_goes_on_alone_too_early_is_caught() {
    let (breach, counts) = first_breach(Times { alone_ms: 800, ..TIMES }, 0..300);
    assert!(breach.is_some(), "{counts:?}");
}
