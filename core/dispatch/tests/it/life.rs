//! A task's life, one event at a time.

use crate::bench::{Bench, START_MS, goto, name, point};
use xtb_dispatch::{DispatcherSettings, OpenTravelCost, TravelCost};
use xtb_nav::{Car, MapPose};
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchCode, DispatchOutcome, DispatchRequest, Roster, RosterEntry, TaskAction,
    TaskId, TaskKind, TaskSpec, TaskState, Waypoint, Who,
};

#[test]
fn the_nearest_robot_goes_and_the_history_says_so() {
    let mut bench = Bench::new(3);
    let id = bench.submit(goto(3.2, 0.0));
    bench.run_ms(300);
    assert_eq!(bench.robot_of(id), Some(2));
    bench.run_ms(4000);
    let history = bench.dispatcher.history(id).unwrap();
    let states: Vec<TaskState> = history.steps.iter().map(|step| step.state).collect();
    use TaskState::{Assigned, Done, Queued, Running};
    assert_eq!(states, [Queued, Assigned, Running, Running, Done]);
    assert_eq!((history.task.robot, history.task.legs_done), (Some(name("xtb-3")), 1));
    bench.run_ms(2000);
    assert!(bench.robots.iter().all(|robot| robot.lease.holder().is_none()), "leases are given back");
}

#[test]
fn a_robot_that_only_sends_states_gets_no_task_while_others_are_present_or_on_the_roster() {
    for by_roster in [false, true] {
        let mut bench = Bench::new(2);
        if by_roster {
            let entry = RosterEntry { name: name("xtb-2"), tags: Vec::new(), start_pose: None };
            bench.dispatcher.roster(bench.now_ms, &Roster { robots: vec![entry] });
        } else {
            bench.dispatcher.presence(bench.now_ms, &name("xtb-2"), true);
        }
        let near = bench.submit(goto(1.0, 0.5));
        let next = bench.submit(goto(1.0, -3.0));
        bench.run_ms(500);
        assert_eq!((bench.robot_of(near), bench.state(next)), (Some(1), TaskState::Queued));
        bench.run_ms(15_000);
        assert_eq!((bench.state(near), bench.state(next)), (TaskState::Done, TaskState::Done));
        assert!(bench.asks.iter().all(|(robot, _)| *robot == name("xtb-2")), "{:?}", bench.asks);
    }
}

#[test]
fn a_roster_that_is_gone_bars_nobody() {
    let mut bench = Bench::new(1);
    let entry = RosterEntry { name: name("other"), tags: Vec::new(), start_pose: None };
    bench.dispatcher.roster(bench.now_ms, &Roster { robots: vec![entry] });
    let id = bench.submit(goto(1.0, 0.5));
    bench.run_ms(500);
    assert_eq!(bench.state(id), TaskState::Queued);
    bench.dispatcher.roster(bench.now_ms, &Roster { robots: Vec::new() });
    bench.run_ms(500);
    assert_eq!(bench.robot_of(id), Some(0));
}

#[test]
fn a_patrol_that_is_done_again_has_its_whole_time() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.2, 0.0), point(1.4, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Patrol { points, dwell_s: 0.0, for_s: Some(20.0) }));
    bench.run_ms(3_000);
    bench.ask(DispatchBody::Cancel { tasks: vec![id] });
    bench.run_ms(30_000);
    assert_eq!(bench.state(id), TaskState::Cancelled);
    bench.ask(DispatchBody::Retry { tasks: vec![id] });
    bench.run_ms(5_000);
    assert_eq!(bench.state(id), TaskState::Running);
}

#[test]
fn a_route_is_driven_in_order_as_often_as_it_says_with_its_stops() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.2, 0.0), point(1.4, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 2, dwell_s: 1.0 }));
    let before_ms = bench.now_ms;
    while bench.state(id) != TaskState::Done && bench.now_ms < before_ms + 30_000 {
        bench.run_ms(50);
    }
    assert_eq!(bench.begun(), [(1, 0), (1, 1), (1, 2), (1, 3)]);
    assert!(bench.now_ms - before_ms > 3000, "three stops of a second");
    assert_eq!(bench.robots[0].at, (1.4, 0.0));
}

#[test]
fn a_patrol_ends_when_its_time_is_up() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.2, 0.0), point(1.0, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Patrol { points, dwell_s: 0.0, for_s: Some(5.0) }));
    bench.run_ms(4000);
    assert_eq!(bench.state(id), TaskState::Running);
    bench.run_ms(2500);
    assert_eq!(bench.state(id), TaskState::Done);
    assert!(bench.robots[0].running().is_none());
}

