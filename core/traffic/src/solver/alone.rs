//! Ways without the other cars: whether there are any, and how long a schedule may be.

use super::Unsolved;
use super::cost_to_go::Grain;
use super::instance::{Instance, MOST_STEPS};
use super::problem::Problem;
use super::search::{Manner, Query, Rank, Search};
use super::table::{Table, WORD};

/// For one car without the others: nearly its shortest way; chosen, not measured.
const MANNER: Manner = Manner { clash_steps: 0, heuristic_weight: 120, most_nodes: 30_000 };
/// Time beyond twice the longest of these ways, in steps, for making room; chosen, not measured.
const SPARE_STEPS: usize = 96;

impl Instance {
    /// Of a problem, with what is the same in `known`, the instance of another one.
    pub(crate) fn new(
        problem: &Problem,
        known: Option<(&Problem, &Self)>,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Self, Unsolved> {
        let mut instance = Self::unbounded(problem, known, keep_going)?;
        let mut longest = 0;
        for car in 0..instance.cars() {
            longest = longest.max(instance.steps_alone(problem, car, keep_going)?);
        }
        instance.horizon = (2 * longest + SPARE_STEPS).next_multiple_of(WORD).min(MOST_STEPS);
        Ok(instance)
    }

    /// Steps that a car needs without the others. Where it finds no way it looks closer.
    fn steps_alone(
        &mut self,
        problem: &Problem,
        me: usize,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<usize, Unsolved> {
        let ranks = vec![Rank::Ignored; self.cars()];
        let query = Query { me, ranks: &ranks, constraints: &[], manner: MANNER };
        for grain in [None, Some(Grain::SHORT), Some(Grain::FINE)] {
            if let Some(grain) = grain {
                let Self { obstacles, drivers, .. } = self;
                drivers[me].look(problem, obstacles, grain, keep_going).ok_or(Unsolved::NotBegun)?;
            }
            if let Some(track) = Search::new().run(self, &Table::new(self), &query) {
                return Ok(track.steps());
            }
        }
        Err(Unsolved::NoWay { name: self.drivers[me].name.clone() })
    }
}
