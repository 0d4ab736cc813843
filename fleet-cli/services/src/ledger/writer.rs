//! A ledger on a thread of its own: its owner hands records over and is told when they are on the disk.
//!
//! Whatever waits goes into one commit, so the disk is waited for once for many. The queue is bounded:
//! what finds it full is refused and counted. After a failed write nothing is written until its owner has
//! heard of it: a record may rest on the one that failed. So every submission that was handed over before
//! [`LedgerWriter::resume`] fails too, and the owner decides what to submit again.

use super::{Body, Ledger, LedgerError, LedgerFault};
use schemars::JsonSchema;
use serde::{Serialize, de::DeserializeOwned};
use std::sync::mpsc::{self, Receiver, SyncSender, TrySendError};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Instant;
use tokio::sync::oneshot;

/// Submissions that wait for the disk at most.
pub const QUEUE: usize = 1024;
/// Submissions in a commit at most.
const GROUP: usize = 256;
/// Bytes in a commit from which on it takes no more.
const GROUP_BYTES: usize = 4 << 20;

/// The owner's end of the thread. Dropping it writes what waits, and gives the ledger back to the system.
#[derive(Debug)]
pub struct LedgerWriter {
    jobs: Option<SyncSender<Job>>,
    shared: Arc<Mutex<Shared>>,
    thread: Option<JoinHandle<()>>,
    path: std::path::PathBuf,
}

/// The answer to a submission: the number of its last record, when all of it is on the disk.
///
/// `.await` it, or `blocking_recv` outside of tokio; a closed channel means that the thread is gone and
/// the outcome unknown.
pub type PendingWrite = oneshot::Receiver<Result<u64, LedgerWriteError>>;

/// A submission that was not written.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}{error}", if *.behind { "not written because an earlier write failed: " } else { "" })]
pub struct LedgerWriteError {
    /// Why.
    pub error: Arc<LedgerError>,
    /// It was fine itself, but came behind one that failed.
    pub behind: bool,
    /// Which failure it was, for [`LedgerWriter::resume`].
    pub failure: u64,
}

/// A submission that was not taken.
#[derive(Debug, thiserror::Error)]
pub enum Refused {
    /// Too much waits for the disk.
    #[error("the ledger is busy: {waiting} submissions are waiting for the disk")]
    Busy {
        /// How many.
        waiting: usize,
    },
    /// It cannot be written down.
    #[error(transparent)]
    Record(LedgerError),
    /// The thread is gone.
    #[error("the ledger's thread has ended")]
    Ended,
}

/// What a writer has done, for everybody to see.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct LedgerCounters {
    /// Records on the disk.
    pub records: u64,
    /// Commits, each of which waited for the disk once.
    pub commits: u64,
    /// Bytes of JSON on the disk.
    pub bytes: u64,
    /// Submissions that wait now.
    pub queue: usize,
    /// The most that ever waited.
    pub queue_high_water: usize,
    /// Submissions refused because too many waited.
    pub refused: u64,
    /// Submissions that failed.
    pub failed: u64,
    /// Records whose number the lock file does not have.
    pub marks_missed: u64,
    /// What went wrong last.
    pub last_error: Option<String>,
    /// How long ago that was, in ms.
    pub last_error_age_ms: Option<u64>,
}

#[derive(Debug, Default)]
struct Shared {
    counters: LedgerCounters,
    last_error_at: Option<Instant>,
}

#[derive(Debug)]
enum Job {
    Write { bodies: Vec<Body>, answer: oneshot::Sender<Result<u64, LedgerWriteError>> },
    Resume { failure: u64 },
}

impl LedgerWriter {
    /// Starts the thread, with room for `queue` submissions ([`QUEUE`] is plenty).
    ///
    /// # Errors
    /// The system has no thread for it.
    pub fn start<R: Send + 'static>(ledger: Ledger<R>, queue: usize) -> Result<Self, LedgerError> {
        let (jobs, waiting) = mpsc::sync_channel(queue.max(1));
        let shared = Arc::<Mutex<Shared>>::default();
        let path = ledger.path.clone();
        let work = Work { ledger, shared: shared.clone(), failures: 0, failed: None };
        let thread = std::thread::Builder::new().name("ledger".into()).spawn(move || work.run(&waiting));
        let thread = thread.map_err(|error| LedgerFault::io("starting its thread", error).of(&path))?;
        Ok(Self { jobs: Some(jobs), shared, thread: Some(thread), path })
    }

    /// Hands records over, all or none; never waits.
    ///
    /// # Errors
    /// Too much waits already, a record is too long, or the thread is gone.
    pub fn submit<R: Serialize + DeserializeOwned>(&self, records: &[R]) -> Result<PendingWrite, Refused> {
        let bodies = records.iter().map(|record| Body::of(record, false)).collect();
        self.send(bodies)
    }

    /// Hands a snapshot over, which replaces all that was submitted before it; never waits.
    ///
    /// # Errors
    /// As [`LedgerWriter::submit`].
    pub fn compact<R: Serialize + DeserializeOwned>(&self, snapshot: &R) -> Result<PendingWrite, Refused> {
        self.send(Body::of(snapshot, true).map(|body| vec![body]))
    }

    /// What is submitted from now on does not rest on what failed: write again. Older news than the last
    /// failure changes nothing.
    ///
    /// # Errors
    /// Too much waits already (ask again), or the thread is gone.
    pub fn resume(&self, failed: &LedgerWriteError) -> Result<(), Refused> {
        self.push(Job::Resume { failure: failed.failure })
    }

    /// What it has done so far.
    #[must_use]
    pub fn counters(&self) -> LedgerCounters {
        let shared = lock(&self.shared);
        let age = shared.last_error_at.map(|at| at.elapsed().as_millis() as u64);
        LedgerCounters { last_error_age_ms: age, ..shared.counters.clone() }
    }

    fn send(&self, bodies: Result<Vec<Body>, LedgerFault>) -> Result<PendingWrite, Refused> {
        let bodies = bodies.map_err(|fault| Refused::Record(fault.of(&self.path)))?;
        let (answer, ticket) = oneshot::channel();
        self.push(Job::Write { bodies, answer })?;
        Ok(ticket)
    }

    fn push(&self, job: Job) -> Result<(), Refused> {
        // Counted under the lock, so that the thread cannot take the job before it is counted.
        let mut shared = lock(&self.shared);
        let counters = &mut shared.counters;
        let sent = self.jobs.as_ref().map(|jobs| jobs.try_send(job));
        match sent {
            Some(Ok(())) => {
                counters.queue += 1;
                counters.queue_high_water = counters.queue_high_water.max(counters.queue);
                Ok(())
            }
            Some(Err(TrySendError::Full(_))) => {
                counters.refused += 1;
                Err(Refused::Busy { waiting: counters.queue })
            }
            Some(Err(TrySendError::Disconnected(_))) | None => Err(Refused::Ended),
        }
    }
}

