//! The planner in three rooms against an exhaustive search, and what it says when there is no way.
#![allow(clippy::unwrap_used)]

mod flood;

use flood::Reachable;
use xtb_nav::map::Zones;
use xtb_nav::planner::End;
use xtb_nav::planner::space::{GridLayers, Hit, LookOut, Obstruction};
use xtb_nav::rooms::{Draw, RoomKind};
use xtb_nav::{
    Car, Cell, Gears, Grid, GridSpace, MapPose, Path, Piece, Plan, PlanError, Planner, PlannerGoal,
    PlannerSettings, Space,
};

const TRUCK: Car =
    Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.393, gears: Gears::BOTH };

fn on(grid: &Grid, look_out: LookOut) -> GridSpace {
    GridSpace::new(&GridLayers::map(grid), TRUCK, look_out).unwrap()
}

fn at(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

fn plan(space: &GridSpace, start: &MapPose, goal: &PlannerGoal) -> Result<Plan, PlanError> {
    Planner::new().plan_on_grid(space, start, goal, &PlannerSettings::default(), &mut || true)
}

/// Free everywhere but for a wall of one cell from south to north at x = 2.0 m, with a gap.
fn divided(gap: std::ops::Range<i64>) -> Grid {
    let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 60).unwrap();
    (0..60).filter(|row| !gap.contains(row)).for_each(|row| grid.set(40, row, Cell::Occupied));
    grid
}

/// From the start to the goal, on arcs the car can drive, touching nothing at any point.
fn proven(space: &GridSpace, path: &Path, start: &MapPose, goal: &PlannerGoal) {
    assert_eq!(path.start, *start);
    assert!(goal.met_by(&path.end()), "{:?} instead of {goal:?}", path.end());
    let tightest = path.pieces.iter().map(|piece| piece.curvature_per_m.abs()).fold(0.0, f64::max);
    assert!(tightest <= 1.0 / TRUCK.radius_m + 1e-9);
    let points = (path.length_m() / 0.01) as usize;
    for n in 0..=points {
        let (pose, _) = path.at(n as f64 * 0.01);
        assert_eq!(space.standing(&pose), None, "on the way at {pose:?}");
    }
}

#[test]
fn all_that_an_exhaustive_search_reaches_is_solved_and_proven() {
    let (mut planner, settings) = (Planner::new(), PlannerSettings::default());
    for (room, queries) in [(RoomKind::Open, 60), (RoomKind::Cluttered, 100), (RoomKind::Doors, 100)] {
        let grid = room.grid(1);
        let space = on(&grid, LookOut::OFF);
        let mut draw = Draw::new(1);
        let mut unsolved = Vec::new();
        let mut most = 0;
        for _ in 0..queries {
            let (start, goal) = (draw.free_pose(&space).unwrap(), draw.free_pose(&space).unwrap());
            match planner.plan_on_grid(&space, &start, &PlannerGoal::exactly(&goal), &settings, &mut || true)
            {
                Ok(plan) => {
                    proven(&space, &plan.path, &start, &PlannerGoal::exactly(&goal));
                    most = most.max(plan.expansions);
                }
                Err(PlanError::Unreachable { .. }) => unsolved.push((start, goal)),
                Err(error) => panic!("{error}"),
            }
        }
        assert!(most < 150_000, "{room:?}: {most} expansions");
        assert!(unsolved.len() * 2 < queries, "{room:?}: {} not solved", unsolved.len());
        if unsolved.is_empty() {
            continue;
        }
        let mut reachable = Reachable::new(&space, &draw.free_pose(&space).unwrap(), true);
        assert!(reachable.len() > 100_000, "{room:?}: only {} poses", reachable.len());
        for (start, goal) in unsolved {
            assert!(!reachable.is(&start, &goal), "{room:?}: {start:?} → {goal:?} is reachable");
        }
    }
}

