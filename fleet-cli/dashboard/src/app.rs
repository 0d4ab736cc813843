//! What all requests and sockets of the dashboard share.

use super::frames::Hello;
use super::metrics::Metrics;
use super::security::Guard;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use xtb_client::Client;
use xtb_client::scene::live::Shared;
use xtb_protocol::Name;

/// What is shown, and who commands.
#[derive(Clone)]
pub struct Shown {
    /// The fleet.
    pub scene: Arc<Shared>,
    /// Who commands; `None` = playing a recording.
    pub commands: Option<Client>,
}

/// What all requests share.
pub(super) struct App {
    pub(super) shown: Shown,
    pub(super) metrics: Metrics,
    pub(super) read_only: bool,
    pub(super) guard: Guard,
    pub(super) began: Instant,
    pub(super) ticks: watch::Sender<u64>,
    /// As of the last beat.
    pub(super) linked: AtomicBool,
    pub(super) places: Arc<Semaphore>,
    pub(super) stop: watch::Receiver<bool>,
    /// A permit is held by whoever has to be waited for at the end.
    pub(super) busy: Arc<Semaphore>,
}

impl App {
    /// What a page is told first.
    pub(super) fn hello(&self, client: Name) -> Hello {
        let why_not = match (&self.shown.commands, self.read_only) {
            (None, _) => Some("playing a recording"),
            (Some(_), true) => Some("the dashboard was started with --read-only"),
            (Some(_), false) => None,
        };
        Hello {
            fleet: self.shown.scene.lock().fleet().clone(),
            client,
            version: env!("CARGO_PKG_VERSION"),
            writable: why_not.is_none(),
            why_not: why_not.map(str::to_owned),
            live: self.shown.commands.is_some(),
        }
    }

    /// Who commands, if commands are taken.
    pub(super) fn commands(&self) -> Option<&Client> {
        self.shown.commands.as_ref().filter(|_| !self.read_only)
    }

    /// The beat of all pages' frames.
    pub(super) fn ticks(&self) -> watch::Receiver<u64> {
        self.ticks.subscribe()
    }

    /// Whether there is a router; a recording needs none.
    pub(super) fn is_linked(&self) -> bool {
        self.linked.load(Ordering::Relaxed)
    }

    /// Becomes true when the server ends.
    pub(super) fn stop(&self) -> watch::Receiver<bool> {
        self.stop.clone()
    }

    /// The end waits until this is dropped.
    pub(super) fn busy(&self) -> Option<OwnedSemaphorePermit> {
        Arc::clone(&self.busy).try_acquire_owned().ok()
    }

    /// A clock that never stands, in ms.
    pub(super) fn clock_ms(&self) -> u64 {
        u64::try_from(self.began.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}