impl Drop for LedgerWriter {
    fn drop(&mut self) {
        self.jobs = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Work<R> {
    ledger: Ledger<R>,
    shared: Arc<Mutex<Shared>>,
    failures: u64,
    failed: Option<LedgerWriteError>,
}

/// Submissions that share a commit.
#[derive(Default)]
struct Group {
    bodies: Vec<Body>,
    /// Each with the number of bodies up to its end.
    answers: Vec<(usize, oneshot::Sender<Result<u64, LedgerWriteError>>)>,
    bytes: usize,
}

impl Group {
    fn add(&mut self, bodies: Vec<Body>, answer: oneshot::Sender<Result<u64, LedgerWriteError>>) {
        self.bytes += bodies.iter().map(|body| body.text.len()).sum::<usize>();
        self.bodies.extend(bodies);
        self.answers.push((self.bodies.len(), answer));
    }

    fn is_full(&self) -> bool {
        let snapshot = self.bodies.last().is_some_and(|body| body.snapshot);
        snapshot || self.answers.len() >= GROUP || self.bytes >= GROUP_BYTES
    }
}

impl<R> Work<R> {
    fn run(mut self, waiting: &Receiver<Job>) {
        let mut next = waiting.recv().ok();
        while let Some(job) = next {
            let mut group = Group::default();
            let mut job = Some(job);
            let (mut taken, mut resume) = (0, None);
            while let Some(now) = job {
                taken += 1;
                match now {
                    Job::Write { bodies, answer } => group.add(bodies, answer),
                    Job::Resume { failure } => {
                        resume = Some(failure);
                        break;
                    }
                }
                job = if group.is_full() { None } else { waiting.try_recv().ok() };
            }
            lock(&self.shared).counters.queue -= taken;
            self.write(group);
            if self.failed.as_ref().is_some_and(|failed| Some(failed.failure) == resume) {
                self.failed = None;
            }
            next = waiting.recv().ok();
        }
    }

    fn write(&mut self, group: Group) {
        let first = self.ledger.last_seq;
        if let Some(failed) = &self.failed {
            let behind = LedgerWriteError { behind: true, ..failed.clone() };
            lock(&self.shared).counters.failed += group.answers.len() as u64;
            answer(group, |_| Err(behind.clone()));
            return;
        }
        if group.bodies.is_empty() {
            answer(group, |_| Ok(first));
            return;
        }
        match self.ledger.write(&group.bodies) {
            Ok(_) => {
                let mut shared = lock(&self.shared);
                let counters = &mut shared.counters;
                counters.records += group.bodies.len() as u64;
                counters.bytes += group.bytes as u64;
                counters.commits += 1;
                counters.marks_missed = self.ledger.marks_missed;
                drop(shared);
                answer(group, |bodies| Ok(first + bodies as u64));
            }
            Err(fault) => {
                let error = Arc::new(fault.of(&self.ledger.path));
                self.failures += 1;
                let mut shared = lock(&self.shared);
                shared.counters.failed += group.answers.len() as u64;
                shared.counters.last_error = Some(error.to_string());
                shared.last_error_at = Some(Instant::now());
                drop(shared);
                let failed = LedgerWriteError { error, behind: false, failure: self.failures };
                self.failed = Some(failed.clone());
                answer(group, |_| Err(failed.clone()));
            }
        }
    }
}

/// Tells everybody of a group; who does not want to know any more has gone.
fn answer(group: Group, result: impl Fn(usize) -> Result<u64, LedgerWriteError>) {
    for (bodies, answer) in group.answers {
        let _ = answer.send(result(bodies));
    }
}
