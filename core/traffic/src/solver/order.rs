//! Passing order: what a schedule says about who goes first, without its clock.
//!
//! Robots are never as punctual as a schedule. It stays free of contact all the same if each one waits
//! where another has to be through first; that order cannot deadlock, because the schedule itself is
//! a way to keep it (the action dependency graph of W. Hönig et al., RA-L 4 (2019)). It needs a schedule of
//! a problem that is to be driven [by order](super::Problem::by_order).

use super::body::{Body, never_meet};
use super::motion::Spot;
use super::problem::Problem;
use super::schedule::Schedule;

/// One has to be through before another goes on. Cars and rows are counted as in the schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Precedence {
    /// Who waits.
    pub car: usize,
    /// What it may not begin yet: the way from this row to the next one.
    pub row: usize,
    /// For whom.
    pub first: usize,
    /// Where that one has to have arrived, at least.
    pub reached: usize,
}

/// Everybody's precedences, sorted by car, row and whom it waits for; for each of these the latest one.
/// Bodies keep `clearance_m`, whoever is early or late.
#[must_use]
pub fn precedences(problem: &Problem, schedule: &Schedule, clearance_m: f64) -> Vec<Precedence> {
    let bodies: Vec<Body> = problem.cars.iter().map(|task| Body::new(&task.car)).collect();
    let spots: Vec<Vec<Spot>> =
        schedule.ways.iter().map(|way| way.rows.iter().map(|row| Spot::new(&row.pose)).collect()).collect();
    let mut found = Vec::new();
    for car in 0..schedule.ways.len() {
        for first in (0..schedule.ways.len()).filter(|&first| first != car) {
            let mut waits_for = 0;
            for row in 0..schedule.ways[car].rows.len() {
                // Backwards in time from what is driven in the same step: the latest one is enough.
                let last = row.min(schedule.ways[first].rows.len().saturating_sub(1));
                let met = (waits_for..last).rev().find(|&earlier| {
                    let mine = (&bodies[car], &spots[car][row], &schedule.ways[car].rows[row].piece);
                    let driven = &schedule.ways[first].rows[earlier].piece;
                    !never_meet(mine, (&bodies[first], &spots[first][earlier], driven), clearance_m)
                });
                if let Some(earlier) = met {
                    waits_for = earlier + 1;
                    found.push(Precedence { car, row, first, reached: earlier + 1 });
                }
            }
        }
    }
    found.sort_unstable();
    found
}
