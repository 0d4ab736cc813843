//! Serves a map and its places to a fleet.

use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, Incoming, Publisher, Service, Subscription};
use xtb_client::map_source::served;
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::Map;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{FleetMap, FleetPlaces, MapHash, MapPlace, Message};

/// A map is published again this often, for whoever missed it.
const PUBLISH_EVERY: Duration = Duration::from_secs(30);

/// Serves a map to a fleet until it is dropped.
pub struct MapService {
    places: watch::Sender<Arc<FleetPlaces>>,
    _serving: [Serving; 2],
    _listening: Subscription,
}

impl MapService {
    /// Publishes a map and its places, now and again, and answers questions for them.
    ///
    /// # Errors
    /// Another map is served already, or Zenoh refuses.
    pub async fn start(bus: &Bus, keys: &FleetKeys, map: &Map, within: Duration) -> Result<Self> {
        let message = FleetMap::from(map);
        if let Some(other) = served(bus, keys, within).await?.iter().find(|other| other.hash != message.hash)
        {
            return Err(taken(&other.name, other.hash));
        }
        let own = message.hash;
        let (_, map_source) = watch::channel(Arc::new(message));
        let (places, places_source) = watch::channel(Arc::new(FleetPlaces::from(map)));
        let serving = [
            Serving::start(bus, keys.map(), &Channel::Map, map_source).await?,
            Serving::start(bus, keys.places(), &Channel::Places, places_source).await?,
        ];
        let listening = bus.subscribe(&keys.map(), move |incoming| warn_of_another(own, &incoming)).await?;
        Ok(Self { places, _serving: serving, _listening: listening })
    }

    /// Serves these places from now on; the map stays as it is.
    pub fn set_places(&self, places: Vec<MapPlace>) {
        self.places.send_modify(|known| *known = Arc::new(FleetPlaces { map: known.map, places }));
    }
}

/// One message, published and answered with, the newest of it, until this is dropped.
struct Serving {
    publishing: JoinHandle<()>,
    _answering: Service,
}

impl Serving {
    async fn start<M: Message + Send + Sync + 'static>(
        bus: &Bus,
        key: String,
        channel: &Channel,
        newest: watch::Receiver<Arc<M>>,
    ) -> Result<Self> {
        let answering = answer(bus, key.clone(), newest.clone()).await?;
        let publisher = bus.publisher::<M>(&key, channel, Format::Postcard).await?;
        Ok(Self { publishing: tokio::spawn(publish(publisher, newest)), _answering: answering })
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.publishing.abort();
    }
}

/// Two servers that met through a router later than they began.
fn warn_of_another(own: MapHash, incoming: &Incoming) {
    if let Ok(FleetMap { name, hash, .. }) = incoming.decode::<FleetMap>()
        && hash != own
    {
        tracing::warn!("another map is also served to this fleet: {name} ({hash}); end one of the servers");
    }
}

fn taken(name: &str, hash: MapHash) -> Error {
    Error::new(ErrorKind::Failed, format!("another map is already served: {name} ({hash})"))
        .hint("`fleet-cli map show --live` shows it; end its server, or choose another --fleet")
}

async fn answer<M: Message + Send + Sync + 'static>(
    bus: &Bus,
    key: String,
    newest: watch::Receiver<Arc<M>>,
) -> Result<Service> {
    let runtime = tokio::runtime::Handle::current();
    let own_key = key.clone();
    let service = bus.serve(&key, move |question| {
        let (own_key, message) = (own_key.clone(), Arc::clone(&newest.borrow()));
        runtime.spawn(async move {
            let format = question.wanted_format();
            if let Err(error) = question.reply(&own_key, message.as_ref(), format).await {
                tracing::debug!("cannot send {}: {error}", M::NAME);
            }
        });
    });
    Ok(service.await?)
}

/// At once, when it changes, and now and again.
async fn publish<M: Message>(publisher: Publisher<M>, mut newest: watch::Receiver<Arc<M>>) {
    let mut tick = tokio::time::interval(PUBLISH_EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut changes = true;
    loop {
        tokio::select! {
            _ = tick.tick() => {}
            changed = newest.changed(), if changes => changes = changed.is_ok(),
        }
        let message = Arc::clone(&newest.borrow_and_update());
        if let Err(error) = publisher.put(&message).await {
            tracing::warn!("cannot publish {}: {error}", M::NAME);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::Client;
    use xtb_client::map_source::{place, places};
    use xtb_nav::Grid;

    fn map(name: &str, width: usize) -> Map {
        Map::new(name, Grid::free(0.05, [0.0, 0.0], width, 10).unwrap(), Vec::new()).unwrap()
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn one_map_is_served_at_a_time_and_the_next_when_that_has_ended() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let (bus, keys, within) = (client.bus(), client.keys(), Duration::from_secs(30));
        assert!(served(bus, keys, within).await.unwrap().is_empty());
        let lab = map("lab", 20);
        let first = MapService::start(bus, keys, &lab, within).await.unwrap();
        let found = served(bus, keys, within).await.unwrap();
        assert_eq!((found.len(), Map::try_from(&found[0]).unwrap()), (1, lab.clone()));

        let refused = MapService::start(bus, keys, &map("barn", 21), within).await.map(drop).unwrap_err();
        let named = format!("another map is already served: lab ({})", lab.hash());
        assert_eq!((refused.kind, refused.message), (ErrorKind::Failed, named));
        assert_eq!(places(bus, keys, within).await.unwrap(), []);
        let gate: MapPlace = serde_json::from_str(r#"{"name":"gate","x_m":0.2,"y_m":0.1}"#).unwrap();
        first.set_places(vec![gate.clone()]);
        assert_eq!(place(bus, keys, "gate", within).await.unwrap(), gate);
        assert!(place(bus, keys, "door", within).await.is_err());
        // The same floor by another name is no other map.
        drop(MapService::start(bus, keys, &map("room", 20), within).await.unwrap());

        drop(first);
        drop(MapService::start(bus, keys, &map("barn", 21), within).await.unwrap());
    }
}
