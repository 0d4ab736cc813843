//! Whole problems: random ones of the public families (own generator, own seeds), and rooms in which
//! somebody has to give way.

use super::*;
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;
use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::planner::space::OneWay;
use xtb_nav::{Car, Cell, Gears, Grid, Map, MapPose, Zone, ZoneKind};

const PUBLIC_CAR: Car =
    Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: Gears::BOTH };
const SQUARE: Car = Car { front_m: 1.0, rear_m: 1.0, half_width_m: 0.8, radius_m: 2.0, gears: Gears::BOTH };

/// Between two starts, or two goals: what the public instances keep.
const SPACING: f64 = 5.6;

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

/// Like the public instances: discs anywhere, whole-numbered places in four directions, off the discs
/// and a car's length or two from each other.
fn random(side: f64, discs: usize, cars: usize, seed: u64) -> Problem {
    let mut random = Pcg32::new(seed, 11);
    let mut uniform =
        |low: f64, high: f64| low + (high - low) * f64::from(random.next_u32()) / 4_294_967_296.0;
    let obstacles: Vec<Obstacle> = (0..discs)
        .map(|_| Obstacle::Disc { x_m: uniform(0.0, side), y_m: uniform(0.0, side), radius_m: 0.8 })
        .collect();
    let mut free_place = |taken: &[MapPose]| loop {
        let direction = libm::floor(uniform(0.0, 4.0));
        let place = pose(
            libm::floor(uniform(2.0, side - 1.0)),
            libm::floor(uniform(2.0, side - 1.0)),
            wrap_rad(direction * FRAC_PI_2),
        );
        let clear = obstacles.iter().all(|disc| PUBLIC_CAR.distance_m(&place, disc.middle_m()) > 0.8);
        let far = |other: &MapPose| libm::hypot(other.x_m - place.x_m, other.y_m - place.y_m) > SPACING;
        if clear && taken.iter().all(far) {
            return place;
        }
    };
    let (mut starts, mut goals) = (Vec::new(), Vec::new());
    for _ in 0..cars {
        starts.push(free_place(&starts));
        goals.push(free_place(&goals));
    }
    let tasks = starts.into_iter().zip(goals).enumerate().map(|(i, (start, goal))| CarTask {
        name: format!("agent{i}"),
        car: PUBLIC_CAR,
        start,
        goal,
    });
    Problem {
        bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: side, north_m: side },
        cars: tasks.collect(),
        obstacles,
        one_way: None,
        step_m: 2.118,
        clearance_m: 0.02,
        tolerance: Tolerance::default(),
        by_order: false,
    }
}

/// A problem in a room of this size.
fn room(wide: f64, deep: f64, obstacles: Vec<Obstacle>, ways: &[(MapPose, MapPose)]) -> Problem {
    let task = |(i, (start, goal)): (usize, &(MapPose, MapPose))| CarTask {
        name: format!("car-{i}"),
        car: SQUARE,
        start: *start,
        goal: *goal,
    };
    Problem {
        bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: wide, north_m: deep },
        obstacles,
        one_way: None,
        cars: ways.iter().enumerate().map(task).collect(),
        step_m: 1.4,
        clearance_m: 0.05,
        tolerance: Tolerance::default(),
        by_order: false,
    }
}

/// A wall between two corners.
fn block(west: f64, south: f64, east: f64, north: f64) -> Obstacle {
    Obstacle::Box {
        middle: pose((west + east) / 2.0, (south + north) / 2.0, 0.0),
        half_length_m: (east - west) / 2.0,
        half_width_m: (north - south) / 2.0,
    }
}

/// Answers "go on" so many times.
fn patience(times: usize) -> impl FnMut() -> bool {
    let mut left = times;
    move || {
        left = left.saturating_sub(1);
        left > 0
    }
}

fn solve(problem: &Problem, settings: &SolverSettings) -> Result<Schedule, Unsolved> {
    Solver::new(problem, &mut patience(1_000_000))?.solve(settings, &mut patience(20_000))
}

/// Solves with priorities and with repair alone; both must be free of contact.
fn solved(problem: &Problem) -> Schedule {
    let mut schedules = [true, false].map(|priorities_first| {
        let settings = SolverSettings { priorities_first, ..SolverSettings::default() };
        let schedule = solve(problem, &settings).unwrap();
        assert_eq!(check(problem, &schedule), Ok(()));
        schedule
    });
    std::mem::replace(&mut schedules[0], Schedule { ways: Vec::new() })
}

