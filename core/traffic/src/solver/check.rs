//! Is a schedule a solution? Judged from its rows alone, by other means than the search's: each step is
//! looked at in fine slices with the exact arcs and outlines of [`Car`](xtb_nav::Car) and [`Piece`].

use super::problem::{Obstacle, Place, Problem};
use super::schedule::{Schedule, ScheduleRow};
use thiserror::Error;
use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::{Car, MapPose, Piece};

/// Slices of a step: 5 cm of the public instances' 2.118 m; chosen, not measured.
const SLICES: usize = 40;
/// Rounding, and starts or goals that touch (`places::TOUCH`), in parts of a step: the 2 cm of 2.118 m that
/// the public instances' own checker allows.
const TOUCH: f64 = 0.0094;
/// Rounding of angles and radii; chosen, not measured.
const ROUNDING: f64 = 1e-3;

/// What is wrong with a schedule.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScheduleFault {
    /// Not one way for each car, in the problem's order.
    #[error("{0} has no path")]
    Missing(String),
    /// It does not begin at the start, or does not end at the goal.
    #[error("{name} is not at its {place}")]
    Place {
        /// Who.
        name: String,
        /// Where it should be.
        place: Place,
    },
    /// A row that the car cannot reach from the one before.
    #[error("{name} cannot drive step {step}: {what}")]
    Drive {
        /// Who.
        name: String,
        /// Where in the schedule.
        step: usize,
        /// What is impossible.
        what: &'static str,
    },
    /// The reference point leaves the map.
    #[error("{name} leaves the map in step {step}")]
    Outside {
        /// Who.
        name: String,
        /// Where in the schedule.
        step: usize,
    },
    /// A step against a one-way zone.
    #[error("{name} drives the wrong way of a one-way zone at ({x_m:.2}, {y_m:.2}) in step {step}")]
    WrongWay {
        /// Who.
        name: String,
        /// Where in the schedule.
        step: usize,
        /// In m.
        x_m: f64,
        /// In m.
        y_m: f64,
    },
    /// A contact with something that stands.
    #[error("{name} touches the obstacle at ({x_m:.2}, {y_m:.2}) in step {step}")]
    Obstacle {
        /// Who.
        name: String,
        /// Where in the schedule.
        step: usize,
        /// In m.
        x_m: f64,
        /// In m.
        y_m: f64,
    },
    /// A contact of two cars.
    #[error("{first} and {second} touch in step {step}")]
    Contact {
        /// One.
        first: String,
        /// The other.
        second: String,
        /// Where in the schedule.
        step: usize,
    },
}

/// Checks a schedule against its problem.
///
/// # Errors
/// The first fault found.
pub fn check(problem: &Problem, schedule: &Schedule) -> Result<(), ScheduleFault> {
    for (i, task) in problem.cars.iter().enumerate() {
        let way = schedule.ways.get(i).filter(|way| way.name == task.name && !way.rows.is_empty());
        let Some(way) = way else { return Err(ScheduleFault::Missing(task.name.clone())) };
        let ends =
            [(Place::Start, way.rows.first(), &task.start), (Place::Goal, way.rows.last(), &task.goal)];
        for (place, row, wanted) in ends {
            if !row.is_some_and(|row| at(&row.pose, wanted, problem)) {
                return Err(ScheduleFault::Place { name: task.name.clone(), place });
            }
        }
        for (step, rows) in way.rows.windows(2).enumerate() {
            drivable(problem, &task.car, rows).map_err(|what| ScheduleFault::Drive {
                name: task.name.clone(),
                step,
                what,
            })?;
            right_way(problem, &task.name, &rows[0])?;
        }
    }
    (0..=schedule.makespan()).try_for_each(|step| slices(problem, schedule, step))
}

fn at(pose: &MapPose, wanted: &MapPose, problem: &Problem) -> bool {
    let position_m = problem.tolerance.position_m.max(problem.step_m * ROUNDING);
    libm::hypot(pose.x_m - wanted.x_m, pose.y_m - wanted.y_m) <= position_m
        && wrap_rad(pose.yaw_rad - wanted.yaw_rad).abs() <= problem.tolerance.yaw_rad.max(ROUNDING)
}

fn same(a: &MapPose, b: &MapPose, step_m: f64) -> bool {
    libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m) < step_m * ROUNDING
        && wrap_rad(a.yaw_rad - b.yaw_rad).abs() < ROUNDING
}

fn drivable(problem: &Problem, car: &Car, rows: &[ScheduleRow]) -> Result<(), &'static str> {
    let (row, next) = (&rows[0], &rows[1]);
    let Piece { length_m, curvature_per_m } = row.piece;
    if next.step != row.step + 1 {
        return Err("a step is missing");
    }
    if length_m.abs() > problem.step_m * (1.0 + ROUNDING) {
        return Err("too fast");
    }
    if curvature_per_m.abs() * car.radius_m > 1.0 + ROUNDING {
        return Err("turns too tightly");
    }
    if !same(&row.piece.end(&row.pose), &next.pose, problem.step_m) {
        return Err("the arc ends at another pose");
    }
    Ok(())
}

