//! What robots say of themselves as it comes in: latest states, presence, and events in order.

use crate::client::{Client, Seen};
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{Notify, mpsc};
use xtb_bus::{Presence, Subscription};
use xtb_protocol::Name;
use xtb_protocol::keys::{Key, RobotKeys};
use xtb_protocol::messages::{Event, RobotState};

/// Events that wait for their reader; one that finds no room is dropped (and logged).
const EVENT_QUEUE: usize = 256;

#[derive(Debug, Default)]
struct Latest {
    states: Mutex<BTreeMap<Name, Seen>>,
    alive: Mutex<BTreeSet<Name>>,
    news: Notify,
}

/// Latest states and presence of one robot or of all, until it is dropped.
pub struct Feed {
    latest: Arc<Latest>,
    _states: Subscription,
    _presence: Presence,
}

impl Feed {
    /// Subscribes.
    ///
    /// # Errors
    /// [`Kind::Failed`](crate::Kind::Failed): Zenoh would not.
    pub async fn open(client: &Client, keys: &RobotKeys) -> Result<Self> {
        let latest = Arc::new(Latest::default());
        let states = Arc::clone(&latest);
        let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<RobotState>() {
            Ok(state) => {
                let seen = Seen { at: Instant::now(), state };
                lock(&states.states).insert(seen.state.robot.clone(), seen);
                states.news.notify_one();
            }
            Err(error) => tracing::debug!("on {}: {error}", incoming.key),
        };
        let _states = client.bus().subscribe(&keys.state(), each).await?;
        let presence = Arc::clone(&latest);
        let each = move |key: &str, there: bool| {
            let Some(robot) = Key::parse(key).and_then(|key| key.robot) else { return };
            let mut alive = lock(&presence.alive);
            if there {
                alive.insert(robot)
            } else {
                alive.remove(&robot)
            };
            drop(alive);
            presence.news.notify_one();
        };
        let _presence = client.bus().watch_alive(&keys.alive(), each).await?;
        Ok(Self { latest, _states, _presence })
    }

    /// The last state of a robot, however old.
    #[must_use]
    pub fn last(&self, robot: &Name) -> Option<Seen> {
        lock(&self.latest.states).get(robot).cloned()
    }

    /// The last states of all robots.
    #[must_use]
    pub fn states(&self) -> BTreeMap<Name, Seen> {
        lock(&self.latest.states).clone()
    }

    /// Who is there.
    #[must_use]
    pub fn alive(&self) -> BTreeSet<Name> {
        lock(&self.latest.alive).clone()
    }

    /// Waits until something has come in since the last call.
    pub async fn news(&self) {
        self.latest.news.notified().await;
    }
}

/// One robot's events, until it is dropped.
pub struct Events {
    queue: mpsc::Receiver<Event>,
    _subscription: Subscription,
}

impl Events {
    /// Subscribes; the robot's last events come first.
    ///
    /// # Errors
    /// [`Kind::Failed`](crate::Kind::Failed): Zenoh would not.
    pub async fn open(client: &Client, keys: &RobotKeys) -> Result<Self> {
        let (sender, queue) = mpsc::channel(EVENT_QUEUE);
        let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<Event>() {
            Ok(event) => {
                if sender.try_send(event).is_err() {
                    tracing::warn!("an event on {} found no room", incoming.key);
                }
            }
            Err(error) => tracing::debug!("on {}: {error}", incoming.key),
        };
        let _subscription = client.bus().subscribe_events(&keys.event(), each).await?;
        Ok(Self { queue, _subscription })
    }

    /// The next event.
    pub async fn next(&mut self) -> Event {
        match self.queue.recv().await {
            Some(event) => event,
            // The sender lives in the subscription, and that in here.
            None => std::future::pending().await,
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
