//! Tasks that wait for a robot that is nearly done.

use crate::bench::{Bench, goto, name, point};
use xtb_dispatch::predicted_free::predict;
use xtb_dispatch::{DispatcherSettings, OpenTravelCost};
use xtb_nav::{Car, Gears, MapPose};
use xtb_protocol::messages::{TaskId, TaskKind, TaskSpec, TaskState, Who};

/// Robot 2 is free, and far away; robot 1 drives to (-1, 0); the task is beside that point.
fn nearly_done_and_far() -> (Bench, TaskId, TaskId) {
    let mut bench = Bench::new(2);
    bench.robots[1].at = (20.0, 0.0);
    bench.run_ms(100);
    let first = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..goto(-1.0, 0.0) });
    bench.run_ms(500);
    assert_eq!((bench.state(first), bench.robot_of(first)), (TaskState::Running, Some(0)));
    let second = bench.submit(goto(-1.5, 0.0));
    bench.run_ms(500);
    (bench, first, second)
}

#[test]
fn a_task_waits_for_the_robot_that_will_be_there_first_and_says_so() {
    let (mut bench, first, second) = nearly_done_and_far();
    assert_eq!(bench.state(second), TaskState::Queued);
    let why = bench.dispatcher.why_queued(bench.now_ms, second).unwrap();
    assert!(why.contains("reserved for xtb-1"), "{why}");
    bench.run_ms(4000);
    assert_eq!(bench.state(first), TaskState::Done);
    assert_eq!(bench.robot_of(second), Some(0));
    assert_eq!(bench.dispatcher.why_queued(bench.now_ms, second), None);
}

#[test]
fn a_robot_that_has_work_of_its_own_is_not_kept_from_it() {
    let (mut bench, _, second) = nearly_done_and_far();
    let third = bench.submit(goto(18.0, 0.0));
    bench.run_ms(500);
    assert_eq!((bench.state(second), bench.robot_of(third)), (TaskState::Queued, Some(1)));
}

#[test]
fn nearly_done_is_believed_for_as_long_as_the_settings_say() {
    let (mut bench, _, second) = nearly_done_and_far();
    bench.robots[0].goal.as_mut().unwrap().ends_ms += 120_000;
    let reserve_ms = DispatcherSettings::default().reserve_ms;
    bench.run_ms(reserve_ms - 2000);
    assert_eq!(bench.state(second), TaskState::Queued);
    bench.run_ms(3000);
    assert_eq!(bench.robot_of(second), Some(1));
}

#[test]
fn nobody_waits_for_a_robot_that_is_blocked_silent_or_latched() {
    let trouble: [fn(&mut Bench); 3] = [
        |bench| bench.robots[0].obstruct(bench.now_ms, bench.now_ms + 60_000),
        |bench| bench.cut[0] = true,
        |bench| bench.robots[0].latch(bench.now_ms),
    ];
    for what in trouble {
        let (mut bench, _, second) = nearly_done_and_far();
        what(&mut bench);
        bench.run_ms(2500);
        assert_eq!(bench.robot_of(second), Some(1));
    }
}

#[test]
fn what_is_left_of_a_route_counts_with_its_stops() {
    let car = Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.4, gears: Gears::BOTH };
    let from = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
    let mut bench = Bench::new(1);
    let points = vec![point(2.0, 0.0), point(4.0, 0.0)];
    let id = bench.submit(TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 4.0 }));
    bench.run_ms(500);
    let mut task = bench.dispatcher.store().task(id).unwrap().clone();
    let candidate = predict(&task, &car, from, &OpenTravelCost).unwrap();
    assert!((candidate.pose.x_m - 4.0).abs() < 1e-9);
    assert!((candidate.extra_m - (4.0 + 2.0 * 4.0 * 0.5 + 2.0)).abs() < 1e-6, "{}", candidate.extra_m);
    task.legs_done = 1;
    let later = predict(&task, &car, from, &OpenTravelCost).unwrap().extra_m;
    assert!((later - (4.0 + 4.0 * 0.5 + 2.0)).abs() < 1e-6, "{later}");
    task.spec.kind = TaskKind::Wander { for_s: 1.0 };
    assert_eq!(predict(&task, &car, from, &OpenTravelCost), None, "nobody knows where a wander ends");
}
