//! What the dispatcher has to find out beside its robots: who should be there and the map; and traffic
//! control, which it runs unless somebody else does.

use crate::charts;
use crate::client::Client;
use crate::traffic::TrafficService;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_nav::Map;
use xtb_protocol::messages::Roster;

/// It looks again this often.
const LOOK_EVERY: Duration = Duration::from_secs(2);
/// What is not known this long after the start is learned while tasks are taken already.
const FIRST_LOOK: Duration = Duration::from_millis(400);

/// What was found.
#[derive(Default)]
pub(super) struct Found {
    pub(super) roster: Option<Roster>,
    pub(super) map: Option<Map>,
    /// Another dispatcher answers too.
    pub(super) second: bool,
}

/// Looks once, in vain at most for [`FIRST_LOOK`].
pub(super) async fn first_look(client: &Client, map: Option<Map>) -> Found {
    let both = async { tokio::join!(roster(client), known_or_served(client, map.clone(), FIRST_LOOK)) };
    match tokio::time::timeout(FIRST_LOOK, both).await {
        Ok((roster, map)) => Found { roster, map, second: false },
        Err(_) => Found { roster: None, map, second: false },
    }
}

/// Keeps looking, and runs traffic control as long as this task does.
pub(super) fn keep_looking(client: &Client, found: Found, within: Duration) -> Looking {
    let (sender, news) = mpsc::channel(4);
    let task = tokio::spawn(look(client.clone(), found, within, sender));
    Looking { task, news }
}

/// Looks until it is dropped.
pub(super) struct Looking {
    task: JoinHandle<()>,
    pub(super) news: mpsc::Receiver<Found>,
}

impl Drop for Looking {
    fn drop(&mut self) {
        self.task.abort();
    }
}

async fn look(client: Client, found: Found, within: Duration, news: mpsc::Sender<Found>) {
    let Found { roster: mut known, mut map, .. } = found;
    if has_second(&client, within).await
        && news.send(Found { second: true, ..Found::default() }).await.is_err()
    {
        return;
    }
    let (mut traffic, mut said) = (None, false);
    let mut tick = tokio::time::interval(LOOK_EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tick.tick().await;
        let mut found = Found::default();
        if let Some(roster) = roster(&client).await.filter(|roster| known.as_ref() != Some(roster)) {
            known = Some(roster.clone());
            found.roster = Some(roster);
        }
        if map.is_none() {
            map = known_or_served(&client, None, within).await;
            found.map.clone_from(&map);
        }
        if (found.roster.is_some() || found.map.is_some()) && news.send(found).await.is_err() {
            return;
        }
        let Some(map) = map.as_ref().filter(|_| traffic.is_none()) else { continue };
        match TrafficService::start(&client, map, within).await {
            Ok(started) => traffic = Some(started),
            Err(failure) if !said => {
                said = true;
                tracing::info!("traffic control is somebody else's: {failure}");
            }
            Err(_) => {}
        }
    }
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

async fn known_or_served(client: &Client, known: Option<Map>, within: Duration) -> Option<Map> {
    if known.is_some() {
        return known;
    }
    let served = charts::served(client.bus(), client.keys(), within).await;
    let message =
        served.inspect_err(|failure| tracing::debug!("no map: {failure}")).ok()?.into_iter().next()?;
    Map::try_from(&message).inspect_err(|error| tracing::warn!("the fleet's map: {error}")).ok()
}
