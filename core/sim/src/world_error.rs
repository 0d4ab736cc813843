//! Why a world is impossible.

use thiserror::Error;
use xtb_nav::map::MapError;

/// Why a world was refused. Items are counted from 1, in the file's order.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WorldError {
    /// Not TOML, or not of a world's layout.
    #[error("not a world file: {0}")]
    Syntax(#[from] toml::de::Error),
    /// A number is not finite or out of its range.
    #[error("{item}: {field} = {value:?} is outside {min}..={max}")]
    OutOfRange {
        /// Which wall, box, …
        item: String,
        /// Which of its values.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest value allowed.
        min: f64,
        /// Largest value allowed.
        max: f64,
    },
    /// A polyline needs two points.
    #[error("{item}: {points} point(s), a wall needs at least 2")]
    WallTooShort {
        /// Which wall.
        item: String,
        /// How many points it has.
        points: usize,
    },
    /// Two boxes of one name could not be told apart.
    #[error("two boxes have the name \"{name}\"")]
    BoxNamedTwice {
        /// The name.
        name: String,
    },
    /// Two zones of one name could not be told apart.
    #[error("two zones have the name \"{name}\"")]
    ZoneNamedTwice {
        /// The name.
        name: String,
    },
    /// Its places are impossible.
    #[error(transparent)]
    Places(MapError),
    /// There is no box of this name.
    #[error("no box has the name \"{name}\"")]
    NoSuchBox {
        /// The name.
        name: String,
    },
    /// A map whose occupied cells make more boxes than a simulator can look for.
    #[error("the map has {boxes} separate things, the limit is {most}: clean it, or use larger cells")]
    TooManyBoxes {
        /// How many it has.
        boxes: usize,
        /// As many are possible.
        most: usize,
    },
    /// A robot would start inside something.
    #[error("start {start} is inside {what}")]
    StartBlocked {
        /// Which start.
        start: usize,
        /// What is there.
        what: String,
    },
    /// A robot would start beyond the room's walls.
    #[error("start {start} is outside the room")]
    StartOutside {
        /// Which start.
        start: usize,
    },
    /// Two robots would start inside each other.
    #[error("starts {first} and {second} overlap")]
    StartsOverlap {
        /// The one.
        first: usize,
        /// The other.
        second: usize,
    },
    /// There is no room for so many robots with 3 m free ahead of each.
    #[error("{asked} robots do not fit: there is room for {placed}; give [[starts]] or a larger room")]
    TooManyRobots {
        /// How many were asked for.
        asked: usize,
        /// How many found a place.
        placed: usize,
    },
}

/// Refuses what is not finite or outside `min..=max`.
pub(crate) fn check(
    item: &str,
    field: &'static str,
    value: f64,
    min: f64,
    max: f64,
) -> Result<(), WorldError> {
    if value.is_finite() && (min..=max).contains(&value) {
        return Ok(());
    }
    Err(WorldError::OutOfRange { item: item.to_owned(), field, value, min, max })
}
