//! The fleet's map and its places, as they are served.

use crate::client;
use crate::error::{Error, ErrorKind, Result};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{FleetMap, FleetPlaces, MapPlace, Message};

/// The maps that are served to a fleet now; more than one is a mistake of its people.
///
/// # Errors
/// [`ErrorKind::Failed`] if the question could not be sent.
pub async fn served(bus: &Bus, keys: &FleetKeys, within: Duration) -> Result<Vec<FleetMap>> {
    answers(bus, &keys.map(), within).await
}

/// All places of the map that is served; `None` if nobody serves one.
///
/// # Errors
/// [`ErrorKind::Failed`] if the question could not be sent.
pub async fn places(bus: &Bus, keys: &FleetKeys, within: Duration) -> Result<Option<Vec<MapPlace>>> {
    let mut found = answers::<FleetPlaces>(bus, &keys.places(), within).await?;
    Ok(found.pop().map(|found| found.places))
}

/// Nobody serves the fleet a map.
#[must_use]
pub fn no_map() -> Error {
    Error::new(ErrorKind::NoMap, "no map is served to this fleet")
}

/// The place of this name.
///
/// # Errors
/// [`ErrorKind::Invalid`]: there is none; [`ErrorKind::NoMap`]; else as [`places`].
pub async fn place(bus: &Bus, keys: &FleetKeys, name: &str, within: Duration) -> Result<MapPlace> {
    let known = places(bus, keys, within).await?.ok_or_else(no_map)?;
    if let Some(place) = known.iter().find(|place| place.name.as_str() == name) {
        return Ok(place.clone());
    }
    let error = Error::new(ErrorKind::Invalid, format!("there is no place {name:?}"));
    Err(error.hint(if known.is_empty() {
        "the fleet's map has no places; `fleet-cli place add` names one".to_owned()
    } else {
        format!("`fleet-cli place list` shows the {} that there are", known.len())
    }))
}

async fn answers<M: Message>(bus: &Bus, key: &str, within: Duration) -> Result<Vec<M>> {
    let answers = client::get(bus, key, within).await?;
    let read = |answer: &Incoming| {
        answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
    };
    Ok(answers.iter().filter_map(read).collect())
}

/// What is published for the fleet from now on, the newest one only, until it is dropped.
pub struct Source<M> {
    newest: watch::Receiver<Option<Arc<M>>>,
    _listening: Subscription,
}

/// Each map that is published.
pub type MapSource = Source<FleetMap>;
/// Each list of places that is published.
pub type PlacesSource = Source<FleetPlaces>;

impl MapSource {
    /// Subscribes.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn open(bus: &Bus, keys: &FleetKeys) -> Result<Self> {
        Self::on(bus, &keys.map()).await
    }
}

impl PlacesSource {
    /// Subscribes.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: Zenoh would not.
    pub async fn open(bus: &Bus, keys: &FleetKeys) -> Result<Self> {
        Self::on(bus, &keys.places()).await
    }
}

impl<M: Message + Send + Sync + 'static> Source<M> {
    async fn on(bus: &Bus, key: &str) -> Result<Self> {
        let (sender, newest) = watch::channel(None);
        let each = move |incoming: Incoming| match incoming.decode::<M>() {
            Ok(message) => drop(sender.send_replace(Some(Arc::new(message)))),
            Err(error) => tracing::warn!("on {}: {error}", incoming.key),
        };
        let _listening = bus.subscribe(key, each).await?;
        Ok(Self { newest, _listening })
    }

    /// Waits for the next one.
    pub async fn next(&mut self) -> Arc<M> {
        loop {
            if self.newest.changed().await.is_err() {
                std::future::pending::<()>().await;
            }
            if let Some(newest) = self.newest.borrow_and_update().clone() {
                return newest;
            }
        }
    }

    /// The newest one.
    #[must_use]
    pub fn newest(&self) -> Option<Arc<M>> {
        self.newest.borrow().clone()
    }
}
