//! The fleet's history: a small SQLite file beside the dispatcher's ledger, with events, what each robot did, and alerts.
//!
//! It is for people, not for recovery: a write that finds no room is dropped and counted, and a history that cannot be
//! opened or written stops nothing. Writes are on a thread of their own, many to a commit, so that `kill -9` of the
//! dispatcher loses what has not been committed yet, well under a second; questions are answered on another thread, from
//! a connection that only reads. Bounded by age and by size: the oldest goes first.

mod read;
pub mod samples;
mod schema;
#[cfg(test)]
mod tests;
mod write;

pub use read::local_day;

use rusqlite::Connection;
use samples::ActivitySample;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use thiserror::Error;
use tokio::sync::oneshot;
use xtb_client::text::event;
use xtb_dispatch::alerts::AlertChange;
use xtb_protocol::Name;
use xtb_protocol::messages::{Alert, Event, EventKind, HistoryKind, HistoryReply, HistoryRequest, TaskEvent};

/// Writes that wait; the next is dropped and counted.
const WRITES: usize = 4096;
/// Questions that wait; the next is answered at once, with that.
const QUESTIONS: usize = 16;
/// What a robot did is kept in pieces of this length.
pub const PIECE_MS: u64 = 15 * 60 * 1000;
/// Longest text of an event, in bytes.
const MAX_TEXT: usize = 1000;

/// How much is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Retention {
    /// Days.
    pub keep_days: u32,
    /// Size of the file, in MiB.
    pub max_mib: u32,
}

impl Default for Retention {
    fn default() -> Self {
        Self { keep_days: 90, max_mib: 256 }
    }
}

/// Why there is no history.
#[derive(Debug, Error)]
pub enum HistoryError {
    /// SQLite's words.
    #[error("the history {path} cannot be used while {doing}: {error}")]
    Sqlite {
        /// The file.
        path: PathBuf,
        /// What was to be done.
        doing: &'static str,
        /// What came of it.
        error: rusqlite::Error,
    },
    /// Something else, or of a later program.
    #[error("{path} is no history that this program knows: {what}")]
    NotOurs {
        /// The file.
        path: PathBuf,
        /// What it is.
        what: String,
    },
    /// The system's words.
    #[error("cannot start the history's thread: {0}")]
    Thread(std::io::Error),
}

/// What was written and what was not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, JsonSchema)]
pub struct HistoryCounters {
    /// Rows written.
    pub written: u64,
    /// Writes that found the queue full.
    pub dropped: u64,
    /// Writes that the disk refused.
    pub failed: u64,
    /// Questions that found the queue full.
    pub overloaded: u64,
}

#[derive(Debug, Default)]
struct Shared {
    written: AtomicU64,
    dropped: AtomicU64,
    failed: AtomicU64,
    overloaded: AtomicU64,
}

/// An event as it is written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HistoryRow {
    at_ms: u64,
    robot: Option<Name>,
    kind: HistoryKind,
    about: Option<String>,
    text: String,
    /// Boot and number of a robot's event: the same is written once.
    once: Option<(u64, u64)>,
}

impl HistoryRow {
    /// A robot's event.
    #[must_use]
    pub fn robot(at_ms: u64, event: &Event) -> Self {
        let (kind, about) = match &event.kind {
            EventKind::Started { .. } => (HistoryKind::Started, None),
            EventKind::Mode { .. } => (HistoryKind::Mode, None),
            EventKind::Goal { id, .. } => (HistoryKind::Goal, Some(id.to_string())),
            EventKind::Lease { .. } => (HistoryKind::Lease, None),
            EventKind::Fault { fault, .. } => (HistoryKind::Fault, Some(fault.to_string())),
            EventKind::Latch { latch, .. } => (HistoryKind::Latch, Some(latch.to_string())),
        };
        let (robot, once) = (Some(event.robot.clone()), Some((event.epoch, event.seq)));
        Self { at_ms, robot, kind, about, text: event::robot(event), once }
    }

    /// A change of a task.
    #[must_use]
    pub fn task(task: &TaskEvent) -> Self {
        Self {
            at_ms: task.step.at_ms,
            robot: task.step.robot.clone(),
            kind: HistoryKind::Task,
            about: Some(task.task.to_string()),
            text: event::task(task),
            once: None,
        }
    }

    /// A robot has come or gone.
    #[must_use]
    pub fn presence(at_ms: u64, robot: &Name, there: bool) -> Self {
        let text = event::presence(robot.as_str(), there);
        let robot = Some(robot.clone());
        Self { at_ms, robot, kind: HistoryKind::Presence, about: None, text, once: None }
    }

    /// What has become of an alert.
    #[must_use]
    pub fn alert(at_ms: u64, AlertChange { step, alert }: &AlertChange) -> Self {
        let by =
            alert.acknowledged.as_ref().filter(|_| *step == xtb_dispatch::alerts::AlertStep::Acknowledged);
        let by = by.map(|ack| format!(" by {}", ack.who())).unwrap_or_default();
        let text = format!("alert {} {}{by}: {}", alert.id, step.as_str(), alert.text);
        let robot = alert.robot.clone();
        Self { at_ms, robot, kind: HistoryKind::Alert, about: Some(alert.id.to_string()), text, once: None }
    }
}

