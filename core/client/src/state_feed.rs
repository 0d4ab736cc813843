//! What robots say of themselves as it comes in: latest states, presence, and events in order.

use crate::client::{Client, LastState};
use crate::error::Result;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::mpsc::error::TrySendError;
use tokio::sync::{Notify, mpsc};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::MissedTickBehavior;
use xtb_bus::{PresenceWatch, Subscription};
use xtb_protocol::Name;
use xtb_protocol::keys::{Key, RobotKeys};
use xtb_protocol::messages::{Event, RobotState};

/// Events that wait for their reader; one that finds no room is dropped (and logged).
const EVENT_QUEUE: usize = 256;
/// Robots whose states are kept: those of the largest fleet. Beyond, the one that has been silent for longest is
/// dropped; a robot that is there speaks 20 times a second.
pub const MOST_ROBOTS: usize = 1024;
/// Questions for a state on their way at most: on a slow link they come as fast as they are answered.
const QUESTIONS: usize = 2;

#[derive(Debug, Default)]
struct Latest {
    states: Mutex<BTreeMap<Name, Arc<LastState>>>,
    dropped: AtomicU64,
    alive: Mutex<BTreeSet<Name>>,
    news: Notify,
}

/// Latest states and presence of one robot or of all, until it is dropped.
pub struct StateFeed {
    latest: Arc<Latest>,
    _source: Source,
}

/// Where they come from.
enum Source {
    Published { _states: Subscription, _presence: PresenceWatch },
    Asked(JoinHandle<()>),
}

impl Drop for Source {
    fn drop(&mut self) {
        if let Self::Asked(asking) = self {
            asking.abort();
        }
    }
}

impl Latest {
    fn put(&self, state: RobotState) {
        let mut states = lock(&self.states);
        if states.len() >= MOST_ROBOTS && !states.contains_key(&state.robot) {
            self.drop_silent(&mut states);
        }
        states.insert(state.robot.clone(), Arc::new(LastState { at: Instant::now(), state }));
        drop(states);
        self.news.notify_one();
    }

    fn drop_silent(&self, states: &mut BTreeMap<Name, Arc<LastState>>) {
        let silent = states.iter().min_by_key(|(_, seen)| seen.at).map(|(robot, _)| robot.clone());
        let Some(robot) = silent else { return };
        states.remove(&robot);
        if self.dropped.fetch_add(1, Ordering::Relaxed) == 0 {
            tracing::warn!(
                "more than {MOST_ROBOTS} robots have sent states: {robot} is dropped, silent for longest"
            );
        }
    }
}

impl StateFeed {
    /// Subscribes.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](crate::ErrorKind::Failed): Zenoh would not.
    pub async fn open(client: &Client, keys: &RobotKeys) -> Result<Self> {
        let latest = Arc::new(Latest::default());
        let states = Arc::clone(&latest);
        let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<RobotState>() {
            Ok(state) => states.put(state),
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
        Ok(Self { latest, _source: Source::Published { _states, _presence } })
    }

    /// Asks one robot for its state, `every` so often or as often as the link can: a subscription to 20 states a
    /// second takes 80 kbit/s, and fills every queue of a link that has less.
    #[must_use]
    pub fn asked(client: &Client, robot: &Name, every: Duration) -> Self {
        let latest = Arc::new(Latest::default());
        let asking = ask_on(client.clone(), robot.clone(), every, Arc::clone(&latest));
        Self { latest, _source: Source::Asked(tokio::spawn(asking)) }
    }

    /// The last state of a robot, however old.
    #[must_use]
    pub fn last(&self, robot: &Name) -> Option<LastState> {
        lock(&self.latest.states).get(robot).map(|seen| LastState::clone(seen))
    }

    /// The last states of all robots, at most [`MOST_ROBOTS`].
    #[must_use]
    pub fn states(&self) -> BTreeMap<Name, LastState> {
        self.shared_states().into_iter().map(|(robot, seen)| (robot, LastState::clone(&seen))).collect()
    }

    /// The same without copies, for those who look many times a second.
    #[must_use]
    pub fn shared_states(&self) -> BTreeMap<Name, Arc<LastState>> {
        lock(&self.latest.states).clone()
    }

    /// How many robots were dropped because there were more than [`MOST_ROBOTS`].
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.latest.dropped.load(Ordering::Relaxed)
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

async fn ask_on(client: Client, robot: Name, every: Duration, latest: Arc<Latest>) {
    let mut ask = tokio::time::interval(every);
    ask.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut asking = JoinSet::new();
    loop {
        tokio::select! {
            Some(states) = asking.join_next() => {
                let states: Vec<RobotState> = states.unwrap_or_default();
                states.into_iter().filter(|state| state.robot == robot).for_each(|state| latest.put(state));
            }
            _ = ask.tick(), if asking.len() < QUESTIONS => {
                let (client, key) = (client.clone(), client.keys().robot(&robot).state());
                asking.spawn(async move {
                    let answers = client.bus().get(&key, client.patience()).await.unwrap_or_default();
                    answers.iter().filter_map(|answer| answer.decode().ok()).collect()
                });
            }
        }
    }
}

/// Whether the queue is full. Once nobody reads it any more nothing is missed.
fn finds_no_room(queue: &mpsc::Sender<Event>, event: Event) -> bool {
    matches!(queue.try_send(event), Err(TrySendError::Full(_)))
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
    /// [`ErrorKind::Failed`](crate::ErrorKind::Failed): Zenoh would not.
    pub async fn open(client: &Client, keys: &RobotKeys) -> Result<Self> {
        let (sender, queue) = mpsc::channel(EVENT_QUEUE);
        let each = move |incoming: xtb_bus::Incoming| match incoming.decode::<Event>() {
            Ok(event) => {
                if finds_no_room(&sender, event) {
                    tracing::warn!("event queue full: an event on {} was dropped", incoming.key);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;
    use xtb_protocol::messages::EventKind;

    #[test]
    fn an_event_that_comes_when_nobody_reads_any_more_finds_no_full_queue() {
        let event = |seq| Event {
            robot: fake::name("xtb-1"),
            epoch: 1,
            seq,
            tick_ms: 0,
            kind: EventKind::Lease { holder: None },
        };
        let (sender, reader) = mpsc::channel(1);
        assert!(!finds_no_room(&sender, event(1)) && finds_no_room(&sender, event(2)));
        drop(reader);
        assert!(!finds_no_room(&sender, event(3)));
    }

    #[test]
    fn of_too_many_robots_the_one_that_was_silent_for_longest_is_dropped() {
        let latest = Latest::default();
        latest.put(fake::state("xtb-1"));
        latest.put(fake::state("xtb-2"));
        for ghost in 0..MOST_ROBOTS - 2 {
            latest.put(fake::state(&format!("ghost-{ghost}")));
        }
        assert_eq!(latest.dropped.load(Ordering::Relaxed), 0);
        latest.put(fake::state("xtb-1"));
        latest.put(fake::state("ghost-new"));
        let states = lock(&latest.states);
        assert_eq!((states.len(), latest.dropped.load(Ordering::Relaxed)), (MOST_ROBOTS, 1));
        assert!(states.contains_key(&fake::name("xtb-1")) && states.contains_key(&fake::name("ghost-new")));
        assert!(!states.contains_key(&fake::name("xtb-2")), "silent for longest");
    }
}
