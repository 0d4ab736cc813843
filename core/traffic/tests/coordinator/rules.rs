//! What traffic control does with single reports, without a fleet that drives.

use crate::scenes::pose;
use crate::toy::room;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::{Car, MapPose, Path, Piece};
use xtb_traffic::coordinator::{Coordinator, Guide, MOST_TRUCKS, PlannedGoal, ReportedRobot, RouteReport};

/// A room of 6 m × 4 m with a box in it.
fn coordinator() -> Coordinator {
    let room = room(6.0, 4.0, &[[4.0, 1.0, 0.5, 2.0]]);
    Coordinator::new(Arc::new(room), 1)
}

fn view(name: &str, here: MapPose, goal: Option<(u128, f64, f64)>) -> ReportedRobot {
    ReportedRobot {
        name: name.to_owned(),
        epoch: 1,
        car: Some(Car::of(&VehicleConfig::default())),
        pose: here,
        sigma_m: 0.01,
        speed_mps: 0.0,
        goal: goal.map(|(id, x_m, y_m)| PlannedGoal { id, x_m, y_m, yaw_rad: None }),
        route: None,
        blocked_at_m: None,
        drives: true,
        age_ms: 0,
    }
}

/// Reports these every 0.2 s and solves jobs at once; what each is told in the end.
fn listen(coordinator: &mut Coordinator, from_ms: u64, views: &[ReportedRobot]) -> Vec<Guide> {
    let mut guides = Vec::new();
    for turn in 0..15 {
        let now = Stamp::from_ms(from_ms + 200 * turn);
        views.iter().for_each(|view| coordinator.robot(now, view.clone()));
        let told = coordinator.tick(now);
        guides = views.iter().map(|view| told[&view.name].clone()).collect();
        while let Some(job) = coordinator.job(now) {
            coordinator.planned(now, job.solve(&mut || true));
        }
    }
    guides
}

#[test]
fn who_has_not_said_what_car_it_is_is_not_led_and_is_driven_around() {
    let mut coordinator = coordinator();
    let unknown = |car| ReportedRobot { car, ..view("b", pose(2.0, 2.0, 0.0), Some((2, 1.0, 3.0))) };
    let a = view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0)));
    let told = listen(&mut coordinator, 1000, &[a.clone(), unknown(None)]);
    assert!(told[0].path.is_some() && told[1].path.is_none(), "{told:?}");
    assert_eq!(coordinator.names(), (vec!["a".to_owned()], vec!["b".to_owned()]));
    // Its body may be larger than a truck's.
    let way = told[0].path.as_ref().unwrap();
    let steps = (0..).map(|step| f64::from(step) * 0.05).take_while(|at_m| *at_m < way.length_m());
    let car = Car::of(&VehicleConfig::default());
    let near = steps.map(|at_m| car.distance_m(&way.at(at_m).0, [2.0, 2.0])).fold(f64::MAX, f64::min);
    assert!(near > 0.45, "{near}");
    let told = listen(&mut coordinator, 20_000, &[a, unknown(Some(car))]);
    assert!(told[1].path.is_some(), "{:?}", told[1]);
}

#[test]
fn a_goal_without_a_heading_gets_a_way_and_one_in_a_box_a_reason() {
    let mut coordinator = coordinator();
    let views = [
        view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0))),
        view("b", pose(1.0, 3.0, 0.0), Some((2, 4.2, 2.0))),
    ];
    let guides = listen(&mut coordinator, 1000, &views);
    let end = guides[0].path.as_ref().unwrap().end();
    assert!((end.x_m - 3.0).hypot(end.y_m - 3.0) < 1e-6 && guides[0].release_m > 0.5);
    assert_eq!(guides[1].path, None);
    assert_eq!(guides[1].reason.as_deref(), Some("the goal is not free on the map"));
}

