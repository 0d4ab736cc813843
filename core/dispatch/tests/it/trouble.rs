//! What becomes of a task when something is in its way: robots, people, the disk.

use crate::bench::{Bench, goto, name, point};
use crate::model::me;
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchCode, GoalStatus, OnTakeover, TaskId, TaskKind, TaskSpec, TaskState,
    TaskStep, Who,
};

#[test]
fn a_task_is_blocked_while_something_stands_in_its_robots_way_and_then_goes_on() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(4.0, 0.0));
    bench.run_ms(500);
    let until_ms = bench.now_ms + 5000;
    bench.robots[0].obstruct(bench.now_ms, until_ms);
    bench.run_ms(1800);
    assert_eq!(bench.state(id), TaskState::Running, "a moment is not worth telling");
    bench.run_ms(500);
    assert_eq!(bench.state(id), TaskState::Blocked);
    assert!(bench.reason(id).contains("obstacle in front"), "{}", bench.reason(id));
    bench.restart();
    bench.run_ms(500);
    assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Blocked, Some(0)));
    bench.run_ms(until_ms + 2200 - bench.now_ms);
    assert_eq!((bench.state(id), bench.reason(id).as_str()), (TaskState::Running, ""));
    bench.run_ms(5000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Done, 1));
}

#[test]
fn what_is_in_the_way_on_and_off_for_a_minute_is_a_minute_and_fills_no_ledger() {
    let mut bench = Bench::new(2);
    bench.robots[1].at = (30.0, 0.0);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(500);
    assert_eq!(bench.robot_of(id), Some(0));
    let (began_ms, before) = (bench.now_ms, bench.ledger.len());
    while bench.robot_of(id) == Some(0) && bench.now_ms < began_ms + 90_000 {
        let until_ms = bench.now_ms + 6000;
        bench.robots[0].obstruct(bench.now_ms, until_ms);
        bench.robots[0].goal.as_mut().unwrap().ends_ms += 2000;
        bench.run_ms(8000);
    }
    assert!((55_000..75_000).contains(&(bench.now_ms - began_ms)), "{} ms", bench.now_ms - began_ms);
    assert!(bench.ledger.len() < before + 8, "{} records", bench.ledger.len() - before);
}

#[test]
fn a_task_that_stays_blocked_goes_to_another_robot_if_another_may_do_it() {
    for (who, other) in [(Who::Any, true), (Who::Robot(name("xtb-1")), false)] {
        let mut bench = Bench::new(2);
        let id = bench.submit(TaskSpec { who, ..goto(1.2, 3.0) });
        bench.run_ms(1000);
        assert_eq!(bench.robot_of(id), Some(0));
        bench.robots[0].obstruct(bench.now_ms, bench.now_ms + 120_000);
        bench.run_ms(60_000);
        assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Blocked, Some(0)));
        bench.run_ms(3_000);
        assert_eq!(bench.robot_of(id), Some(usize::from(other)));
        assert_eq!(bench.robots[0].running().is_none(), other, "two robots drive for one task");
        bench.run_ms(10_000);
        let done = bench.state(id) == TaskState::Done;
        assert_eq!((done, bench.dispatcher.store().task(id).unwrap().failures), (other, 0));
    }
}

#[test]
fn a_blocked_task_can_be_cancelled() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(500);
    bench.robots[0].obstruct(bench.now_ms, bench.now_ms + 60_000);
    bench.run_ms(3000);
    assert_eq!(bench.state(id), TaskState::Blocked);
    let ticket = bench.ask(DispatchBody::Cancel { tasks: vec![id] });
    bench.run_ms(500);
    assert_eq!(bench.change(ticket).unwrap().state, Some(TaskState::Cancelled));
    assert!(bench.robots[0].running().is_none());
}

#[test]
fn a_full_disk_refuses_with_its_reason_and_what_runs_goes_on() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(500);
    bench.full = true;
    let error = bench.refused(vec![goto(3.0, 0.0)]);
    assert_eq!(error.code, DispatchCode::LedgerFailed);
    assert!(error.message.contains("the disk is full"), "{}", error.message);
    bench.run_ms(5000);
    assert_eq!(bench.robots[0].finished.len(), 1, "the robot has arrived meanwhile");
    assert_ne!(bench.state(id), TaskState::Done);
    assert!(bench.dispatcher.list(bench.now_ms).ledger_failed.is_some());
    bench.full = false;
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Done);
    assert_eq!(bench.submit(goto(3.0, 0.0)), TaskId::new(2));
    assert!(bench.dispatcher.list(bench.now_ms).ledger_failed.is_none());
}

