//! Two solvers with different beginnings, each on a thread of its own. Each improves its schedule until it
//! finds nothing more; the better of what both have soon after each other wins.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use xtb_traffic::solver::{Problem, Schedule, Solver, SolverSettings, Unsolved};

/// How often somebody looks whether it has ended.
pub(super) const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long the second one may still go on when the first finds nothing better.
const GRACE: Duration = Duration::from_millis(300);

/// What came out, and from what it came.
#[derive(Debug)]
pub(super) struct Planned {
    pub(super) schedule: Schedule,
    pub(super) first: First,
    /// How often makespan or flowtime became less since.
    pub(super) improved: usize,
}

/// The first schedule that any of the two found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct First {
    /// How long that took.
    pub(super) after: Duration,
    /// In steps.
    pub(super) makespan: usize,
    /// In steps.
    pub(super) flowtime: usize,
}

type Outcome = Result<Planned, Unsolved>;

/// A race that runs.
#[derive(Debug)]
pub(super) struct Race {
    stop: Arc<AtomicBool>,
    outcome: Arc<Mutex<Option<Outcome>>>,
}

impl Race {
    /// Begins; it ends by itself at `deadline`.
    pub(super) fn start(problem: &Problem, seed: u64, deadline: Instant) -> Self {
        let (stop, outcome) = (Arc::new(AtomicBool::new(false)), Arc::new(Mutex::new(None)));
        let race = Self { stop: stop.clone(), outcome: outcome.clone() };
        let problem = problem.clone();
        std::thread::spawn(move || {
            // Whoever waits for it is told; what went wrong is on standard error.
            let ended = catch_unwind(AssertUnwindSafe(|| run(&problem, seed, deadline, &stop)));
            let ended = ended.unwrap_or(Err(Unsolved::NotBegun));
            *outcome.lock().unwrap_or_else(PoisonError::into_inner) = Some(ended);
        });
        race
    }

    /// Gives up.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// How it ended, once.
    pub(super) fn ended(&self) -> Option<Outcome> {
        self.outcome.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

fn run(problem: &Problem, seed: u64, deadline: Instant, stop: &AtomicBool) -> Outcome {
    let begun = Instant::now();
    let on_time = || !stop.load(Ordering::Relaxed) && Instant::now() < deadline;
    let solver = Solver::new(problem, &mut || on_time())?;
    // When one of them had found nothing better for a while.
    let ended: Mutex<Option<Instant>> = Mutex::new(None);
    let since = || ended.lock().unwrap_or_else(PoisonError::into_inner).map(|at| at.elapsed());
    let solve = |seed: u64, priorities_first: bool| -> Outcome {
        let mut go_on = || on_time() && since().is_none_or(|since| since < GRACE);
        let settings = SolverSettings { seed, priorities_first, ..SolverSettings::default() };
        let mut solution = solver.begin(&settings, &mut go_on)?;
        let schedule = solution.schedule();
        let (makespan, flowtime) = (schedule.makespan(), schedule.flowtime());
        let first = First { after: begun.elapsed(), makespan, flowtime };
        let improved = solution.improve(&mut go_on);
        ended.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(Instant::now);
        Ok(Planned { schedule: solution.schedule(), first, improved })
    };
    let (one, other) = std::thread::scope(|scope| {
        let other = scope.spawn(|| solve(seed.wrapping_add(1), false));
        (solve(seed, true), other.join())
    });
    // A thread that panicked has told so on standard error.
    let other = other.unwrap_or(Err(Unsolved::NotBegun));
    match (one, other) {
        (Ok(one), Ok(other)) => Ok(better(one, other)),
        (Err(_), Ok(solved)) => Ok(solved),
        (one, _) => one,
    }
}

/// What began later only if neither makespan nor flowtime is greater: then nothing is worse than what was
/// found first.
fn better(one: Planned, other: Planned) -> Planned {
    let (early, late) = if other.first.after < one.first.after { (other, one) } else { (one, other) };
    let (a, b) = (&early.schedule, &late.schedule);
    if b.makespan() <= a.makespan() && b.flowtime() <= a.flowtime() {
        return Planned { first: early.first, ..late };
    }
    early
}
