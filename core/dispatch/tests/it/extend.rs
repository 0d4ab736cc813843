//! More points for a route that has not ended.

use crate::bench::{Bench, goto, name, point};
use crate::model::{Weather, World};
use xtb_dispatch::{LedgerEntry, OpenTravelCost, TaskStore, TravelCost};
use xtb_nav::{Car, MapPose};
use xtb_protocol::messages::{
    DispatchBody, DispatchCode, DispatchOutcome, MAX_POINTS, TaskId, TaskKind, TaskSpec, TaskState, Waypoint,
    Who,
};

fn route(points: &[(f64, f64)]) -> TaskSpec {
    let points = points.iter().map(|(x_m, y_m)| point(*x_m, *y_m)).collect();
    let who = Who::Robot(name("xtb-1"));
    TaskSpec { who, ..TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 }) }
}

fn extend(bench: &mut Bench, task: TaskId, after: u32, points: &[(f64, f64)]) -> u64 {
    let points = points.iter().map(|(x_m, y_m)| point(*x_m, *y_m)).collect();
    bench.ask(DispatchBody::Extend { task, after, points })
}

/// `None` = taken.
fn refusal(bench: &Bench, ticket: u64) -> Option<DispatchCode> {
    bench.change(ticket).expect("an answer").error.map(|error| error.code)
}

fn run_until_done(bench: &mut Bench, task: TaskId) {
    let until_ms = bench.now_ms + 60_000;
    while bench.state(task) != TaskState::Done && bench.now_ms < until_ms {
        bench.run_ms(50);
    }
    assert_eq!(bench.state(task), TaskState::Done);
}

#[test]
fn a_route_that_is_extended_while_it_is_driven_goes_on_at_its_former_last_point_as_at_any_other() {
    let mut bench = Bench::new(1);
    let task = bench.submit(route(&[(1.5, 0.0), (2.0, 0.0)]));
    bench.run_ms(1000);
    let ticket = extend(&mut bench, task, 2, &[(2.5, 0.0), (3.0, 0.0)]);
    bench.run_ms(20);
    assert_eq!(refusal(&bench, ticket), None);
    run_until_done(&mut bench, task);
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2), (1, 3)], "one assignment, each drive once");
    let history = bench.dispatcher.history(task).unwrap();
    let reached = |leg| history.steps.iter().find(|step| step.legs_done == leg).unwrap().at_ms;
    let gaps: Vec<u64> =
        (1..=4).map(|leg| reached(leg) - if leg == 1 { 0 } else { reached(leg - 1) }).collect();
    assert_eq!(
        gaps[1], gaps[2],
        "the drive after the former last point begins as soon as any other: {gaps:?}"
    );
    let words = "2 points added by cli-7, 4 altogether";
    assert!(history.steps.iter().any(|step| step.reason.as_deref() == Some(words)), "{history:?}");
}

#[test]
fn a_robot_that_can_pass_points_knows_the_next_leg_while_one_is_under_way() {
    let mut bench = Bench::new(1);
    bench.passes(0);
    let task = bench.submit(route(&[(1.5, 0.0), (2.0, 0.0), (2.5, 0.0)]));
    bench.run_ms(500);
    assert_eq!(bench.dispatcher.store().task(task).unwrap().legs_done, 0);
    assert_eq!(bench.begun(), [(1, 0), (1, 1)], "the next one, and no more");
    let ticket = extend(&mut bench, task, 3, &[(3.0, 0.0)]);
    run_until_done(&mut bench, task);
    assert_eq!(refusal(&bench, ticket), None);
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2), (1, 3)], "one assignment, each drive asked for once");
    assert_eq!(bench.robots[0].finished.len(), 4);
}

#[test]
fn a_leg_is_only_known_ahead_where_the_robot_does_not_stand_before_it() {
    let points = || vec![point(1.5, 0.0), point(2.0, 0.0)];
    for kind in [
        TaskKind::Route { points: points(), loops: 1, dwell_s: 0.5 },
        TaskKind::Patrol { points: points(), dwell_s: 0.0, for_s: Some(60.0) },
    ] {
        let mut bench = Bench::new(1);
        bench.passes(0);
        bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..TaskSpec::new(kind) });
        bench.run_ms(500);
        assert_eq!(bench.begun(), [(1, 0)]);
    }
}

