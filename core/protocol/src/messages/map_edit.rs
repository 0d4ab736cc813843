//! A change of the fleet's map: other zones and places on the same floor, made by the map server alone, and what
//! changed before.
//!
//! An edit names the content that its author saw ([`MapContent`]): on any other it is refused as a conflict, so that
//! nobody overwrites what somebody else has saved.

use super::places::validate_places;
use super::{MAX_ZONES, MapHash, MapPlace, MapZone, Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

/// Longest reason of an edit, in characters.
pub const MAX_WHY: usize = 200;
/// Versions of a map that are remembered; older ones are dropped.
pub const MAX_MAP_VERSIONS: usize = 200;
const MAX_EDIT_BYTES: usize = 3 * 1024 * 1024;
const MAX_HISTORY_BYTES: usize = 512 * 1024;

/// What a map holds, as two hashes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapContent {
    /// Floor and zones: the map's own hash.
    pub map: MapHash,
    /// Its places.
    pub places: MapHash,
}

/// Other zones and places for the map that is served. The floor stays.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapEdit {
    /// Chosen by the client; the same id again, from the same client, changes nothing twice.
    pub id: Uuid,
    /// What was edited.
    pub base: MapContent,
    /// The reason, for the history: 1 to [`MAX_WHY`] characters.
    #[serde(deserialize_with = "text::read")]
    pub why: String,
    /// All zones from now on.
    #[serde(default)]
    pub zones: Vec<MapZone>,
    /// All places from now on.
    #[serde(default)]
    pub places: Vec<MapPlace>,
}

impl Message for MapEdit {
    const NAME: &'static str = "MapEdit";
    const MAX_BYTES: usize = MAX_EDIT_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        if !is_why(&self.why) {
            let reason = format!("why: 1 to {MAX_WHY} characters that can be seen, no blank at either end");
            return Err(CodecError::Malformed { name: Self::NAME, reason });
        }
        bounded("zones", self.zones.len() as f64, 0.0, MAX_ZONES as f64, "")?;
        self.zones.iter().try_for_each(MapZone::validate)?;
        validate_places(&self.places)
    }
}

/// Whether this can be the reason of an edit.
#[must_use]
pub fn is_why(why: &str) -> bool {
    let length = why.chars().take(MAX_WHY + 1).count();
    (1..=MAX_WHY).contains(&length) && why.trim() == why && !why.contains(text::is_control)
}

/// Why a map server refused an edit; nothing has changed then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum MapEditCode {
    /// Not a message of ours, or of another version.
    Malformed,
    /// A number that is not finite or out of its range.
    OutOfRange,
    /// The map has changed since the author looked at it.
    Conflict,
    /// Zones or places that no map can have.
    Invalid,
    /// The map's file could not be read or written.
    NotStored,
    /// Too many edits wait.
    Overloaded,
}

/// A version of the map: who made it, when, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapVersion {
    /// Counts the versions of this map, from 1.
    pub number: u64,
    /// When it was saved, in ms since 1970, by the server's clock.
    pub at_ms: u64,
    /// The client; `file` = somebody changed the map's file itself.
    pub by: Name,
    /// The reason.
    #[serde(deserialize_with = "text::read")]
    pub why: String,
    /// What it holds.
    pub content: MapContent,
}

/// What a map server says to an edit.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MapEditReply {
    /// It is served now; also if the map was so already.
    Saved {
        /// As which version.
        version: MapVersion,
        /// Whether it is in the map's file; if not, it ends with the server.
        stored: bool,
    },
    /// Nothing has changed.
    Refused {
        /// Why, for programs.
        code: MapEditCode,
        /// Why, for people.
        #[serde(deserialize_with = "text::read")]
        message: String,
        /// What to do.
        #[serde(deserialize_with = "text::read")]
        hint: String,
    },
}

impl Message for MapEditReply {
    const NAME: &'static str = "MapEditReply";
}

/// The versions of the map that is served.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapHistory {
    /// The map's name.
    #[serde(deserialize_with = "text::read")]
    pub name: String,
    /// Whether edits are kept in the map's file; if not, they end with the server.
    pub stored: bool,
    /// The newest [`MAX_MAP_VERSIONS`], the newest last.
    #[serde(default)]
    pub versions: Vec<MapVersion>,
}

impl Message for MapHistory {
    const NAME: &'static str = "MapHistory";
    const MAX_BYTES: usize = MAX_HISTORY_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        bounded("versions", self.versions.len() as f64, 0.0, MAX_MAP_VERSIONS as f64, "")
    }
}