#[test]
fn a_restarted_dispatcher_goes_on_at_the_leg_that_runs() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.5, 0.0), point(3.5, 0.0), point(1.0, 0.0)];
    let mut spec = TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 });
    spec.on_link_loss = xtb_protocol::messages::LinkLoss::Finish;
    let id = bench.submit(spec);
    bench.run_ms(2500);
    assert_eq!(bench.begun(), [(1, 0), (1, 1)]);
    bench.restart();
    bench.run_ms(1000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Running, 2), "nothing is asked for twice");
    bench.run_ms(12_000);
    assert_eq!(bench.state(id), TaskState::Done);
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2)]);
    assert_eq!(bench.robots[0].finished.len(), 3);
}

#[test]
fn a_leg_that_was_reached_while_nobody_watched_is_not_driven_again() {
    let mut bench = Bench::new(1);
    let spec = TaskSpec { on_link_loss: xtb_protocol::messages::LinkLoss::Finish, ..goto(2.0, 0.0) };
    let id = bench.submit(spec);
    bench.run_ms(500);
    for _ in 0..500 {
        bench.now_ms += 10;
        bench.robots[0].turn(bench.now_ms);
    }
    assert_eq!(bench.robots[0].finished.len(), 1);
    bench.restart();
    bench.run_ms(500);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Done, 1));
}

#[test]
fn a_robot_that_does_not_confirm_is_named_and_the_task_ends_later() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { grace_s: 8.0, ..goto(9.0, 0.0) });
    bench.run_ms(1000);
    bench.cut[0] = true;
    let ticket = bench.ask(DispatchBody::CancelAll {});
    bench.run_ms(5500);
    let change = bench.change(ticket).unwrap();
    assert_eq!((change.id, change.state), (id, Some(TaskState::Cancelling)));
    let error = change.error.unwrap();
    assert!(error.code == DispatchCode::Unconfirmed && error.message.contains("xtb-1"), "{error:?}");
    bench.run_ms(6000);
    assert_eq!(bench.state(id), TaskState::Cancelled);
    assert!(bench.reason(id).contains("ended by its link-loss policy"), "{}", bench.reason(id));
}

