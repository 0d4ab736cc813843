//! A checked problem with what is computed once for it.

use super::Unsolved;
use super::body::{Body, never_meet, pass};
use super::cost_to_go::Grain;
use super::driver::Driver;
use super::lattice::Lattice;
use super::motion::Spot;
use super::obstacle_index::{Keep, ObstacleIndex};
use super::places::{Places, TOUCH, settle};
use super::problem::{CarTask, Problem};
use xtb_nav::{MapPose, Piece};

/// What a gap may differ by when it is computed another time, in m: far more than f64's.
const ROUNDING_M: f64 = 1e-9;
/// Longest schedule, in steps: a bound for the tables' memory; chosen, not measured.
pub(crate) const MOST_STEPS: usize = 1024;

/// Everything that stays the same while schedules are looked for.
#[derive(Debug)]
pub(crate) struct Instance {
    pub(crate) obstacles: ObstacleIndex,
    pub(crate) lattice: Lattice,
    pub(crate) drivers: Vec<Driver>,
    /// Between two cars, in m; row by row.
    margins: Vec<f64>,
    pub(crate) step: f64,
    /// See [`Problem::by_order`].
    by_order: bool,
    /// Longest schedule, in steps.
    pub(crate) horizon: usize,
    /// Of each car's way without the others.
    pub(crate) alone: Vec<usize>,
    /// Farthest corner of any car from its middle, in m.
    pub(crate) reach: f64,
    /// Farthest corner of any car from its reference point, in m.
    pub(crate) farthest: f64,
}

impl Instance {
    /// Before anybody looked for a way. `known` is the instance of another problem, if there was one: what is
    /// the same is not computed again.
    pub(crate) fn unbounded(
        problem: &Problem,
        known: Option<(&Problem, &Self)>,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Self, Unsolved> {
        problem.validate()?;
        let bodies: Vec<Body> = problem.cars.iter().map(|task| Body::new(&task.car)).collect();
        let most = |of: &dyn Fn(usize) -> f64| (0..bodies.len()).map(of).fold(0.0, f64::max);
        let reach = most(&|i| bodies[i].reach);
        let farthest = most(&|i| bodies[i].reach_of_reference());
        let way = most(&|i| bodies[i].way(&full_lock(problem.step_m, problem.cars[i].car.radius_m)));
        let obstacles =
            ObstacleIndex::new(problem, farthest + way + problem.clearance_m.max(0.0) + problem.step_m);
        let places = settle(problem, &obstacles, &bodies)?;
        let margins = car_margins(problem, &bodies, &places);
        let lattice = Lattice::new(problem, Grain::COARSE.side);
        let mut drivers = Vec::with_capacity(bodies.len());
        for ((task, body), places) in problem.cars.iter().zip(bodies).zip(&places) {
            let exceptions = exceptions(problem.clearance_m, &obstacles, &body, places);
            let keep = Keep { margin: problem.clearance_m, exceptions };
            let known = known.and_then(|(before, instance)| instance.same(before, problem, task, places));
            let driver = Driver::new(problem, &obstacles, (task, body, keep, places), known, keep_going);
            drivers.push(driver.ok_or(Unsolved::NotBegun)?);
        }
        let (step, horizon) = (problem.step_m, MOST_STEPS);
        let by_order = problem.by_order;
        let alone = Vec::new();
        Ok(Self { obstacles, lattice, drivers, margins, step, by_order, horizon, alone, reach, farthest })
    }

    /// The same car on the same floor on the way to the same goal.
    fn same(&self, before: &Problem, now: &Problem, task: &CarTask, places: &Places) -> Option<&Driver> {
        let floor = |problem: &Problem| (problem.bounds, problem.step_m, problem.clearance_m);
        let changed = before.obstacles != now.obstacles || before.one_way != now.one_way;
        if floor(before) != floor(now) || changed {
            return None;
        }
        let mut cars = before.cars.iter().zip(&self.drivers);
        let start = Spot::new(&places.start);
        cars.find(|(known, driver)| {
            known.car == task.car && driver.goal == places.goal && driver.to_goal.serves(&start)
        })
        .map(|(_, driver)| driver)
    }

    /// Between two cars, in m.
    #[inline]
    pub(crate) fn margin(&self, a: usize, b: usize) -> f64 {
        self.margins[a * self.drivers.len() + b]
    }

    /// Whether two cars stay clear of each other in one step.
    pub(crate) fn pass(&self, a: (usize, &Spot, &Piece), b: (usize, &Spot, &Piece)) -> bool {
        let of = |car: usize| &self.drivers[car].body;
        let (mine, theirs, margin) = ((of(a.0), a.1, a.2), (of(b.0), b.1, b.2), self.margin(a.0, b.0));
        if self.by_order { never_meet(mine, theirs, margin) } else { pass(mine, theirs, margin) }
    }

    pub(crate) fn cars(&self) -> usize {
        self.drivers.len()
    }
}

fn full_lock(step: f64, radius: f64) -> Piece {
    Piece { length_m: step, curvature_per_m: 1.0 / radius }
}

/// The wished clearance, or what starts and goals leave of it.
fn car_margins(problem: &Problem, bodies: &[Body], places: &[Places]) -> Vec<f64> {
    let (count, touch) = (bodies.len(), problem.step_m * TOUCH);
    let mut margins = vec![problem.clearance_m; count * count];
    for a in 0..count {
        for b in 0..a {
            let gap = |at: &MapPose, there: &MapPose| {
                bodies[b].at(&Spot::new(at)).gap_m(&bodies[a].at(&Spot::new(there)))
            };
            let (first, second) = (&places[b], &places[a]);
            // A start may lie on another's goal: these two are not taken at the same time then.
            let gaps = [
                gap(&first.start, &second.start),
                gap(&first.goal, &second.goal),
                gap(&first.start, &second.goal),
                gap(&first.goal, &second.start),
            ];
            let kept = gaps.into_iter().filter(|&apart| apart >= -touch);
            let margin = kept.map(|apart| apart - ROUNDING_M).fold(problem.clearance_m, f64::min);
            margins[a * count + b] = margin;
            margins[b * count + a] = margin;
        }
    }
    margins
}

/// The same for obstacles: those nearer to a start or goal than the clearance.
fn exceptions(clearance_m: f64, obstacles: &ObstacleIndex, body: &Body, places: &Places) -> Vec<(u32, f64)> {
    let near = |pose: &MapPose| {
        obstacles.gaps(body, &Spot::new(pose)).filter(|(gap, _)| *gap < clearance_m).collect()
    };
    let mut found: Vec<(f64, usize)> = near(&places.start);
    found.extend::<Vec<_>>(near(&places.goal));
    found.into_iter().map(|(gap, index)| (index as u32, gap - ROUNDING_M)).collect()
}