#[test]
fn a_reported_speed_that_no_truck_drives_takes_no_more_floor_than_a_fast_one() {
    let mut coordinator = Coordinator::new(Arc::new(room(20.0, 4.0, &[])), 1);
    let a = view("a", pose(0.5, 3.5, 0.0), Some((1, 1.5, 3.5)));
    let pretends = ReportedRobot { speed_mps: 2000.0, drives: false, ..view("b", pose(19.0, 3.5, PI), None) };
    let told = listen(&mut coordinator, 1000, &[a, pretends]);
    assert!(told[0].path.is_some() && told[0].cruise_mps > 0.0, "{told:?}");
}

#[test]
fn nothing_is_released_before_it_has_listened() {
    let mut coordinator = coordinator();
    let now = Stamp::from_ms(1000);
    coordinator.robot(now, view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0))));
    coordinator.tick(now);
    assert!(coordinator.job(now).is_none());
    let later = Stamp::from_ms(2600);
    coordinator.robot(later, view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0))));
    coordinator.tick(later);
    assert!(coordinator.job(later).is_some());
    assert!(coordinator.job(later).is_none(), "one job is out at a time");
}

/// Reports these until it has listened for long enough; when that is.
fn told(coordinator: &mut Coordinator, views: &[ReportedRobot]) -> Stamp {
    let mut now = Stamp::ZERO;
    for turn in 0..10 {
        now = Stamp::from_ms(1000 + 200 * turn);
        views.iter().for_each(|view| coordinator.robot(now, view.clone()));
        coordinator.tick(now);
    }
    now
}

#[test]
fn far_groups_are_planned_apart_and_neither_waits_for_the_other() {
    let mut coordinator = Coordinator::new(Arc::new(room(40.0, 6.0, &[])), 1);
    let views = [
        view("a", pose(1.0, 1.0, 0.0), Some((1, 4.0, 3.0))),
        view("b", pose(4.0, 5.0, 3.0), Some((2, 1.0, 3.0))),
        view("c", pose(36.0, 1.0, 0.0), Some((3, 38.0, 3.0))),
    ];
    let now = told(&mut coordinator, &views);
    let (west, east) = (coordinator.job(now).unwrap(), coordinator.job(now).unwrap());
    assert!(coordinator.job(now).is_none());
    let east = east.solve(&mut || true);
    assert_eq!(east.counts(), (1, 0));
    coordinator.planned(now, east);
    let guides = coordinator.tick(now);
    assert!(guides["c"].path.is_some() && guides["c"].release_m > 0.5, "{:?}", guides["c"]);
    assert!(guides["a"].path.is_none() && guides["b"].path.is_none());
    let west = west.solve(&mut || true);
    assert_eq!(west.counts(), (2, 0));
    coordinator.planned(now, west);
    let guides = coordinator.tick(now);
    assert!(views.iter().all(|view| guides[&view.name].release_m > 0.0), "{guides:?}");
}

#[test]
fn a_way_that_meets_one_that_was_planned_elsewhere_meanwhile_is_not_used_but_looked_for_again() {
    // a has to go all around the wall, through the gap at its end; b goes through the gap.
    let wall = [[3.9, 0.0, 0.2, 18.4]];
    let mut coordinator = Coordinator::new(Arc::new(room(8.0, 20.0, &wall)), 1);
    let views = [
        view("a", pose(2.0, 1.0, 1.57), Some((1, 6.0, 1.0))),
        view("b", pose(2.0, 19.2, 0.0), Some((2, 6.0, 19.2))),
    ];
    let now = told(&mut coordinator, &views);
    let (one, other) = (coordinator.job(now).unwrap(), coordinator.job(now).unwrap());
    let (one, other) = (one.solve(&mut || true), other.solve(&mut || true));
    assert_eq!((one.counts(), other.counts()), ((1, 0), (1, 0)));
    coordinator.planned(now, other);
    coordinator.planned(now, one);
    assert_eq!(coordinator.counters().outdated, 1);
    let guides = coordinator.tick(now);
    assert!(guides["a"].path.is_none() && guides["b"].path.is_some());
    let guides = listen(&mut coordinator, now.ms() + 200, &views);
    assert!(guides.iter().all(|guide| guide.path.is_some()), "{guides:?}");
    assert!(coordinator.is_acyclic());
}

