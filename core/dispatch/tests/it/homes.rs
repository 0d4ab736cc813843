//! Docks and parking places: who goes there, when, and who comes back.

use crate::bench::{Bench, goto, name, point};
use xtb_dispatch::{HomeRules, HomeSettings, Record};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    BatteryLevel, Body, DispatchBody, HomeStatus, MAX_PRIORITY, MapPlace, PlaceKind, RobotHome, TaskId,
    TaskKind, TaskSpec, TaskState, Who,
};

const DISPATCH: &str = "dispatch";

fn place(text: &str, kind: PlaceKind, x_m: f64, y_m: f64) -> MapPlace {
    MapPlace { name: name(text), kind, x_m, y_m, yaw_rad: None, tags: Vec::new(), points: Vec::new() }
}

fn docks() -> Vec<MapPlace> {
    vec![
        place("dock-1", PlaceKind::Dock, 2.0, 5.0),
        place("dock-2", PlaceKind::Dock, 8.0, 5.0),
        place("parking-1", PlaceKind::Parking, 0.0, -5.0),
        place("bench", PlaceKind::Place, 2.0, 2.0),
    ]
}

fn rules() -> HomeRules {
    HomeRules {
        settings: HomeSettings { park_after_s: 30.0, ..HomeSettings::default() },
        ..HomeRules::default()
    }
}

/// Robots with full batteries, in a room with these places.
fn bench(robots: usize, places: &[MapPlace]) -> Bench {
    let mut bench = Bench::new(robots);
    bench.robots.iter_mut().for_each(|robot| robot.set_battery(8.0));
    told(&mut bench, places);
    bench.run_ms(3_500);
    bench
}

fn told(bench: &mut Bench, places: &[MapPlace]) {
    bench.dispatcher.set_home_rules(Some(rules()));
    bench.dispatcher.set_places(places);
}

/// The dispatcher's own drives, oldest first.
fn own(bench: &Bench) -> Vec<(TaskId, TaskState, (f64, f64))> {
    let own = bench.dispatcher.store().tasks().filter(|task| task.by.as_str() == DISPATCH);
    let to = |kind: &TaskKind| (kind.points()[0].x_m, kind.points()[0].y_m);
    own.map(|task| (task.id, task.state, to(&task.spec.kind))).collect()
}

fn open(bench: &Bench) -> usize {
    own(bench).iter().filter(|(_, state, _)| !state.is_final()).count()
}

fn home(bench: &Bench, robot: &str) -> Option<RobotHome> {
    let homes = bench.dispatcher.homes(bench.now_ms);
    assert!(homes.active);
    homes.robots.into_iter().find(|home| home.robot.as_str() == robot)
}

fn status(bench: &Bench, robot: &str) -> Option<HomeStatus> {
    home(bench, robot).map(|home| home.status)
}

/// Its voltage goes on like this, in V a second.
fn run_with_battery(bench: &mut Bench, robot: usize, from_v: f64, rise_vps: f64, seconds: u32) {
    for second in 0..seconds {
        bench.robots[robot].set_battery(from_v + rise_vps * f64::from(second));
        bench.run_ms(1000);
    }
}

