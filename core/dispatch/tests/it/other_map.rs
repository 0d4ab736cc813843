//! Tasks are of the map that the fleet had when they were submitted.

use crate::bench::{Bench, goto, name, point};
use xtb_dispatch::MapTravelCost;
use xtb_nav::{Cell, Grid, Map};
use xtb_protocol::messages::{
    Adopted, DispatchBody, DispatchOutcome, MapHash, SuspensionCause, TaskKind, TaskSpec, TaskState, Who,
};

fn causes(bench: &Bench) -> Vec<SuspensionCause> {
    bench.dispatcher.suspensions().into_iter().map(|suspension| suspension.cause).collect()
}

const LAB: MapHash = MapHash::new(1);
const LAB_LATER: MapHash = MapHash::new(2);
const HALL: MapHash = MapHash::new(3);

fn other(of: Option<&str>, now: &str) -> SuspensionCause {
    SuspensionCause::OtherMap { of: of.map(str::to_owned), now: now.to_owned() }
}

fn adopt(bench: &mut Bench) -> Adopted {
    let ticket = bench.ask(DispatchBody::Adopt {});
    bench.run_ms(50);
    match bench.answer(ticket) {
        Some(DispatchOutcome::Adopted(adopted)) => adopted.clone(),
        other => panic!("{other:?}"),
    }
}

/// A dispatcher that was started again where the fleet has this map.
fn moved(bench: &mut Bench, map: &str, hash: MapHash) {
    bench.restart();
    bench.dispatcher.map(bench.now_ms, map, hash);
}

#[test]
fn tasks_of_another_map_wait_until_they_are_adopted_and_new_ones_do_not() {
    let mut bench = Bench::new(1);
    bench.dispatcher.map(bench.now_ms, "lab", LAB);
    let [running, waiting] = [goto(3.0, 0.0), goto(4.0, 0.0)].map(|spec| bench.submit(spec));
    bench.run_ms(1000);
    assert_eq!(bench.state(running), TaskState::Running);
    moved(&mut bench, "hall", HALL);
    bench.run_ms(1000);
    assert!(bench.robots[0].running().is_none(), "it drives in one room for a task of another");
    let here = bench.submit(goto(1.5, 0.0));
    bench.run_ms(20_000);
    assert_eq!(
        [running, waiting, here].map(|id| bench.state(id)),
        [TaskState::Queued, TaskState::Queued, TaskState::Done]
    );
    let suspended = bench.dispatcher.suspensions();
    assert_eq!(
        (suspended[0].cause.clone(), suspended[0].tasks, suspended.len()),
        (other(Some("lab"), "hall"), 2, 1)
    );
    bench.restart();
    bench.run_ms(5000);
    assert_eq!(causes(&bench), [other(Some("lab"), "hall")], "before the map is known again");
    let adopted = adopt(&mut bench);
    assert_eq!((adopted.map.as_deref(), adopted.tasks), (Some("hall"), vec![running, waiting]));
    bench.run_ms(20_000);
    assert_eq!([running, waiting].map(|id| bench.state(id)), [TaskState::Done; 2]);
    assert_eq!(adopt(&mut bench).tasks, []);
}

#[test]
fn nothing_is_begun_after_a_start_before_somebody_had_time_to_say_that_the_map_is_another_one() {
    for known in [false, true] {
        let mut bench = Bench::new(1);
        if known {
            bench.dispatcher.map(bench.now_ms, "lab", LAB);
        }
        for x_m in [9.0, 3.0] {
            bench.submit(goto(x_m, 0.0));
        }
        bench.run_ms(1000);
        assert!(bench.robots[0].running().is_some());
        bench.robots[0].reboot(); // another world: it knows of nothing
        let begun = bench.begun().len();
        bench.restart();
        bench.run_ms(2500);
        assert_eq!(bench.begun().len() > begun, !known);
        bench.run_ms(2500);
        assert!(bench.begun().len() > begun, "no map is no contradiction");
    }
}

