//! Answers who asks whether an identity is admitted.

use std::sync::{Arc, Mutex, PoisonError};
use xtb_bus::{Bus, BusError, Service};
use xtb_identity::Registry;
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::IdentityStatus;

/// The registry as it was read last. Clones share it.
#[derive(Debug, Clone)]
pub(super) struct Known(Arc<Mutex<Registry>>);

impl Known {
    pub(super) fn new(registry: Registry) -> Self {
        Self(Arc::new(Mutex::new(registry)))
    }

    pub(super) fn set(&self, registry: Registry) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = registry;
    }

    fn status(&self, name: &Name) -> IdentityStatus {
        let registry = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = registry.get(name);
        IdentityStatus {
            name: name.clone(),
            role: entry.map(|entry| entry.role.to_string()),
            generation: entry.filter(|entry| !entry.revoked).map_or(0, |entry| entry.generation),
            revoked: entry.is_some_and(|entry| entry.revoked),
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
