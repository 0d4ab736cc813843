//! Paths are looked for beside the control loop, on a thread of their own: a plan takes milliseconds to
//! seconds, a turn five.
//!
//! One slot each way. A job that was not begun yet gives way to a newer one: its goal is over.

use std::io;
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use xtb_nav::navigator::{PlanDone, PlanJob};
use xtb_nav::planner::Planner;
use xtb_protocol::Name;

#[derive(Debug, Default)]
struct Slot {
    job: Option<PlanJob>,
    over: bool,
}

#[derive(Debug, Default)]
struct JobSlot {
    slot: Mutex<Slot>,
    news: Condvar,
}

impl JobSlot {
    fn change(&self, change: impl FnOnce(&mut Slot)) {
        change(&mut self.slot.lock().unwrap_or_else(PoisonError::into_inner));
        self.news.notify_one();
    }

    /// The next job; `None` when there will be none any more.
    fn next(&self) -> Option<PlanJob> {
        let mut slot = self.slot.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if slot.over {
                return None;
            }
            if let Some(job) = slot.job.take() {
                return Some(job);
            }
            slot = self.news.wait(slot).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

/// The control loop's end: jobs out, plans in. Dropping it ends the thread after its present job.
#[derive(Debug)]
pub(crate) struct PlannerWorker {
    jobs: Arc<JobSlot>,
    done: mpsc::Receiver<PlanDone>,
}

impl PlannerWorker {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system cannot.
    pub(crate) fn start(robot: &Name) -> io::Result<Self> {
        let jobs = Arc::new(JobSlot::default());
        let (sender, done) = mpsc::sync_channel(1);
        let theirs = jobs.clone();
        std::thread::Builder::new().name(format!("planner-{robot}")).spawn(move || {
            let mut planner = Planner::default();
            while let Some(job) = theirs.next() {
                if sender.send(job.run(&mut planner)).is_err() {
                    return;
                }
            }
        })?;
        Ok(Self { jobs, done })
    }

    /// A job for the thread.
    pub(crate) fn ask(&self, job: PlanJob) {
        self.jobs.change(|slot| slot.job = Some(job));
    }

    /// A plan that is done.
    pub(crate) fn done(&self) -> Option<PlanDone> {
        self.done.try_recv().ok()
    }
}

impl Drop for PlannerWorker {
    fn drop(&mut self) {
        self.jobs.change(|slot| slot.over = true);
    }
}