#[test]
fn a_task_that_is_paused_while_the_next_leg_is_known_begins_none_of_it() {
    let mut bench = Bench::new(1);
    bench.passes(0);
    let task = bench.submit(route(&[(1.5, 0.0), (2.0, 0.0)]));
    bench.run_ms(500);
    bench.ask(DispatchBody::Pause { tasks: vec![task] });
    bench.run_ms(5000);
    assert_eq!(bench.robots[0].finished, []);
    bench.ask(DispatchBody::Resume { tasks: vec![task] });
    run_until_done(&mut bench, task);
    assert_eq!(bench.robots[0].finished.len(), 2);
}

#[test]
fn a_route_that_waits_is_extended_too() {
    let mut bench = Bench::new(1);
    bench.robots[0].up = false;
    bench.run_ms(5000);
    let task = bench.submit(route(&[(1.5, 0.0)]));
    let ticket = extend(&mut bench, task, 1, &[(2.0, 0.0)]);
    bench.run_ms(20);
    assert_eq!((refusal(&bench, ticket), bench.state(task)), (None, TaskState::Queued));
    bench.robots[0].up = true;
    run_until_done(&mut bench, task);
    assert_eq!(bench.robots[0].at, (2.0, 0.0));
}

#[test]
fn the_same_extension_again_changes_nothing_and_one_after_other_points_is_stale() {
    let mut bench = Bench::new(1);
    let task = bench.submit(route(&[(1.5, 0.0)]));
    for _ in 0..2 {
        let ticket = extend(&mut bench, task, 1, &[(2.0, 0.0), (2.5, 0.0)]);
        bench.run_ms(20);
        assert_eq!(refusal(&bench, ticket), None);
    }
    let entries = bench.ledger.len();
    let stored = bench.dispatcher.store().task(task).unwrap().spec.kind.points().len();
    for (after, points) in [(1, vec![(9.0, 0.0)]), (2, vec![(9.0, 0.0)]), (4, vec![(9.0, 0.0)])] {
        let ticket = extend(&mut bench, task, after, &points);
        bench.run_ms(20);
        assert_eq!(refusal(&bench, ticket), Some(DispatchCode::Stale), "after {after}");
    }
    let many: Vec<(f64, f64)> = vec![(2.0, 0.0); MAX_POINTS - 2];
    let ticket = extend(&mut bench, task, 3, &many);
    bench.run_ms(20);
    assert_eq!(refusal(&bench, ticket), Some(DispatchCode::Stale), "more than a route may have");
    run_until_done(&mut bench, task);
    assert_eq!((stored, bench.begun().len()), (3, 3));
    let ticket = extend(&mut bench, task, 1, &[(2.0, 0.0), (2.5, 0.0)]);
    bench.run_ms(20);
    assert_eq!(refusal(&bench, ticket), None, "what was taken once stays taken, also when all is done");
    assert!(bench.ledger.len() > entries && bench.begun().len() == 3);
}

#[test]
fn what_has_ended_or_is_no_route_that_is_driven_once_is_not_extended() {
    let mut bench = Bench::new(1);
    let done = bench.submit(route(&[(1.1, 0.0)]));
    run_until_done(&mut bench, done);
    let single = bench.submit(goto(1.5, 0.0));
    let TaskKind::Route { points, .. } = route(&[(1.5, 0.0)]).kind else { unreachable!() };
    let round = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 2, dwell_s: 0.0 }));
    for task in [done, single, round] {
        let ticket = extend(&mut bench, task, 1, &[(3.0, 0.0)]);
        bench.run_ms(20);
        assert_eq!(refusal(&bench, ticket), Some(DispatchCode::WrongState), "{task}");
    }
    let ticket = extend(&mut bench, TaskId::new(99), 1, &[(3.0, 0.0)]);
    bench.run_ms(20);
    assert_eq!(refusal(&bench, ticket), Some(DispatchCode::UnknownTask));
}

/// A wall beyond x = 5 m.
#[derive(Debug)]
struct Wall;

impl TravelCost for Wall {
    fn distance_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        OpenTravelCost.distance_m(car, from, to)
    }

    fn estimate_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        OpenTravelCost.estimate_m(car, from, to)
    }

    fn admits(&self, _: &Car, point: &Waypoint) -> Result<(), (DispatchCode, String)> {
        if point.x_m > 5.0 { Err((DispatchCode::GoalBlocked, "a wall".to_owned())) } else { Ok(()) }
    }
}

#[test]
fn an_extension_into_a_wall_is_refused_and_the_route_goes_on_as_it_was() {
    let mut bench = Bench::new(1);
    bench.travel_cost = Box::new(Wall);
    let task = bench.submit(route(&[(1.5, 0.0)]));
    let ticket = extend(&mut bench, task, 1, &[(2.0, 0.0), (6.0, 0.0)]);
    bench.run_ms(20);
    let Some(DispatchOutcome::Error(error)) = bench.answer(ticket) else { panic!("taken") };
    assert_eq!(error.code, DispatchCode::GoalBlocked);
    run_until_done(&mut bench, task);
    assert_eq!(bench.begun().len(), 1);
}

