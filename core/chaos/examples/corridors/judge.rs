//! Whether a goal that failed had a way: the search of `fleet-cli plan`, with its clearance and look-out, for
//! 60 s each question, from where everybody stood.
//!
//! A goal without a yaw is looked at with each of the four yaws along the room's walls in which a robot can
//! stand there. All others either come to where they were to go, or back to where they stood; meanwhile they
//! may be anywhere. If neither has a solution there was no way.

use crate::lifelong::Failed;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::time::{Duration, Instant};
use xtb_control::VehicleConfig;
use xtb_nav::geometry::rect::INFRARED_STOPS_M;
use xtb_nav::{Car, MapPose};
use xtb_sim::World;
use xtb_traffic::solver::{
    CarTask, FloorBounds, Obstacle, Problem, Solver, SolverSettings, Tolerance, Unsolved, obstacles_of,
};

/// For one question.
const WITHIN: Duration = Duration::from_secs(60);
/// As `fleet-cli plan` has them.
const CLEARANCE_M: f64 = 0.05;
const TURN_RAD: f64 = 0.7;

/// What came out.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// There was one.
    Way { others: &'static str },
    /// None was found: why the last search ended.
    NoWay(String),
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Way { others } => write!(f, "WRONGLY: there is a way, the others {others}"),
            Self::NoWay(why) => write!(f, "no way: {why}"),
        }
    }
}

/// A room as the search sees it.
pub(crate) struct Judge {
    bounds: FloorBounds,
    obstacles: Vec<Obstacle>,
    truck: Car,
}

impl Judge {
    pub(crate) fn new(world: &str) -> Self {
        let map = World::from_toml(world).unwrap().to_map(0.05).unwrap();
        let grid = map.grid();
        let [west_m, south_m] = grid.origin_m();
        let side = grid.resolution_m();
        let (east_m, north_m) = (west_m + side * grid.width() as f64, south_m + side * grid.height() as f64);
        let bounds = FloorBounds { west_m, south_m, east_m, north_m };
        Self { bounds, obstacles: obstacles_of(grid), truck: Car::of(&VehicleConfig::default()) }
    }

    pub(crate) fn of(&self, failed: &Failed) -> Verdict {
        let goals: Vec<[f64; 2]> = failed.goals.clone();
        let mut why = String::new();
        for yaw_rad in [0.0, FRAC_PI_2, PI, -FRAC_PI_2] {
            let mine = MapPose { x_m: goals[failed.robot][0], y_m: goals[failed.robot][1], yaw_rad };
            for others in ["go on", "come back"] {
                let goal = |index: usize| {
                    let [x_m, y_m] = goals[index];
                    match others {
                        _ if index == failed.robot => mine,
                        "go on" => {
                            MapPose { x_m, y_m, yaw_rad: self.along(x_m, y_m, failed.poses[index].yaw_rad) }
                        }
                        _ => failed.poses[index],
                    }
                };
                match self.solve(failed, &goal) {
                    Ok(()) => return Verdict::Way { others },
                    Err(unsolved) => why = unsolved.to_string(),
                }
            }
        }
        Verdict::NoWay(why)
    }

    /// A yaw in which a robot can stand there, the nearest to its own.
    fn along(&self, x_m: f64, y_m: f64, own_rad: f64) -> f64 {
        let mut yaws = [0.0, FRAC_PI_2, PI, -FRAC_PI_2];
        yaws.sort_by(|a, b| (b - own_rad).cos().total_cmp(&(a - own_rad).cos()));
        let stands = |yaw_rad: &f64| {
            let (sin, cos) = yaw_rad.sin_cos();
            let half = [self.truck.front_m + INFRARED_STOPS_M, self.truck.half_width_m];
            let half = [half[0] * cos.abs() + half[1] * sin.abs(), half[0] * sin.abs() + half[1] * cos.abs()];
            self.obstacles.iter().all(|thing| match thing {
                Obstacle::Disc { .. } => true,
                Obstacle::Box { middle, half_length_m, half_width_m } => {
                    (middle.x_m - x_m).abs() > half[0] + half_length_m
                        || (middle.y_m - y_m).abs() > half[1] + half_width_m
                }
            })
        };
        yaws.iter().copied().find(stands).unwrap_or(yaws[0])
    }

    fn solve(&self, failed: &Failed, goal: &dyn Fn(usize) -> MapPose) -> Result<(), Unsolved> {
        let truck = self.truck;
        let car = Car {
            front_m: truck.front_m + INFRARED_STOPS_M,
            rear_m: truck.rear_m + INFRARED_STOPS_M,
            ..truck
        };
        let task = |(index, start): (usize, &MapPose)| CarTask {
            name: format!("xtb-{}", index + 1),
            car,
            start: *start,
            goal: goal(index),
        };
        let problem = Problem {
            bounds: self.bounds,
            obstacles: self.obstacles.clone(),
            one_way: None,
            cars: failed.poses.iter().enumerate().map(task).collect(),
            step_m: truck.radius_m * TURN_RAD,
            clearance_m: CLEARANCE_M,
            tolerance: Tolerance::default(),
            by_order: true,
        };
        let end = Instant::now() + WITHIN;
        let mut on_time = || Instant::now() < end;
        Solver::new(&problem, &mut on_time)?.solve(&SolverSettings::default(), &mut on_time).map(|_| ())
    }
}
