//! Who does what: cheapest, fair, and fast.

use crate::robots::FakeRobot;
use std::collections::BTreeSet;
use xtb_dispatch::assign::auction::RAISE_M;
use xtb_dispatch::assign::{Candidate, Demand, INFEASIBLE, assign, auction, exact, solve};
use xtb_dispatch::{OpenTravelCost, TravelCost};
use xtb_nav::geometry::reeds_shepp;
use xtb_nav::rooms::Draw;
use xtb_nav::{Car, Gears, MapPose};
use xtb_protocol::messages::{MAX_REPORTED_M, Message, RobotState, TaskId, Waypoint};

const CAR: Car = Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.4, gears: Gears::BOTH };

fn costs(draw: &mut Draw, rows: usize, columns: usize, never: f64) -> Vec<f32> {
    let mut one = || if draw.uniform(0.0, 1.0) < never { INFEASIBLE } else { draw.uniform(0.0, 50.0) as f32 };
    (0..rows * columns).map(|_| one()).collect()
}

/// Pairs, and what they come to.
fn sum(cost: &[f32], columns: usize, found: &[Option<usize>]) -> (usize, f64) {
    let pairs = found.iter().enumerate().filter_map(|(row, column)| Some(cost[row * columns + (*column)?]));
    pairs.fold((0, 0.0), |(n, total), cost| (n + 1, total + f64::from(cost)))
}

/// The most pairs, of these the cheapest: every permutation is tried.
fn brute(cost: &[f32], columns: usize, row: usize, used: &mut Vec<bool>) -> (usize, f64) {
    if row * columns >= cost.len() {
        return (0, 0.0);
    }
    let mut best = brute(cost, columns, row + 1, used);
    for column in 0..columns {
        let one = cost[row * columns + column];
        if used[column] || one == INFEASIBLE {
            continue;
        }
        used[column] = true;
        let (n, total) = brute(cost, columns, row + 1, used);
        used[column] = false;
        let this = (n + 1, total + f64::from(one));
        if this.0 > best.0 || (this.0 == best.0 && this.1 < best.1) {
            best = this;
        }
    }
    best
}

#[test]
fn small_assignments_are_the_best_of_all() {
    let mut draw = Draw::new(1);
    for never in [0.0, 0.3, 0.7] {
        for _ in 0..200 {
            let rows = draw.whole(1, 5) as usize;
            let columns = draw.whole(rows as i64, 6) as usize;
            let cost = costs(&mut draw, rows, columns, never);
            let best = brute(&cost, columns, 0, &mut vec![false; columns]);
            let (n, total) = sum(&cost, columns, &exact::solve(&cost, rows, columns));
            assert_eq!(n, best.0, "{rows} × {columns}");
            assert!((total - best.1).abs() < 1e-3, "{total}, best {}", best.1);
        }
    }
}

#[test]
fn large_assignments_are_within_a_raise_for_each_row_of_the_best() {
    let mut draw = Draw::new(2);
    for (rows, columns) in [(50, 50), (50, 100), (100, 300)] {
        let cost = costs(&mut draw, rows, columns, 0.0);
        let (n, best) = sum(&cost, columns, &exact::solve(&cost, rows, columns));
        let (m, total) = sum(&cost, columns, &auction::solve(&cost, rows, columns));
        assert_eq!((n, m), (rows, rows));
        assert!(total <= best + rows as f64 * f64::from(RAISE_M) + 1e-3, "{total}, best {best}");
    }
}

#[test]
fn an_auction_leaves_nobody_without_what_is_left() {
    let mut draw = Draw::new(3);
    for _ in 0..50 {
        let cost = costs(&mut draw, 30, 40, 0.8);
        let found = auction::solve(&cost, 30, 40);
        let taken: BTreeSet<usize> = found.iter().flatten().copied().collect();
        assert_eq!(taken.len(), found.iter().flatten().count(), "a column twice");
        for (row, column) in found.iter().enumerate() {
            assert!(column.is_none_or(|column| cost[row * 40 + column] != INFEASIBLE));
            let left = (0..40).any(|c| !taken.contains(&c) && cost[row * 40 + c] != INFEASIBLE);
            assert!(column.is_some() || !left, "row {row} goes without");
        }
    }
}