#[test]
fn tasks_go_on_when_their_own_map_is_back() {
    let mut bench = Bench::new(1);
    bench.dispatcher.map(bench.now_ms, "lab", LAB);
    let id = bench.submit(goto(3.0, 0.0));
    moved(&mut bench, "hall", HALL);
    bench.run_ms(5000);
    assert_eq!(bench.state(id), TaskState::Queued);
    moved(&mut bench, "lab", LAB_LATER);
    bench.run_ms(15_000);
    assert_eq!((bench.state(id), causes(&bench)), (TaskState::Done, vec![]), "a new version is the same map");
}

#[test]
fn tasks_of_no_map_go_along_with_the_first_one_that_is_known() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(3.0, 0.0));
    bench.dispatcher.map(bench.now_ms, "lab", LAB);
    bench.run_ms(100);
    assert_eq!(bench.dispatcher.history(id).unwrap().task.map.as_deref(), Some("lab"));
    bench.run_ms(10_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

#[test]
fn what_an_older_program_left_waits_for_somebody_to_say_that_it_is_of_this_map() {
    let mut bench = Bench::new(1);
    let id = bench.submit(goto(3.0, 0.0));
    bench.ledger.iter_mut().for_each(|entry| entry.v = 1);
    bench.restart();
    bench.run_ms(100);
    assert_eq!(causes(&bench), [], "no map contradicts it");
    moved(&mut bench, "lab", LAB);
    bench.run_ms(10_000);
    assert_eq!((causes(&bench), bench.state(id)), (vec![other(None, "lab")], TaskState::Queued));
    assert_eq!(adopt(&mut bench).tasks, [id]);
    bench.run_ms(10_000);
    assert_eq!(bench.state(id), TaskState::Done);
}

/// A room of 10 by 8 m with a wall across at y = 4 m, and the map's name.
fn walled(wall: bool) -> MapTravelCost {
    let mut grid = Grid::free(0.05, [0.0, -1.0], 200, 180).unwrap();
    if wall {
        (0..200).for_each(|column| grid.set(column, 100, Cell::Occupied));
    }
    MapTravelCost::new(Map::new("lab", grid, Vec::new()).unwrap())
}

/// So many robots say that they are XTBs: what has not said what car it is fits everywhere.
fn measure(bench: &mut Bench, robots: usize) {
    let car = xtb_nav::Car::of(&xtb_control::VehicleConfig::default());
    for number in 1..=robots {
        bench.dispatcher.set_factsheet(bench.now_ms, &name(&format!("xtb-{number}")), &[], Some(car));
    }
}

#[test]
fn a_new_version_of_the_map_fails_what_it_makes_unreachable_and_nothing_else() {
    let mut bench = Bench::new(2);
    bench.travel_cost = Box::new(walled(false));
    bench.dispatcher.map(bench.now_ms, "lab", LAB);
    let far = |x_m: f64, y_m: f64| TaskSpec { who: Who::Robot(name("xtb-2")), ..goto(x_m, y_m) };
    bench.cut[1] = true; // its robot does nothing meanwhile
    bench.run_ms(2000);
    let [on_the_wall, behind, here] =
        [far(5.0, 4.1), far(5.0, 6.0), far(5.0, 2.0)].map(|spec| bench.submit(spec));
    let points = vec![point(2.0, 4.1), point(3.0, 2.0)];
    let route = TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 5.0 });
    let passed = bench.submit(TaskSpec { who: Who::Robot(name("xtb-1")), ..route });
    bench.run_ms(12_000);
    assert_eq!(bench.dispatcher.store().task(passed).unwrap().legs_done, 1);
    bench.travel_cost = Box::new(walled(true));
    measure(&mut bench, 2);
    bench.dispatcher.map(bench.now_ms, "lab", LAB_LATER);
    bench.run_ms(500);
    let states = |bench: &Bench| [on_the_wall, behind, here].map(|id| bench.state(id));
    use TaskState::{Done, Failed, Queued};
    assert_eq!(states(&bench), [Failed, Queued, Queued]);
    let why = "(5.00, 4.10) is occupied on the map, or outside it (current map: lab)";
    assert_eq!(bench.reason(on_the_wall), why);
    bench.cut[1] = false;
    bench.run_ms(6000);
    assert_eq!(states(&bench)[1], Failed);
    let why = "no path to (5.00, 6.00) from any suitable robot (current map: lab)";
    assert_eq!(bench.reason(behind), why);
    bench.run_ms(30_000);
    assert_eq!(
        (states(&bench)[2], bench.state(passed)),
        (Done, Done),
        "what is behind a task does not matter"
    );
}

