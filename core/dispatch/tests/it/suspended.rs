//! After an emergency stop of all robots nothing is assigned, until somebody activates the dispatcher.

use crate::bench::{Bench, goto, name};
use crate::model::me;
use xtb_dispatch::{LedgerEntry, Record};
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchCode, DispatchOutcome, GoalStatus, OnTakeover, Suspension, SuspensionCause,
    TaskSpec, TaskState, Who,
};

fn by(client: &str) -> SuspensionCause {
    SuspensionCause::FleetStop { by: Some(name(client)) }
}

/// An emergency stop of all robots, as everybody hears it.
fn stop_all(bench: &mut Bench) {
    bench.dispatcher.fleet_stop(bench.now_ms, Some(&name("cli-7")));
    let now_ms = bench.now_ms;
    bench.robots.iter_mut().for_each(|robot| robot.latch(now_ms));
}

fn reset_all(bench: &mut Bench) {
    bench.robots.iter_mut().for_each(|robot| robot.latched = None);
}

fn causes(bench: &Bench) -> Vec<SuspensionCause> {
    bench.dispatcher.suspensions().into_iter().map(|suspension| suspension.cause).collect()
}

fn activate(bench: &mut Bench) -> Option<Suspension> {
    let ticket = bench.ask(DispatchBody::Activate {});
    bench.run_ms(50);
    match bench.answer(ticket) {
        Some(DispatchOutcome::Activated(ended)) => ended.clone(),
        other => panic!("{other:?}"),
    }
}

#[test]
fn after_a_stop_of_the_fleet_resets_set_nothing_in_motion_until_it_is_activated() {
    let mut bench = Bench::new(3);
    let running = bench.submit(goto(4.0, 0.0));
    bench.run_ms(1000);
    stop_all(&mut bench);
    bench.run_ms(1000);
    assert_eq!((bench.state(running), bench.robot_of(running)), (TaskState::Queued, None));
    reset_all(&mut bench);
    let later = bench.submit(goto(2.0, 0.0));
    let begun = bench.begun().len();
    bench.run_ms(60_000);
    assert_eq!((bench.begun().len(), causes(&bench)), (begun, vec![by("cli-7")]));
    for id in [running, later] {
        let shown = bench.dispatcher.history(id).unwrap().task;
        assert_eq!(shown.state, TaskState::Queued);
        assert!(shown.reason.unwrap().contains("emergency stop of all robots by cli-7"));
    }
    let ended = activate(&mut bench).unwrap();
    assert_eq!((ended.cause, ended.tasks), (by("cli-7"), 2));
    bench.run_ms(15_000);
    assert_eq!([running, later].map(|id| bench.state(id)), [TaskState::Done; 2]);
    assert_eq!(activate(&mut bench), None, "it was not suspended any more");
}

#[test]
fn a_robot_that_the_stop_did_not_reach_is_told_to_let_go() {
    let mut bench = Bench::new(2);
    let id = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..goto(9.0, 0.0) });
    bench.run_ms(1000);
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    bench.run_ms(500);
    assert!(bench.robots[0].running().is_none(), "it drives on for a dispatcher that is suspended");
    assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Queued, None));
    assert!(bench.asks.iter().any(|(_, body)| matches!(body, Body::Withdraw { .. })));
}

#[test]
fn a_drive_whose_task_has_left_its_robot_before_the_stop_is_not_asked_for_again() {
    let mut bench = Bench::new(1);
    bench.held_up = Some(Vec::new());
    let id = bench.submit(goto(4.0, 0.0));
    bench.run_ms(400);
    // It begins, its answer is lost, and its own link-loss policy ends it.
    let request = bench.held_up.iter().flatten().next().unwrap().clone();
    bench.robots[0].request(bench.now_ms, &me(), &request).unwrap();
    bench.run_ms(100);
    assert_eq!(bench.state(id), TaskState::Running);
    bench.robots[0].end(GoalStatus::Failed, Some("controlling client dispatch timed out"));
    let leaves = (0..20).any(|_| {
        bench.run_ms(10);
        bench.robot_of(id).is_none()
    });
    assert!(leaves);
    stop_all(&mut bench);
    let begun = bench.begun().len();
    bench.run_ms(5000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Queued, begun));
}

