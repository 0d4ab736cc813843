//! What the dispatcher has to find out beside its robots: who should be there, the map and its places; and traffic
//! control, which it runs unless somebody else does.

use crate::traffic::TrafficService;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_client::client::Client;
use xtb_client::map_source::{self, MapSource, PlacesSource};
use xtb_dispatch::{MapTravelCost, OpenTravelCost, TravelCost};
use xtb_nav::Map;
use xtb_protocol::messages::{FleetMap, MapPlace, Roster};

/// It looks again this often.
const LOOK_EVERY: Duration = Duration::from_secs(2);
/// After so many looks in a row without a roster there is none any more: 10 s; chosen, not measured.
const ROSTER_GONE: u32 = 5;
/// What is not known this long after the start is learned while tasks are taken already.
const FIRST_LOOK: Duration = Duration::from_millis(400);

/// The map that this process serves, and each later version of it.
pub(super) type OwnMap = watch::Receiver<Arc<Map>>;

/// What ways cost.
pub(super) type Ground = Box<dyn TravelCost + Send + Sync>;

/// Measures a map; the largest take seconds.
pub(super) fn ground(map: Option<&Map>) -> Ground {
    match map {
        Some(map) => Box::new(MapTravelCost::new(map.clone())),
        None => Box::new(OpenTravelCost),
    }
}

/// What was found.
#[derive(Default)]
pub(super) struct Found {
    pub(super) roster: Option<Roster>,
    pub(super) map: Option<Map>,
    pub(super) places: Option<Vec<MapPlace>>,
    /// The same, measured; `None` = not yet.
    pub(super) ground: Option<Ground>,
    /// Where it comes from if this process serves it.
    pub(super) own: Option<OwnMap>,
    /// Another dispatcher answers too.
    pub(super) second: bool,
}

/// Looks once, in vain at most for [`FIRST_LOOK`]. A map that is known beforehand is ours to serve.
pub(super) async fn first_look(client: &Client, own: Option<OwnMap>) -> Found {
    let known = own.as_ref().map(|own| own.borrow().as_ref().clone());
    let map = async {
        match known.clone() {
            Some(own) => Some(own),
            None => served(client, FIRST_LOOK).await,
        }
    };
    let places = async {
        match &own {
            Some(own) => Some(own.borrow().places().to_vec()),
            None => places(client, FIRST_LOOK).await,
        }
    };
    let all = async { tokio::join!(roster(client), map, places) };
    match tokio::time::timeout(FIRST_LOOK, all).await {
        Ok((roster, map, places)) => Found { roster, map, places, own, ..Found::default() },
        Err(_) => Found { map: known, own, ..Found::default() },
    }
}

/// Keeps looking, and runs traffic control as long as this task does.
pub(super) fn keep_looking(client: &Client, found: Found, within: Duration) -> MapWatch {
    let (sender, news) = mpsc::channel(4);
    let task = tokio::spawn(look(client.clone(), found, within, sender));
    MapWatch { task, news }
}

/// Looks until it is dropped.
pub(super) struct MapWatch {
    task: JoinHandle<()>,
    pub(super) news: mpsc::Receiver<Found>,
}

impl Drop for MapWatch {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn look(client: Client, found: Found, within: Duration, news: mpsc::Sender<Found>) {
    let Found { roster: mut known, mut map, mut places, mut own, .. } = found;
    if has_second(&client, within).await
        && news.send(Found { second: true, ..Found::default() }).await.is_err()
    {
        return;
    }
    let maps = MapSource::open(client.bus(), client.keys()).await;
    let maps = maps.inspect_err(|failure| tracing::warn!("cannot check for another map: {failure}")).ok();
    let named = PlacesSource::open(client.bus(), client.keys()).await;
    let named = named.inspect_err(|failure| tracing::warn!("cannot check for other places: {failure}")).ok();
    let (mut traffic, mut said, mut without_roster) = (None, false, 0);
    let mut tick = tokio::time::interval(LOOK_EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tick.tick().await;
        let mut found = Found::default();
        let roster = roster(&client).await;
        without_roster = if roster.is_some() { 0 } else { without_roster + 1 };
        if roster.is_some() && roster != known {
            (known, found.roster) = (roster.clone(), roster);
        } else if known.is_some() && without_roster >= ROSTER_GONE {
            // The simulator that had it has ended.
            (known, found.roster) = (None, Some(Roster { robots: Vec::new() }));
        }
        found.map = match (&map, &mut own) {
            // Whoever serves a map knows which one it is.
            (map, Some(own)) => newer(map.as_ref(), own),
            (None, None) => served(&client, within).await,
            (Some(map), None) => maps.as_ref().and_then(|maps| another(map, maps)),
        };
        if let Some(new) = found.map.clone() {
            map.clone_from(&found.map);
            traffic = None;
            // The largest maps take seconds: not in the loop that keeps the leases.
            found.ground = tokio::task::spawn_blocking(move || ground(Some(&new))).await.ok();
        }
        let newest = match named.as_ref().and_then(PlacesSource::newest) {
            Some(newest) => Some(newest.places.clone()),
            None if places.is_none() && map.is_some() => self::places(&client, within).await,
            None => None,
        };
        if newest.is_some() && newest != places {
            places.clone_from(&newest);
            found.places = newest;
        }
        let is_news = found.roster.is_some() || found.map.is_some() || found.places.is_some();
        if is_news && news.send(found).await.is_err() {
            return;
        }
        let Some(map) = map.as_ref().filter(|_| traffic.is_none()) else { continue };
        match TrafficService::start(&client, map, within).await {
            Ok(started) => traffic = Some(started),
            Err(failure) if !said => {
                said = true;
                tracing::info!("using another program's traffic control: {failure}");
            }
            Err(_) => {}
        }
    }
}

/// The map that this process serves, if it has other zones now.
fn newer(map: Option<&Map>, own: &mut OwnMap) -> Option<Map> {
    let newest = own.borrow_and_update();
    let same = map.is_some_and(|map| map.hash() == newest.hash());
    (!same).then(|| newest.as_ref().clone())
}

/// The map that was published last, if it is not this one.
fn another(map: &Map, maps: &MapSource) -> Option<Map> {
    let newest = maps.newest()?;
    let same = newest.name == map.name() && newest.hash == map.hash();
    if same { None } else { read(&newest) }
}

/// Two that began at the same moment have not seen each other's presence: both answer, and both end.
async fn has_second(client: &Client, within: Duration) -> bool {
    let answers = client.bus().get(&client.keys().dispatch_tasks(), within).await;
    answers.is_ok_and(|answers| answers.len() > 1)
}

async fn roster(client: &Client) -> Option<Roster> {
    let entries = client.roster_entries(&[]).await;
    let robots = entries.inspect_err(|failure| tracing::debug!("no roster: {failure}")).ok()??;
    Some(Roster { robots })
}

async fn served(client: &Client, within: Duration) -> Option<Map> {
    let served = map_source::served(client.bus(), client.keys(), within).await;
    let served = served.inspect_err(|failure| tracing::debug!("no map: {failure}")).ok()?;
    read(served.first()?)
}

/// `None` = nobody has told of any yet.
async fn places(client: &Client, within: Duration) -> Option<Vec<MapPlace>> {
    let found = map_source::places(client.bus(), client.keys(), within).await;
    let found = found.inspect_err(|failure| tracing::debug!("no places: {failure}")).ok()?;
    found.filter(|places| !places.is_empty())
}

fn read(message: &FleetMap) -> Option<Map> {
    Map::try_from(message).inspect_err(|error| tracing::warn!("the fleet's map: {error}")).ok()
}
