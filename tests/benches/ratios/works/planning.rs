//! What is planned, for one robot and for many, and the maps under it.

use super::Work;
use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_control::infrared::BumperRanges;
use xtb_dispatch::OpenTravelCost;
use xtb_dispatch::assign::{Candidate, Demand, assign};
use xtb_nav::map::raster;
use xtb_nav::obstacle_layer::BumperScan;
use xtb_nav::planner::space::{GridLayers, LookOut};
use xtb_nav::rooms::{Draw, RoomKind};
use xtb_nav::{
    Car, Cell, Gears, Grid, GridSpace, MapPose, ObstacleLayer, Planner, PlannerGoal, PlannerSettings,
};
use xtb_protocol::messages::{TaskId, Waypoint};
use xtb_traffic::coordinator::{Coordinator, GridRoom, JointJob, PlannedGoal, ReportedRobot};
use xtb_traffic::solver::{CarTask, FloorBounds, Obstacle, Problem, Solver, SolverSettings, Tolerance};

/// The truck of the planner's table in docs/navigation.md.
const TRUCK: Car =
    Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.393, gears: Gears::BOTH };
/// The car of the public instances.
const LARGE_CAR: Car =
    Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: Gears::BOTH };

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

/// The first ten queries of a seed that have a way.
pub(super) fn single_plans(room: RoomKind) -> Work {
    const PLANS: usize = 10;
    let grid = room.grid(1);
    let space = GridSpace::new(&GridLayers::map(&grid), TRUCK, LookOut::TRUCK).expect("layers of one grid");
    let (mut draw, mut planner, settings) = (Draw::new(1), Planner::new(), PlannerSettings::default());
    let mut plan = move |space: &GridSpace, (start, goal): &(MapPose, MapPose)| {
        planner.plan_on_grid(space, start, &PlannerGoal::exactly(goal), &settings, &mut || true).is_ok()
    };
    let mut place = || draw.free_pose(&space).expect("a free place");
    let queries = (0..100 * PLANS).map(|_| (place(), place()));
    let queries: Vec<(MapPose, MapPose)> = queries.filter(|query| plan(&space, query)).take(PLANS).collect();
    assert_eq!(queries.len(), PLANS, "queries with a way");
    Work::new(PLANS as f64, move || {
        let solved = queries.iter().filter(|query| plan(&space, query)).count();
        assert_eq!(solved, PLANS, "ways that were found before");
    })
}

/// A truck on a circle in the open room; every third beam hits something.
pub(super) fn obstacle_scans() -> Work {
    const SCANS: usize = 500;
    let (grid, mut draw) = (RoomKind::Open.grid(1), Draw::new(1));
    let mut ranges = || -> BumperRanges {
        std::array::from_fn(|_| {
            let range_cm = draw.uniform(15.0, 60.0);
            (draw.uniform(0.0, 1.0) < 0.3).then_some(range_cm)
        })
    };
    let scan = |n: usize| {
        let angle = n as f64 * 0.01;
        let (sin, cos) = angle.sin_cos();
        let pose = pose(5.0 + 2.0 * cos, 5.0 + 2.0 * sin, angle + FRAC_PI_2);
        BumperScan { pose, sigma_m: 0.02, front_cm: ranges(), rear_cm: ranges() }
    };
    let scans: Vec<BumperScan> = (0..SCANS).map(scan).collect();
    Work::new(SCANS as f64, move || {
        let (mut layer, mut now) = (ObstacleLayer::new(TRUCK, Some(&grid)), Stamp::ZERO);
        for scan in &scans {
            now = now.plus_ms(40);
            layer.see(now, scan, Some(&grid), &[]);
        }
        black_box(layer.obstacles(now).count());
    })
}

/// Three trucks before a door of 1.4 m and two behind it, all to the other side.
pub(super) fn joint_plans() -> Work {
    let job = door_job();
    Work::new(1.0, move || {
        let (planned, _) = black_box(&job).solve(&mut || true).counts();
        assert!(planned > 0, "nobody has a way");
    })
}

fn door_job() -> JointJob {
    let mut grid = Grid::free(0.05, [0.0, 0.0], 200, 120).expect("a grid");
    for y_m in [1.15, 4.85] {
        raster::rectangle(&mut grid, &pose(5.0, y_m, 0.0), 0.2, 2.3, Cell::Occupied);
    }
    let places = [
        pose(1.2, 1.0, 0.0),
        pose(1.2, 3.0, 0.0),
        pose(1.2, 5.0, 0.0),
        pose(8.8, 2.0, PI),
        pose(8.8, 4.0, PI),
    ];
    let view = |index: usize| {
        let MapPose { x_m, y_m, yaw_rad } = places[(index + 2) % places.len()];
        ReportedRobot {
            name: format!("xtb-{}", index + 1),
            epoch: 1,
            car: Some(TRUCK),
            pose: places[index],
            sigma_m: 0.01,
            speed_mps: 0.0,
            goal: Some(PlannedGoal { id: index as u128 + 1, x_m, y_m, yaw_rad: Some(yaw_rad) }),
            route: None,
            blocked_at_m: None,
            drives: true,
            age_ms: 0,
        }
    };
    let mut coordinator = Coordinator::new(Arc::new(GridRoom::new(grid)), 1);
    let mut turns = (0..100).map(|turn| Stamp::from_ms(1000 + 200 * turn));
    let job = turns.find_map(|now| {
        (0..places.len()).for_each(|index| coordinator.robot(now, view(index)));
        coordinator.tick(now);
        coordinator.job(now)
    });
    job.expect("something to plan")
}