/// The rule of one-way zones, by the row's own pose.
fn right_way(problem: &Problem, name: &str, row: &ScheduleRow) -> Result<(), ScheduleFault> {
    let zones = problem.one_way.as_ref().filter(|_| row.piece.length_m != 0.0);
    match zones.and_then(|zones| zones.against(&row.pose, &row.piece)) {
        Some([x_m, y_m]) => Err(ScheduleFault::WrongWay { name: name.to_owned(), step: row.step, x_m, y_m }),
        None => Ok(()),
    }
}

/// Looks at one step slice by slice.
fn slices(problem: &Problem, schedule: &Schedule, step: usize) -> Result<(), ScheduleFault> {
    let touch = problem.step_m * TOUCH;
    let bodies: Vec<Car> = problem.cars.iter().map(|task| task.car.grown(-touch / 2.0)).collect();
    let name = |car: usize| problem.cars[car].name.clone();
    let spans: Vec<([f64; 2], f64)> =
        (0..bodies.len()).map(|car| span(&problem.cars[car].car, &schedule.ways[car].rows, step)).collect();
    let near = |(a, far): ([f64; 2], f64), b: [f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]) <= far + touch;
    let obstacles: Vec<Vec<&Obstacle>> = spans
        .iter()
        .map(|&(at, far)| {
            let around = |thing: &&Obstacle| near((at, far + thing.reach_m()), thing.middle_m());
            problem.obstacles.iter().filter(around).collect()
        })
        .collect();
    let pairs: Vec<(usize, usize)> = (0..spans.len())
        .flat_map(|car| (car + 1..spans.len()).map(move |other| (car, other)))
        .filter(|&(car, other)| near((spans[car].0, spans[car].1 + spans[other].1), spans[other].0))
        .collect();
    for slice in 0..SLICES {
        let fraction = slice as f64 / SLICES as f64;
        let poses: Vec<MapPose> = schedule.ways.iter().map(|way| pose(&way.rows, step, fraction)).collect();
        for (car, pose) in poses.iter().enumerate() {
            let bounds = &problem.bounds;
            let wide =
                (bounds.west_m - ROUNDING * touch..=bounds.east_m + ROUNDING * touch).contains(&pose.x_m);
            let deep =
                (bounds.south_m - ROUNDING * touch..=bounds.north_m + ROUNDING * touch).contains(&pose.y_m);
            if !(wide && deep) {
                return Err(ScheduleFault::Outside { name: name(car), step });
            }
            let hit = |obstacle: &&&Obstacle| hits(&problem.cars[car].car, pose, obstacle, touch);
            if let Some(obstacle) = obstacles[car].iter().find(hit) {
                let [x_m, y_m] = obstacle.middle_m();
                return Err(ScheduleFault::Obstacle { name: name(car), step, x_m, y_m });
            }
        }
        let touching = |&&(car, other): &&(usize, usize)| {
            bodies[car].overlaps(&poses[car], &bodies[other], &poses[other])
        };
        if let Some(&(car, other)) = pairs.iter().find(touching) {
            return Err(ScheduleFault::Contact { first: name(car), second: name(other), step });
        }
    }
    Ok(())
}

/// Where a car is when a step begins, and how far any point of it gets from there in that step.
fn span(car: &Car, rows: &[ScheduleRow], step: usize) -> ([f64; 2], f64) {
    let reach = libm::hypot(car.front_m.max(car.rear_m), car.half_width_m);
    let driven = rows.get(step).map_or(0.0, |row| row.piece.length_m.abs());
    let at = pose(rows, step, 0.0);
    ([at.x_m, at.y_m], reach + driven)
}

fn pose(rows: &[ScheduleRow], step: usize, fraction: f64) -> MapPose {
    match rows.get(step) {
        Some(row) => row.piece.after(&row.pose, row.piece.length_m * fraction),
        None => rows[rows.len() - 1].pose,
    }
}

/// Whether a car is deeper than `touch` in an obstacle.
fn hits(car: &Car, pose: &MapPose, obstacle: &Obstacle, touch: f64) -> bool {
    match *obstacle {
        Obstacle::Disc { x_m, y_m, radius_m } => car.distance_m(pose, [x_m, y_m]) < radius_m - touch,
        Obstacle::Box { middle, half_length_m, half_width_m } => {
            let radius_m = f64::INFINITY;
            let solid = Car {
                front_m: half_length_m,
                rear_m: half_length_m,
                half_width_m,
                radius_m,
                gears: car.gears,
            };
            car.grown(-touch).overlaps(pose, &solid, &middle)
        }
    }
}
