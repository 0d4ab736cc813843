//! Answers who asks whether an identity is admitted.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use xtb_bus::{Bus, BusError, Service};
use xtb_identity::{Registry, RegistryEntry};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::IdentityStatus;

/// The registry as it was read last, and the one whose rules are in force. Clones share it.
#[derive(Debug, Clone)]
pub(super) struct Known(Arc<Mutex<Registries>>);

#[derive(Debug)]
struct Registries {
    read: Registry,
    in_force: Registry,
}

impl Known {
    pub(super) fn new(registry: Registry) -> Self {
        Self(Arc::new(Mutex::new(Registries { read: registry.clone(), in_force: registry })))
    }

    /// What stands in the file now.
    pub(super) fn read(&self, registry: Registry) {
        self.lock().read = registry;
    }

    /// Whose rules the router has now.
    pub(super) fn in_force(&self, registry: Registry) {
        self.lock().in_force = registry;
    }

    fn lock(&self) -> MutexGuard<'_, Registries> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn status(&self, name: &Name) -> IdentityStatus {
        let Registries { read, in_force } = &*self.lock();
        let entry = read.get(name);
        let admitted = entry.filter(|entry| !entry.revoked);
        let has = |entry: &RegistryEntry| {
            let mut those = in_force.admitted();
            those.any(|it| it.common_name() == entry.common_name() && it.role == entry.role)
        };
        IdentityStatus {
            name: name.clone(),
            role: entry.map(|entry| entry.role.to_string()),
            generation: admitted.map_or(0, |entry| entry.generation),
            revoked: entry.is_some_and(|entry| entry.revoked),
            waiting: admitted.is_some_and(|entry| !has(entry)),
        }
    }
}

/// Serves it from a router's own session, which is under no rule.
///
/// # Errors
/// [`BusError`].
pub(super) async fn serve(bus: &Bus, keys: &FleetKeys, known: Known) -> Result<Service, BusError> {
    let (runtime, keys) = (tokio::runtime::Handle::current(), keys.clone());
    let key = keys.identity(None);
    bus.serve(&key, move |question| {
        let Some(name) = question.client() else { return };
        let (status, own_key) = (known.status(name), keys.identity(Some(name)));
        runtime.spawn(async move {
            if let Err(error) = question.reply(&own_key, &status, Format::Json).await {
                tracing::debug!("cannot answer about {own_key}: {error}");
            }
        });
    })
    .await
}
