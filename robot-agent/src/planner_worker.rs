//! Paths are looked for beside the control loop, on threads of their own: a plan takes milliseconds to
//! seconds, a turn five. A robot has such a thread for itself; many simulated ones share some, as each that has
//! planned keeps megabytes for the next plan.
//!
//! One slot each way for each robot. A job that was not begun yet gives way to a newer one: its goal is over.

use std::collections::VecDeque;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, mpsc};
use xtb_nav::navigator::{PlanDone, PlanJob};
use xtb_nav::planner::Planner;

/// How far below the rest of the process planners are (`nice`): they get a third of what another busy thread gets.
/// Chosen; without it, stops of 200 robots that plan on two cores waited for seconds.
#[cfg(target_os = "linux")]
const NICE: i32 = 5;

/// Threads that plan. They end after their present jobs when the last of these is dropped.
#[derive(Debug, Clone)]
pub(crate) struct Planners(Arc<Owner>);

#[derive(Debug)]
struct Owner(Arc<Queue>);

impl Drop for Owner {
    fn drop(&mut self) {
        self.0.lock().over = true;
        self.0.news.notify_all();
    }
}

/// Robots that wait for a path, each once.
#[derive(Debug, Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    news: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    seats: VecDeque<Arc<Seat>>,
    over: bool,
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, seat: Arc<Seat>) {
        self.lock().seats.push_back(seat);
        self.news.notify_one();
    }

    /// The next robot; `None` when there will be none any more.
    fn next(&self) -> Option<Arc<Seat>> {
        let mut waiting = self.lock();
        loop {
            if waiting.over {
                return None;
            }
            if let Some(seat) = waiting.seats.pop_front() {
                return Some(seat);
            }
            waiting = self.news.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

#[derive(Debug, Default)]
struct Slot {
    job: Option<PlanJob>,
    /// It waits in the queue, or a thread has taken it from there: two jobs of one robot never run at once.
    queued: bool,
}

/// One robot's.
#[derive(Debug)]
struct Seat {
    slot: Mutex<Slot>,
    done: mpsc::SyncSender<PlanDone>,
}

impl Seat {
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether it waits for another job to be run.
    fn is_asked_again(&self) -> bool {
        let mut slot = self.lock();
        slot.queued = slot.job.is_some();
        slot.queued
    }
}

/// This thread gives way to all else that the process does: commands and stops come by other threads.
fn give_way() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::setpriority_process(Some(rustix::thread::gettid()), NICE) {
        tracing::debug!("a planner cannot give way: {error}");
    }
}

fn work(queue: &Queue) {
    give_way();
    let mut planner = Planner::default();
    while let Some(seat) = queue.next() {
        let job = seat.lock().job.take();
        if let Some(job) = job {
            // A panic is this robot's alone, whose plan never comes; the thread goes on for the others.
            match catch_unwind(AssertUnwindSafe(|| job.run(&mut planner))) {
                // A loop that has ended wants no plan.
                Ok(done) => drop(seat.done.send(done)),
                Err(_) => planner = Planner::default(),
            }
        }
        if seat.is_asked_again() {
            queue.push(seat);
        }
    }
}

impl Planners {
    /// Starts so many threads, at least one.
    ///
    /// # Errors
    /// The system cannot.
    pub(crate) fn start(threads: usize, name: &str) -> io::Result<Self> {
        let planners = Self(Arc::new(Owner(Arc::default())));
        for _ in 0..threads.max(1) {
            let queue = planners.0.0.clone();
            std::thread::Builder::new().name(format!("planner-{name}")).spawn(move || work(&queue))?;
        }
        Ok(planners)
    }

    /// A robot's place among them.
    pub(crate) fn worker(&self) -> PlannerWorker {
        let (sender, done) = mpsc::sync_channel(1);
        let seat = Arc::new(Seat { slot: Mutex::default(), done: sender });
        PlannerWorker { seat, done, planners: self.clone() }
    }
}

/// The control loop's end: jobs out, plans in.
#[derive(Debug)]
pub(crate) struct PlannerWorker {
    seat: Arc<Seat>,
    done: mpsc::Receiver<PlanDone>,
    planners: Planners,
}

impl PlannerWorker {
    /// A job for the threads.
    pub(crate) fn ask(&self, job: PlanJob) {
        let mut slot = self.seat.lock();
        slot.job = Some(job);
        let queued = std::mem::replace(&mut slot.queued, true);
        drop(slot);
        if !queued {
            self.planners.0.0.push(self.seat.clone());
        }
    }

    /// A plan that is done.
    pub(crate) fn done(&self) -> Option<PlanDone> {
        self.done.try_recv().ok()
    }
}

impl Drop for PlannerWorker {
    fn drop(&mut self) {
        self.seat.lock().job = None;
    }
}