#[test]
fn crowded_random_maps_are_solved_without_contact() {
    for (cars, seed) in [(10, 1), (20, 2), (25, 3)] {
        let schedule = solved(&random(50.0, 25, cars, seed));
        assert_eq!(schedule.ways.len(), cars);
        assert!(schedule.makespan() < 60, "{}", schedule.makespan());
    }
}

#[test]
fn the_same_seed_gives_the_same_schedule() {
    let problem = random(50.0, 25, 12, 4);
    let once = |seed| solve(&problem, &SolverSettings { seed, ..SolverSettings::default() }).unwrap();
    assert_eq!(once(7), once(7));
}

#[test]
fn forty_cars_on_a_large_floor_are_solved_within_a_budget_and_then_only_get_better() {
    /// Questions whether to go on until the first schedule: twice what it takes.
    const BUDGET: usize = 220;
    let problem = random(120.0, 60, 40, 9);
    let solver = Solver::new(&problem, &mut patience(100_000)).unwrap();
    let cost = |solution: &Solution<'_>| (solution.schedule().makespan(), solution.schedule().flowtime());
    let run = || {
        let mut solution = solver.begin(&SolverSettings::default(), &mut patience(BUDGET)).unwrap();
        let first = cost(&solution);
        let mut before = first;
        for _ in 0..6 {
            solution.improve(&mut patience(40));
            let now = cost(&solution);
            assert!(now.0 <= before.0 && now.1 <= before.1, "{before:?} became {now:?}");
            before = now;
        }
        assert!(before < first, "{first:?} became {before:?}");
        solution.schedule()
    };
    let schedule = run();
    assert_eq!(check(&problem, &schedule), Ok(()));
    // The same seed and the same work, bit for bit the same.
    assert_eq!(run(), schedule);
}

#[test]
fn improving_ends_by_itself_when_nothing_becomes_shorter() {
    let ways = [(pose(4.0, 4.0, 0.0), pose(16.0, 4.0, 0.0)), (pose(4.0, 14.0, 0.0), pose(16.0, 14.0, 0.0))];
    let problem = room(20.0, 20.0, Vec::new(), &ways);
    let solver = Solver::new(&problem, &mut || true).unwrap();
    let mut solution = solver.begin(&SolverSettings::default(), &mut || true).unwrap();
    solution.improve(&mut || true);
    let best = solution.schedule();
    assert_eq!((best.makespan(), best.flowtime()), (9, 18));
    assert_eq!(solution.improve(&mut || true), 0);
}

#[test]
fn on_a_large_floor_the_way_around_a_long_wall_is_found() {
    // 14 m through the wall, ten times as far around its end.
    let walls = vec![block(60.0, 0.0, 62.0, 84.0)];
    let ways = [(pose(54.0, 8.0, 0.0), pose(68.0, 8.0, 0.0)), (pose(68.0, 16.0, PI), pose(54.0, 16.0, PI))];
    let schedule = solved(&room(120.0, 120.0, walls, &ways));
    assert!(schedule.ways[0].rows.iter().any(|row| row.pose.y_m > 84.0));
}

#[test]
fn five_trucks_drive_through_a_door_of_a_metre_wherever_they_come_from() {
    /// Searches that take a quarter of 2 s on one core.
    const BUDGET: usize = 40;
    // The trucks' own measures, with 0.27 m of look-out at both ends.
    let car = Car { front_m: 0.52, rear_m: 0.52, half_width_m: 0.2, radius_m: 0.39, gears: Gears::BOTH };
    let walls = vec![block(0.0, 3.95, 3.5, 4.05), block(4.5, 3.95, 8.0, 4.05)];
    for from_north in 0..=2 {
        let task = |i: u32| {
            let aside = f64::from(i) * 1.2 - 2.4;
            let yaw_rad = if i < from_north { -FRAC_PI_2 } else { FRAC_PI_2 };
            let (south, north) = (pose(4.0 + aside, 2.0, yaw_rad), pose(4.0 - aside, 6.0, yaw_rad));
            let (start, goal) = if i < from_north { (north, south) } else { (south, north) };
            CarTask { name: format!("xtb-{i}"), car, start, goal }
        };
        let cars = (0..5).map(task).collect();
        let problem = Problem { cars, step_m: 0.273, by_order: true, ..room(8.0, 8.0, walls.clone(), &[]) };
        let solver = Solver::new(&problem, &mut patience(1_000)).unwrap();
        for priorities_first in [true, false] {
            let settings = SolverSettings { priorities_first, ..SolverSettings::default() };
            let schedule = solver.solve(&settings, &mut patience(BUDGET));
            let schedule =
                schedule.unwrap_or_else(|error| panic!("{from_north}, {priorities_first}: {error}"));
            assert_eq!(check(&problem, &schedule), Ok(()));
        }
    }
}