#[test]
fn a_goal_that_fails_is_tried_again_and_then_failed_with_the_robots_reason() {
    let mut bench = Bench::new(1);
    bench.robots[0].doomed.push((2.0, 0.0));
    let id = bench.submit(TaskSpec { retries: 1, ..goto(2.0, 0.0) });
    bench.run_ms(15_000);
    assert_eq!(bench.state(id), TaskState::Failed);
    assert_eq!(bench.reason(id), "xtb-1: blocked near (1.0, 1.0)");
    assert_eq!(bench.begun(), [(1, 0), (2, 0)]);
    bench.robots[0].doomed.clear();
    bench.ask(DispatchBody::Retry { tasks: vec![id] });
    bench.run_ms(10_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_robot_that_leaves_gives_its_task_back_after_the_grace_and_not_before() {
    let mut bench = Bench::new(2);
    let id = bench.submit(TaskSpec { grace_s: 15.0, ..goto(1.0, 4.0) });
    bench.run_ms(1000);
    let first = bench.robot_of(id).unwrap();
    bench.cut[first] = true;
    bench.run_ms(14_500);
    assert_eq!(bench.robot_of(id), Some(first));
    bench.run_ms(1500);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    assert!(bench.robots[first].running().is_none(), "it has stopped by itself");
    bench.run_ms(12_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_latched_robot_gives_its_task_to_another_at_once() {
    let mut bench = Bench::new(2);
    let id = bench.submit(goto(1.0, 4.0));
    bench.run_ms(1000);
    let first = bench.robot_of(id).unwrap();
    bench.robots[first].latch(bench.now_ms);
    bench.run_ms(1000);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    let steps = bench.dispatcher.history(id).unwrap().steps;
    assert!(
        steps.iter().any(|step| step.reason.as_deref().is_some_and(|why| why.contains("latched: estop")))
    );
    assert_eq!(bench.dispatcher.store().task(id).unwrap().failures, 0);
}

#[test]
fn an_assignment_that_was_held_up_begins_nothing_once_its_task_has_left() {
    let mut bench = Bench::new(2);
    bench.held_up = Some(Vec::new());
    let id = bench.submit(goto(1.0, 4.0));
    bench.run_ms(500);
    let first = bench.robot_of(id).unwrap();
    let late = bench.held_up.take().unwrap().remove(0);
    bench.robots[first].latch(bench.now_ms);
    bench.run_ms(1000);
    assert_eq!(bench.robot_of(id), Some(1 - first));
    bench.robots[first].latched = None;
    bench.robots[first].request(bench.now_ms, &me(), &late);
    assert!(bench.robots[first].running().is_none());
    assert!(bench.asks.iter().any(|(_, body)| matches!(body, Body::Withdraw { .. })));
}

/// Whatever comes, at most one robot drives, until the task is done.
fn one_drives_until_done(bench: &mut Bench, id: TaskId) {
    for _ in 0..2000 {
        bench.run_ms(10);
        let driving = bench.robots.iter().filter(|robot| robot.running().is_some()).count();
        assert!(driving < 2, "two robots drive for one task");
    }
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_state_from_before_a_robots_restart_that_comes_late_gives_its_drive_to_nobody_else() {
    for heard_before in [false, true] {
        let mut bench = Bench::new(2);
        let id = bench.submit(goto(1.2, 3.0));
        bench.run_ms(500);
        let seq = bench.begun()[0].0;
        bench.robots[0].latch(bench.now_ms);
        let late = bench.robots[0].state(bench.now_ms);
        bench.robots[0].reboot();
        bench.run_ms(3000);
        assert!(bench.robots[0].running().is_some() && bench.begun().iter().all(|of| of.0 == seq));
        bench.restart();
        if heard_before {
            bench.run_ms(100);
        }
        // And then nothing for a while.
        bench.dispatcher.state(bench.now_ms, &late);
        bench.cut[0] = true;
        bench.run_ms(300);
        bench.cut[0] = false;
        one_drives_until_done(&mut bench, id);
    }
}

#[test]
fn a_next_leg_that_was_held_up_begins_nothing_once_its_task_has_left() {
    let mut bench = Bench::new(2);
    bench.passes(0);
    bench.held_up = Some(Vec::new());
    let points = vec![point(1.2, 1.0), point(1.2, 3.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 }));
    bench.run_ms(300);
    // The first leg arrives, the next one does not.
    let first = bench.held_up.replace(Vec::new()).unwrap().remove(0);
    let reply = bench.robots[0].request(bench.now_ms, &me(), &first).unwrap();
    bench.dispatcher.replied(bench.now_ms, &name("xtb-1"), &reply);
    bench.run_ms(300);
    assert!(bench.begun().iter().any(|(_, leg)| *leg == 1));
    let held_up = bench.held_up.take().unwrap();
    bench.robots[0].latch(bench.now_ms);
    bench.run_ms(200);
    assert_ne!(bench.robot_of(id), Some(0));
    bench.robots[0].latched = None;
    for late in held_up {
        bench.robots[0].request(bench.now_ms, &me(), &late);
    }
    one_drives_until_done(&mut bench, id);
}

#[test]
fn a_drive_that_was_withdrawn_before_the_dispatcher_ended_is_nobodys_stop() {
    let mut bench = Bench::new(2);
    let id = bench.submit(TaskSpec { on_takeover: OnTakeover::Fail, ..goto(1.2, 3.0) });
    bench.run_ms(500);
    bench.robots[0].obstruct(bench.now_ms, bench.now_ms + 120_000);
    let withdrawn = (0..10_000).any(|_| {
        bench.run_ms(10);
        bench.asks.iter().any(|(_, body)| matches!(body, Body::Withdraw { .. }))
    });
    assert!(withdrawn);
    bench.restart();
    bench.run_ms(120_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn a_robot_that_is_taken_over_holds_its_task_and_names_who_has_it() {
    for (policy, after) in [
        (OnTakeover::Fail, TaskState::Failed),
        (OnTakeover::Resume, TaskState::Running),
        (OnTakeover::Requeue, TaskState::Running),
    ] {
        let mut bench = Bench::new(1);
        let id = bench.submit(TaskSpec { on_takeover: policy, grace_s: 3.0, ..goto(9.0, 0.0) });
        bench.run_ms(1000);
        bench.by_person(0, Body::Acquire { take: true });
        bench.run_ms(80);
        assert!(bench.reason(id).contains("under control of cli-9"), "{}", bench.reason(id));
        for _ in 0..20 {
            bench.by_person(0, Body::Retain {});
            bench.run_ms(100);
            assert_ne!(bench.state(id), TaskState::Running, "{policy:?}");
        }
        bench.by_person(0, Body::Release {});
        bench.run_ms(9000);
        assert_eq!(bench.state(id), after, "{policy:?}");
    }
}

#[test]
fn a_persons_stop_is_not_undone_by_a_clock() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { on_takeover: OnTakeover::Resume, ..goto(9.0, 0.0) });
    bench.run_ms(1000);
    bench.by_person(0, Body::Stop {});
    bench.run_ms(60_000);
    assert_eq!(
        (bench.state(id), bench.reason(id).as_str()),
        (TaskState::Held, "xtb-1 received a stop command")
    );
    bench.ask(DispatchBody::Resume { tasks: vec![id] });
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Running);
}

#[test]
fn a_robot_that_does_not_answer_delays_nobody() {
    let mut bench = Bench::new(2);
    let first = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..goto(1.0, 1.0) });
    bench.cut[0] = true;
    let second = bench.submit(TaskSpec { who: Who::Robot(name("xtb-2")), ..goto(2.0, 1.0) });
    bench.run_ms(3000);
    assert_eq!(bench.state(second), TaskState::Done);
    assert_ne!(bench.state(first), TaskState::Done);
}

#[test]
fn a_robot_that_joins_late_gets_what_waits_and_why_it_waits_is_said() {
    let mut bench = Bench::new(1);
    bench.cut[0] = true;
    bench.run_ms(2000);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(1000);
    let why = bench.dispatcher.why_queued(bench.now_ms, id).unwrap();
    assert!(why.contains("xtb-1: no message for"), "{why}");
    bench.cut[0] = false;
    bench.run_ms(4000);
    assert_eq!(bench.state(id), TaskState::Done);
}

/// Its states come, but no request gets through to it.
fn run_deaf_ms(bench: &mut Bench, robot: usize, ms: u64) {
    bench.cut[robot] = true;
    for _ in 0..ms / 50 {
        let state = bench.robots[robot].state(bench.now_ms);
        bench.dispatcher.state(bench.now_ms, &state);
        bench.run_ms(50);
    }
}

#[test]
fn a_robot_that_sends_states_and_answers_nothing_gives_its_task_to_another() {
    let mut bench = Bench::new(2);
    bench.cut[0] = true;
    let id = bench.submit(goto(1.0, 0.5));
    run_deaf_ms(&mut bench, 0, 5_000);
    assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Assigned, Some(0)), "the nearest one");
    run_deaf_ms(&mut bench, 0, 15_000);
    assert_eq!(bench.state(id), TaskState::Done);
    let history = bench.dispatcher.history(id).unwrap();
    assert_eq!((history.task.robot, history.task.failures), (Some(name("xtb-2")), 0));
    let given_back = |step: &TaskStep| step.reason.as_deref() == Some("xtb-1 does not answer");
    assert!(history.steps.iter().any(given_back), "{:?}", history.steps);
}

#[test]
fn a_robot_that_was_asked_to_drive_keeps_its_task_until_it_confirms_though_it_answers_nothing_more() {
    let mut bench = Bench::new(2);
    bench.held_up = Some(Vec::new());
    let id = bench.submit(goto(1.0, 0.5));
    bench.run_ms(1000);
    assert_eq!(bench.held_up.as_ref().map(|requests| requests.is_empty()), Some(false));
    run_deaf_ms(&mut bench, 0, 20_000);
    assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Assigned, Some(0)));
}

#[test]
fn a_drive_that_ends_by_itself_leaves_a_robot_that_answers_a_new_dispatcher_nothing() {
    let mut bench = Bench::new(2);
    let id = bench.submit(goto(1.0, 3.0));
    bench.run_ms(500);
    bench.restart();
    bench.robots[0].end(GoalStatus::Failed, Some("controlling client dispatch timed out"));
    run_deaf_ms(&mut bench, 0, 5_000);
    assert_eq!(bench.robot_of(id), Some(0), "what the dispatcher before has asked for may be on its way");
    run_deaf_ms(&mut bench, 0, 25_000);
    assert_eq!(bench.state(id), TaskState::Done);
}