#[test]
fn what_is_adopted_is_looked_up_on_the_new_map() {
    let mut bench = Bench::new(1);
    bench.dispatcher.map(bench.now_ms, "hall", HALL);
    bench.cut[0] = true;
    bench.run_ms(2000);
    let [on_the_wall, here] = [goto(5.0, 4.1), goto(5.0, 2.0)].map(|spec| bench.submit(spec));
    bench.restart();
    bench.travel_cost = Box::new(walled(true));
    bench.dispatcher.map(bench.now_ms, "lab", LAB);
    bench.run_ms(500);
    measure(&mut bench, 1);
    assert_eq!(bench.state(on_the_wall), TaskState::Queued, "it is none of this map's");
    assert_eq!(adopt(&mut bench).tasks, [on_the_wall, here]);
    bench.run_ms(500);
    assert_eq!([on_the_wall, here].map(|id| bench.state(id)), [TaskState::Failed, TaskState::Queued]);
}

#[test]
fn a_robot_that_is_too_wide_for_a_goal_is_not_sent_there() {
    let mut bench = Bench::new(2);
    bench.travel_cost = Box::new(walled(true));
    (bench.robots[0].at, bench.robots[1].at) = ((5.0, 2.0), (1.0, 1.0));
    bench.run_ms(2000);
    let truck = xtb_nav::Car::of(&xtb_control::VehicleConfig::default());
    for (robot, car) in [("xtb-1", truck.grown(0.2)), ("xtb-2", truck)] {
        bench.dispatcher.set_factsheet(bench.now_ms, &name(robot), &[], Some(car));
    }
    let id = bench.submit(goto(5.0, 3.7)); // 0.3 m from the wall
    bench.run_ms(1000);
    assert_eq!(bench.robot_of(id), Some(1), "the nearer one is 0.4 m from its middle to its side");
    let next = bench.submit(goto(4.0, 3.7));
    bench.run_ms(200);
    assert_eq!((bench.robot_of(id), bench.robot_of(next)), (Some(1), None), "it waits for who is busy");
}

#[test]
fn a_task_that_only_a_robot_without_a_factsheet_may_fit_waits_for_the_factsheet() {
    let mut bench = Bench::new(2);
    bench.travel_cost = Box::new(walled(true));
    (bench.robots[0].at, bench.robots[1].at) = ((5.0, 2.0), (1.0, 1.0));
    bench.run_ms(2000);
    let truck = xtb_nav::Car::of(&xtb_control::VehicleConfig::default());
    bench.dispatcher.set_factsheet(bench.now_ms, &name("xtb-1"), &[], Some(truck.grown(0.2)));
    let id = bench.submit(goto(5.0, 3.7)); // 0.3 m from the wall
    bench.run_ms(2000);
    assert_eq!((bench.state(id), bench.robot_of(id)), (TaskState::Queued, None));
    let why = bench.dispatcher.why_queued(bench.now_ms, id);
    assert_eq!(why.as_deref(), Some("xtb-2: factsheet not read yet"));
    let wide = bench.submit(goto(4.0, 2.0));
    bench.run_ms(1000);
    assert!(bench.robot_of(wide).is_some(), "where the widest fits, any may go");
    bench.dispatcher.set_factsheet(bench.now_ms, &name("xtb-2"), &[], Some(truck));
    bench.run_ms(30_000);
    let robot = bench.dispatcher.history(id).unwrap().task.robot;
    assert_eq!((bench.state(id), robot), (TaskState::Done, Some(name("xtb-2"))));
}