#[test]
fn an_assignment_that_is_on_its_way_when_the_fleet_is_stopped_is_not_asked_for_again() {
    let mut bench = Bench::new(1);
    bench.held_up = Some(Vec::new());
    let id = bench.submit(goto(4.0, 0.0));
    bench.run_ms(400);
    let begun = bench.begun().len();
    assert!(begun > 0);
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    bench.run_ms(5000);
    assert_eq!((bench.begun().len(), bench.state(id)), (begun, TaskState::Queued));
    let late = bench.held_up.take().unwrap().pop().unwrap();
    let reply = bench.robots[0].request(bench.now_ms, &me(), &late);
    assert!(reply.is_some() && bench.robots[0].running().is_none(), "a late request begins it: {reply:?}");
}

#[test]
fn the_suspension_outlives_restarts_and_snapshots() {
    let mut bench = Bench::new(2);
    let id = bench.submit(goto(2.0, 0.0));
    bench.dispatcher.fleet_stop(bench.now_ms, Some(&name("cli-7")));
    bench.run_ms(500);
    bench.restart();
    bench.run_ms(30_000);
    assert_eq!((causes(&bench), bench.begun().len()), (vec![by("cli-7")], 0));
    assert!(bench.dispatcher.compact(bench.now_ms));
    bench.effects();
    let snapshot: Vec<LedgerEntry> = bench.ledger.split_off(bench.ledger.len() - 1);
    assert!(matches!(snapshot[0].record, Record::Snapshot(_)));
    bench.ledger =
        snapshot.iter().map(|entry| LedgerEntry::from_json(&entry.to_json().unwrap()).unwrap()).collect();
    bench.restart();
    bench.run_ms(5000);
    assert_eq!(causes(&bench), [by("cli-7")]);
    assert!(activate(&mut bench).is_some());
    bench.restart();
    bench.run_ms(10_000);
    assert_eq!((causes(&bench), bench.state(id)), (vec![], TaskState::Done));
}

#[test]
fn it_holds_at_once_and_gets_into_the_ledger_when_that_can_be_written_again() {
    let mut bench = Bench::new(1);
    bench.full = true;
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    bench.run_ms(3000);
    assert_eq!(causes(&bench), [SuspensionCause::FleetStop { by: None }]);
    let refused = bench.ask(DispatchBody::Activate {});
    bench.run_ms(2000);
    assert!(
        matches!(bench.answer(refused), Some(DispatchOutcome::Error(error)) if error.code == DispatchCode::LedgerFailed)
    );
    bench.full = false;
    bench.run_ms(2000);
    bench.restart();
    assert_eq!(causes(&bench), [SuspensionCause::FleetStop { by: None }]);
}

#[test]
fn a_stop_that_is_called_while_it_is_being_activated_suspends_it_anew() {
    let mut bench = Bench::new(1);
    bench.dispatcher.fleet_stop(bench.now_ms, Some(&name("cli-7")));
    bench.run_ms(100);
    // Asked, and not written yet.
    let request = xtb_protocol::messages::DispatchRequest {
        id: xtb_protocol::Uuid::from_u128(5),
        body: DispatchBody::Activate {},
    };
    bench.dispatcher.request(bench.now_ms, 500, &name("cli-7"), &request, &xtb_dispatch::OpenTravelCost);
    bench.dispatcher.fleet_stop(bench.now_ms, Some(&name("cli-8")));
    bench.run_ms(200);
    assert!(matches!(bench.answer(500), Some(DispatchOutcome::Activated(Some(_)))));
    assert_eq!(causes(&bench), [by("cli-8")]);
}

