//! Places of the fleet's map: points and areas that people have named, so that nobody types coordinates.
//!
//! They are served beside the [`FleetMap`](super::FleetMap) and say which map they belong to. Robots do not need
//! them, so naming a place changes nothing that a robot plans on.

use super::{Message, angle, bounded, coordinate};
use crate::keys::{Name, NameError};
use crate::messages::{MAX_ZONE_POINTS, MapHash};
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Most places of a map.
pub const MAX_PLACES: usize = 500;
/// Most tags of a place.
pub const MAX_PLACE_TAGS: usize = 8;
/// With a robot's name, the tag of the place where that robot starts: `start-xtb-1`.
const START_TAG: &str = "start-";

/// Text that cannot be a place's name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum PlaceNameError {
    /// See [`Name`].
    #[error(transparent)]
    Name(#[from] NameError),
    /// On a command line it would be taken for an option or a coordinate.
    #[error("\"{0}\" cannot be a place's name: it must begin with a letter and not be a number")]
    Number(Name),
}

/// A name that a place may have: that of a [`Name`] which begins with a letter and is no number (`inf`, `nan`).
///
/// # Errors
/// See [`PlaceNameError`].
pub fn place_name(text: &str) -> Result<Name, PlaceNameError> {
    let name = Name::new(text)?;
    let is_word = text.starts_with(|c: char| c.is_ascii_lowercase()) && text.parse::<f64>().is_err();
    if is_word { Ok(name) } else { Err(PlaceNameError::Number(name)) }
}

/// What a place is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum PlaceKind {
    /// Somewhere that people send robots to.
    #[default]
    Place,
    /// Where a robot is charged.
    Dock,
    /// Where a robot may stand for long.
    Parking,
    /// Where a robot waits for its turn.
    Waiting,
}

impl PlaceKind {
    /// As files and messages write it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Place => "place",
            Self::Dock => "dock",
            Self::Parking => "parking",
            Self::Waiting => "waiting",
        }
    }
}

impl fmt::Display for PlaceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

/// A named point, or a named area and the point in it that robots are sent to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapPlace {
    /// See [`place_name`].
    pub name: Name,
    /// What it is for.
    #[serde(default)]
    pub kind: PlaceKind,
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Yaw on arrival, counter-clockwise from +x; `None` = any.
    #[serde(default)]
    pub yaw_rad: Option<f64>,
    /// What people group places by; at most [`MAX_PLACE_TAGS`].
    #[serde(default)]
    pub tags: Vec<Name>,
    /// Corners of the area in order, (x, y) in m; empty = a point.
    #[serde(default)]
    pub points: Vec<[f64; 2]>,
}

/// All places of a fleet's map.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FleetPlaces {
    /// The map that they are on.
    pub map: MapHash,
    /// Each with a name of its own.
    #[serde(default)]
    pub places: Vec<MapPlace>,
}

impl FleetPlaces {
    /// The place of this name.
    #[must_use]
    pub fn named(&self, name: &str) -> Option<&MapPlace> {
        self.places.iter().find(|place| place.name.as_str() == name)
    }
}

impl Message for FleetPlaces {
    const NAME: &'static str = "FleetPlaces";
    const MAX_BYTES: usize = 2 * 1024 * 1024;

    fn validate(&self) -> Result<(), CodecError> {
        validate_places(&self.places)
    }
}

/// Whether these can be the places of a message.
pub(super) fn validate_places(places: &[MapPlace]) -> Result<(), CodecError> {
    bounded("places", places.len() as f64, 0.0, MAX_PLACES as f64, "")?;
    for (i, place) in places.iter().enumerate() {
        place.validate()?;
        if places[..i].iter().any(|other| other.name == place.name) {
            return Err(malformed(format!("two places have the name {}", place.name)));
        }
    }
    Ok(())
}

impl MapPlace {
    /// Whether it is this robot's start pose: it has the tag `start-ROBOT`.
    #[must_use]
    pub fn is_start_of(&self, robot: &Name) -> bool {
        self.tags.iter().any(|tag| tag.as_str().strip_prefix(START_TAG) == Some(robot.as_str()))
    }

    fn validate(&self) -> Result<(), CodecError> {
        place_name(self.name.as_str()).map_err(|error| malformed(error.to_string()))?;
        coordinate("x_m", self.x_m)?;
        coordinate("y_m", self.y_m)?;
        self.yaw_rad.map_or(Ok(()), |yaw_rad| angle("yaw_rad", yaw_rad))?;
        bounded("tags of a place", self.tags.len() as f64, 0.0, MAX_PLACE_TAGS as f64, "")?;
        if !self.points.is_empty() {
            bounded("points of a place", self.points.len() as f64, 3.0, MAX_ZONE_POINTS as f64, "")?;
        }
        self.points.iter().flatten().try_for_each(|along| coordinate("points", *along))
    }
}

fn malformed(reason: String) -> CodecError {
    CodecError::Malformed { name: FleetPlaces::NAME, reason }
}
