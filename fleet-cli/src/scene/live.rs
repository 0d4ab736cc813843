//! A [`Scene`] kept up to date from Zenoh. Callbacks only read and store, so a screen that is slow
//! misses pictures and holds up nobody.

use super::{AtMs, Scene};
use crate::client::Client;
use crate::error::Result;
use crate::listen::{Inlet, Item, Sources};
use crate::news::News;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use xtb_protocol::keys::FleetKeys;

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
pub struct Shared {
    scene: Mutex<Scene>,
    began: Instant,
    unreadable: AtomicU64,
}

impl Shared {
    /// A scene whose clock begins now.
    #[must_use]
    pub fn new(scene: Scene) -> Self {
        Self { scene: Mutex::new(scene), began: Instant::now(), unreadable: AtomicU64::new(0) }
    }

    /// The viewer's clock.
    #[must_use]
    pub fn now_ms(&self) -> AtMs {
        u64::try_from(self.began.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    /// The scene, locked: read and let go, nothing else.
    pub fn lock(&self) -> MutexGuard<'_, Scene> {
        self.scene.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes in an item that came just now; one that cannot be read is counted.
    pub fn put(&self, item: &Item) {
        match News::of(item) {
            Ok((key, news)) => self.lock().take(self.now_ms(), &key, news),
            Err(error) => {
                self.unreadable.fetch_add(1, Ordering::Relaxed);
                tracing::debug!("unreadable: {error}");
            }
        }
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
    pub scene: Arc<Shared>,
    _sources: Sources,
}

impl Live {
    /// Subscribes to everything that a screen shows.
    ///
    /// # Errors
    /// [`Kind::Failed`](crate::Kind::Failed): Zenoh would not.
    pub async fn open(client: &Client, wanted: Wanted) -> Result<Self> {
        let mut scene = Scene::new(client.fleet().clone());
        client.told_entries(&[]).into_iter().for_each(|entry| scene.expect(entry));
        let scene = Arc::new(Shared::new(scene));
        let into = Arc::clone(&scene);
        let inlet: Inlet = Arc::new(move |item| into.put(&item));
        let mut sources = Sources::default();
        for key_expr in key_exprs(client.keys(), wanted) {
            sources.add(client, &key_expr, &inlet).await?;
        }
        Ok(Self { scene, _sources: sources })
    }
}

fn key_exprs(keys: &FleetKeys, wanted: Wanted) -> Vec<String> {
    let robots = keys.any_robot();
    let mut found = vec![robots.alive(), robots.state(), robots.event(), robots.about()];
    found.extend([keys.map(), keys.sim_roster(), keys.dispatch_tasks(), keys.traffic_state()]);
    found.extend(wanted.sensors.then(|| robots.sensors()));
    found.extend(wanted.truth.then(|| keys.sim_truth()));
    found
}
