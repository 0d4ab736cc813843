//! The dispatcher as a service: tasks in, requests to robots out, every change in the ledger first.
//!
//! What it decides is [`xtb_dispatch`]'s; here are its clock, its Zenoh and its disk. `event_loop` is the
//! loop, `request_queue` answers questions, `robot_client` talks to robots, `map_watch` looks for roster and map
//! and runs traffic control, `store` opens the ledger, `usage` counts what the robots did, `observer` raises alerts and
//! keeps the fleet's history. `standby` follows
//! another dispatcher and takes over from it, `standby_link` is that dispatcher's end.

mod event_loop;
mod flying;
mod map_watch;
mod observer;
mod request_queue;
mod robot_client;
pub mod standby;
mod standby_link;
pub mod store;
pub mod usage;

pub use observer::{ObserverCounters, ObserverSettings};

use crate::ledger;
use observer::Observer;
use schemars::JsonSchema;
use serde::Serialize;
use standby_link::StandbyLink;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};
use store::Store;
use tokio::sync::{oneshot, watch};
use tokio::task::JoinHandle;
use usage::Usage;
use xtb_bus::{Bus, PresenceToken};
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::dispatcher::DispatcherIdentity;
use xtb_dispatch::{Dispatcher, DispatcherSettings, HomeRules};
use xtb_nav::Map;
use xtb_protocol::messages::{DispatchStatus, Suspension, SuspensionCause, TaskList};
use xtb_protocol::{Name, Uuid};

/// As which client it asks robots: always the same, so that it gets its leases back after a restart.
pub const CLIENT: &str = "dispatch";
/// A dispatcher that has died with its machine is taken for alive for up to 2 s, by the link's lease.
const GONE_WITHIN: Duration = Duration::from_secs(3);

/// What it has done and refused, for everybody to see.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct DispatcherCounters {
    /// Questions that were read.
    pub questions: u64,
    /// Questions that could not be read.
    pub unreadable: u64,
    /// What came in on keys that are none of ours, and was dropped.
    pub foreign_keys: u64,
    /// Questions that found the queue full.
    pub overloaded: u64,
    /// Requests sent to robots.
    pub asked: u64,
    /// Requests not sent, because too many to that robot were on their way.
    pub ask_dropped: u64,
    /// Changes that found the queue of events full.
    pub events_dropped: u64,
    /// Snapshots written.
    pub snapshots: u64,
    /// Questions of a stand-by.
    pub standby_questions: u64,
    /// Those of them that found the queue full.
    pub standby_overloaded: u64,
    /// The ledger's own.
    pub ledger: ledger::LedgerCounters,
    /// Of alerts and history.
    pub observer: ObserverCounters,
}

/// What a dispatcher is started with beside its ledger.
#[derive(Debug, Default)]
pub struct Floor {
    /// The map that this process serves, and its later versions; `None` = the fleet's, if it has one.
    pub own: Option<watch::Receiver<Arc<Map>>>,
    /// When robots go to docks and parking places by themselves; `None` = never.
    pub home: Option<HomeRules>,
}

/// What it says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    /// Its tasks, and for which map it takes them.
    pub status: DispatchStatus,
    /// What is suspended.
    pub suspended: Vec<Suspension>,
    /// What it has done.
    pub counters: DispatcherCounters,
    /// What the robots did since it began.
    pub usage: Usage,
}

/// A dispatcher, until it is stopped. One that is dropped stops too, without waiting for the disk.
pub struct DispatchService {
    working: JoinHandle<Result<()>>,
    standing: watch::Receiver<Standing>,
    stop: Option<oneshot::Sender<()>>,
}

impl Standing {
    fn of(dispatcher: &Dispatcher, now_ms: u64, counters: DispatcherCounters, usage: Usage) -> Self {
        let (status, suspended) = (dispatcher.status(now_ms), dispatcher.suspensions());
        Self { status, suspended, counters, usage }
    }

    /// Its open tasks, such as `12 open tasks of map lab`; for whom it says what it found at the start.
    #[must_use]
    pub fn found(&self) -> String {
        let others: u64 = self.of_other_maps().map(|suspension| suspension.tasks).sum();
        let open = self.status.open.saturating_sub(others);
        let tasks = if open == 1 { "task" } else { "tasks" };
        let map = self.status.map.as_ref().map(|map| format!(" of map {map}")).unwrap_or_default();
        format!("{open} open {tasks}{map}")
    }

    fn of_other_maps(&self) -> impl Iterator<Item = &Suspension> {
        let of_another =
            |suspension: &&Suspension| matches!(suspension.cause, SuspensionCause::OtherMap { .. });
        self.suspended.iter().filter(of_another)
    }
}