#[test]
fn among_many_one_whose_goal_is_another_ones_place_gets_a_way_in_the_same_job_as_that_one() {
    let mut coordinator = Coordinator::new(Arc::new(room(22.0, 20.0, &[])), 1);
    // a, which is asked first, wants to where b stands; the rest are many and drive north.
    let mut views = vec![
        view("a", pose(2.0, 2.0, 0.0), Some((1, 10.0, 9.0))),
        view("b", pose(10.0, 9.0, 3.0), Some((2, 2.0, 18.0))),
    ];
    for index in 0..16_u32 {
        let x_m = 2.0 + 1.2 * f64::from(index);
        views.push(view(&format!("t{index}"), pose(x_m, 4.0, PI / 2.0), Some((3, x_m, 16.0))));
    }
    let now = told(&mut coordinator, &views);
    let job = coordinator.job(now).unwrap();
    assert!(coordinator.job(now).is_none(), "they are one region");
    coordinator.planned(now, job.solve(&mut || true));
    let guides = coordinator.tick(now);
    assert!(guides["a"].path.is_some() && guides["b"].path.is_some(), "{:?}", guides["a"]);
    assert!(coordinator.is_acyclic());
}

#[test]
fn one_that_waits_for_a_way_itself_turns_away_only_who_is_near_and_if_many_wait_only_who_has_stood() {
    let led_with_b_at = |x_m: f64, goal, others: u32, turns: u64| {
        let mut coordinator = Coordinator::new(Arc::new(room(20.0, 8.0, &[])), 1);
        let mut views = vec![view("a", pose(1.0, 2.0, 0.0), Some((1, 18.0, 2.0)))];
        let told = listen(&mut coordinator, 1000, &views);
        assert!(told[0].path.is_some(), "{told:?}");
        views.push(view("b", pose(x_m, 2.0, 0.0), goal));
        let place = |other: u32| pose(1.0 + f64::from(other % 16), 4.5 + f64::from(other / 16), 0.0);
        views.extend((0..others).map(|other| view(&format!("t{other}"), place(other), Some((3, 10.0, 3.5)))));
        for turn in 0..turns {
            let now = Stamp::from_ms(5000 + 200 * turn);
            views.iter().for_each(|view| coordinator.robot(now, view.clone()));
            coordinator.tick(now);
        }
        coordinator.names().0
    };
    let goal = Some((2, 18.0, 1.0));
    assert_eq!(led_with_b_at(12.0, goal, 0, 15), ["a"]);
    assert!(led_with_b_at(4.0, goal, 0, 15).is_empty());
    assert!(led_with_b_at(12.0, None, 0, 15).is_empty(), "it stands there for good");
    assert!(led_with_b_at(4.0, goal, 47, 15).is_empty());
    assert_eq!(led_with_b_at(4.0, goal, 48, 15), ["a"]);
    assert!(led_with_b_at(4.0, goal, 48, 60).is_empty());
    assert!(led_with_b_at(12.0, None, 48, 15).is_empty());
}

#[test]
fn a_result_for_an_earlier_goal_is_not_used() {
    let mut coordinator = coordinator();
    coordinator.tick(Stamp::from_ms(1000));
    let now = Stamp::from_ms(3000);
    coordinator.robot(now, view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0))));
    let job = coordinator.job(now).unwrap();
    coordinator.robot(now, view("a", pose(1.0, 1.0, 0.0), Some((2, 3.0, 1.0))));
    coordinator.planned(now, job.solve(&mut || true));
    assert_eq!(coordinator.tick(now)["a"].path, None);
    let views = [view("a", pose(1.0, 1.0, 0.0), Some((2, 3.0, 1.0)))];
    let guides = listen(&mut coordinator, 3200, &views);
    assert!((guides[0].path.as_ref().unwrap().end().y_m - 1.0).abs() < 1e-6);
}

