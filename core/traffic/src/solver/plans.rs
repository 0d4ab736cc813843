//! All cars' tracks and who is in whose way: what priorities and repair work on.

use super::Unsolved;
use super::cars::{Cars, bits};
use super::instance::Instance;
use super::motion::WAIT;
use super::query::{Constraint, Manner, Query, Rank};
use super::schedule::Schedule;
use super::search::Search;
use super::table::{Table, Track};
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::rc::Rc;

/// The state of the search for a schedule.
#[derive(Debug)]
pub(crate) struct Plans<'s> {
    pub(crate) instance: &'s Instance,
    pub(crate) table: Table<'s>,
    pub(crate) search: Search,
    random: Pcg32,
    /// Who is in whose way; symmetric.
    clashes: Vec<Cars>,
}

impl<'s> Plans<'s> {
    pub(crate) fn new(instance: &'s Instance, seed: u64) -> Self {
        Self {
            instance,
            table: Table::new(instance),
            search: Search::new(),
            random: Pcg32::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15), 5),
            clashes: vec![0; instance.cars()],
        }
    }

    pub(crate) fn cars(&self) -> usize {
        self.instance.cars()
    }

    /// Uniform in 0..`below`.
    pub(crate) fn draw(&mut self, below: usize) -> usize {
        ((u64::from(self.random.next_u32()) * below.max(1) as u64) >> 32) as usize
    }

    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let other = self.draw(last + 1);
            items.swap(last, other);
        }
    }

    /// A track for a car, with ranks for all others. Nothing changes.
    pub(crate) fn search(
        &mut self,
        me: usize,
        ranks: &[Rank],
        constraints: &[Constraint],
        manner: Manner,
    ) -> Option<Rc<Track>> {
        self.search.run(self.instance, &self.table, &Query { me, ranks, constraints, manner }).map(Rc::new)
    }

    /// Gives a car its track.
    pub(crate) fn put(&mut self, car: usize, track: Rc<Track>) {
        self.take(car);
        let met = self.met_by(car, &track);
        self.table.put(car, track);
        self.clashes[car] = met;
        for other in bits(met) {
            self.clashes[other] |= 1 << car;
        }
    }

    /// Takes it away.
    pub(crate) fn take(&mut self, car: usize) -> Option<Rc<Track>> {
        for other in bits(self.clashes[car]) {
            self.clashes[other] &= !(1 << car);
        }
        self.clashes[car] = 0;
        self.table.take(car)
    }

    /// Whom a car would be in the way of on this track.
    pub(crate) fn met_by(&self, car: usize, track: &Track) -> Cars {
        let last = self.table.steps().max(track.steps());
        let mut met: Cars = 0;
        for step in 0..=last {
            self.table.meets(car, track.at(step), step, |other| {
                met |= 1 << other;
                true
            });
        }
        met
    }

    /// Cars that this one is in the way of.
    pub(crate) fn clashes(&self, car: usize) -> Cars {
        self.clashes[car]
    }

    /// Pairs that are in each other's way.
    pub(crate) fn pairs(&self) -> usize {
        self.clashes.iter().map(|cars| cars.count_ones() as usize).sum::<usize>() / 2
    }

    /// Cars that are in the way of somebody.
    pub(crate) fn clashing(&self) -> Vec<usize> {
        (0..self.cars()).filter(|&car| self.clashes[car] != 0).collect()
    }

    /// Cars without a track.
    pub(crate) fn missing(&self) -> Vec<usize> {
        (0..self.cars()).filter(|&car| self.table.track(car).is_none()).collect()
    }

    pub(crate) fn solved(&self) -> bool {
        self.clashes.iter().all(|&cars| cars == 0) && self.missing().is_empty()
    }

    /// First step in which two cars touch.
    pub(crate) fn first_clash(&self, a: usize, b: usize) -> Option<usize> {
        let (first, second) = (self.table.track(a)?, self.table.track(b)?);
        (0..=first.steps().max(second.steps())).find(|&step| {
            let ((at, piece), (there, driven)) = (first.at(step), second.at(step));
            !self.instance.pass((a, at, piece), (b, there, driven))
        })
    }

    /// Where a car is in a step, and what it drives.
    pub(crate) fn constraint(&self, car: usize, step: usize) -> Option<Constraint> {
        let track = self.table.track(car)?;
        let (spot, piece) = track.at(step);
        let stays = step >= track.steps() && *piece == WAIT;
        Some(Constraint { car, step, spot: *spot, piece: *piece, stays })
    }

    /// Sum of all cars' steps.
    pub(crate) fn flowtime(&self) -> usize {
        (0..self.cars()).filter_map(|car| self.table.track(car)).map(|track| track.steps()).sum()
    }

    pub(crate) fn schedule(&self) -> Schedule {
        Schedule::new(self.instance, |car| self.table.track(car).map(Rc::as_ref))
    }

    pub(crate) fn unsolved(&self) -> Unsolved {
        let name = |car: usize| self.instance.drivers[car].name.clone();
        let pairs =
            (0..self.cars()).flat_map(|a| bits(self.clashes[a]).filter(move |&b| a < b).map(move |b| (a, b)));
        let conflicts: Vec<_> = pairs.map(|(a, b)| (name(a), name(b))).collect();
        let without = self.missing().into_iter().map(name).collect();
        Unsolved::OutOfBudget { conflicts, without }
    }
}
