//! How many steps it takes to a goal from anywhere and any step, around the tracks of the others: the heuristic of a
//! search that has to wait. Without it all ways of passing the time promise the same.
//!
//! Backwards in time from when the others stand for good, on the search's squares, for a disc around the car's reference
//! point, as wide as the car is long, that moves in any direction: cars that meet at a door wait at its ends for each
//! other, not beside each other. How a car turns is in the [cost to go](super::cost_to_go), below which it never is. It
//! is an estimate and no bound: where two cars have room beside each other it may be too long.

use super::cost_to_go::Grain;
use super::instance::Instance;
use super::query::{Query, Rank};
use super::table::Table;

/// No way.
const NEVER: u16 = u16::MAX;
/// What a step in the place of a car that must not be met counts, in steps: finite, as who stands very close to it has
/// to get away. Chosen; 10 and 1,000 find schedules at a door as soon.
const HARD_STEPS: u16 = 40;
/// Most squares times steps: 32 MiB of memory. Chosen, not measured.
const MOST: usize = 16 << 20;
/// So many of them are filled in the time that a node of a search takes, roughly.
const A_NODE: usize = 2_000;
/// Squares along an axis that a step may lead on: a step is two long, wherever in its square it begins.
const FAR: usize = 2;

/// Steps to one goal, by step and square; kept from one search to the next for its memory.
#[derive(Debug, Default)]
pub(crate) struct TimeToGo {
    /// One layer after the other, each with a frame of squares where nobody can be.
    steps: Vec<u16>,
    /// Squares of a layer, and along a row of it, with the frame; without it.
    layer: usize,
    along: usize,
    columns: usize,
    last: usize,
    /// Of one layer: what a step there costs beyond itself, and the cost to go.
    costs: Vec<u16>,
    least: Vec<u16>,
}

impl TimeToGo {
    /// Takes the measures of the floor, for a goal that can be kept from `goal_opens` on. What [`Self::fill`] will take
    /// in nodes of a search; `None` if that is too much, on a floor with other squares, and if nobody is in the way.
    pub(crate) fn measure(
        &mut self,
        instance: &Instance,
        table: &Table<'_>,
        query: &Query<'_>,
        goal_opens: u32,
    ) -> Option<u32> {
        let (lattice, driver) = (&instance.lattice, &instance.drivers[query.me]);
        let usual = instance.step * Grain::COARSE.side;
        let is_usual = lattice.side == usual && driver.to_goal.side_m() == usual;
        let counts = |(car, rank): (usize, &Rank)| {
            car != query.me && *rank != Rank::Ignored && table.track(car).is_some()
        };
        if !is_usual || !query.ranks.iter().enumerate().any(counts) {
            return None;
        }
        self.columns = lattice.columns;
        self.along = lattice.columns + 2 * FAR;
        self.layer = self.along * (lattice.rows + 2 * FAR);
        self.last = table.steps().max(goal_opens as usize).min(instance.horizon - 1);
        let squares = self.layer * (self.last + 1);
        (squares <= MOST).then_some((squares / A_NODE) as u32)
    }

    /// Looks from the goal, with the measures that were taken.
    pub(crate) fn fill(
        &mut self,
        instance: &Instance,
        table: &Table<'_>,
        query: &Query<'_>,
        goal_opens: u32,
    ) {
        let (lattice, driver) = (&instance.lattice, &instance.drivers[query.me]);
        self.least.clear();
        self.least.resize(self.layer, NEVER);
        for square in 0..lattice.squares() {
            let [x, y] = lattice.middle(square % lattice.columns, square / lattice.columns);
            let slot = self.slot(square);
            self.least[slot] = driver.to_goal.least(x, y);
        }
        let goal = self.slot(lattice.square(driver.goal.x_m, driver.goal.y_m));
        self.least[goal] = 0;
        self.steps.clear();
        self.steps.resize(self.layer * (self.last + 1), NEVER);
        for step in (0..=self.last).rev() {
            self.weigh(instance, table, query, step);
            let (now, later) = self.steps[step * self.layer..].split_at_mut(self.layer);
            if later.is_empty() {
                now.copy_from_slice(&self.least);
            } else {
                earlier(self.along, &later[..self.layer], now);
            }
            for ((now, cost), least) in now.iter_mut().zip(&self.costs).zip(&self.least) {
                *now = now.saturating_add(*cost).max(*least);
            }
            if step >= goal_opens as usize {
                now[goal] = 0;
            }
        }
    }

    /// Steps from a square in a step; 0 where no way leads, of which the cost to go knows more.
    #[inline]
    pub(crate) fn at(&self, square: usize, step: usize) -> u32 {
        let steps = self.steps[step.min(self.last) * self.layer + self.slot(square)];
        if steps == NEVER { 0 } else { u32::from(steps) }
    }

    #[inline]
    fn slot(&self, square: usize) -> usize {
        (square / self.columns + FAR) * self.along + square % self.columns + FAR
    }

    /// What the others make of the squares in a step.
    fn weigh(&mut self, instance: &Instance, table: &Table<'_>, query: &Query<'_>, step: usize) {
        let lattice = &instance.lattice;
        let mine = instance.drivers[query.me].body.half_length();
        let mut costs = std::mem::take(&mut self.costs);
        costs.clear();
        costs.resize(self.layer, 0);
        for (other, rank) in query.ranks.iter().enumerate() {
            let cost = match rank {
                Rank::Ignored => continue,
                Rank::Soft => query.manner.clash_steps as u16,
                Rank::Hard => HARD_STEPS,
            };
            let Some(track) = table.track(other).filter(|_| other != query.me) else { continue };
            let (body, spot) = (&instance.drivers[other].body, track.at(step).0);
            let far = mine + instance.margin(query.me, other) - lattice.side / 2.0;
            let (there, [x, y], around) = (body.at(spot), body.centre(spot), body.reach + far);
            let (low, high) = (lattice.cell(x - around, y - around), lattice.cell(x + around, y + around));
            for row in low.1..=high.1 {
                for column in low.0..=high.0 {
                    let [x, y] = lattice.middle(column, row);
                    if there.distance_m(x, y) < far {
                        let slot = &mut costs[self.slot(row * lattice.columns + column)];
                        *slot = slot.saturating_add(cost);
                    }
                }
            }
        }
        self.costs = costs;
    }
}

/// What is `now` if it is `later` a step afterwards, wherever that leads.
fn earlier(along: usize, later: &[u16], now: &mut [u16]) {
    let inner = FAR * along + FAR..later.len() - FAR * along - FAR;
    now.fill(NEVER);
    for row in 0..=2 * FAR {
        for column in 0..=2 * FAR {
            // No step but one from corner to corner leads to the corners.
            if row % (2 * FAR) == 0 && column % (2 * FAR) == 0 {
                continue;
            }
            let there = &later[row * along + column..][..inner.len()];
            now[inner.clone()].iter_mut().zip(there).for_each(|(now, there)| *now = (*now).min(*there));
        }
    }
    now.iter_mut().for_each(|now| *now = now.saturating_add(1));
}