#[test]
fn two_cars_swap_places_through_a_door() {
    let walls = vec![block(11.0, 0.0, 12.0, 8.0), block(11.0, 11.0, 12.0, 20.0)];
    let (west, east) = (pose(5.0, 10.0, 0.0), pose(18.0, 10.0, PI));
    let ways = [(west, pose(18.0, 10.0, 0.0)), (east, pose(5.0, 10.0, PI))];
    solved(&room(23.0, 20.0, walls, &ways));
}

#[test]
fn in_a_corridor_with_a_bay_one_backs_out_of_the_way() {
    // 3 m wide; the bay in its south wall lies behind where the eastern car starts.
    let walls = vec![block(0.0, 0.0, 20.0, 6.0), block(27.0, 0.0, 40.0, 6.0), block(0.0, 9.0, 40.0, 10.0)];
    let ways = [(pose(4.0, 7.5, 0.0), pose(36.0, 7.5, 0.0)), (pose(17.0, 7.5, PI), pose(4.0, 7.5, PI))];
    solved(&room(40.0, 10.0, walls, &ways));
}

#[test]
fn a_car_that_has_arrived_makes_room_for_one_that_comes_later() {
    // The second car's goal lies behind the first one's, in a dead end.
    let walls = vec![block(10.0, 0.0, 30.0, 6.0), block(10.0, 9.0, 30.0, 15.0)];
    let ways = [(pose(7.0, 7.5, 0.0), pose(14.0, 7.5, 0.0)), (pose(3.0, 3.0, 0.0), pose(26.0, 7.5, 0.0))];
    let schedule = solved(&room(30.0, 15.0, walls, &ways));
    assert!(schedule.ways[0].rows.len() > 5, "the first one has to wait for the second");
}

/// Two halls with two doors, the northern one to the west only, the southern one to the east; each of
/// two cars stands before the door that it may not take.
fn one_way_doors() -> Problem {
    let walls =
        vec![block(11.0, 0.0, 12.0, 4.0), block(11.0, 7.0, 12.0, 13.0), block(11.0, 16.0, 12.0, 20.0)];
    let ways = [(pose(4.0, 14.5, 0.0), pose(19.0, 14.5, 0.0)), (pose(19.0, 5.5, PI), pose(4.0, 5.5, PI))];
    let grid = Grid::free(0.5, [0.0, 0.0], 46, 40).unwrap();
    let zone = |name: &str, south: f64, heading_rad: f64| {
        let corners = vec![[10.0, south], [13.0, south], [13.0, south + 3.0], [10.0, south + 3.0]];
        Zone::new(name, ZoneKind::OneWay { heading_rad }, corners).unwrap()
    };
    let zones = vec![zone("in", 13.0, PI), zone("out", 4.0, 0.0)];
    let zones = OneWay::of(&Map::new("doors", grid, zones).unwrap());
    Problem { one_way: zones.map(Arc::new), ..room(23.0, 20.0, walls, &ways) }
}

#[test]
fn one_way_doors_are_taken_the_right_way_only() {
    let problem = one_way_doors();
    let schedule = solved(&problem);
    let northern = |car: usize| {
        schedule.ways[car].rows.iter().any(|row| (row.pose.x_m - 11.5).abs() < 1.4 && row.pose.y_m > 10.0)
    };
    assert!(!northern(0) && northern(1));
    // Without the zones both go straight on, which with them is a fault.
    let free = solved(&Problem { one_way: None, ..problem.clone() });
    assert!(matches!(check(&problem, &free), Err(ScheduleFault::WrongWay { .. })));
    // One door only, against it: no way.
    let shut =
        Problem { obstacles: vec![block(11.0, 0.0, 12.0, 13.0), block(11.0, 16.0, 12.0, 20.0)], ..problem };
    assert_eq!(solve(&shut, &SolverSettings::default()), Err(Unsolved::NoWay { name: "car-0".to_owned() }));
}

#[test]
fn a_group_finds_its_ways_around_each_other() {
    let ways = [
        (pose(4.0, 10.0, 0.0), pose(16.0, 10.0, 0.0)),
        (pose(16.0, 10.0, PI), pose(4.0, 10.0, PI)),
        (pose(10.0, 4.0, FRAC_PI_2), pose(10.0, 16.0, FRAC_PI_2)),
    ];
    let problem = room(20.0, 20.0, Vec::new(), &ways);
    let instance = instance::Instance::new(&problem, None, &mut || true).unwrap();
    let mut plans = Plans::new(&instance, 1);
    assert!(groups::run(&mut plans, &[0, 1, 2], &mut || true));
    assert!(plans.solved());
    assert_eq!(check(&problem, &plans.schedule()), Ok(()));
}