#[test]
fn a_submission_is_taken_whole_or_refused_with_a_reason() {
    let mut bench = Bench::with(1, DispatcherSettings { max_open: 3, ..DispatcherSettings::default() });
    let tags = vec!["red".to_owned()];
    let entry = RosterEntry { name: name("xtb-1"), tags, start_pose: None };
    bench.dispatcher.roster(bench.now_ms, &Roster { robots: vec![entry] });
    bench.dispatcher.set_factsheet(bench.now_ms, &name("xtb-1"), &["goto".to_owned()], None);
    let who = |who| TaskSpec { who, ..goto(1.0, 0.0) };
    let late = TaskSpec { deadline_ms: Some(bench.now_ms - 5000), ..goto(1.0, 0.0) };
    for (spec, code, words) in [
        (who(Who::Robot(name("xtb-2"))), DispatchCode::UnknownRobot, "xtb-2"),
        (who(Who::Tag("blue".into())), DispatchCode::UnknownTag, "blue"),
        (who(Who::Able("fly".into())), DispatchCode::UnknownCapability, "fly"),
        (late, DispatchCode::DeadlinePast, "5 s"),
        (goto(1001.0, 0.0), DispatchCode::OutOfRange, "x_m"),
        (TaskSpec { priority: 10, ..goto(1.0, 0.0) }, DispatchCode::OutOfRange, "priority"),
        (goto(f64::NAN, 0.0), DispatchCode::OutOfRange, "x_m"),
    ] {
        let error = bench.refused(vec![goto(1.0, 0.0), spec]);
        assert_eq!(error.code, code);
        assert!(error.message.contains(words) && error.message.contains("task 2"), "{}", error.message);
    }
    assert_eq!(bench.refused(vec![goto(1.0, 0.0); 4]).code, DispatchCode::QueueFull);
    assert_eq!(bench.dispatcher.store().tasks().count(), 0, "nothing of a refused submission is taken");
    bench.submit(who(Who::Tag("@red".into())));
}

#[test]
fn the_same_submission_again_is_the_same_tasks_also_after_a_restart() {
    let mut bench = Bench::new(0);
    let body = DispatchBody::Submit { tasks: vec![goto(1.0, 0.0), goto(2.0, 0.0)] };
    let request = DispatchRequest { id: Uuid::from_u128(5), body };
    for ticket in [1, 2, 3] {
        bench.dispatcher.request(bench.now_ms, ticket, &name("cli-7"), &request, &OpenTravelCost);
        bench.run_ms(20);
        assert_eq!(
            bench.answer(ticket),
            Some(&DispatchOutcome::Submitted(vec![TaskId::new(1), TaskId::new(2)]))
        );
        bench.restart();
    }
    assert_eq!(bench.dispatcher.store().tasks().count(), 2);
}

#[test]
fn a_cancelled_task_is_answered_when_the_robot_has_confirmed() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(9.0, 0.0));
    bench.run_ms(1000);
    let ticket = bench.ask(DispatchBody::Cancel { tasks: vec![id] });
    bench.cut[0] = true;
    bench.run_ms(1000);
    assert_eq!((bench.change(ticket), bench.state(id)), (None, TaskState::Cancelling));
    bench.cut[0] = false;
    bench.run_ms(1000);
    assert_eq!(bench.change(ticket).unwrap().state, Some(TaskState::Cancelled));
    assert!(bench.robots[0].running().is_none());
    assert_eq!(bench.reason(id), "cancelled by cli-7");
}

#[test]
fn pause_stops_the_robot_and_resume_goes_on_at_the_same_leg() {
    let mut bench = Bench::new(1);
    let points = vec![point(1.5, 0.0), point(9.0, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 }));
    bench.run_ms(3000);
    let ticket = bench.ask(DispatchBody::Pause { tasks: vec![id] });
    bench.run_ms(500);
    assert_eq!(bench.change(ticket).unwrap().error, None);
    assert!(bench.robots[0].running().is_none());
    let other = bench.submit(goto(1.6, 0.0));
    bench.run_ms(2000);
    assert_eq!(bench.state(other), TaskState::Done, "its robot is free for others");
    assert_eq!(bench.state(id), TaskState::Paused);
    bench.ask(DispatchBody::Resume { tasks: vec![id] });
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Running);
    assert_eq!(bench.begun().iter().filter(|(_, leg)| *leg == 0).count(), 2, "one of each task");
}

#[test]
fn a_drive_that_was_reached_while_its_task_was_paused_is_not_driven_again() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(2.0, 0.0));
    bench.run_ms(500);
    let arrives = (0..1000).any(|_| {
        bench.run_ms(10);
        bench.robots[0].running().is_none()
    });
    assert!(arrives && bench.state(id) == TaskState::Running, "its state does not show it yet");
    bench.ask(DispatchBody::Pause { tasks: vec![id] });
    bench.run_ms(200);
    assert_eq!(bench.robot_of(id), None);
    bench.robots[0].reboot(); // it knows of nothing any more
    bench.run_ms(1000);
    bench.ask(DispatchBody::Resume { tasks: vec![id] });
    bench.run_ms(10_000);
    assert_eq!((bench.state(id), bench.begun().len()), (TaskState::Done, 1));
    assert_eq!(bench.dispatcher.history(id).unwrap().task.robot, Some(name("xtb-1")));
}