#[test]
fn what_an_earlier_coordinator_released_stays_so() {
    let mut path = Path::standing(pose(1.0, 1.0, 0.0));
    path.push(Piece { length_m: 2.0, curvature_per_m: 0.0 });
    let mut one = view("a", pose(1.2, 1.0, 0.0), Some((1, 3.0, 3.0)));
    one.route = Some(RouteReport { plan: 41, path: path.clone(), done_m: 0.2, release_m: 1.0 });
    let mut coordinator = coordinator();
    coordinator.robot(Stamp::from_ms(1000), one.clone());
    let guide = coordinator.tick(Stamp::from_ms(1000)).remove("a").unwrap();
    assert_eq!((guide.plan, guide.release_m, guide.path.as_ref()), (41, 1.0, Some(&path)));
    let guide = listen(&mut coordinator, 1200, &[one]).remove(0);
    let next = guide.path.unwrap();
    assert!(guide.plan > 41 && guide.release_m >= 1.0);
    assert_eq!(next.start, path.start);
    assert!((next.at(1.0).0.x_m - 2.0).abs() < 1e-9 && (next.end().y_m - 3.0).abs() < 1e-6);
}

#[test]
fn an_older_report_changes_nothing_and_too_many_trucks_are_counted() {
    let mut coordinator = coordinator();
    let now = Stamp::from_ms(5000);
    coordinator.robot(now, view("a", pose(1.0, 1.0, 0.0), Some((1, 3.0, 3.0))));
    coordinator.robot(now, ReportedRobot { age_ms: 500, ..view("a", pose(1.0, 1.0, 0.0), None) });
    assert_eq!(coordinator.tick(now)["a"].goal, Some((1, 1)));
    for index in 0..MOST_TRUCKS + 3 {
        coordinator.robot(now, view(&format!("t{index}"), pose(1.0, 1.0, 0.0), None));
    }
    assert_eq!(coordinator.tick(now).len(), MOST_TRUCKS);
    assert_eq!(coordinator.counters().ignored, 4);
}

#[test]
fn a_truck_that_is_one_too_many_is_told_so_by_name_until_there_is_room() {
    let mut coordinator = coordinator();
    let now = Stamp::from_ms(5000);
    for index in 0..MOST_TRUCKS {
        coordinator.robot(now, view(&format!("t{index}"), pose(1.0, 1.0, 0.0), None));
    }
    assert!(coordinator.refused().is_empty());
    let late = view("late", pose(1.0, 1.0, 0.0), Some((7, 3.0, 3.0)));
    coordinator.robot(now, late.clone());
    coordinator.robot(now, view("idle", pose(1.0, 1.0, 0.0), None));
    assert!(!coordinator.tick(now).contains_key("late"));
    let told = coordinator.refused();
    assert_eq!((told["late"].goal, told["idle"].goal), (Some((1, 7)), None));
    let reason = told["late"].reason.clone().unwrap();
    assert!(reason.contains(&MOST_TRUCKS.to_string()), "{reason}");
    assert_eq!((told.len(), &told["idle"].reason), (2, &None));
    coordinator.forget("t7");
    coordinator.robot(now.plus_ms(200), late);
    let guides = coordinator.tick(now.plus_ms(200));
    assert!(guides.contains_key("late") && !coordinator.refused().contains_key("late"));
    coordinator.tick(now.plus_ms(60_000));
    assert!(coordinator.refused().is_empty(), "of whom nothing is heard any more");
}

/// One of 2 m to the east, of which 1 m is released.
fn report(plan: u64) -> RouteReport {
    let mut path = Path::standing(pose(1.0, 1.0, 0.0));
    path.push(Piece { length_m: 2.0, curvature_per_m: 0.0 });
    RouteReport { plan, path, done_m: 0.2, release_m: 1.0 }
}