#[test]
fn a_start_on_an_obstacle_is_moved_within_the_tolerance_or_named() {
    let disc = |x_m| Obstacle::Disc { x_m, y_m: 10.0, radius_m: 0.8 };
    let ways = [(pose(5.0, 10.0, 0.0), pose(15.0, 5.0, 0.0))];
    let tolerance = Tolerance { position_m: 0.1, yaw_rad: 0.05 };
    // 5 cm into the nose, and 30 cm.
    let slight = Problem { tolerance, ..room(20.0, 20.0, vec![disc(6.75)], &ways) };
    solved(&slight);
    assert!(
        solve(&Problem { tolerance: Tolerance::default(), ..slight }, &SolverSettings::default()).is_err()
    );
    // 10 cm into the nose, and 1.2 cm more: that is as good as touching.
    solved(&Problem { tolerance, ..room(20.0, 20.0, vec![disc(6.69)], &ways) });
    let deep = Problem { tolerance, ..room(20.0, 20.0, vec![disc(6.5)], &ways) };
    let error = solve(&deep, &SolverSettings::default()).unwrap_err().to_string();
    assert_eq!(error, "the start of car-0 overlaps the obstacle at (6.50, 10.00) by 0.201 m");
}

#[test]
fn ways_to_known_goals_are_not_computed_again() {
    let mut problem = random(50.0, 25, 8, 8);
    let solver = Solver::new(&problem, &mut || true).unwrap();
    let schedule = solver.solve(&SolverSettings::default(), &mut || true).unwrap();
    for (task, way) in problem.cars.iter_mut().zip(&schedule.ways) {
        task.start = way.rows[5.min(way.rows.len() - 1)].pose;
    }
    problem.cars.swap(0, 1);
    let next = solver.next(&problem, &mut || panic!("it floods again")).unwrap();
    let schedule = next.solve(&SolverSettings::default(), &mut || true).unwrap();
    assert_eq!(check(&problem, &schedule), Ok(()));
    assert_eq!(schedule.ways[0].name, "agent1");
}

#[test]
fn a_car_behind_walls_has_no_way() {
    let walls = vec![block(11.0, 0.0, 12.0, 20.0)];
    let problem = room(23.0, 20.0, walls, &[(pose(5.0, 10.0, 0.0), pose(18.0, 10.0, 0.0))]);
    let error = solve(&problem, &SolverSettings::default()).unwrap_err();
    assert_eq!(error, Unsolved::NoWay { name: "car-0".to_owned() });
}

#[test]
fn without_a_budget_it_says_so_and_with_a_small_one_who_is_in_the_way() {
    let problem = random(50.0, 25, 20, 5);
    assert_eq!(Solver::new(&problem, &mut || false).unwrap_err(), Unsolved::NotBegun);
    let solver = Solver::new(&problem, &mut || true).unwrap();
    let settings = SolverSettings { priorities_first: false, ..SolverSettings::default() };
    let Err(Unsolved::OutOfBudget { without, .. }) = solver.solve(&settings, &mut patience(5)) else {
        panic!()
    };
    assert_eq!(without.len(), 16);
}

#[test]
fn starts_that_overlap_and_names_used_twice_are_refused() {
    let twice = [(pose(5.0, 5.0, 0.0), pose(15.0, 5.0, 0.0)), (pose(6.0, 5.5, 0.0), pose(15.0, 15.0, 0.0))];
    let mut problem = room(20.0, 20.0, Vec::new(), &twice);
    let error = solve(&problem, &SolverSettings::default()).unwrap_err().to_string();
    assert_eq!(error, "the starts of car-0 and car-1 overlap");
    problem.cars[1].name = "car-0".to_owned();
    let error = solve(&problem, &SolverSettings::default()).unwrap_err();
    assert_eq!(error, Unsolved::Problem(ProblemError::SameName("car-0".to_owned())));
    problem.step_m = f64::NAN;
    assert!(problem.validate().is_err());
}