#[test]
fn a_wander_that_is_assigned_again_gets_the_time_that_is_left() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec::new(TaskKind::Wander { for_s: 60.0 }));
    let pause = |bench: &mut Bench, for_ms: u64| {
        bench.run_ms(2000);
        assert_eq!(bench.state(id), TaskState::Running);
        bench.ask(DispatchBody::Pause { tasks: vec![id] });
        bench.run_ms(for_ms);
        bench.ask(DispatchBody::Resume { tasks: vec![id] });
    };
    pause(&mut bench, 20_000);
    pause(&mut bench, 60_000);
    bench.run_ms(6000);
    assert_eq!(bench.state(id), TaskState::Done);
    let given: Vec<f64> = bench
        .asks
        .iter()
        .filter_map(|(_, body)| match body {
            Body::Assign { errand: TaskAction::Wander { for_s }, .. } => Some(*for_s),
            _ => None,
        })
        .collect();
    assert_eq!((given.len(), given[0], given[2]), (3, 60.0, 1.0), "{given:?}");
    assert!((30.0..39.0).contains(&given[1]), "{given:?}");
}

#[test]
fn verbs_that_do_not_fit_say_why() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(1.1, 0.0));
    bench.run_ms(2000);
    assert_eq!(bench.state(id), TaskState::Done);
    for body in [
        DispatchBody::Cancel { tasks: vec![id] },
        DispatchBody::Pause { tasks: vec![id] },
        DispatchBody::Retry { tasks: vec![id] },
    ] {
        let ticket = bench.ask(body);
        bench.run_ms(50);
        let error = bench.change(ticket).unwrap().error.unwrap();
        assert_eq!(error.code, DispatchCode::WrongState);
        assert!(error.hint.contains(&format!("`fleet-cli task {id}`")), "{}", error.hint);
    }
    let ticket = bench.ask(DispatchBody::Cancel { tasks: vec![TaskId::new(99)] });
    bench.run_ms(50);
    assert_eq!(bench.change(ticket).unwrap().error.unwrap().code, DispatchCode::UnknownTask);
}

#[test]
fn a_deadline_that_passes_stops_the_robot() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { deadline_ms: Some(bench.now_ms + 2000), ..goto(9.0, 0.0) });
    bench.run_ms(2500);
    assert_eq!((bench.state(id), bench.reason(id).as_str()), (TaskState::Failed, "deadline passed"));
    assert!(bench.robots[0].running().is_none());
}

/// One robot, always something of priority 9 to do: what has priority 0 has its turn.
#[test]
fn low_priorities_do_not_starve() {
    let mut bench =
        Bench::with(1, DispatcherSettings { priority_step_ms: 2000, ..DispatcherSettings::default() });
    let low = bench.submit(TaskSpec { priority: 0, ..goto(1.1, 0.0) });
    let mut near = 0;
    while bench.state(low) != TaskState::Done && bench.now_ms < START_MS + 120_000 {
        let waiting = bench.dispatcher.store().open().filter(|task| task.id != low).count();
        if waiting < 3 {
            near += 1;
            bench.submit(TaskSpec { priority: 9, ..goto(1.0 + f64::from(near % 2) * 0.2, 0.0) });
        }
        bench.run_ms(100);
    }
    let done_ms = bench.now_ms - START_MS;
    assert_eq!(bench.state(low), TaskState::Done);
    assert!(done_ms > 2000, "it was not its turn yet: {done_ms} ms");
    assert!(done_ms < 9 * 2000 + 12_000, "{done_ms} ms");
}

#[test]
fn what_the_ground_refuses_is_not_taken() {
    struct Pit;
    impl TravelCost for Pit {
        fn distance_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
            OpenTravelCost.distance_m(car, from, to)
        }
        fn estimate_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
            OpenTravelCost.estimate_m(car, from, to)
        }
        fn admits(&self, _: &Car, to: &Waypoint) -> Result<(), (DispatchCode, String)> {
            if to.x_m > 5.0 { Err((DispatchCode::KeepOut, "in the pit".into())) } else { Ok(()) }
        }
    }
    let mut bench = Bench::new(1);
    let body = DispatchBody::Submit { tasks: vec![goto(6.0, 0.0)] };
    let request = DispatchRequest { id: Uuid::from_u128(5), body };
    bench.dispatcher.request(bench.now_ms, 50, &name("cli-7"), &request, &Pit);
    bench.effects();
    let Some(DispatchOutcome::Error(error)) = bench.answer(50) else { panic!() };
    assert_eq!((error.code, error.message.as_str()), (DispatchCode::KeepOut, "in the pit"));
}

#[test]
fn what_has_a_deadline_that_is_over_is_not_begun_again() {
    let mut bench = Bench::new(1);
    let id = bench.submit(TaskSpec { deadline_ms: Some(bench.now_ms + 1000), ..goto(9.0, 0.0) });
    bench.run_ms(1500);
    assert_eq!(bench.state(id), TaskState::Failed);
    let ticket = bench.ask(DispatchBody::Retry { tasks: vec![id] });
    bench.run_ms(50);
    let error = bench.change(ticket).unwrap().error.unwrap();
    assert_eq!((error.code, bench.state(id)), (DispatchCode::WrongState, TaskState::Failed));
    assert!(error.message.contains("deadline"), "{}", error.message);
}