#[test]
fn at_warn_a_robot_ends_its_task_goes_to_the_nearest_dock_and_works_again_when_it_is_charged() {
    let mut bench = bench(1, &docks());
    let first = bench.submit(goto(4.0, 0.0));
    bench.run_ms(1000);
    bench.robots[0].set_battery(7.1);
    bench.run_ms(3000);
    assert_eq!((bench.state(first), own(&bench).len()), (TaskState::Running, 0));
    assert_eq!(status(&bench, "xtb-1"), Some(HomeStatus::AfterTask));
    let second = bench.submit(goto(1.0, 0.0));
    bench.run_ms(5000);
    assert_eq!(bench.state(first), TaskState::Done);
    let [(task, _, to)] = own(&bench)[..] else { panic!("{:?}", own(&bench)) };
    assert_eq!(to, (2.0, 5.0));
    let on_the_way = home(&bench, "xtb-1").unwrap();
    assert_eq!((on_the_way.status, on_the_way.task), (HomeStatus::OnTheWay, Some(task)));
    assert_eq!(on_the_way.place, Some(name("dock-1")));
    assert!(on_the_way.why.contains("battery low (7.10 V)"), "{on_the_way:?}");
    let why = bench.dispatcher.why_queued(bench.now_ms, second).unwrap();
    assert!(why.contains("busy with"), "{why}");
    bench.run_ms(15_000);
    assert_eq!(bench.state(task), TaskState::Done);
    run_with_battery(&mut bench, 0, 7.3, 0.002, 340);
    assert_eq!(status(&bench, "xtb-1"), Some(HomeStatus::Charging));
    assert_eq!((bench.state(second), own(&bench).len()), (TaskState::Queued, 1), "it charges up to 8.0 V");
    let why = bench.dispatcher.why_queued(bench.now_ms, second).unwrap();
    assert!(why.contains("charging at dock-1") && why.contains("8.00 V"), "{why}");
    run_with_battery(&mut bench, 0, 8.01, 0.0, 20);
    assert_eq!(bench.state(second), TaskState::Done);
}

#[test]
fn just_above_its_last_level_a_robot_goes_at_once_and_another_one_does_its_task() {
    let mut bench = bench(2, &docks());
    let task = bench.submit(TaskSpec::new(TaskKind::Patrol {
        points: vec![point(0.0, 0.0), point(9.0, 0.0)],
        dwell_s: 0.0,
        for_s: None,
    }));
    bench.run_ms(3000);
    let first = bench.robot_of(task).unwrap();
    bench.robots[first].set_battery(7.1);
    bench.run_ms(5000);
    assert_eq!(bench.robot_of(task), Some(first), "a patrol has no end to wait for");
    bench.robots[first].set_battery(6.97);
    bench.run_ms(1500);
    assert_eq!(bench.robot_of(task), Some(first), "it may be the sag of a start");
    bench.run_ms(2500);
    assert_eq!(bench.robot_of(task), Some(1 - first));
    assert_eq!(bench.dispatcher.store().task(task).unwrap().failures, 0);
    let [(drive, state, _)] = own(&bench)[..] else { panic!("{:?}", own(&bench)) };
    assert!(matches!(state, TaskState::Assigned | TaskState::Running), "{state:?}");
    assert_eq!(bench.robot_of(drive), Some(first));
}

#[test]
fn a_dock_is_one_robots_and_one_that_is_charged_makes_room() {
    let mut places = docks();
    places.remove(1);
    let mut bench = bench(2, &places);
    (0..2).for_each(|robot| bench.robots[robot].set_battery(7.1 - 0.01 * robot as f64));
    bench.run_ms(20_000);
    assert_eq!(own(&bench).len(), 1, "the lower one first: {:?}", own(&bench));
    assert_eq!(bench.robots[1].at, (2.0, 5.0));
    assert_eq!(status(&bench, "xtb-2"), Some(HomeStatus::Charging));
    assert_eq!(status(&bench, "xtb-1"), Some(HomeStatus::WaitsForDock));
    // At `warn` it works as long as there is no dock for it.
    let task = bench.submit(goto(3.0, 0.0));
    bench.run_ms(8_000);
    assert_eq!((bench.robot_of(task), bench.state(task)), (None, TaskState::Done));
    bench.robots[1].set_battery(8.1);
    bench.run_ms(30_000);
    assert_eq!(bench.robots[1].at, (0.0, -5.0), "to the parking place: {:?}", own(&bench));
    bench.run_ms(5_000);
    assert_eq!(bench.robots[0].at, (2.0, 5.0), "{:?}", own(&bench));
    assert_eq!(status(&bench, "xtb-2"), Some(HomeStatus::Parked));
}