#[test]
fn the_look_out_strip_is_kept_free_on_the_whole_way() {
    let (mut planner, settings) = (Planner::new(), PlannerSettings::default());
    let grid = RoomKind::Doors.grid(6);
    let (space, body) = (on(&grid, LookOut::TRUCK), on(&grid, LookOut::OFF));
    let mut draw = Draw::new(6);
    let (mut solved, mut narrow) = (0, 0);
    for _ in 0..60 {
        let (start, goal) =
            (draw.free_pose(&space).unwrap(), PlannerGoal::exactly(&draw.free_pose(&space).unwrap()));
        let Ok(plan) = planner.plan_on_grid(&space, &start, &goal, &settings, &mut || true) else {
            narrow +=
                usize::from(planner.plan_on_grid(&body, &start, &goal, &settings, &mut || true).is_ok());
            continue;
        };
        proven(&space, &plan.path, &start, &goal);
        solved += 1;
        for n in 0..(plan.path.length_m() / 0.01) as usize {
            let (pose, piece) = plan.path.at(n as f64 * 0.01);
            let ahead = piece.unwrap().gear();
            let (sin, cos) = libm::sincos(pose.yaw_rad);
            for (along, left) in
                [(0.26, -0.17), (0.26, 0.0), (0.26, 0.17), (0.5, -0.17), (0.5, 0.0), (0.5, 0.17)]
            {
                let along = along * ahead;
                let cell = grid.at(pose.x_m + along * cos - left * sin, pose.y_m + along * sin + left * cos);
                assert_eq!(cell, Cell::Free, "before the bumper at {pose:?}");
            }
        }
    }
    assert!(solved > 5 && narrow > 0, "{solved} solved, {narrow} with the body alone");
}

#[test]
fn the_same_question_has_the_same_answer_whatever_was_asked_before() {
    let space = on(&RoomKind::Cluttered.grid(2), LookOut::OFF);
    let (mut draw, settings) = (Draw::new(2), PlannerSettings::default());
    let queries: Vec<(MapPose, PlannerGoal)> = (0..10)
        .map(|_| (draw.free_pose(&space).unwrap(), PlannerGoal::exactly(&draw.free_pose(&space).unwrap())))
        .collect();
    let mut planner = Planner::new();
    let mut ask = |(start, goal): &(MapPose, PlannerGoal)| {
        planner.plan_on_grid(&space, start, goal, &settings, &mut || true)
    };
    let first: Vec<_> = queries.iter().map(&mut ask).collect();
    let again: Vec<_> = queries.iter().map(&mut ask).collect();
    let alone: Vec<_> = queries.iter().map(|(start, goal)| plan(&space, start, goal)).collect();
    assert!(first == again && first == alone);
    assert!(first.iter().filter(|plan| plan.is_ok()).count() >= 5);
}

#[test]
fn a_goal_without_a_heading_is_no_longer_than_one_with_any() {
    let space = on(&divided(20..45), LookOut::OFF);
    let (start, free) =
        (at(1.0, 2.4, 2.0), PlannerGoal { yaw_rad: None, ..PlannerGoal::exactly(&at(3.2, 0.6, 0.0)) });
    let any = plan(&space, &start, &free).unwrap();
    proven(&space, &any.path, &start, &free);
    for n in 0..8 {
        let goal = PlannerGoal::exactly(&at(3.2, 0.6, f64::from(n) * 0.785));
        let one = plan(&space, &start, &goal).unwrap();
        proven(&space, &one.path, &start, &goal);
        assert!(any.cost < one.cost + 0.6, "{} with any heading, {} with number {n}", any.cost, one.cost);
    }
}

#[test]
fn in_a_one_way_zone_a_goal_without_a_heading_is_not_ended_across_it() {
    let grid = Grid::free(0.05, [0.0, 0.0], 80, 60).unwrap();
    let north = vec![Some(std::f32::consts::FRAC_PI_2); 80 * 60];
    let layers = GridLayers { one_way: Some(&north), ..GridLayers::map(&grid) };
    let space = GridSpace::new(&layers, TRUCK, LookOut::OFF).unwrap();
    let free = PlannerGoal { yaw_rad: None, tolerance_m: 0.05, ..PlannerGoal::exactly(&at(2.0, 2.4, 0.0)) };
    for yaw_rad in [0.2, 1.5, 2.9] {
        let start = at(1.0, 0.8, yaw_rad);
        let end = plan(&space, &start, &free).unwrap().path.end();
        assert!(end.yaw_rad.sin().abs() > 0.7, "from {yaw_rad} it ends across: {end:?}");
        // Whoever is there already stays.
        let there = at(2.0, 2.4, yaw_rad);
        assert_eq!(plan(&space, &there, &free).unwrap().path.length_m(), 0.0);
    }
}

