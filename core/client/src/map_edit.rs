//! Changing the fleet's map: the map server is asked, which alone changes it, and keeps who did so and why.

use crate::client::{self, Client};
use crate::error::{Error, ErrorKind, Result};
use crate::map_source;
use std::time::{Duration, Instant};
use xtb_bus::Incoming;
use xtb_identity::Action;
use xtb_nav::map::places_hash;
use xtb_protocol::Uuid;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{
    MAX_WHY, MapContent, MapEdit, MapEditReply, MapHistory, MapPlace, MapVersion, MapZone, is_why,
};

/// A map server answers within this; then the same is asked again.
const ANSWERS_WITHIN: Duration = Duration::from_secs(2);
/// For so long.
const ASKED_FOR: Duration = Duration::from_secs(8);

/// Zones and places of the map that is served, to be changed.
#[derive(Debug, Clone, PartialEq)]
pub struct MapDraft {
    /// What they were when they were read.
    pub base: MapContent,
    /// All zones.
    pub zones: Vec<MapZone>,
    /// All places.
    pub places: Vec<MapPlace>,
}

/// A map that was saved.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Saved {
    /// As which version.
    pub version: MapVersion,
    /// Whether it is in the map's file; if not, it ends with the server.
    pub stored: bool,
}

/// Zones and places as they are now.
///
/// # Errors
/// [`ErrorKind::NoMap`]: nobody serves one; [`ErrorKind::Failed`]: several programs do.
pub async fn draft(client: &Client) -> Result<MapDraft> {
    let mut served = map_source::served(client.bus(), client.keys(), client.settings().timeout).await?;
    let programs = served.len();
    let map = served.pop().ok_or_else(map_source::no_map)?;
    one_place(programs)?;
    let places = map_source::places(client.bus(), client.keys(), client.settings().timeout).await?;
    let places = places.unwrap_or_default();
    let base = MapContent { map: map.hash, places: places_hash(&places) };
    Ok(MapDraft { base, zones: map.zones, places })
}

/// Saves zones and places as a new version of the map. Asked again with the same id until answered.
///
/// # Errors
/// [`ErrorKind::NotEdited`]: the server refuses, as a conflict if the map has changed since; nothing has changed
/// then. [`ErrorKind::NoMap`], [`ErrorKind::Failed`]: as of [`draft`]. [`ErrorKind::OutcomeUnknown`].
pub async fn save(client: &Client, draft: MapDraft, why: &str) -> Result<Saved> {
    client.may(Action::ChangeMap)?;
    let why = why.trim().to_owned();
    if !is_why(&why) {
        let message = format!("the reason of a change of the map has 1 to {MAX_WHY} characters");
        return Err(Error::new(ErrorKind::Invalid, message).hint("say in a few words why the map changes"));
    }
    one_place(histories(client).await?.len())?;
    let MapDraft { base, zones, places } = draft;
    let edit = MapEdit { id: Uuid::new_v4(), base, why, zones, places };
    let name = client.name();
    let (key, channel) = (client.keys().map_edit(Some(name)), Channel::MapEdit(name.clone()));
    let (began, mut reply) = (Instant::now(), None);
    while reply.is_none() && began.elapsed() < ASKED_FOR {
        let within = client.round_trip().patience(ANSWERS_WITHIN);
        let each = |answer: Incoming| match answer.decode::<MapEditReply>() {
            Ok(read) => reply = Some(read),
            Err(error) => tracing::warn!("on {}: {error}", answer.key),
        };
        client.bus().ask_each(&key, &channel, &edit, within, each).await?;
    }
    match reply {
        Some(MapEditReply::Saved { version, stored }) => Ok(Saved { version, stored }),
        Some(MapEditReply::Refused { code, message, hint }) => {
            Err(Error::new(ErrorKind::NotEdited(code), message).hint(hint))
        }
        None => Err(Error::new(ErrorKind::OutcomeUnknown, "the map server does not answer")
            .hint("`fleet-cli map history` shows whether it was saved; an older map server takes no edits")),
    }
}

/// Who changed the map that is served, when and why.
///
/// # Errors
/// [`ErrorKind::NoMap`]: nobody serves one that can be changed; [`ErrorKind::Failed`] if the question could not be sent.
pub async fn history(client: &Client) -> Result<MapHistory> {
    histories(client).await?.pop().ok_or_else(unchangeable)
}

/// Of each program that serves a map.
async fn histories(client: &Client) -> Result<Vec<MapHistory>> {
    let answers = client::get(client.bus(), &client.keys().map_history(), client.patience()).await?;
    let read = |answer: &Incoming| {
        answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
    };
    Ok(answers.iter().filter_map(read).collect())
}

/// A change needs one program that serves the map.
fn one_place(programs: usize) -> Result<()> {
    match programs {
        0 => Err(unchangeable()),
        1 => Ok(()),
        many => {
            let message =
                format!("{many} programs serve the fleet's map: no single one could store the change");
            Err(Error::new(ErrorKind::Failed, message)
                .hint("end all but one of them: `map serve`, simulators, `traffic serve` and `dispatch serve` with --map"))
        }
    }
}

fn unchangeable() -> Error {
    Error::new(ErrorKind::NoMap, "no map that can be changed is served to this fleet")
}