#[test]
fn the_check_sees_what_is_wrong() {
    let ways = [(pose(4.0, 4.0, 0.0), pose(16.0, 4.0, 0.0)), (pose(4.0, 14.0, 0.0), pose(16.0, 14.0, 0.0))];
    let problem = room(20.0, 20.0, Vec::new(), &ways);
    let good = solved(&problem);
    let wrong = |change: &dyn Fn(&mut Schedule)| {
        let mut schedule = good.clone();
        change(&mut schedule);
        check(&problem, &schedule).unwrap_err()
    };
    assert!(matches!(wrong(&|s| s.ways[1].rows.clear()), ScheduleFault::Missing(_)));
    assert!(matches!(
        wrong(&|s| s.ways[0].rows.truncate(2)),
        ScheduleFault::Place { place: Place::Goal, .. }
    ));
    assert!(matches!(wrong(&|s| s.ways[0].rows[3].pose.y_m += 0.1), ScheduleFault::Drive { .. }));
    let lower = |s: &mut Schedule| s.ways[1].rows.iter_mut().for_each(|row| row.pose.y_m -= 9.0);
    let close = Problem {
        cars: problem
            .cars
            .iter()
            .cloned()
            .enumerate()
            .map(|(i, mut task)| {
                task.start.y_m -= 9.0 * i as f64;
                task.goal.y_m -= 9.0 * i as f64;
                task
            })
            .collect(),
        ..problem.clone()
    };
    let mut touching = good.clone();
    lower(&mut touching);
    assert!(matches!(check(&close, &touching).unwrap_err(), ScheduleFault::Contact { .. }));
    let blocked = Problem { obstacles: vec![block(9.0, 4.5, 10.0, 5.0)], ..problem.clone() };
    assert!(matches!(check(&blocked, &good).unwrap_err(), ScheduleFault::Obstacle { .. }));
    let smaller = FloorBounds { east_m: 10.0, ..problem.bounds };
    assert!(matches!(
        check(&Problem { bounds: smaller, ..problem }, &good).unwrap_err(),
        ScheduleFault::Outside { .. }
    ));
}

#[test]
fn the_squares_of_a_grid_become_few_boxes() {
    let mut grid = Grid::free(0.1, [-1.0, 2.0], 20, 10).unwrap();
    for row in 2..6 {
        for column in 3..9 {
            grid.set(column, row, Cell::Occupied);
        }
    }
    grid.set(15, 9, Cell::Unknown);
    let boxes = obstacles_of(&grid);
    assert_eq!(boxes.len(), 2);
    let Obstacle::Box { middle, half_length_m, half_width_m } = boxes[0] else { panic!() };
    assert!((middle.x_m - -0.4).abs() < 1e-12 && (middle.y_m - 2.4).abs() < 1e-12, "{middle:?}");
    assert!((half_length_m - 0.3).abs() < 1e-12 && (half_width_m - 0.2).abs() < 1e-12);
}

/// Drives a schedule by its order alone: in each round only those go on whom the dice let, and who
/// need not wait. Nobody may touch anybody, and all must arrive.
#[test]
fn the_order_keeps_cars_apart_when_they_are_late() {
    let problem = Problem { by_order: true, ..random(50.0, 25, 15, 6) };
    let schedule = solved(&problem);
    let order = precedences(&problem, &schedule, 0.0);
    let ends: Vec<usize> = schedule.ways.iter().map(|way| way.rows.len() - 1).collect();
    let mut random = Pcg32::new(3, 3);
    let mut at = vec![0; ends.len()];
    for _ in 0..2_000 {
        let may = |car: usize, at: &[usize]| {
            at[car] < ends[car]
                && order.iter().all(|p| p.car != car || p.row != at[car] || at[p.first] >= p.reached)
        };
        let moving: Vec<bool> =
            (0..at.len()).map(|car| may(car, &at) && random.next_u32().is_multiple_of(3)).collect();
        for slice in 0..8 {
            let pose = |car: usize| {
                let row = &schedule.ways[car].rows[at[car]];
                let way = if moving[car] { row.piece.length_m * f64::from(slice) / 8.0 } else { 0.0 };
                row.piece.after(&row.pose, way)
            };
            for car in 0..at.len() {
                for other in 0..car {
                    assert!(!PUBLIC_CAR.overlaps(&pose(car), &PUBLIC_CAR, &pose(other)), "{car} and {other}");
                }
            }
        }
        for (place, moved) in at.iter_mut().zip(moving) {
            *place += usize::from(moved);
        }
    }
    assert_eq!(at, ends);
}

#[test]
fn a_way_is_a_path_with_the_same_ends() {
    let schedule = solved(&random(50.0, 25, 5, 7));
    for way in &schedule.ways {
        let (path, last) = (way.path().unwrap(), way.rows[way.rows.len() - 1].pose);
        let end = path.end();
        assert!(libm::hypot(end.x_m - last.x_m, end.y_m - last.y_m) < 1e-6);
        assert!(wrap_rad(end.yaw_rad - last.yaw_rad).abs() < 1e-6);
    }
}