#[test]
fn a_dispatcher_that_is_killed_at_every_write_sends_nobody_twice() {
    for kill_at in 1..12 {
        let mut bench = bench(2, &docks());
        let writes = bench.ledger.len();
        let mut killed = 0;
        bench.robots[0].set_battery(7.0);
        bench.robots[1].set_battery(6.95);
        for _ in 0..3000 {
            bench.run_ms(10);
            if bench.ledger.len() - writes >= kill_at * (killed + 1) {
                killed += 1;
                bench.restart();
                told(&mut bench, &docks());
            }
        }
        assert!(killed >= 1 || kill_at > 6, "{kill_at}");
        let mut at: Vec<(f64, f64)> = bench.robots.iter().map(|robot| robot.at).collect();
        at.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(at, [(2.0, 5.0), (8.0, 5.0)], "{kill_at}");
        assert_eq!(own(&bench).len(), 2, "{kill_at}: {:?}", own(&bench));
        let submitted = bench.ledger.iter().filter(|entry| matches!(entry.record, Record::Submitted { .. }));
        assert_eq!(submitted.count(), 2);
    }
}

#[test]
fn a_dispatcher_that_begins_anew_leaves_a_robot_that_is_charged_at_its_dock() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(20_000);
    assert_eq!(bench.robots[0].at, (2.0, 5.0));
    bench.robots[0].set_battery(7.6);
    let task = bench.submit(goto(1.0, 0.0));
    bench.restart();
    bench.dispatcher.set_home_rules(Some(rules()));
    bench.run_ms(2_000);
    assert_eq!(bench.state(task), TaskState::Queued, "the places are not known yet");
    bench.dispatcher.set_places(&docks());
    bench.run_ms(5_000);
    assert_eq!((bench.state(task), open(&bench)), (TaskState::Queued, 0));
}

#[test]
fn a_dock_that_does_not_charge_is_left_for_another_one() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(125_000);
    assert_eq!((bench.robots[0].at, own(&bench).len()), ((2.0, 5.0), 1));
    bench.run_ms(60_000);
    assert_eq!(bench.robots[0].at, (8.0, 5.0), "{:?}", home(&bench, "xtb-1"));
    bench.run_ms(200_000);
    assert_eq!(own(&bench).len(), 2, "no dock is left");
    let stands = home(&bench, "xtb-1").unwrap();
    assert_eq!((stands.status, stands.place), (HomeStatus::NotCharging, Some(name("dock-2"))));
    assert!(stands.why.contains("contacts"), "{}", stands.why);
}

#[test]
fn an_idle_robot_parks_and_leaves_for_the_next_task() {
    let mut bench = bench(1, &docks());
    bench.run_ms(25_000);
    assert_eq!(own(&bench).len(), 0);
    bench.run_ms(4_000);
    let [(drive, _, to)] = own(&bench)[..] else { panic!("{:?}", own(&bench)) };
    assert_eq!(to, (0.0, -5.0));
    let task = bench.submit(goto(3.0, 0.0));
    bench.run_ms(1_500);
    assert_eq!(bench.robot_of(task), Some(0), "{:?}", bench.reason(task));
    assert_eq!(
        (bench.state(drive), bench.reason(drive)),
        (TaskState::Cancelled, "there is a task for it".into())
    );
    bench.run_ms(60_000);
    assert_eq!(bench.robots[0].at, (0.0, -5.0));
    bench.run_ms(60_000);
    assert_eq!((own(&bench).len(), status(&bench, "xtb-1")), (2, Some(HomeStatus::Parked)));
}

#[test]
fn who_cancels_a_drive_home_is_obeyed_for_ten_minutes() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(1_000);
    let (drive, ..) = own(&bench)[0];
    bench.ask(DispatchBody::Cancel { tasks: vec![drive] });
    bench.run_ms(590_000);
    assert_eq!((bench.state(drive), own(&bench).len()), (TaskState::Cancelled, 1));
    assert_eq!(status(&bench, "xtb-1"), Some(HomeStatus::NeedsHelp));
    bench.restart();
    told(&mut bench, &docks());
    bench.run_ms(5_000);
    assert_eq!(own(&bench).len(), 1, "a restart does not change its mind");
    bench.run_ms(10_000);
    assert_eq!(own(&bench).len(), 2);
}

