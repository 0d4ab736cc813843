//! Serves a map and its places to a fleet, and changes them for whoever may: the only path of a change.
//!
//! What becomes of an edit is decided in `editor.rs`, on a thread for what blocks; who changed what and why is kept by
//! `history.rs`. Here are queue, clock and Zenoh.

mod editor;
mod history;

pub use editor::MapStore;
pub use history::{MapVersions, MapVersionsError};

use crate::dispatch::store::wall_ms;
use editor::{Editor, Found};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, Incoming, Publisher, Question, Service, Subscription};
use xtb_client::map_source::served;
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::Map;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{
    FleetMap, FleetPlaces, MapEdit, MapEditCode, MapEditReply, MapHash, MapHistory, Message,
};
use xtb_protocol::wire::CodecError;

/// A map is published again this often, for whoever missed it.
const PUBLISH_EVERY: Duration = Duration::from_secs(30);
/// Edits that wait; the next is refused as `overloaded`.
const EDITS: usize = 8;

/// Where a map is kept, and who changed it.
pub struct KeptMap {
    /// The map's file.
    pub store: Box<dyn MapStore>,
    /// The versions of before.
    pub history: MapVersions,
}

/// Serves a map to a fleet until it is dropped.
pub struct MapService {
    maps: watch::Receiver<Arc<Map>>,
    inputs: mpsc::Sender<Input>,
    working: JoinHandle<()>,
    _serving: [Serving; 3],
    _edits: Service,
    _listening: Subscription,
}

/// What comes to the editor.
enum Input {
    Edit(Question),
    /// The map's file holds this now.
    File(Map),
}

impl MapService {
    /// Publishes a map and its places, now and again, and answers questions for them. Changes end with it.
    ///
    /// # Errors
    /// Another map is served already, or Zenoh refuses.
    pub async fn start(bus: &Bus, keys: &FleetKeys, map: &Map, within: Duration) -> Result<Self> {
        Self::start_kept(bus, keys, map, None, within).await
    }

    /// The same; changes are kept.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub async fn start_kept(
        bus: &Bus,
        keys: &FleetKeys,
        map: &Map,
        kept: Option<KeptMap>,
        within: Duration,
    ) -> Result<Self> {
        let hash = map.hash();
        if let Some(other) = served(bus, keys, within).await?.iter().find(|other| other.hash != hash) {
            return Err(taken(&other.name, other.hash));
        }
        let (store, history) = match kept {
            Some(KeptMap { store, history }) => (Some(store), history),
            None => (None, MapVersions::default()),
        };
        let editor = Editor::new(wall_ms(), map.clone(), history, store);
        let (maps_sender, maps) = watch::channel(Arc::clone(editor.map()));
        let (map_sender, map_source) = watch::channel(Arc::new(FleetMap::from(map)));
        let (places_sender, places_source) = watch::channel(Arc::new(FleetPlaces::from(map)));
        let (history_sender, history_source) = watch::channel(Arc::new(editor.told()));
        let (inputs, queue) = mpsc::channel(EDITS);
        let serving = [
            Serving::start(bus, keys.map(), &Channel::Map, map_source.clone()).await?,
            Serving::start(bus, keys.places(), &Channel::Places, places_source).await?,
            Serving::answering(bus, keys.map_history(), history_source).await?,
        ];
        let edits = take_edits(bus, keys, inputs.clone()).await?;
        let own = map_source;
        let listening =
            bus.subscribe(&keys.map(), move |incoming| warn_of_another(own.borrow().hash, &incoming)).await?;
        let told =
            Told { maps: maps_sender, map: map_sender, places: places_sender, history: history_sender };
        let working = tokio::spawn(work(editor, queue, told, keys.clone()));
        Ok(Self { maps, inputs, working, _serving: serving, _edits: edits, _listening: listening })
    }

    /// The map as it is served, and each later version of it.
    #[must_use]
    pub fn maps(&self) -> watch::Receiver<Arc<Map>> {
        self.maps.clone()
    }

    /// The map's file holds this now: its zones and places are served, if the floor is the same.
    pub async fn file_holds(&self, map: Map) {
        // Fails only when the service ends.
        let _ = self.inputs.send(Input::File(map)).await;
    }
}

impl Drop for MapService {
    fn drop(&mut self) {
        self.working.abort();
    }
}

/// Where what is served goes out.
struct Told {
    maps: watch::Sender<Arc<Map>>,
    map: watch::Sender<Arc<FleetMap>>,
    places: watch::Sender<Arc<FleetPlaces>>,
    history: watch::Sender<Arc<MapHistory>>,
}