/// Found as 101 robots that said they were 1e16 m away: their bids displaced each other for ever.
#[test]
fn an_auction_ends_whatever_the_costs_are_and_each_column_goes_once() {
    let mut draw = Draw::new(6);
    let large = [0.0, 1.0, 50.0, 4_194_304.0, 1e9, 1e16, 1e30, f32::MAX];
    for (rows, columns) in [(2, 2), (5, 5), (30, 40), (101, 202)] {
        let size = rows * columns;
        let mut all: Vec<Vec<f32>> = large.iter().map(|cost| vec![*cost; size]).collect();
        all.push(vec![INFEASIBLE; size]);
        for _ in 0..5 {
            let kinds = large.len() as i64;
            // One more than there are: a pair that may not be.
            let one = |draw: &mut Draw| *large.get(draw.whole(0, kinds) as usize).unwrap_or(&INFEASIBLE);
            all.push((0..size).map(|_| one(&mut draw)).collect());
            all.push((0..size).map(|_| one(&mut draw) * draw.uniform(0.0, 1.0) as f32).collect());
        }
        // Near columns for which all fight, and one that is far.
        all.push((0..size).map(|at| if at % columns == 0 { 1e6 } else { (at % 3) as f32 }).collect());
        for cost in all {
            // INFEASIBLE times 0 is no cost.
            let cost: Vec<f32> = cost.iter().map(|c| if c.is_nan() { INFEASIBLE } else { *c }).collect();
            let found = auction::solve(&cost, rows, columns);
            let taken: BTreeSet<usize> = found.iter().flatten().copied().collect();
            assert_eq!(taken.len(), found.iter().flatten().count(), "a column twice");
            for (row, column) in found.iter().enumerate() {
                assert!(column.is_none_or(|column| cost[row * columns + column] != INFEASIBLE));
                let left = (0..columns).any(|c| !taken.contains(&c) && cost[row * columns + c] != INFEASIBLE);
                assert!(column.is_some() || !left, "row {row} goes without");
            }
        }
    }
}

#[test]
fn a_state_of_a_place_or_speed_that_no_robot_can_have_is_refused() {
    let sound = FakeRobot::new("xtb-1", (999.0, -1200.0)).state(1000);
    assert!(sound.validate().is_ok(), "one that has driven on beyond the farthest goal");
    for far_m in [-MAX_REPORTED_M * 1.01, 1e16, f64::NAN] {
        for at in [(far_m, 0.0), (0.0, far_m)] {
            assert!(FakeRobot::new("xtb-1", at).state(1000).validate().is_err(), "{at:?}");
        }
    }
    assert!(RobotState { speed_mps: Some(1e16), ..sound }.validate().is_err());
}

#[test]
fn more_rows_than_columns_is_the_same_the_other_way_round() {
    let pairs: BTreeSet<(usize, usize)> = solve(&[1.0, 9.0, 9.0, 1.0, 0.5, 9.0], 3, 2).into_iter().collect();
    assert_eq!(pairs, [(2, 0), (1, 1)].into_iter().collect());
}

fn fleet(draw: &mut Draw, robots: usize, tasks: usize, depot: bool) -> (Vec<Candidate>, Vec<Demand>) {
    let reach = if depot { 1.0 } else { 50.0 };
    let robots = (0..robots).map(|_| {
        let (x_m, y_m) = (draw.uniform(-reach, reach), draw.uniform(-reach, reach));
        Candidate { pose: MapPose { x_m, y_m, yaw_rad: draw.uniform(-3.0, 3.0) }, car: CAR, extra_m: 0.0 }
    });
    let robots = robots.collect();
    let tasks = (0..tasks).map(|i| {
        let (x_m, y_m) = (draw.uniform(-50.0, 50.0), draw.uniform(-50.0, 50.0));
        let level = draw.whole(3, 6) as u64;
        Demand { id: TaskId::new(i as u64), level, first: Some(Waypoint { x_m, y_m, yaw_rad: None }) }
    });
    (robots, tasks.collect())
}

