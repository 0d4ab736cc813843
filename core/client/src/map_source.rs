//! The fleet's map, as it is served.

use crate::client;
use crate::error::Result;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::FleetMap;

/// The maps that are served to a fleet now; more than one is a mistake of its people.
///
/// # Errors
/// [`ErrorKind::Failed`](crate::ErrorKind::Failed) if the question could not be sent.
pub async fn served(bus: &Bus, keys: &FleetKeys, within: Duration) -> Result<Vec<FleetMap>> {
    let answers = client::get(bus, &keys.map(), within).await?;
    let read = |answer: &Incoming| {
        answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
    };
    Ok(answers.iter().filter_map(read).collect())
}

/// Each map that is published for the fleet from now on, the newest one only, until it is dropped.
pub struct MapSource {
    newest: watch::Receiver<Option<Arc<FleetMap>>>,
    _listening: Subscription,
}

impl MapSource {
    /// Subscribes.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](crate::ErrorKind::Failed): Zenoh would not.
    pub async fn open(bus: &Bus, keys: &FleetKeys) -> Result<Self> {
        let (sender, newest) = watch::channel(None);
        let each = move |incoming: Incoming| match incoming.decode::<FleetMap>() {
            Ok(map) => drop(sender.send_replace(Some(Arc::new(map)))),
            Err(error) => tracing::warn!("on {}: {error}", incoming.key),
        };
        let _listening = bus.subscribe(&keys.map(), each).await?;
        Ok(Self { newest, _listening })
    }

    /// The newest one.
    #[must_use]
    pub fn newest(&self) -> Option<Arc<FleetMap>> {
        self.newest.borrow().clone()
    }
}
