//! Where cars really begin and end: starts and goals that touch something are moved as little as
//! helps, within what still counts as being there.

use super::body::Body;
use super::motion::Spot;
use super::obstacle_index::ObstacleIndex;
use super::problem::{Place, Problem, ProblemError};
use std::f64::consts::TAU;
use xtb_nav::MapPose;

/// Overlap that counts as touching, in parts of a step. The public instances, whose places are rounded to
/// a third of a car's length, allow 2 cm of their step of 2.118 m.
pub(crate) const TOUCH: f64 = 0.009;
/// What a moved place keeps from others, in parts of the clearance; chosen, not measured.
const KEPT: f64 = 0.5;
/// Places that are tried: so many distances, …
const DISTANCES: u32 = 8;
/// … directions …
const DIRECTIONS: u32 = 24;
/// … and angles (to either side); all chosen, not measured.
const ANGLES: i32 = 3;
/// Of the tolerance; the rest is for rounding. Chosen, not measured.
const USED: f64 = 0.99;

/// A car's places after that.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Places {
    pub(crate) start: MapPose,
    pub(crate) goal: MapPose,
}

/// The places of all cars.
pub(crate) fn settle(
    problem: &Problem,
    obstacles: &ObstacleIndex,
    bodies: &[Body],
) -> Result<Vec<Places>, ProblemError> {
    let starts = each(problem, obstacles, bodies, Place::Start)?;
    let goals = each(problem, obstacles, bodies, Place::Goal)?;
    Ok(starts.into_iter().zip(goals).map(|(start, goal)| Places { start, goal }).collect())
}

fn each(
    problem: &Problem,
    obstacles: &ObstacleIndex,
    bodies: &[Body],
    place: Place,
) -> Result<Vec<MapPose>, ProblemError> {
    let cars = problem.cars.iter();
    let mut poses: Vec<MapPose> =
        cars.map(|task| if place == Place::Start { task.start } else { task.goal }).collect();
    let touch = problem.step_m * TOUCH;
    for car in 0..poses.len() {
        let name = || problem.cars[car].name.clone();
        let given = poses[car];
        let (x_m, y_m) = (given.x_m, given.y_m);
        if !obstacles.inside(x_m, y_m) {
            return Err(ProblemError::Outside { place, name: name(), x_m, y_m });
        }
        let free = |pose: &MapPose| gap(obstacles, bodies, &poses, car, pose);
        if free(&given) >= 0.0 {
            continue;
        }
        let pose = moved(problem, &given, free);
        let overlap_m = -gap(obstacles, bodies, &poses, car, &pose);
        if overlap_m > touch {
            if let Some((apart, index)) = obstacles.nearest(&bodies[car], &Spot::new(&pose))
                && apart < -touch
            {
                let [x_m, y_m] = problem.obstacles[index].middle_m();
                return Err(ProblemError::Blocked { place, name: name(), overlap_m, x_m, y_m });
            }
            let body = bodies[car].at(&Spot::new(&pose));
            let overlaps = |other: &usize| {
                *other != car && body.gap_m(&bodies[*other].at(&Spot::new(&poses[*other]))) < -touch
            };
            let second =
                (0..poses.len()).find(overlaps).map_or_else(String::new, |i| problem.cars[i].name.clone());
            return Err(ProblemError::Overlap { place, first: name(), second });
        }
        poses[car] = pose;
    }
    Ok(poses)
}

/// How far a car there is from obstacles and from the others' places.
fn gap(obstacles: &ObstacleIndex, bodies: &[Body], poses: &[MapPose], car: usize, pose: &MapPose) -> f64 {
    let spot = Spot::new(pose);
    let body = bodies[car].at(&spot);
    let others = poses.iter().zip(bodies).enumerate().filter(|(other, _)| *other != car);
    let cars = others.map(|(_, (there, other))| body.gap_m(&other.at(&Spot::new(there))));
    let solids = obstacles.nearest(&bodies[car], &spot).map_or(f64::MAX, |(apart, _)| apart);
    cars.fold(solids, f64::min)
}

/// The nearest place within the tolerance that is free; else the one that overlaps least.
fn moved(problem: &Problem, given: &MapPose, free: impl Fn(&MapPose) -> f64) -> MapPose {
    let tolerance = problem.tolerance;
    let wanted = problem.clearance_m * KEPT;
    let mut best = (free(given), *given);
    for ring in 0..=DISTANCES {
        let distance = tolerance.position_m * USED * f64::from(ring) / f64::from(DISTANCES);
        for direction in 0..if ring == 0 { 1 } else { DIRECTIONS } {
            let (sin, cos) = libm::sincos(TAU * f64::from(direction) / f64::from(DIRECTIONS));
            for angle in -ANGLES..=ANGLES {
                let pose = MapPose {
                    x_m: given.x_m + distance * cos,
                    y_m: given.y_m + distance * sin,
                    yaw_rad: given.yaw_rad + tolerance.yaw_rad * USED * f64::from(angle) / f64::from(ANGLES),
                };
                let apart = free(&pose);
                if apart > best.0 {
                    best = (apart, pose);
                }
            }
        }
        if best.0 >= wanted {
            break;
        }
    }
    best.1
}