#[test]
fn a_dispatcher_that_was_away_notices_that_all_robots_were_stopped_together() {
    for (stopped, apart_ms, suspends) in [(3, 0, true), (3, 60_000, false), (2, 0, false)] {
        let mut bench = Bench::new(3);
        let ids = [1.5, 2.5, 3.5].map(|x_m| bench.submit(goto(x_m, 3.0)));
        bench.run_ms(500);
        let now_ms = bench.now_ms;
        for (i, robot) in bench.robots.iter_mut().enumerate().take(stopped) {
            robot.latch(now_ms - apart_ms * i as u64);
        }
        bench.restart();
        bench.run_ms(5000);
        assert_eq!(causes(&bench).len(), usize::from(suspends), "{stopped} stopped, {apart_ms} ms apart");
        reset_all(&mut bench);
        bench.run_ms(20_000);
        let done = ids.iter().filter(|id| bench.state(**id) == TaskState::Done).count();
        assert_eq!(done == 0, suspends, "{done} done; {stopped} stopped, {apart_ms} ms apart");
    }
}

#[test]
fn what_was_activated_is_not_suspended_by_the_same_stop_again() {
    let mut bench = Bench::new(2);
    stop_all(&mut bench);
    bench.run_ms(4000);
    assert!(activate(&mut bench).is_some());
    bench.run_ms(10_000);
    bench.restart();
    bench.run_ms(10_000);
    assert_eq!(causes(&bench), [], "the robots are latched still, and somebody has activated it since");
    let id = bench.submit(goto(2.0, 0.0));
    reset_all(&mut bench);
    bench.run_ms(10_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_held_task_does_not_go_on_while_it_is_suspended() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { on_takeover: OnTakeover::Resume, ..goto(4.0, 0.0) });
    bench.run_ms(500);
    bench.by_person(0, Body::Acquire { take: true });
    bench.run_ms(500);
    assert_eq!(bench.state(id), TaskState::Held);
    let begun = bench.begun().len();
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    bench.by_person(0, Body::Release {});
    bench.run_ms(20_000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Held, begun));
    activate(&mut bench);
    bench.run_ms(15_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn tasks_that_are_suspended_can_be_cancelled_paused_and_miss_their_deadline() {
    let mut bench = Bench::new(1);
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    let [first, second] = [goto(2.0, 0.0), goto(3.0, 0.0)].map(|spec| bench.submit(spec));
    let late = bench.submit(TaskSpec { deadline_ms: Some(bench.now_ms + 2000), ..goto(1.0, 0.0) });
    bench.ask(DispatchBody::Cancel { tasks: vec![first] });
    bench.ask(DispatchBody::Pause { tasks: vec![second] });
    bench.run_ms(3000);
    let states = [first, second, late].map(|id| bench.state(id));
    assert_eq!(states, [TaskState::Cancelled, TaskState::Paused, TaskState::Failed]);
}

#[test]
fn a_task_that_waits_again_is_on_no_robot_whichever_had_it_last() {
    let mut bench = Bench::new(2);
    let id = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..goto(4.0, 0.0) });
    bench.run_ms(1000);
    let shown = |bench: &Bench| bench.dispatcher.list(bench.now_ms).tasks[0].clone();
    assert_eq!(shown(&bench).robot, Some(name("xtb-1")));
    let now_ms = bench.now_ms;
    bench.robots[0].latch(now_ms);
    bench.run_ms(1000);
    assert_eq!((shown(&bench).state, shown(&bench).robot), (TaskState::Queued, None));
    bench.ask(DispatchBody::Cancel { tasks: vec![id] });
    bench.run_ms(200);
    assert_eq!((shown(&bench).state, shown(&bench).robot), (TaskState::Cancelled, None), "it ended on none");
    let list = bench.dispatcher.list(bench.now_ms);
    assert_eq!(list.of_robot(&name("xtb-1")), None);
}

#[test]
fn an_older_program_refuses_a_ledger_with_these_records() {
    let mut bench = Bench::new(1);
    bench.dispatcher.fleet_stop(bench.now_ms, None);
    bench.run_ms(100);
    assert!(
        bench.ledger.iter().all(|entry| entry.v == 2),
        "version 1 knows no suspension: {:?}",
        bench.ledger
    );
}