impl Told {
    /// Tells of the editor's map; nothing if it is the same.
    fn tell(&self, editor: &Editor) {
        let (before, map) = (self.maps.borrow().content(), editor.map());
        if before == map.content() {
            return;
        }
        if before.map != map.hash() {
            self.map.send_replace(Arc::new(FleetMap::from(map.as_ref())));
        }
        self.places.send_replace(Arc::new(FleetPlaces::from(map.as_ref())));
        self.history.send_replace(Arc::new(editor.told()));
        // Last: whoever follows it here finds the others in step.
        self.maps.send_replace(Arc::clone(map));
        if let Some(version) = editor.told().versions.last() {
            tracing::info!("the map is version {} now, by {}: {}", version.number, version.by, version.why);
        }
    }
}

/// Edits one after the other, until nobody can bring any more.
async fn work(mut editor: Editor, mut queue: mpsc::Receiver<Input>, told: Told, keys: FleetKeys) {
    while let Some(input) = queue.recv().await {
        let answer = match input {
            Input::File(map) => Job::File(map),
            Input::Edit(question) => match question.decode::<MapEdit>() {
                Ok((edit, format)) => Job::Edit(question, Box::new(edit), format),
                Err(error) => {
                    let code = match error {
                        CodecError::OutOfRange(_) => MapEditCode::OutOfRange,
                        _ => MapEditCode::Malformed,
                    };
                    let format = question.likely_format::<MapEdit>();
                    reply(question, &keys, refusal(code, error.to_string()), format).await;
                    continue;
                }
            },
        };
        // A large map takes its time, and files may take longer.
        let done = tokio::task::spawn_blocking(move || {
            let reply = answer.carry_out(&mut editor);
            (editor, reply)
        });
        let Ok((back, answer)) = done.await else { return };
        editor = back;
        told.tell(&editor);
        if let Some((question, answer, format)) = answer {
            reply(question, &keys, answer, format).await;
        }
    }
}

/// One thing for the editor.
enum Job {
    Edit(Question, Box<MapEdit>, Format),
    File(Map),
}

impl Job {
    fn carry_out(self, editor: &mut Editor) -> Option<(Question, MapEditReply, Format)> {
        match self {
            Self::Edit(question, edit, format) => {
                let answer = editor.edit(wall_ms(), question.client()?, &edit);
                Some((question, answer, format))
            }
            Self::File(map) => {
                if editor.found(wall_ms(), map) == Found::OtherFloor {
                    tracing::warn!("the map's file has another floor now; start again to serve it");
                }
                None
            }
        }
    }
}

fn refusal(code: MapEditCode, message: String) -> MapEditReply {
    let message = message.chars().take(500).collect();
    MapEditReply::Refused { code, message, hint: "docs/protocol.md has the messages".to_owned() }
}

async fn reply(question: Question, keys: &FleetKeys, answer: MapEditReply, format: Format) {
    let Some(client) = question.client() else { return };
    if let Err(error) = question.reply(&keys.map_edit(Some(client)), &answer, format).await {
        tracing::debug!("cannot answer an edit of the map: {error}");
    }
}

/// Brings edits to the queue; what finds no room is refused.
async fn take_edits(bus: &Bus, keys: &FleetKeys, inputs: mpsc::Sender<Input>) -> Result<Service> {
    let (runtime, own_keys) = (tokio::runtime::Handle::current(), keys.clone());
    let every_client = keys.map_edit(None);
    let service = bus.serve(&every_client, move |question| {
        let Err(mpsc::error::TrySendError::Full(Input::Edit(question))) =
            inputs.try_send(Input::Edit(question))
        else {
            return;
        };
        let (keys, format) = (own_keys.clone(), question.likely_format::<MapEdit>());
        runtime.spawn(async move {
            let full = refusal(MapEditCode::Overloaded, format!("{EDITS} edits wait already"));
            reply(question, &keys, full, format).await;
        });
    });
    Ok(service.await?)
}

/// One message, answered with and published, the newest of it, until this is dropped.
struct Serving {
    publishing: Option<JoinHandle<()>>,
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
        Ok(Self { publishing: Some(tokio::spawn(publish(publisher, newest))), _answering: answering })
    }

    /// Answered with, but not published.
    async fn answering<M: Message + Send + Sync + 'static>(
        bus: &Bus,
        key: String,
        newest: watch::Receiver<Arc<M>>,
    ) -> Result<Self> {
        Ok(Self { publishing: None, _answering: answer(bus, key, newest).await? })
    }
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.publishing.iter().for_each(JoinHandle::abort);
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

/// At once, when it changes, and now and again, as long as there is somebody who could change it.
async fn publish<M: Message>(publisher: Publisher<M>, mut newest: watch::Receiver<Arc<M>>) {
    let mut tick = tokio::time::interval(PUBLISH_EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            _ = tick.tick() => {}
            // Nobody changes it any more: the service has ended, and its session with it.
            changed = newest.changed() => if changed.is_err() { return },
        }
        let message = Arc::clone(&newest.borrow_and_update());
        if let Err(error) = publisher.put(&message).await {
            tracing::warn!("cannot publish {}: {error}", M::NAME);
        }
    }
}

#[cfg(test)]
mod tests;