#[test]
fn an_extension_is_answered_when_it_is_in_the_ledger_and_a_killed_dispatcher_drives_all_of_it_once() {
    for durable in [false, true] {
        let mut bench = Bench::new(1);
        let task = bench.submit(route(&[(1.5, 0.0), (2.0, 0.0)]));
        bench.run_ms(500);
        bench.full = !durable;
        let ticket = extend(&mut bench, task, 2, &[(2.5, 0.0)]);
        bench.run_ms(20);
        assert_eq!(bench.change(ticket).is_some_and(|change| change.error.is_none()), durable);
        bench.full = false;
        bench.restart();
        let points = bench.dispatcher.store().task(task).unwrap().spec.kind.points().len();
        assert_eq!(points, if durable { 3 } else { 2 });
        // Whoever was not answered asks again.
        let ticket = extend(&mut bench, task, 2, &[(2.5, 0.0)]);
        bench.run_ms(100);
        assert_eq!(refusal(&bench, ticket), None);
        run_until_done(&mut bench, task);
        let mut legs: Vec<u32> = bench.begun().into_iter().map(|(_, leg)| leg).collect();
        legs.dedup();
        assert_eq!(legs, [0, 1, 2], "{durable}");
    }
}

#[test]
fn an_extension_that_arrives_while_the_last_drive_is_being_written_as_done_comes_too_late() {
    let mut bench = Bench::new(1);
    let task = bench.submit(route(&[(1.2, 0.0)]));
    while bench.begun().is_empty() {
        bench.run_ms(10);
    }
    bench.full = true;
    bench.run_ms(5000);
    assert_eq!(bench.robots[0].at, (1.2, 0.0), "it is there, and the ledger does not know");
    assert_eq!(bench.dispatcher.store().task(task).unwrap().legs_done, 0);
    bench.full = false;
    // Either is possible, both at once are not: the point is added before the route ends, or refused.
    let refused = loop {
        let ticket = extend(&mut bench, task, 1, &[(1.4, 0.0)]);
        bench.run_ms(50);
        match refusal(&bench, ticket) {
            Some(DispatchCode::LedgerFailed) => {} // it is tried again each second
            answer => break answer,
        }
    };
    run_until_done(&mut bench, task);
    let legs = bench.dispatcher.store().task(task).unwrap().legs_done;
    assert!(matches!((refused, legs), (Some(DispatchCode::WrongState), 1) | (None, 2)), "{refused:?} {legs}");
}

/// The layout of what stands on disks; this test is never edited to pass.
#[test]
fn the_entry_that_version_4_added() {
    let text = concat!(
        r#"{"v":4,"n":2,"at_ms":6,"record":{"extended":{"task":"t1","after":1,"points":"#,
        r#"[{"x_m":1.5,"y_m":2.0,"yaw_rad":null}],"by":"cli-7"}}}"#
    );
    let entry = LedgerEntry::from_json(text).unwrap();
    assert_eq!((entry.to_json().unwrap().as_str(), entry.record.version()), (text, 4));
}

#[test]
fn a_ledger_with_an_extension_of_other_points_is_damaged() {
    let mut bench = Bench::new(1);
    let task = bench.submit(route(&[(1.5, 0.0)]));
    extend(&mut bench, task, 1, &[(2.0, 0.0)]);
    bench.run_ms(20);
    let place = bench.ledger.iter().position(|entry| entry.v == 4).unwrap();
    let mut twice = bench.ledger[..=place].to_vec();
    let again = LedgerEntry { n: twice[place].n + 1, ..twice[place].clone() };
    assert!(TaskStore::replay(9, twice.clone()).is_ok());
    twice.push(again);
    assert!(TaskStore::replay(9, twice).unwrap_err().to_string().contains("cannot have more points after 1"));
}

/// Storms in which people extend routes, too: the model's checks at each step, crashes at any write.
#[test]
fn storms_with_extensions_lose_and_double_nothing() {
    let mut extended = 0;
    for seed in 7000..7060 {
        let mut world = World::new(seed, Weather { extensions: true, ..Weather::STORM });
        world.run().unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        extended += world.ledger.iter().filter(|entry| entry.v == 4).count();
    }
    assert!(extended > 60, "{extended} extensions");
}
