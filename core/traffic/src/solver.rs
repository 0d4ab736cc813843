//! Traffic: ways for several cars at once on which no two ever touch.
//!
//! ```text
//!   Problem ──► Solver::new ──► solve ──► Schedule ──► check
//!               obstacles,       ├─ priorities: who gives way to whom, depth-first (PBS)
//!               ways to goals    └─ repair: new ways for a few cars around a conflict (LNS, CBS)
//!                    │                 └─ search: one car in space and time, around the others (A*)
//!                    └─ improve: shorter ways for a few cars at a time, as long as there is time (LNS)
//! ```
//!
//! Time goes in steps of equal length; in a step a car drives one arc of at most `step_m` or waits.
//! Contact is judged along the whole step, never at its ends only. A car that has arrived stays.
//!
//! Priorities: H. Ma et al., *Searching with Consistent Prioritization for Multi-Agent Path
//! Finding*, AAAI 2019. Repair: J. Li et al., *MAPF-LNS2*, AAAI 2022. Groups: G. Sharon et al.,
//! *Conflict-based search*, AIJ 219 (2015); for cars L. Wen et al., *CL-MAPF*, 2020.
//!
//! On open floors repair alone is as good; at a door priorities find a schedule up to eight times sooner.

mod alone;
mod analytic_expansion;
mod body;
mod cars;
mod check;
mod closed;
mod cost_to_go;
mod driver;
mod groups;
mod improve;
mod instance;
mod lattice;
mod motion;
mod obstacle_index;
mod order;
mod places;
mod plans;
mod priorities;
mod problem;
mod query;
mod repair;
mod schedule;
mod search;
mod table;
#[cfg(test)]
mod tests;
mod time_to_go;

pub use check::{ScheduleFault, check};
pub use order::{Precedence, precedences};
pub use problem::{
    CarTask, FloorBounds, MOST_CARS, Obstacle, Place, Problem, ProblemError, Tolerance, obstacles_of,
};
pub use schedule::{Schedule, ScheduleRow, Way};

use instance::Instance;
use plans::Plans;
use thiserror::Error;

/// How long and how hard to try.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolverSettings {
    /// Of every random choice.
    pub seed: u64,
    /// Begin with priorities, as long as they promise something; otherwise with repair at once.
    pub priorities_first: bool,
    /// Rounds of repair after which it gives up even if it may go on.
    pub most_rounds: usize,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self { seed: 1, priorities_first: true, most_rounds: 100_000 }
    }
}

/// Why there is no schedule.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unsolved {
    /// The problem cannot be.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// Even alone this car does not get there.
    #[error("no path from the start to the goal of {name}, even without the other vehicles")]
    NoWay {
        /// Its name.
        name: String,
    },
    /// The budget ended before these pairs of cars got out of each other's way.
    #[error("search budget used up; {}", trouble(conflicts, without))]
    OutOfBudget {
        /// Names, two by two.
        conflicts: Vec<(String, String)>,
        /// Names of those for which no way was found at all.
        without: Vec<String>,
    },
    /// The budget ended before the search had begun.
    #[error("search budget used up before the search started")]
    NotBegun,
}

fn trouble(conflicts: &[(String, String)], without: &[String]) -> String {
    /// More would not be read.
    const SHOWN: usize = 6;
    let mut text: Vec<String> = conflicts.iter().take(SHOWN).map(|(a, b)| format!("{a} and {b}")).collect();
    if conflicts.len() > SHOWN {
        text.push(format!("{} more pairs", conflicts.len() - SHOWN));
    }
    let mut parts = Vec::new();
    if !text.is_empty() {
        parts.push(format!("still in conflict: {}", text.join(", ")));
    }
    if !without.is_empty() {
        parts.push(format!("no path found for {}", without.join(", ")));
    }
    parts.join("; ")
}

/// A problem with everything that is computed once: several threads may solve it with other seeds.
#[derive(Debug)]
pub struct Solver {
    problem: Problem,
    instance: Instance,
}

impl Solver {
    /// Checks the problem and computes the ways to each goal. `keep_going` is asked now and then.
    ///
    /// # Errors
    /// A problem that cannot be, a car that has no way even alone, or [`Unsolved::NotBegun`].
    pub fn new(problem: &Problem, keep_going: &mut dyn FnMut() -> bool) -> Result<Self, Unsolved> {
        Ok(Self { problem: problem.clone(), instance: Instance::new(problem, None, keep_going)? })
    }

    /// The same for what came of this problem: on an unchanged floor, ways to goals that are known
    /// already are not computed again, wherever the cars are by now.
    ///
    /// # Errors
    /// Like [`Solver::new`].
    pub fn next(&self, problem: &Problem, keep_going: &mut dyn FnMut() -> bool) -> Result<Self, Unsolved> {
        let instance = Instance::new(problem, Some((&self.problem, &self.instance)), keep_going)?;
        Ok(Self { problem: problem.clone(), instance })
    }

    /// What is to be solved.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Looks for a schedule until there is one, or until `keep_going` says no. With the same settings
    /// the same schedule comes out, unless the budget ends first.
    ///
    /// # Errors
    /// [`Unsolved::OutOfBudget`].
    pub fn solve(
        &self,
        settings: &SolverSettings,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Schedule, Unsolved> {
        Ok(self.begin(settings, keep_going)?.schedule())
    }

    /// The same for a schedule that is to be [improved](Solution::improve).
    ///
    /// # Errors
    /// [`Unsolved::OutOfBudget`].
    pub fn begin(
        &self,
        settings: &SolverSettings,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Solution<'_>, Unsolved> {
        let mut plans = Plans::new(&self.instance, settings.seed);
        if settings.priorities_first {
            priorities::run(&mut plans, keep_going);
        }
        if !plans.solved() {
            repair::run(&mut plans, settings.most_rounds, keep_going);
        }
        if !plans.solved() {
            return Err(plans.unsolved());
        }
        repair::polish(&mut plans, keep_going);
        Ok(Solution { plans })
    }
}

/// A schedule that can become shorter.
#[derive(Debug)]
pub struct Solution<'s> {
    plans: Plans<'s>,
}

impl Solution<'_> {
    /// The schedule as it is now.
    #[must_use]
    pub fn schedule(&self) -> Schedule {
        self.plans.schedule()
    }

    /// Shortens it until a round of attempts, some for each car, finds nothing more, or until `keep_going`
    /// says no. Neither the makespan nor the flowtime grows. Returns how often one of them became less.
    pub fn improve(&mut self, keep_going: &mut dyn FnMut() -> bool) -> usize {
        improve::run(&mut self.plans, keep_going)
    }
}