#[test]
fn a_robot_that_begins_nothing_any_more_is_not_sent_and_somebody_is_told() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(6.85);
    bench.run_ms(30_000);
    assert_eq!(own(&bench).len(), 0);
    let stands = home(&bench, "xtb-1").unwrap();
    assert_eq!(stands.status, HomeStatus::NeedsHelp);
    assert!(stands.why.contains("6.85 V") && stands.why.contains("cannot drive"), "{}", stands.why);
}

#[test]
fn a_drive_home_that_fails_is_tried_again_after_a_minute() {
    let mut bench = bench(1, &docks()[..1]);
    bench.robots[0].doomed.push((2.0, 5.0));
    bench.robots[0].set_battery(7.1);
    bench.run_ms(60_000);
    let drives = own(&bench);
    assert_eq!((drives.len(), drives[0].1), (1, TaskState::Failed), "{drives:?}");
    bench.robots[0].doomed.clear();
    bench.run_ms(90_000);
    assert_eq!(bench.robots[0].at, (2.0, 5.0), "{:?}", own(&bench));
}

#[test]
fn a_dock_at_which_somebody_else_has_stopped_is_left_to_them() {
    let mut bench = bench(2, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(1_000);
    assert_eq!(own(&bench)[0].2, (2.0, 5.0));
    bench.robots[1].at = (2.1, 5.2);
    bench.run_ms(30_000);
    assert_eq!(bench.robots[0].at, (8.0, 5.0), "{:?}", own(&bench));
    let (drive, state, _) = own(&bench)[0];
    assert_eq!((state, bench.reason(drive)), (TaskState::Cancelled, "xtb-2 stands at dock-1".into()));
}

#[test]
fn a_robot_that_does_not_get_to_its_dock_goes_to_another_one() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(1_500);
    assert_eq!(own(&bench)[0].2, (2.0, 5.0));
    // Somebody stands in its way, and moves only when it has turned round.
    let until_ms = bench.now_ms + 95_000;
    bench.robots[0].obstruct(bench.now_ms, until_ms);
    bench.run_ms(80_000);
    assert_eq!(own(&bench).len(), 1);
    bench.run_ms(40_000);
    let (drive, state, _) = own(&bench)[0];
    assert_eq!((state, bench.reason(drive)), (TaskState::Cancelled, "xtb-1 does not get to dock-1".into()));
    assert_eq!(bench.robots[0].at, (8.0, 5.0), "{:?}", own(&bench));
}

#[test]
fn a_robot_that_dies_on_its_way_keeps_its_dock_for_minutes_only() {
    let mut bench = bench(2, &docks()[..1]);
    bench.robots[0].set_battery(7.1);
    bench.run_ms(1_500);
    assert_eq!(own(&bench).len(), 1);
    bench.robots[0].up = false;
    bench.robots[1].set_battery(7.1);
    bench.run_ms(30_000);
    assert_eq!(own(&bench).len(), 1);
    bench.run_ms(210_000);
    assert_eq!((own(&bench).len(), bench.robots[1].at), (2, (2.0, 5.0)));
}

#[test]
fn a_battery_that_is_not_measured_any_more_is_not_full() {
    let mut bench = bench(1, &docks());
    bench.robots[0].set_battery(7.1);
    bench.run_ms(20_000);
    assert_eq!(bench.robots[0].at, (2.0, 5.0));
    run_with_battery(&mut bench, 0, 7.3, 0.002, 60);
    let task = bench.submit(goto(1.0, 0.0));
    (bench.robots[0].battery_v, bench.robots[0].battery_level) = (None, BatteryLevel::Unknown);
    bench.run_ms(20_000);
    assert_eq!((bench.state(task), status(&bench, "xtb-1")), (TaskState::Queued, Some(HomeStatus::Charging)));
    assert!(home(&bench, "xtb-1").unwrap().why.contains("not measured any more"));
    run_with_battery(&mut bench, 0, 8.01, 0.0, 20);
    assert_eq!(bench.state(task), TaskState::Done);
}