#[test]
fn a_reported_route_that_no_robot_would_follow_is_not_taken_over() {
    let mut endless = report(41);
    // As many arcs as a track may have, each as long as it may be: bent, as straights in a row are one piece.
    for arc in 0..255 {
        endless.path.push(Piece { length_m: 1000.0, curvature_per_m: f64::from(arc % 2) * 0.1 });
    }
    let beyond = RouteReport { release_m: 2.1, ..report(41) };
    for route in [endless, beyond] {
        let mut coordinator = coordinator();
        let route = Some(route);
        let one = ReportedRobot { route, ..view("a", pose(1.2, 1.0, 0.0), Some((1, 3.0, 3.0))) };
        coordinator.robot(Stamp::from_ms(1000), one);
        assert_eq!(coordinator.tick(Stamp::from_ms(1000))["a"].path, None);
    }
}

#[test]
fn a_reported_plan_that_nobody_can_have_counted_to_does_not_end_the_counting() {
    let mut coordinator = coordinator();
    let route = Some(report(u64::MAX));
    let one = ReportedRobot { route, ..view("a", pose(1.2, 1.0, 0.0), Some((1, 3.0, 3.0))) };
    let guide = listen(&mut coordinator, 1000, &[one]).remove(0);
    assert!((1..100).contains(&guide.plan), "{}", guide.plan);
    assert!(guide.path.is_some(), "it is led from where it stands");
}

#[test]
fn one_that_nobody_has_heard_of_for_long_makes_room_for_one_that_speaks_unless_it_holds_a_release() {
    let mut coordinator = coordinator();
    let stands = |index: usize| view(&format!("t{index}"), pose(1.0, 1.0, 0.0), None);
    let route = Some(report(41));
    let holds = ReportedRobot { route, ..view("t0", pose(1.2, 1.0, 0.0), Some((1, 3.0, 3.0))) };
    coordinator.robot(Stamp::from_ms(1000), holds);
    for index in 1..MOST_TRUCKS {
        coordinator.robot(Stamp::from_ms(1000 + index as u64), stands(index));
    }
    let known = |coordinator: &Coordinator| {
        let (led, around) = coordinator.names();
        led.into_iter().chain(around).collect::<Vec<String>>()
    };
    // Some minutes are no reason: it may stand in a doorway.
    coordinator.robot(Stamp::from_ms(500_000), stands(1000));
    assert_eq!((known(&coordinator).len(), coordinator.counters().ignored), (MOST_TRUCKS, 1));
    assert!(!known(&coordinator).contains(&"t1000".to_owned()));
    let late = Stamp::from_ms(700_000);
    // One that is as silent itself displaces nobody.
    coordinator.robot(late, ReportedRobot { age_ms: 650_000, ..stands(1001) });
    assert!(!known(&coordinator).contains(&"t1001".to_owned()));
    coordinator.robot(late, stands(1002));
    let names = known(&coordinator);
    let has = |name: &str| names.iter().any(|known| known == name);
    assert_eq!(names.len(), MOST_TRUCKS);
    assert!(has("t0") && !has("t1") && has("t2") && has("t1002"), "{names:?}");
    assert_eq!(coordinator.counters().ignored, 2);
}

/// A lane for one, in which two want past each other, and a room beside it.
fn lane_and_room() -> Coordinator {
    let room = room(8.0, 6.0, &[[0.0, 0.0, 8.0, 1.5], [0.0, 2.4, 8.0, 1.6]]);
    Coordinator::new(Arc::new(room), 1)
}

fn east_and_west() -> [ReportedRobot; 2] {
    let east = view("a", pose(1.0, 1.95, 0.0), Some((1, 7.0, 1.95)));
    [east, view("b", pose(7.0, 1.95, PI), Some((2, 1.0, 1.95)))]
}