/// Twenty cars among 25 discs on 50 × 50 m, as in the public instances; the first seed that has a schedule.
pub(super) fn offline_plan() -> Work {
    let problem = (1..=10).map(twenty_cars).find(solves).expect("a problem with a schedule");
    Work::new(1.0, move || assert!(solves(&problem), "a schedule that was found before"))
}

fn solves(problem: &Problem) -> bool {
    let settings = SolverSettings { most_rounds: 1000, ..SolverSettings::default() };
    let solver = Solver::new(problem, &mut || true);
    solver.and_then(|solver| solver.solve(&settings, &mut || true)).is_ok()
}

fn twenty_cars(seed: u64) -> Problem {
    const SIDE_M: f64 = 50.0;
    const DISC_M: f64 = 0.8;
    /// Between two starts, or two goals.
    const SPACING_M: f64 = 5.6;
    let mut draw = Draw::new(seed);
    let discs: Vec<Obstacle> = (0..25)
        .map(|_| Obstacle::Disc {
            x_m: draw.uniform(0.0, SIDE_M),
            y_m: draw.uniform(0.0, SIDE_M),
            radius_m: DISC_M,
        })
        .collect();
    let mut places = || {
        let mut places: Vec<MapPose> = Vec::new();
        while places.len() < 20 {
            let quarters = draw.whole(-1, 2) as f64;
            let (x_m, y_m) = (draw.whole(2, 48) as f64, draw.whole(2, 48) as f64);
            let place = pose(x_m, y_m, quarters * FRAC_PI_2);
            let off_discs = discs.iter().all(|disc| LARGE_CAR.distance_m(&place, disc.middle_m()) > DISC_M);
            let apart = |other: &MapPose| (other.x_m - x_m).hypot(other.y_m - y_m) > SPACING_M;
            if off_discs && places.iter().all(apart) {
                places.push(place);
            }
        }
        places
    };
    let ways = places().into_iter().zip(places()).enumerate();
    let cars = ways
        .map(|(i, (start, goal))| CarTask { name: format!("car-{i}"), car: LARGE_CAR, start, goal })
        .collect();
    Problem {
        bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: SIDE_M, north_m: SIDE_M },
        cars,
        obstacles: discs,
        one_way: None,
        step_m: 2.118,
        clearance_m: 0.02,
        tolerance: Tolerance::default(),
        by_order: false,
    }
}

/// Robots and tasks anywhere on 100 × 100 m.
pub(super) fn assignments() -> Work {
    const ROBOTS: usize = 100;
    let mut draw = Draw::new(1);
    let mut place = || pose(draw.uniform(-50.0, 50.0), draw.uniform(-50.0, 50.0), draw.uniform(-3.0, 3.0));
    let robots: Vec<Candidate> =
        (0..ROBOTS).map(|_| Candidate { pose: place(), car: TRUCK, extra_m: 0.0 }).collect();
    let demand = |number: u64| {
        let MapPose { x_m, y_m, .. } = place();
        Demand { id: TaskId::new(number), level: 5, first: Some(Waypoint { x_m, y_m, yaw_rad: None }) }
    };
    let tasks: Vec<Demand> = (0..300).map(demand).collect();
    Work::new(1.0, move || {
        let pairs = assign(black_box(&tasks), &robots, &OpenTravelCost, &|_, _| Some(0.0));
        assert_eq!(pairs.len(), ROBOTS);
    })
}

/// On a new map of 50 × 50 m.
pub(super) fn rectangles() -> Work {
    const RECTANGLES: usize = 500;
    let floor = Grid::free(0.05, [0.0, 0.0], 1000, 1000).expect("a grid");
    let mut draw = Draw::new(1);
    let rectangles: Vec<(MapPose, f64, f64)> = (0..RECTANGLES)
        .map(|_| {
            let middle = pose(draw.uniform(0.0, 50.0), draw.uniform(0.0, 50.0), draw.uniform(-PI, PI));
            (middle, draw.uniform(0.2, 5.0), draw.uniform(0.1, 2.0))
        })
        .collect();
    Work::new(RECTANGLES as f64, move || {
        let mut grid = floor.clone();
        for (middle, length_m, width_m) in &rectangles {
            raster::rectangle(&mut grid, middle, *length_m, *width_m, Cell::Occupied);
        }
        black_box(grid.at(25.0, 25.0));
    })
}
