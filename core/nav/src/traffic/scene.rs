//! A checked problem with what is computed once for it.

use super::Unsolved;
use super::body::{Body, pass};
use super::cost_to_go::{CostToGo, Lattice};
use super::floor::Floor;
use super::motion::{Spot, WAIT};
use super::problem::{Place, Problem, ProblemError};
use crate::{MapPose, Piece};

/// Overlap of starts or goals that counts as touching, in parts of a step.
const TOUCH: f64 = 0.005;
/// Longest schedule, in steps.
const MOST_STEPS: usize = 1024;
/// Time beyond the longest way alone, in steps.
const SPARE_STEPS: usize = 96;

/// One car, ready for the search.
#[derive(Debug)]
pub(crate) struct Driver {
    pub(crate) name: String,
    pub(crate) body: Body,
    pub(crate) radius: f64,
    pub(crate) start: Spot,
    pub(crate) goal: MapPose,
    /// Straight, left and right, ahead and astern.
    pub(crate) moves: [Piece; 6],
    /// To obstacles, in m.
    pub(crate) margin: f64,
    pub(crate) to_goal: CostToGo,
}

/// Everything that stays the same while schedules are looked for.
#[derive(Debug)]
pub(crate) struct Scene {
    pub(crate) floor: Floor,
    pub(crate) lattice: Lattice,
    pub(crate) drivers: Vec<Driver>,
    /// Between two cars, in m; row by row.
    margins: Vec<f64>,
    pub(crate) step: f64,
    /// Longest schedule, in steps.
    pub(crate) horizon: usize,
    /// Farthest corner of any car from its middle, in m.
    pub(crate) reach: f64,
    /// Farthest corner of any car from its reference point, in m.
    pub(crate) farthest: f64,
}

impl Scene {
    pub(crate) fn new(problem: &Problem, keep_going: &mut dyn FnMut() -> bool) -> Result<Self, Unsolved> {
        problem.validate()?;
        let bodies: Vec<Body> = problem.cars.iter().map(|task| Body::new(&task.car)).collect();
        let most = |of: &dyn Fn(usize) -> f64| (0..bodies.len()).map(of).fold(0.0, f64::max);
        let reach = most(&|i| bodies[i].reach);
        let farthest = most(&|i| bodies[i].reach_of_reference());
        let way = most(&|i| bodies[i].way(&full_lock(problem.step_m, problem.cars[i].car.radius_m)));
        let floor = Floor::new(problem, farthest + way + problem.clearance_m.max(0.0) + problem.step_m);
        let margins = car_margins(problem, &bodies)?;
        let lattice = Lattice::new(problem);
        let mut drivers = Vec::with_capacity(bodies.len());
        let mut longest = 0;
        for (task, body) in problem.cars.iter().zip(bodies) {
            let margin = floor_margin(problem, &floor, &body, task)?;
            let (start, goal) = (Spot::new(&task.start), Spot::new(&task.goal));
            let moves = moves(problem.step_m, task.car.radius_m);
            let flood = CostToGo::flood(&lattice, &floor, (&body, &moves, margin), goal, keep_going);
            let to_goal = flood.ok_or(Unsolved::NotBegun)?;
            let steps = to_goal.steps(&lattice, &start);
            longest = longest.max(steps.ok_or_else(|| Unsolved::NoWay { name: task.name.clone() })?);
            let (name, goal, radius) = (task.name.clone(), task.goal, task.car.radius_m);
            drivers.push(Driver { name, body, radius, start, goal, moves, margin, to_goal });
        }
        let horizon = (2 * usize::from(longest) + SPARE_STEPS).next_multiple_of(64).min(MOST_STEPS);
        Ok(Self { floor, lattice, drivers, margins, step: problem.step_m, horizon, reach, farthest })
    }

    /// Between two cars, in m.
    #[inline]
    pub(crate) fn margin(&self, a: usize, b: usize) -> f64 {
        self.margins[a * self.drivers.len() + b]
    }

    /// Whether two cars stay clear of each other in one step.
    pub(crate) fn pass(&self, a: (usize, &Spot, &Piece), b: (usize, &Spot, &Piece)) -> bool {
        let of = |car: usize| &self.drivers[car].body;
        pass((of(a.0), a.1, a.2), (of(b.0), b.1, b.2), self.margin(a.0, b.0))
    }

    pub(crate) fn cars(&self) -> usize {
        self.drivers.len()
    }
}

fn full_lock(step: f64, radius: f64) -> Piece {
    Piece { length_m: step, curvature_per_m: 1.0 / radius }
}

fn moves(step: f64, radius: f64) -> [Piece; 6] {
    let piece = |gear: f64, turn: f64| Piece { length_m: gear * step, curvature_per_m: turn / radius };
    [piece(1.0, 0.0), piece(1.0, 1.0), piece(1.0, -1.0), piece(-1.0, 0.0), piece(-1.0, 1.0), piece(-1.0, -1.0)]
}

/// The wished clearance, or what starts and goals leave of it.
fn car_margins(problem: &Problem, bodies: &[Body]) -> Result<Vec<f64>, ProblemError> {
    let (count, touch) = (bodies.len(), problem.step_m * TOUCH);
    let mut margins = vec![problem.clearance_m; count * count];
    for a in 0..count {
        for b in 0..a {
            let (first, second) = (&problem.cars[b], &problem.cars[a]);
            let gap = |at: &MapPose, there: &MapPose| {
                bodies[b].at(&Spot::new(at)).gap(&bodies[a].at(&Spot::new(there)))
            };
            let (starts, goals) = (gap(&first.start, &second.start), gap(&first.goal, &second.goal));
            for (place, apart) in [(Place::Start, starts), (Place::Goal, goals)] {
                if apart < -touch {
                    let (first, second) = (first.name.clone(), second.name.clone());
                    return Err(ProblemError::Overlap { place, first, second });
                }
            }
            // A start may lie on another's goal: these two are not taken at the same time then.
            let crossed = [gap(&first.start, &second.goal), gap(&first.goal, &second.start)];
            let kept = crossed.into_iter().filter(|&apart| apart >= -touch);
            let least = kept.fold(starts.min(goals), f64::min);
            let margin = problem.clearance_m.min(least - 1e-9);
            margins[a * count + b] = margin;
            margins[b * count + a] = margin;
        }
    }
    Ok(margins)
}

fn floor_margin(
    problem: &Problem,
    floor: &Floor,
    body: &Body,
    task: &super::problem::Task,
) -> Result<f64, ProblemError> {
    let mut margin = problem.clearance_m;
    for (place, pose) in [(Place::Start, &task.start), (Place::Goal, &task.goal)] {
        let (name, spot) = (task.name.clone(), Spot::new(pose));
        let (x_m, y_m) = (pose.x_m, pose.y_m);
        if !floor.clear(body, &spot, &WAIT, f64::NEG_INFINITY) {
            return Err(ProblemError::Outside { place, name, x_m, y_m });
        }
        let Some((gap, index)) = floor.nearest(body, &spot) else { continue };
        if gap < -problem.step_m * TOUCH {
            let [x_m, y_m] = problem.obstacles[index].middle_m();
            return Err(ProblemError::Blocked { place, name, x_m, y_m });
        }
        margin = margin.min(gap - 1e-9);
    }
    Ok(margin)
}