/// Reports these every 0.2 s for 100 s; when each was first told a reason to give its goal up, in ms, and which.
fn reasons(coordinator: &mut Coordinator, views: &[ReportedRobot]) -> Vec<(u64, String)> {
    let mut first = BTreeMap::new();
    for now_ms in (0..100_000).step_by(200) {
        let now = Stamp::from_ms(now_ms);
        views.iter().for_each(|view| coordinator.robot(now, view.clone()));
        for (name, guide) in coordinator.tick(now) {
            if let Some(reason) = guide.reason {
                first.entry(name).or_insert((now_ms, reason));
            }
        }
        if let Some(job) = coordinator.job(now) {
            coordinator.planned(now, job.solve(&mut || true));
        }
    }
    first.into_values().collect()
}

#[test]
fn one_of_two_that_wait_for_each_other_gives_up_also_while_a_third_one_moves_elsewhere() {
    let [a, b] = east_and_west();
    let c = ReportedRobot { speed_mps: 0.4, ..view("c", pose(4.0, 5.0, 0.0), None) };
    let told = reasons(&mut lane_and_room(), &[a, b, c]);
    assert!(matches!(told[..], [(60_000..75_000, _)]), "{told:?}");
}

#[test]
fn one_that_waits_for_one_that_moves_is_not_told_to_give_up() {
    let [a, b] = east_and_west();
    let told = reasons(&mut lane_and_room(), &[a, ReportedRobot { speed_mps: 0.3, ..b }]);
    assert!(told.is_empty(), "{told:?}");
}

/// A truck that has been led from here to there, and reports from then on that this place is taken; after 10 s of that,
/// the pieces of its first way and of its next one, and of the way of another one that is led across the same place.
fn held_up_at(table: &[[f64; 4]], here: MapPose, to_m: [f64; 2], at_m: [f64; 2]) -> [Vec<Piece>; 3] {
    let mut coordinator = Coordinator::new(Arc::new(room(12.0, 10.0, table)), 1);
    let pieces = |guide: &Guide| guide.path.as_ref().map_or_else(Vec::new, |path| path.pieces.clone());
    let mut a = view("a", here, Some((1, to_m[0], to_m[1])));
    let guide = listen(&mut coordinator, 1000, std::slice::from_ref(&a)).remove(0);
    let (first, path) = (pieces(&guide), guide.path.unwrap());
    assert!(guide.release_m > 0.3, "{} m", guide.release_m);
    a.route = Some(RouteReport { plan: guide.plan, path, done_m: 0.0, release_m: guide.release_m });
    a.blocked_at_m = Some(at_m);
    let mut told = Vec::new();
    for turn in 0..4 {
        told = listen(&mut coordinator, 4000 + 3000 * turn, std::slice::from_ref(&a));
    }
    let across = view("b", pose(at_m[0], 1.0, PI / 2.0), Some((2, at_m[0], 5.0)));
    let both = listen(&mut coordinator, 16_000, &[a, across]);
    [first, pieces(&told[0]), pieces(&both[1])]
}

#[test]
fn one_that_is_held_up_right_ahead_of_its_bumper_is_led_astern_first_and_nobody_else_around_that() {
    for ahead_m in [0.05, 0.12, 0.2] {
        let front_m = Car::of(&VehicleConfig::default()).front_m;
        let at_m = [2.0 + front_m + ahead_m, 3.0];
        let [first, own, others] = held_up_at(&[], pose(2.0, 3.0, 0.0), [6.0, 3.0], at_m);
        assert!(first[0].length_m > 0.0 && own[0].length_m < -0.1, "{ahead_m} m: {first:?}, {own:?}");
        assert!(!others.is_empty(), "{ahead_m} m");
    }
}

#[test]
fn one_that_is_held_up_right_behind_its_bumper_turns_away_from_a_table_by_small_moves() {
    let (table, here) = ([3.4, 5.2, 1.2, 0.6], pose(4.993, 6.256, -1.955));
    let [first, own, _] = held_up_at(&[table], here, [6.0, 9.1], [4.975, 6.675]);
    assert!(first[0].length_m < 0.0, "it begins astern: {first:?}");
    assert!(own.first().is_some_and(|piece| piece.length_m > 0.05), "{own:?}");
}