impl DispatchService {
    /// Starts it on a ledger that is held already; it answers when this returns. `own`: the map, and its later
    /// versions, if this process serves it.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: the fleet has a dispatcher already, the ledger's entries make no sense, it is a copy,
    /// or has a stand-by that does not answer; or Zenoh would not.
    pub async fn start(
        client: &Client,
        store: Store,
        Floor { own, home }: Floor,
        observer: ObserverSettings,
        within: Duration,
    ) -> Result<Self> {
        store.no_copy()?;
        let now = Clock::start();
        let path = store.ledger.path().to_owned();
        let read = store.entries.len() as u64;
        let mut dispatcher = recover(now.ms(), &path, store.entries)?;
        dispatcher.set_home_rules(home);
        let (bus, keys) = (client.bus(), client.keys());
        alone(bus, &keys.dispatch_alive(), within).await?;
        let token = bus.declare_alive(&keys.dispatch_alive()).await?;
        let mut link = StandbyLink::open(client, now, &path, &dispatcher).await?;
        link.consult(now, &dispatcher).await?;
        let (stop, stopped) = oneshot::channel();
        let none = Standing::of(&dispatcher, now.ms(), DispatcherCounters::default(), Usage::default());
        let (told, standing) = watch::channel(none);
        let observer = Observer::open(client, now, &path, observer).await?;
        let ledger = event_loop::Held { ledger: store.ledger, read, link };
        let work = event_loop::Work::new(client, now, dispatcher, ledger, own, observer, told).await?;
        let working = tokio::spawn(run(work, stopped, token));
        Ok(Self { working, standing, stop: Some(stop) })
    }

    /// What it says of itself.
    #[must_use]
    pub fn standing(&self) -> Standing {
        self.standing.borrow().clone()
    }

    /// Resolves when it has ended by itself: somebody else writes its ledger, or the disk's thread is gone.
    pub async fn ended(&mut self) -> Error {
        match (&mut self.working).await {
            Ok(Err(failure)) => failure,
            Ok(Ok(())) => Error::new(ErrorKind::Failed, "the dispatcher has ended"),
            Err(error) => Error::new(ErrorKind::Failed, format!("the dispatcher has ended: {error}")),
        }
    }

    /// Ends it: nothing more is accepted, what is being written is finished. Robots go by what their tasks
    /// say of a lost link.
    ///
    /// # Errors
    /// The ledger could not be written at the end, or it had ended before.
    pub async fn stop(mut self) -> Result<Standing> {
        drop(self.stop.take());
        match (&mut self.working).await {
            Ok(ended) => ended?,
            Err(error) => {
                return Err(Error::new(ErrorKind::Failed, format!("the dispatcher failed: {error}")));
            }
        }
        Ok(self.standing())
    }
}

impl Drop for DispatchService {
    fn drop(&mut self) {
        self.working.abort();
    }
}

async fn run(work: event_loop::Work, stopped: oneshot::Receiver<()>, token: PresenceToken) -> Result<()> {
    let ended = work.run(stopped).await;
    drop(token);
    ended
}

/// The list of tasks as anybody may ask for it.
pub(super) type List = Arc<TaskList>;

fn recover(now_ms: u64, path: &Path, entries: Vec<xtb_dispatch::LedgerEntry>) -> Result<Dispatcher> {
    let random = Uuid::new_v4().as_u128();
    let me = Name::new(CLIENT).map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
    // Bits 64 to 79 of a random UUID hold its version; these do not.
    let identity = DispatcherIdentity { me, ledger: (random >> 80) as u64, run: random as u64 };
    Dispatcher::recover(now_ms, identity, DispatcherSettings::default(), entries)
        .map_err(|error| store::unreadable(path, &error))
}

/// Waits until the fleet has no dispatcher, but not for long: one that was killed is gone soon.
async fn alone(bus: &Bus, key: &str, within: Duration) -> Result<()> {
    let began = Instant::now();
    loop {
        if bus.alive(key, within).await?.is_empty() {
            return Ok(());
        }
        if began.elapsed() > GONE_WITHIN {
            return Err(second());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

fn second() -> Error {
    Error::new(ErrorKind::Failed, "this fleet already has a dispatcher").hint(
        "`fleet-cli tasks` shows its tasks; use that one, choose another --fleet, or start this one as its \
             stand-by with --standby",
    )
}

/// Wall clock at the start and monotonic since: it never goes back and does not jump.
#[derive(Debug, Clone, Copy)]
pub(super) struct Clock {
    wall_ms: u64,
    began: Instant,
}

impl Clock {
    fn start() -> Self {
        Self { wall_ms: store::wall_ms(), began: Instant::now() }
    }

    /// ms since 1970.
    pub(super) fn ms(&self) -> u64 {
        self.wall_ms + u64::try_from(self.began.elapsed().as_millis()).unwrap_or(u64::MAX / 2)
    }
}
