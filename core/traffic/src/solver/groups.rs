//! Small groups for which no order of priorities works: conflict-based search, a move at a time.
//! Everybody outside of the group is a wall.

use super::plans::Plans;
use super::query::{ANY, Constraint, Manner, Rank};
use super::table::Track;
use crate::conflicts::{self, Conflict};
use std::rc::Rc;

/// Most cars of a group: the choices double with each move that is forbidden. Chosen, not measured.
pub(crate) const MOST: usize = 3;
/// Choices that are looked at; chosen, not measured.
const MOST_CHOICES: usize = 60;
/// One search of a group, nearly the shortest way; chosen, not measured.
const MANNER: Manner = Manner { clash_steps: 1, heuristic_weight: 110, most_nodes: 4_000, most_steps: ANY };

/// Some of the cars; the tracks that were looked at last are those in `plans`.
struct Group<'g, 's> {
    plans: &'g mut Plans<'s>,
    cars: &'g [usize],
    keep_going: &'g mut dyn FnMut() -> bool,
}

/// Plans the group anew around all others. If that fails everything stays as it was.
pub(crate) fn run(plans: &mut Plans<'_>, cars: &[usize], keep_going: &mut dyn FnMut() -> bool) -> bool {
    let old: Vec<_> = cars.iter().map(|&car| plans.take(car)).collect();
    let found = conflicts::resolve(&mut Group { plans, cars, keep_going }, MOST_CHOICES, &mut 0);
    if found.is_none() {
        for (&car, track) in cars.iter().zip(old) {
            plans.take(car);
            if let Some(track) = track {
                plans.put(car, track);
            }
        }
    }
    found.is_some()
}

impl conflicts::Group for Group<'_, '_> {
    type Way = Rc<Track>;
    type Constraint = Constraint;

    fn size(&self) -> usize {
        self.cars.len()
    }

    /// A track around everybody outside of the group. The search must not see the car's own old track,
    /// and it never does.
    fn way(&mut self, member: usize, constraints: &[Constraint]) -> Option<Rc<Track>> {
        let mut ranks = vec![Rank::Hard; self.plans.cars()];
        for &car in self.cars {
            ranks[car] = Rank::Soft;
        }
        self.plans.search(self.cars[member], &ranks, constraints, MANNER)
    }

    fn cost(&self, ways: &[Rc<Track>]) -> usize {
        ways.iter().map(|track| track.steps()).sum()
    }

    /// The first contact; leaves the tracks in place.
    fn conflict(&mut self, ways: &[Rc<Track>]) -> Option<Conflict<Constraint>> {
        for (&car, track) in self.cars.iter().zip(ways) {
            self.plans.put(car, track.clone());
        }
        let (plans, cars) = (&*self.plans, self.cars);
        let pairs = (0..cars.len()).flat_map(|a| (a + 1..cars.len()).map(move |b| (a, b)));
        let clashes = pairs.filter_map(|(a, b)| Some((a, b, plans.first_clash(cars[a], cars[b])?)));
        let (one, other, step) = clashes.min_by_key(|&(_, _, step)| step)?;
        let (avoids, avoids_too) = (plans.constraint(cars[other], step)?, plans.constraint(cars[one], step)?);
        Some(Conflict { one, avoids, other, avoids_too })
    }

    fn goes_on(&mut self) -> bool {
        (self.keep_going)()
    }
}