#[test]
fn a_car_with_its_nose_at_a_wall_backs_off_first() {
    let space = on(&divided(20..45), LookOut::TRUCK);
    let start = at(1.7, 0.6, 0.0);
    let goal = PlannerGoal::exactly(&at(3.0, 0.8, 0.0));
    let plan = plan(&space, &start, &goal).unwrap();
    proven(&space, &plan.path, &start, &goal);
    assert!(plan.path.pieces[0].length_m < 0.0);
    assert!(plan.path.cusps() >= 1);
}

#[test]
fn ends_that_touch_something_say_what_and_where() {
    let grid = divided(20..45);
    let space = on(&grid, LookOut::OFF);
    let free = at(1.0, 1.0, 0.0);
    let Err(PlanError::StartInCollision(Hit { x_m, what: Obstruction::Wall, .. })) =
        plan(&space, &at(1.9, 0.5, 0.0), &PlannerGoal::exactly(&free))
    else {
        panic!("the start stands in the wall")
    };
    assert!((x_m - 2.025).abs() < 1e-9);
    let error = plan(&space, &free, &PlannerGoal::exactly(&at(3.9, 1.5, 0.0))).unwrap_err();
    assert_eq!(error.to_string(), "the goal touches the edge of the map at (4.03, 1.33)");
    let cells = (0..80 * 60).map(|index| u16::from(index % 80 > 60)).collect();
    let zones = Zones { names: vec!["charging".into()], cells };
    let layers = GridLayers { zones: Some(&zones), ..GridLayers::map(&grid) };
    let space = GridSpace::new(&layers, TRUCK, LookOut::OFF).unwrap();
    let error = plan(&space, &free, &PlannerGoal::exactly(&at(3.5, 1.5, 0.0))).unwrap_err();
    assert!(matches!(&error, PlanError::GoalKeptOut { name, .. } if name == "charging"), "{error}");
    let error = plan(&space, &at(f64::NAN, 1.0, 0.0), &PlannerGoal::exactly(&free)).unwrap_err();
    assert_eq!(error, PlanError::NotAPose(End::Start));
    let goal = PlannerGoal { tolerance_m: -1.0, ..PlannerGoal::exactly(&free) };
    assert_eq!(plan(&space, &free, &goal).unwrap_err(), PlanError::NotAPose(End::Goal));
}

#[test]
fn a_heading_within_the_tolerance_does_where_the_exact_one_does_not_fit() {
    // A lane of 45 cm: straight in it the car fits, 20° off it does not.
    let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 60).unwrap();
    for column in 40..80 {
        (0..60).filter(|row| !(20..29).contains(row)).for_each(|row| grid.set(column, row, Cell::Occupied));
    }
    let space = on(&grid, LookOut::OFF);
    let goal = PlannerGoal { tolerance_rad: 0.35, ..PlannerGoal::exactly(&at(3.0, 1.225, 0.35)) };
    let plan_in = plan(&space, &at(1.0, 1.2, 0.0), &goal).unwrap();
    proven(&space, &plan_in.path, &at(1.0, 1.2, 0.0), &goal);
    let exact = PlannerGoal { tolerance_rad: 0.0, ..goal };
    assert!(matches!(plan(&space, &at(1.0, 1.2, 0.0), &exact), Err(PlanError::GoalInCollision(_))));
}