/// In how much time is told by the example `assigning`.
#[test]
fn of_ten_thousand_tasks_each_of_a_thousand_robots_gets_one() {
    for depot in [false, true] {
        let (robots, tasks) = fleet(&mut Draw::new(4), 1000, 10_000, depot);
        let pairs = assign(&tasks, &robots, &OpenTravelCost, &|_, _| Some(0.0));
        let taken: BTreeSet<usize> = pairs.iter().map(|(task, _)| *task).collect();
        let given: BTreeSet<usize> = pairs.iter().map(|(_, robot)| *robot).collect();
        assert_eq!((pairs.len(), taken.len(), given.len()), (1000, 1000, 1000));
    }
}

#[test]
fn higher_levels_go_first_and_no_free_robot_is_left_with_a_task_it_could_do() {
    let (robots, tasks) = fleet(&mut Draw::new(5), 40, 100, false);
    // The first thirty robots may do the first ten tasks only.
    let fits = |task: usize, robot: usize| (robot >= 30 || task < 10).then_some(0.0);
    let pairs = assign(&tasks, &robots, &OpenTravelCost, &fits);
    assert_eq!(pairs.len(), 20, "ten by the many, ten by the free");
    let lowest = pairs.iter().filter(|(_, robot)| *robot >= 30).map(|(task, _)| tasks[*task].level).min();
    let taken: BTreeSet<usize> = pairs.iter().map(|(task, _)| *task).collect();
    let left = (10..100).filter(|task| !taken.contains(task)).map(|task| tasks[task].level).max();
    assert!(lowest >= left, "{lowest:?} before {left:?}");
    assert_eq!(pairs, assign(&tasks, &robots, &OpenTravelCost, &fits), "the same each time");
}

/// Against the best of 360 yaws on arrival.
#[test]
fn distances_to_far_points_are_those_of_the_shortest_ways() {
    let mut draw = Draw::new(6);
    for _ in 0..300 {
        let from = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-3.0, 3.0) };
        let (angle, far_m) = (draw.uniform(-3.2, 3.2), draw.uniform(1.6, 10.0));
        let (x_m, y_m) = (far_m * angle.cos(), far_m * angle.sin());
        let yaws = (0..360).map(|deg| f64::from(deg).to_radians());
        let ways = yaws.map(|yaw_rad| reeds_shepp::distance_m(&from, &MapPose { x_m, y_m, yaw_rad }, 0.4));
        let best_m = ways.fold(f64::INFINITY, f64::min);
        let ours_m = OpenTravelCost.distance_m(&CAR, &from, &Waypoint { x_m, y_m, yaw_rad: None });
        assert!((-0.01..0.1).contains(&(ours_m - best_m)), "{ours_m}, best {best_m} to {x_m} {y_m}");
        let estimate_m = OpenTravelCost.estimate_m(&CAR, &from, &Waypoint { x_m, y_m, yaw_rad: None });
        assert!((estimate_m - best_m).abs() < 0.4, "{estimate_m}, best {best_m}");
    }
}

#[test]
fn a_place_ahead_is_nearer_than_one_beside() {
    let pose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
    let at = |x_m, y_m| Waypoint { x_m, y_m, yaw_rad: None };
    for far in [
        OpenTravelCost.distance_m(&CAR, &pose, &at(0.0, 1.0)),
        OpenTravelCost.estimate_m(&CAR, &pose, &at(0.0, 1.0)),
    ] {
        assert!(far > 1.05, "{far}");
    }
    assert!((OpenTravelCost.distance_m(&CAR, &pose, &at(1.0, 0.0)) - 1.0).abs() < 1e-6);
}