#[test]
fn a_robot_with_a_home_goes_there_and_nobody_is_sent_without_rules() {
    let mut bench = bench(1, &docks());
    let homes = [(name("xtb-1"), name("bench"))].into_iter().collect();
    bench.dispatcher.set_home_rules(Some(HomeRules { homes, ..rules() }));
    bench.robots[0].set_battery(7.1);
    bench.run_ms(20_000);
    assert_eq!(bench.robots[0].at, (2.0, 2.0));
    assert_eq!(status(&bench, "xtb-1"), Some(HomeStatus::Charging));
    let mut bench = Bench::new(1);
    bench.robots[0].set_battery(7.0);
    bench.dispatcher.set_places(&docks());
    bench.run_ms(60_000);
    assert_eq!(own(&bench).len(), 0);
    assert!(!bench.dispatcher.homes(bench.now_ms).active);
}

#[test]
fn nobody_is_sent_while_the_fleet_is_stopped_or_somebody_else_drives() {
    let mut bench = bench(1, &docks());
    bench.dispatcher.fleet_stop(bench.now_ms, Some(&name("cli-7")));
    bench.robots[0].set_battery(7.0);
    bench.run_ms(20_000);
    assert_eq!(own(&bench).len(), 0);
    bench.by_person(0, Body::Acquire { take: true });
    bench.ask(DispatchBody::Activate {});
    let until_ms = bench.now_ms + 5_000;
    while bench.now_ms < until_ms {
        bench.by_person(0, Body::Retain {});
        bench.run_ms(100);
    }
    assert_eq!(own(&bench).len(), 0);
    bench.run_ms(10_000);
    assert_eq!(own(&bench).len(), 1);
}

/// An order to go there for one robot.
fn order(robot: &str, x_m: f64, y_m: f64) -> TaskSpec {
    TaskSpec { priority: MAX_PRIORITY, who: Who::Robot(name(robot)), ..goto(x_m, y_m) }
}

#[test]
fn who_is_ordered_to_a_dock_goes_at_once_and_another_one_does_its_task() {
    let mut bench = bench(2, &docks());
    let task = bench.submit(goto(9.0, 0.0));
    bench.run_ms(2_000);
    let (first, named) = (bench.robot_of(task).unwrap(), ["xtb-1", "xtb-2"]);
    // Somewhere else it is a task like any other.
    let elsewhere = bench.submit(order(named[first], 5.0, 5.0));
    bench.run_ms(1_000);
    assert_eq!((bench.robot_of(task), bench.state(elsewhere)), (Some(first), TaskState::Queued));
    bench.ask(DispatchBody::Cancel { tasks: vec![elsewhere] });
    let ordered = bench.submit(order(named[first], 8.0, 5.0));
    bench.run_ms(3_000);
    assert_eq!(bench.robot_of(ordered), Some(first), "{:?}", bench.reason(ordered));
    assert_eq!(bench.robot_of(task), Some(1 - first), "{:?}", bench.reason(task));
    assert_eq!(bench.dispatcher.store().task(task).unwrap().failures, 0);
    bench.run_ms(25_000);
    assert_eq!((bench.state(ordered), bench.state(task)), (TaskState::Done, TaskState::Done));
    assert_eq!(bench.robots[first].at, (8.0, 5.0));
}

#[test]
fn another_map_or_a_place_that_is_gone_ends_the_drive() {
    let mut bench = bench(1, &docks());
    let hash = |n| xtb_protocol::messages::MapHash::new(n);
    bench.dispatcher.map(bench.now_ms, "lab", hash(1));
    bench.run_ms(500);
    bench.robots[0].set_battery(7.1);
    bench.run_ms(1_000);
    let (drive, ..) = own(&bench)[0];
    let left: Vec<MapPlace> = docks().into_iter().filter(|place| place.name != dock()).collect();
    bench.dispatcher.set_places(&left);
    bench.run_ms(1_500);
    assert_eq!((bench.state(drive), bench.reason(drive)), (TaskState::Cancelled, "its place is gone".into()));
    let (drive, _, to) = own(&bench)[1];
    assert_eq!(to, (8.0, 5.0));
    bench.dispatcher.map(bench.now_ms, "barn", hash(2));
    bench.dispatcher.set_places(&[]);
    bench.run_ms(5_000);
    assert_eq!((bench.state(drive), open(&bench)), (TaskState::Cancelled, 0));
}

fn dock() -> Name {
    name("dock-1")
}