#[test]
fn what_is_walled_in_is_named_with_the_wall() {
    let (start, goal) = (at(1.0, 1.5, 0.0), PlannerGoal::exactly(&at(3.2, 1.5, 0.0)));
    // No gap at all, one too narrow for a point as wide as the car, one too narrow for the car.
    for gap in [0..0, 30..34, 26..34] {
        let error = plan(&on(&divided(gap.clone()), LookOut::OFF), &start, &goal).unwrap_err();
        let PlanError::Unreachable { at_m, by: Some(hit), .. } = &error else { panic!("{gap:?}: {error}") };
        assert_eq!(hit.what, Obstruction::Wall, "{error}");
        assert!((hit.x_m - 2.025).abs() < 1e-9 && (1.0..3.2).contains(&at_m[0]), "{error}");
    }
    assert!(plan(&on(&divided(26..35), LookOut::OFF), &start, &goal).is_ok());
}

#[test]
fn a_budget_that_is_used_up_says_how_far_it_got() {
    let space = on(&divided(0..11), LookOut::OFF);
    let (start, goal) = (at(1.0, 2.4, 0.0), PlannerGoal::exactly(&at(3.2, 2.4, 0.0)));
    let settings = PlannerSettings { most_expansions: 16, ..PlannerSettings::default() };
    let error = Planner::new().plan_on_grid(&space, &start, &goal, &settings, &mut || true).unwrap_err();
    let PlanError::Budget { expansions, nearest, left_m, .. } = error else { panic!("{error}") };
    assert!((16..48).contains(&expansions) && left_m > 0.5 && space.standing(&nearest).is_none());
    let mut asked = 0;
    let mut never = || {
        asked += 1;
        false
    };
    let settings = PlannerSettings::default();
    let error = Planner::new().plan_on_grid(&space, &start, &goal, &settings, &mut never).unwrap_err();
    assert!(matches!(error, PlanError::Budget { .. }) && asked == 1);
    assert!(plan(&space, &start, &goal).is_ok());
}

#[test]
fn settings_that_make_no_search_are_refused() {
    let space = on(&divided(20..45), LookOut::OFF);
    let refused = |change: fn(&mut PlannerSettings)| {
        let mut settings = PlannerSettings::default();
        change(&mut settings);
        let goal = PlannerGoal::exactly(&at(1.0, 2.0, 0.0));
        let plan = Planner::new().plan_on_grid(&space, &at(1.0, 1.0, 0.0), &goal, &settings, &mut || true);
        matches!(plan, Err(PlanError::Settings(_)))
    };
    assert!(refused(|settings| settings.lattices.clear()));
    assert!(refused(|settings| settings.lattices[0].headings = 50));
    assert!(refused(|settings| settings.heuristic_weight = f64::NAN));
    assert!(!refused(|_| ()));
}

#[test]
fn a_car_that_looks_one_way_only_is_never_driven_the_other_way() {
    let grid = RoomKind::Open.grid(1);
    let settings = PlannerSettings::default();
    for gears in [Gears { ahead: true, astern: false }, Gears { ahead: false, astern: true }] {
        let space = GridSpace::new(&GridLayers::map(&grid), Car { gears, ..TRUCK }, LookOut::TRUCK).unwrap();
        let (mut planner, mut draw, mut found) = (Planner::new(), Draw::new(7), 0);
        for _ in 0..40 {
            let (start, goal) = (draw.free_pose(&space).unwrap(), draw.free_pose(&space).unwrap());
            let goal = PlannerGoal { yaw_rad: None, tolerance_m: 0.05, ..PlannerGoal::exactly(&goal) };
            if let Ok(plan) = planner.plan_on_grid(&space, &start, &goal, &settings, &mut || true) {
                proven(&space, &plan.path, &start, &goal);
                assert!(plan.path.pieces.iter().all(|piece| gears.allow(piece.length_m)), "{:?}", plan.path);
                found += 1;
            }
        }
        assert!(found >= 25, "{gears:?}: {found} of 40");
        let straight = Piece { length_m: if gears.ahead { -0.1 } else { 0.1 }, curvature_per_m: 0.0 };
        let start = draw.free_pose(&space).unwrap();
        assert!(!space.drives(&start, &straight) && !space.may_drive_all(&start, &[straight]));
        assert_eq!(space.driving(&start, &straight).map(|hit| hit.what), Some(Obstruction::Unseen));
    }
}
