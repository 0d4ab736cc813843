//! Ways without the other cars: whether there are any, and how long a schedule may be.

use super::Unsolved;
use super::cost_to_go::Grain;
use super::instance::{Instance, MOST_STEPS};
use super::problem::Problem;
use super::query::{ANY, Manner, Query, Rank};
use super::search::Search;
use super::table::{Table, WORD};

/// For one car without the others: nearly its shortest way; chosen, not measured.
const MANNER: Manner = Manner { clash_steps: 0, heuristic_weight: 120, most_nodes: 30_000, most_steps: ANY };
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
        let mut alone = Vec::with_capacity(instance.cars());
        let first = instance.steps_alone(0..instance.cars());
        for (me, steps) in first.into_iter().enumerate() {
            alone.push(match steps {
                Some(steps) => steps,
                None => instance.closer(problem, me, keep_going)?,
            });
        }
        let longest = alone.iter().copied().max().unwrap_or(0);
        instance.horizon = (2 * longest + SPARE_STEPS).next_multiple_of(WORD).min(MOST_STEPS);
        instance.alone = alone;
        Ok(instance)
    }

    /// Steps that each of these cars needs without the others, if it finds a way.
    fn steps_alone(&self, cars: std::ops::Range<usize>) -> Vec<Option<usize>> {
        let ranks = vec![Rank::Ignored; self.cars()];
        let (mut search, table) = (Search::new(), Table::new(self));
        cars.map(|me| {
            let query = Query { me, ranks: &ranks, constraints: &[], manner: MANNER };
            search.run(self, &table, &query).map(|track| track.steps())
        })
        .collect()
    }

    /// The same for one that found no way, looking closer.
    fn closer(
        &mut self,
        problem: &Problem,
        me: usize,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<usize, Unsolved> {
        for grain in [Grain::SHORT, Grain::FINE] {
            let Self { obstacles, drivers, .. } = self;
            drivers[me].look(problem, obstacles, grain, keep_going).ok_or(Unsolved::NotBegun)?;
            if let Some(steps) = self.steps_alone(me..me + 1)[0] {
                return Ok(steps);
            }
        }
        Err(Unsolved::NoWay { name: self.drivers[me].name.clone() })
    }
}
