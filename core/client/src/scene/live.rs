//! A [`Scene`] kept up to date from Zenoh. Callbacks only read and store, so a screen that is slow
//! misses pictures and holds up nobody.

use super::{AtMs, MOST_ROBOTS, Scene};
use crate::Result;
use crate::client::Client;
use crate::messages::{AnyMessage, Unreadable};
use crate::subscription::{Inlet, Item, Subscriptions};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use xtb_protocol::Name;
use xtb_protocol::keys::{FleetKeys, Key};

/// What a screen wants beyond states, events, presence, tasks and the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Wanted {
    /// Samples of every robot, which they send only while somebody listens.
    pub sensors: bool,
    /// Where simulated robots really are.
    pub truth: bool,
}

/// A scene that others write and screens read.
#[derive(Debug)]
pub struct SharedScene {
    scene: Mutex<Scene>,
    clock: Clock,
    unreadable: AtomicU64,
    rewinds: AtomicU64,
}

/// What tells a scene's time.
#[derive(Debug)]
enum Clock {
    /// The viewer's, since then.
    Running(Instant),
    /// Whoever plays a recording.
    Set(AtomicU64),
}

impl SharedScene {
    /// A scene whose clock begins now.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        Self::timed(scene, Clock::Running(Instant::now()))
    }

    /// A scene out of a recording, whose clock is where that is played: it stands while that is paused.
    #[must_use]
    pub fn played(scene: Scene) -> Self {
        Self::timed(scene, Clock::Set(AtomicU64::new(0)))
    }

    fn timed(scene: Scene, clock: Clock) -> Self {
        Self { scene: Mutex::new(scene), clock, unreadable: AtomicU64::new(0), rewinds: AtomicU64::new(0) }
    }

    /// The clock by which everything in the scene has its age: the viewer's, or the recording's.
    #[must_use]
    pub fn now_ms(&self) -> AtMs {
        match &self.clock {
            Clock::Running(began) => u64::try_from(began.elapsed().as_millis()).unwrap_or(u64::MAX),
            Clock::Set(at_ms) => at_ms.load(Ordering::Acquire),
        }
    }

    /// Sets the clock of a recording.
    pub fn set_now_ms(&self, now_ms: AtMs) {
        if let Clock::Set(at_ms) = &self.clock {
            at_ms.store(now_ms, Ordering::Release);
        }
    }

    /// Begins anew, at another place of a recording: what a viewer holds of the scene before is void.
    pub fn rewind(&self, scene: Scene, now_ms: AtMs) {
        let mut place = self.lock();
        *place = scene;
        self.set_now_ms(now_ms);
        self.rewinds.fetch_add(1, Ordering::Release);
    }

    /// How often it has begun anew; what is live never does.
    #[must_use]
    pub fn rewinds(&self) -> u64 {
        self.rewinds.load(Ordering::Acquire)
    }

    /// The scene, locked: read and let go, nothing else.
    pub fn lock(&self) -> MutexGuard<'_, Scene> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in an item that came just now; one that cannot be read is counted.
    pub fn put(&self, item: &Item) {
        match AnyMessage::of(item) {
            Ok((key, news)) => self.lock().take(self.now_ms(), &key, news),
            Err(error) => self.note_unreadable(&error),
        }
    }

    /// Counts an item that cannot be read.
    pub fn note_unreadable(&self, error: &Unreadable) {
        self.unreadable.fetch_add(1, Ordering::Relaxed);
        tracing::debug!("unreadable: {error}");
    }

    /// Messages that could not be read.
    #[must_use]
    pub fn unreadable(&self) -> u64 {
        self.unreadable.load(Ordering::Relaxed)
    }
}

/// A live scene, until it is dropped.
pub struct Live {
    /// What is known.
    pub scene: Arc<SharedScene>,
    _sources: Subscriptions,
    asking: JoinHandle<()>,
}

impl Drop for Live {
    fn drop(&mut self) {
        self.asking.abort();
    }
}

impl Live {
    /// Subscribes to everything that a screen shows.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](crate::ErrorKind::Failed): Zenoh would not.
    pub async fn open(client: &Client, wanted: Wanted) -> Result<Self> {
        let mut scene = Scene::new(client.fleet().clone());
        scene.set_aliases(client.settings().aliases.clone());
        client.told_entries(&[]).into_iter().for_each(|entry| scene.expect(entry));
        let scene = Arc::new(SharedScene::new(scene));
        let into = Arc::clone(&scene);
        let (come, comers) = mpsc::channel(MOST_ROBOTS);
        let inlet: Inlet = Arc::new(move |item| {
            if let Item::Presence(key, true) = &item
                && let Some(robot) = Key::parse(key).and_then(|key| key.robot)
            {
                // Without room its factsheet stays unknown, until it comes again.
                let _ = come.try_send(robot);
            }
            into.put(&item);
        });
        let asking = tokio::spawn(ask_factsheets(client.clone(), Arc::clone(&scene), comers));
        let mut sources = Subscriptions::default();
        for key_expr in key_exprs(client.keys(), wanted) {
            sources.add(client, &key_expr, &inlet).await?;
        }
        Ok(Self { scene, _sources: sources, asking })
    }

    /// Samples of every robot too, for as long as what comes back is kept: robots send them only while
    /// somebody listens.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](crate::ErrorKind::Failed): Zenoh would not.
    pub async fn sensors(&self, client: &Client) -> Result<Subscriptions> {
        let into = Arc::clone(&self.scene);
        let inlet: Inlet = Arc::new(move |item| into.put(&item));
        let mut sources = Subscriptions::default();
        sources.add(client, &client.keys().any_robot().sensors(), &inlet).await?;
        Ok(sources)
    }
}

/// Who comes, or comes again, is asked for its factsheet: that is not published.
async fn ask_factsheets(client: Client, scene: Arc<SharedScene>, mut comers: mpsc::Receiver<Name>) {
    while let Some(robot) = comers.recv().await {
        match client.get(&client.keys().robot(&robot).about()).await {
            Ok(answers) => answers.into_iter().for_each(|answer| scene.put(&Item::Message(answer))),
            Err(error) => tracing::debug!("{error}"),
        }
    }
}

fn key_exprs(keys: &FleetKeys, wanted: Wanted) -> Vec<String> {
    let robots = keys.any_robot();
    let mut found = vec![robots.alive(), robots.state(), robots.event(), robots.about()];
    found.extend([keys.map(), keys.places(), keys.sim_roster(), keys.dispatch_tasks(), keys.traffic_state()]);
    found.extend([keys.dispatch_alerts(), keys.sim_stats()]);
    found.extend(wanted.sensors.then(|| robots.sensors()));
    found.extend(wanted.truth.then(|| keys.sim_truth()));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRobot, name};
    use std::time::Duration;

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_comes_later_is_asked_for_its_factsheet_too() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let live = Live::open(&client, Wanted::default()).await.unwrap();
        let _late = FakeRobot::start(&client, "xtb-1").await;
        let mut look = tokio::time::interval(Duration::from_millis(5));
        let is_known =
            || live.scene.lock().robots().get(&name("xtb-1")).is_some_and(|robot| robot.about.is_some());
        while !is_known() {
            look.tick().await;
        }
    }
}
