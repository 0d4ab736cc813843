//! The fleet's robots towards a master control of VDA 5050: MQTT on one side, dispatcher and robots on the other.
//!
//! What is decided is [`xtb_vda5050`]'s; here are its clock, its files, MQTT and Zenoh. Each robot has a session of its
//! own with the broker, so that the broker tells of each by itself when it is gone.

mod asks;
mod broker;
mod link;
mod records;
mod session;

pub(crate) use broker::trusting;
pub use broker::{Broker, Login};

use records::Records;
use session::Session;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::{JoinHandle, JoinSet};
use xtb_bus::Subscription;
use xtb_client::client::Client;
use xtb_client::state_feed::StateFeed;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{TaskEvent, TaskId, TaskState};
use xtb_vda5050::Protocol;

/// Robots that have a session at most.
const MOST_ROBOTS: usize = 1000;
/// Tasks that are remembered; beyond, the oldest are forgotten.
const MOST_TASKS: usize = 8192;
/// New robots are looked for this often.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Sessions have this long to say that they end.
const ENDS_WITHIN: Duration = Duration::from_secs(3);

/// What a bridge is told.
#[derive(Debug, Clone)]
pub struct BridgeOptions {
    /// Where the broker is.
    pub broker: Broker,
    /// Which version is spoken.
    pub protocol: Protocol,
    /// The first level of topics.
    pub interface: String,
    /// Whose robots they are.
    pub manufacturer: String,
    /// Where orders are kept.
    pub folder: PathBuf,
    /// Only these robots; empty = all that are there.
    pub robots: Vec<Name>,
}

/// What has happened so far.
#[derive(Debug, Default)]
pub struct BridgeCounters {
    /// Connections to the broker that were made.
    pub connected: AtomicU64,
    /// Messages that came in.
    pub received: AtomicU64,
    /// Messages that found the queue of their robot full.
    pub dropped: AtomicU64,
    /// Messages that were handed to the broker's connection.
    pub published: AtomicU64,
    /// Messages that found the broker's connection too slow; what they say is said again.
    pub held_back: AtomicU64,
    /// Questions to the dispatcher and to robots.
    pub asked: AtomicU64,
}

fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// How a task stands, as an event has told it.
#[derive(Debug, Clone)]
struct Fact {
    ledger: u64,
    entry: u64,
    state: TaskState,
    legs_done: u32,
    reason: Option<String>,
}

type Facts = Arc<Mutex<BTreeMap<TaskId, Fact>>>;

/// What all sessions share.
struct Shared {
    client: Client,
    feed: StateFeed,
    facts: Facts,
    options: BridgeOptions,
    counters: Arc<BridgeCounters>,
    records: Records,
}

/// The bridge, until it is stopped.
pub struct Bridge {
    working: JoinHandle<()>,
    stop: watch::Sender<bool>,
    counters: Arc<BridgeCounters>,
    _events: Subscription,
}

impl Bridge {
    /// Starts it. A broker that does not answer is tried again and again.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: the folder cannot be used; [`ErrorKind::Failed`]: another bridge uses it, or Zenoh would
    /// not.
    pub async fn start(client: &Client, options: BridgeOptions) -> Result<Self> {
        let records = Records::open(&options.folder)?;
        let facts = Facts::default();
        let noted = Arc::clone(&facts);
        let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<TaskEvent>() {
            Ok(event) => note(&mut noted.lock().unwrap_or_else(PoisonError::into_inner), event),
            Err(error) => tracing::debug!("on {}: {error}", incoming.key),
        };
        let _events = client.bus().subscribe(&client.keys().dispatch_event(), each).await?;
        let feed = StateFeed::open(client, &client.keys().any_robot()).await?;
        let counters = Arc::new(BridgeCounters::default());
        let shared =
            Shared { client: client.clone(), feed, facts, options, counters: Arc::clone(&counters), records };
        let (stop, stopped) = watch::channel(false);
        let working = tokio::spawn(run(Arc::new(shared), stopped));
        Ok(Self { working, stop, counters, _events })
    }

    /// What has happened so far.
    #[must_use]
    pub fn counters(&self) -> &BridgeCounters {
        &self.counters
    }

    /// Says `OFFLINE` for each robot, and ends.
    pub async fn stop(self) {
        self.stop.send_replace(true);
        // Whoever has not ended by then is told of by its last will.
        let _ = tokio::time::timeout(ENDS_WITHIN, self.working).await;
    }
}

fn note(facts: &mut BTreeMap<TaskId, Fact>, event: TaskEvent) {
    let TaskEvent { ledger, entry, task, step } = event;
    if facts.get(&task).is_some_and(|known| known.ledger == ledger && known.entry >= entry) {
        return;
    }
    let (state, legs_done, reason) = (step.state, step.legs_done, step.reason);
    facts.insert(task, Fact { ledger, entry, state, legs_done, reason });
    if facts.len() > MOST_TASKS {
        facts.pop_first();
    }
}

/// A session for each robot that is there, or was.
async fn run(shared: Arc<Shared>, mut stop: watch::Receiver<bool>) {
    let mut sessions = JoinSet::new();
    let mut known = BTreeSet::new();
    let mut tick = tokio::time::interval(LOOK_EVERY);
    let only = &shared.options.robots;
    while !*stop.borrow() {
        for robot in shared.feed.alive() {
            let wanted = only.is_empty() || only.contains(&robot);
            if !wanted || known.contains(&robot) || known.len() >= MOST_ROBOTS {
                continue;
            }
            known.insert(robot.clone());
            match Session::open(&shared, robot.clone()) {
                Ok(session) => drop(sessions.spawn(session.run(stop.clone()))),
                Err(error) => tracing::error!("{robot} is not shown to the master control: {error}"),
            }
        }
        tokio::select! {
            _ = tick.tick() => {}
            _ = stop.changed() => {}
        }
    }
    while sessions.join_next().await.is_some() {}
}

fn failed(what: String) -> Error {
    Error::new(ErrorKind::Config, what)
}
