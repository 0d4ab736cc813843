//! Two solvers with different beginnings, each on a thread of its own: the better of what both find
//! soon after each other wins.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use xtb_traffic::solver::{Problem, Schedule, Settings, Solver, Unsolved};

/// How often somebody looks whether it has ended.
pub(super) const LOOK_EVERY: Duration = Duration::from_millis(10);
/// How long the second one may still go on when the first has a schedule.
const GRACE: Duration = Duration::from_millis(300);

type Outcome = Result<Schedule, Unsolved>;

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
            let ended = run(&problem, seed, deadline, &stop);
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
    let on_time = || !stop.load(Ordering::Relaxed) && Instant::now() < deadline;
    let solver = Solver::new(problem, &mut || on_time())?;
    // When the first schedule was there.
    let first: Mutex<Option<Instant>> = Mutex::new(None);
    let since = || first.lock().unwrap_or_else(PoisonError::into_inner).map(|at| at.elapsed());
    let solve = |seed: u64, priorities_first: bool| {
        let mut go_on = || on_time() && since().is_none_or(|since| since < GRACE);
        let settings = Settings { seed, priorities_first, ..Settings::default() };
        let solved = solver.solve(&settings, &mut go_on);
        if solved.is_ok() {
            first.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(Instant::now);
        }
        solved
    };
    let (one, other) = std::thread::scope(|scope| {
        let other = scope.spawn(|| solve(seed.wrapping_add(1), false));
        (solve(seed, true), other.join())
    });
    // A thread that panicked has told so on standard error.
    let other = other.unwrap_or(Err(Unsolved::NotBegun));
    match (one, other) {
        (Ok(one), Ok(other)) => Ok(if other.flowtime() < one.flowtime() { other } else { one }),
        (Err(_), Ok(solved)) => Ok(solved),
        (one, _) => one,
    }
}
