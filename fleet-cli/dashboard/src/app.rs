//! What all requests and sockets of the dashboard share.

use super::access::Visitor;
use super::hello::{Hello, Who};
use super::metrics::Metrics;
use super::playback::Playback;
use super::security::Guard;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use xtb_client::scene::live::SharedScene;
use xtb_client::{Client, Error, ErrorKind, Result, rights};
use xtb_identity::Action;
use xtb_protocol::Name;

/// How often it is looked whether a page's visitor is still in, if nothing has changed.
const LOOK_AGAIN: Duration = Duration::from_secs(1);

/// What is shown, and who commands.
#[derive(Clone)]
pub struct Shown {
    /// The fleet.
    pub scene: Arc<SharedScene>,
    /// Who commands; `None` = playing a recording.
    pub commands: Option<Client>,
    /// What plays the recording, if one is played.
    pub playback: Option<Arc<dyn Playback>>,
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
    pub(super) fn hello(&self, client: Name, visitor: &Visitor) -> Hello {
        let person = visitor.person();
        let refused = person.and_then(|person| rights::check(&person.name, person.role, Action::Drive).err());
        let why_not = match (&self.shown.commands, self.read_only) {
            (None, _) => Some("playing a recording".to_owned()),
            (Some(_), true) => Some("the dashboard was started with --read-only".to_owned()),
            (Some(_), false) => refused.map(|refused| refused.message),
        };
        let stops = person.is_none_or(|person| person.role.may(Action::EmergencyStop));
        Hello {
            fleet: self.shown.scene.lock().fleet().clone(),
            client,
            version: env!("CARGO_PKG_VERSION"),
            writable: why_not.is_none(),
            why_not,
            estop: stops && self.commands().is_some(),
            who: person.map(Who::from),
            live: self.shown.commands.is_some(),
        }
    }

    /// Whether a visitor may do this now.
    ///
    /// # Errors
    /// [`ErrorKind::NotAllowed`]: it has not the role, or is out meanwhile.
    pub(super) fn may(&self, visitor: &Visitor, action: Action) -> Result<()> {
        let (Some(people), Some(person)) = (self.guard.people(), visitor.person()) else { return Ok(()) };
        match people.again(person, Instant::now()) {
            Some(person) => rights::check(&person.name, person.role, action),
            None => Err(Error::new(ErrorKind::NotAllowed, format!("{} is signed out", person.name))
                .hint("sign in again")),
        }
    }

    /// Ends when a visitor is out, or has another role.
    pub(super) async fn left(&self, visitor: &Visitor) {
        let (Some(people), Some(person)) = (self.guard.people(), visitor.person()) else {
            return std::future::pending().await;
        };
        let mut changes = people.changes();
        while people.again(person, Instant::now()).is_some_and(|now| now.role == person.role) {
            // Certificates end without a word.
            let _ = tokio::time::timeout(LOOK_AGAIN, changes.changed()).await;
        }
        tracing::info!("a page of {} was closed: signed out, revoked, or of another role now", person.name);
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
