//! Who is linked, by certificate: the log ties each link to a name, and `seen.toml` says when each was there last.

use super::files::Folder;
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};
use xtb_bus::{Bus, BusError, Link, Links};
use xtb_identity::CommonName;

/// `seen.toml` is written this often at most.
const WRITE_EVERY: Duration = Duration::from_secs(60);

/// Survives the sessions of a router. Clones share it.
#[derive(Debug, Clone)]
pub(super) struct Visitors {
    folder: Folder,
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug)]
struct Inner {
    links: HashMap<Link, usize>,
    seen: BTreeMap<String, SystemTime>,
    changed: bool,
    written: Option<Instant>,
}

impl Visitors {
    pub(super) fn new(folder: &Folder) -> Self {
        let seen = folder.seen();
        let inner = Inner { links: HashMap::new(), seen, changed: false, written: None };
        Self { folder: folder.clone(), inner: Arc::new(Mutex::new(inner)) }
    }

    /// Follows the links of a session, until that is dropped.
    pub(super) async fn watch(&self, bus: &Bus) -> Result<Links, BusError> {
        self.lock().links.clear();
        let visitors = self.clone();
        bus.watch_links(move |link, there| visitors.take(link, there)).await
    }

    fn take(&self, link: Link, there: bool) {
        let certificate = link.common_name.as_deref().unwrap_or("none");
        tracing::info!(
            certificate,
            from = link.from,
            "{certificate} has {} from {}",
            if there { "come" } else { "gone" },
            link.from
        );
        let mut inner = self.lock();
        inner.see(&link);
        match there {
            true => *inner.links.entry(link).or_default() += 1,
            false => {
                inner.links.remove(&link);
            }
        }
    }

    /// Notes who is there now, and writes it if that is due. Failures are logged: a router routes without it.
    pub(super) fn note(&self, ends: bool) {
        let mut inner = self.lock();
        let due = inner.written.is_none_or(|written| written.elapsed() >= WRITE_EVERY);
        if !due && !ends {
            return;
        }
        let there: Vec<Link> = inner.links.keys().cloned().collect();
        for link in &there {
            inner.see(link);
        }
        if !inner.changed {
            return;
        }
        inner.changed = false;
        inner.written = Some(Instant::now());
        let seen = inner.seen.clone();
        drop(inner);
        if let Err(error) = self.folder.write_seen(&seen) {
            tracing::warn!("cannot write when each identity was seen last: {error}");
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    fn see(&mut self, link: &Link) {
        let own = link.common_name.as_deref().and_then(|text| text.parse::<CommonName>().ok());
        if let Some(CommonName { name, .. }) = own {
            self.seen.insert(name.to_string(), SystemTime::now());
            self.changed = true;
        }
    }
}