/// What is to be written.
#[derive(Debug)]
enum Job {
    Event(HistoryRow),
    Samples { at_ms: u64, samples: Vec<(Name, ActivitySample)> },
    Alert(Box<Alert>),
}

/// A question and where its answer goes.
type Question = Box<(HistoryRequest, u64, oneshot::Sender<HistoryReply>)>;

/// A history, until it is dropped; then what waits is written first.
#[derive(Debug)]
pub struct History {
    jobs: Option<SyncSender<Job>>,
    questions: Option<SyncSender<Question>>,
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// Where the history of a ledger lies.
#[must_use]
pub fn path_beside(ledger: &Path) -> PathBuf {
    let mut name = ledger.to_owned().into_os_string();
    name.push("-history");
    name.into()
}

impl History {
    /// Opens it, or begins one; gives the alerts that it keeps too, oldest first.
    ///
    /// # Errors
    /// See [`HistoryError`]. Nothing was changed.
    pub fn open(path: &Path, bounds: Retention) -> Result<(Self, Vec<Alert>), HistoryError> {
        let connection = schema::open(path)?;
        let reader = schema::open_to_read(path)?;
        let alerts = read::alerts(&connection).map_err(failed(path, "reading its alerts"))?;
        let (jobs, waiting) = sync_channel(WRITES);
        let (questions, asked) = sync_channel(QUESTIONS);
        let shared = Arc::<Shared>::default();
        let mut writer = write::Writer::new(connection, bounds, Arc::clone(&shared));
        let threads = vec![
            spawn("history", move || writer.run(&waiting))?,
            spawn("history-reader", move || read::answer_all(&reader, &asked))?,
        ];
        Ok((Self { jobs: Some(jobs), questions: Some(questions), shared, threads }, alerts))
    }

    /// An event.
    pub fn event(&self, row: HistoryRow) {
        self.write(Job::Event(row));
    }

    /// What robots did up to now, since the last time.
    pub fn samples(&self, at_ms: u64, samples: Vec<(Name, ActivitySample)>) {
        if !samples.is_empty() {
            self.write(Job::Samples { at_ms, samples });
        }
    }

    /// An alert as it is now.
    pub fn alert(&self, alert: Alert) {
        self.write(Job::Alert(Box::new(alert)));
    }

    fn write(&self, job: Job) {
        let sent = self.jobs.as_ref().map(|jobs| jobs.try_send(job));
        if !matches!(sent, Some(Ok(()))) {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Asks it; `now_ms` is the dispatcher's clock. The answer comes from its thread.
    #[must_use]
    pub fn ask(&self, request: HistoryRequest, now_ms: u64) -> oneshot::Receiver<HistoryReply> {
        let (answer, answered) = oneshot::channel();
        let sent =
            self.questions.as_ref().map(|questions| questions.try_send(Box::new((request, now_ms, answer))));
        if let Some(Err(TrySendError::Full(back) | TrySendError::Disconnected(back))) = sent {
            let (.., answer) = *back;
            self.shared.overloaded.fetch_add(1, Ordering::Relaxed);
            let message = format!("{QUESTIONS} questions to the history wait already: try again");
            // Who has asked may be gone.
            let _ = answer.send(HistoryReply::Failed { message });
        }
        answered
    }

    /// What was written and what was not.
    #[must_use]
    pub fn counters(&self) -> HistoryCounters {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let Shared { written, dropped, failed, overloaded } = &*self.shared;
        HistoryCounters {
            written: count(written),
            dropped: count(dropped),
            failed: count(failed),
            overloaded: count(overloaded),
        }
    }
}

impl Drop for History {
    fn drop(&mut self) {
        drop((self.jobs.take(), self.questions.take()));
        for thread in self.threads.drain(..) {
            // A thread that has panicked has said so.
            let _ = thread.join();
        }
    }
}

fn spawn(name: &str, work: impl FnOnce() + Send + 'static) -> Result<JoinHandle<()>, HistoryError> {
    std::thread::Builder::new().name(name.to_owned()).spawn(work).map_err(HistoryError::Thread)
}

fn failed(path: &Path, doing: &'static str) -> impl FnOnce(rusqlite::Error) -> HistoryError + use<> {
    let path = path.to_owned();
    move |error| HistoryError::Sqlite { path, doing, error }
}

/// A number of ours in SQLite, whose numbers have a sign.
fn stored(number: u64) -> i64 {
    i64::try_from(number).unwrap_or(i64::MAX)
}

/// The same back.
fn number(stored: i64) -> u64 {
    u64::try_from(stored).unwrap_or(0)
}

fn configure(connection: &Connection) -> rusqlite::Result<()> {
    connection.busy_timeout(schema::BUSY)?;
    // A power cut may lose the last commits, a killed process none: it is no ledger. 256 KiB of it stay in memory.
    connection
        .execute_batch("PRAGMA synchronous = NORMAL; PRAGMA trusted_schema = OFF; PRAGMA cache_size = -256;")
}
