//! The fleet's map: cells, zones, and a hash that says whether two programs mean the same floor.

use super::{Message, angle, bounded, coordinate};
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// Longest name of a map or a zone, in characters.
pub const MAX_MAP_NAME: usize = 64;
/// Most zones of a map.
pub const MAX_ZONES: usize = 200;
/// Most corners of a zone; it has at least 3.
pub const MAX_ZONE_POINTS: usize = 200;
/// Most cells of a map: 200 m × 200 m at 5 cm.
pub const MAX_MAP_CELLS: u64 = 16_000_000;

/// What a map holds as 64 bits, written as 16 hexadecimal digits: the same for the same resolution,
/// origin, cells and zones, whatever file or message they came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "String", into = "String")]
pub struct MapHash(u64);

/// Text that is no [`MapHash`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0:?} is not a map's hash: 16 of 0-9 and a-f")]
pub struct NoMapHash(String);

impl MapHash {
    /// These bits.
    #[must_use]
    pub const fn new(bits: u64) -> Self {
        Self(bits)
    }

    /// The bits.
    #[must_use]
    pub fn bits(self) -> u64 {
        self.0
    }
}

impl fmt::Display for MapHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{:016x}", self.0))
    }
}

impl std::str::FromStr for MapHash {
    type Err = NoMapHash;

    fn from_str(text: &str) -> Result<Self, NoMapHash> {
        let digits =
            text.len() == 16 && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b));
        let bits = if digits { u64::from_str_radix(text, 16).ok() } else { None };
        bits.map(Self).ok_or_else(|| NoMapHash(text.chars().take(32).collect()))
    }
}

impl TryFrom<String> for MapHash {
    type Error = NoMapHash;

    fn try_from(text: String) -> Result<Self, NoMapHash> {
        text.parse()
    }
}

impl From<MapHash> for String {
    fn from(hash: MapHash) -> String {
        hash.to_string()
    }
}

/// What is known of a square of the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum MapCell {
    /// Nothing stands there.
    Free,
    /// Something stands there.
    Occupied,
    /// Nobody has looked.
    Unknown,
}

/// What holds inside a zone.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MapZoneKind {
    /// No part of a robot may be inside.
    KeepOut,
    /// Driven through in one direction only.
    OneWay {
        /// Which, counter-clockwise from +x.
        heading_rad: f64,
    },
}

/// A polygon on the floor, and its rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapZone {
    /// As people call it.
    pub name: String,
    /// Its rule.
    pub kind: MapZoneKind,
    /// Its corners in order, (x, y) in m; the last one is joined to the first.
    pub points: Vec<[f64; 2]>,
}

/// The map that all robots of a fleet plan on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FleetMap {
    /// As people call it.
    pub name: String,
    /// Of everything below.
    pub hash: MapHash,
    /// Side of a cell, in m.
    pub resolution_m: f64,
    /// South-west corner of the first cell, (x, y) in m.
    pub origin_m: [f64; 2],
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Runs of equal cells; rows from south to north, each from west to east.
    pub cells: Vec<(MapCell, u32)>,
    /// Zones.
    #[serde(default)]
    pub zones: Vec<MapZone>,
}

impl Message for FleetMap {
    const NAME: &'static str = "FleetMap";
    const MAX_BYTES: usize = 4 * 1024 * 1024;

    fn validate(&self) -> Result<(), CodecError> {
        name(&self.name)?;
        bounded("resolution_m", self.resolution_m, 0.005, 1.0, "m")?;
        coordinate("origin_m", self.origin_m[0])?;
        coordinate("origin_m", self.origin_m[1])?;
        let most = MAX_MAP_CELLS as f64;
        let count = u64::from(self.width) * u64::from(self.height);
        bounded("width × height", count as f64, 1.0, most, "cells")?;
        if self.cells.iter().any(|(_, length)| *length == 0) {
            return Err(malformed("a run without cells".to_owned()));
        }
        // No sum of so few runs of 32 bits overflows.
        let sum: u64 = self.cells.iter().map(|(_, length)| u64::from(*length)).sum();
        if sum != count {
            return Err(malformed(format!("the runs are {sum} cells, width × height is {count}")));
        }
        bounded("zones", self.zones.len() as f64, 0.0, MAX_ZONES as f64, "")?;
        self.zones.iter().try_for_each(MapZone::validate)
    }
}

impl MapZone {
    pub(super) fn validate(&self) -> Result<(), CodecError> {
        name(&self.name)?;
        if let MapZoneKind::OneWay { heading_rad } = self.kind {
            angle("heading_rad", heading_rad)?;
        }
        bounded("points of a zone", self.points.len() as f64, 3.0, MAX_ZONE_POINTS as f64, "")?;
        self.points.iter().flatten().try_for_each(|along| coordinate("points", *along))
    }
}

fn name(text: &str) -> Result<(), CodecError> {
    if is_map_name(text) {
        Ok(())
    } else {
        Err(malformed(format!("{text:?} is not a valid name of a map or zone")))
    }
}

/// Whether a map or a zone may be called so: 1 to [`MAX_MAP_NAME`] characters that can be seen, no blank
/// at either end.
#[must_use]
pub fn is_map_name(text: &str) -> bool {
    let length = text.chars().take(MAX_MAP_NAME + 1).count();
    (1..=MAX_MAP_NAME).contains(&length) && text.trim() == text && !text.contains(text::is_control)
}

fn malformed(reason: String) -> CodecError {
    let reason = reason.chars().take(200).collect();
    CodecError::Malformed { name: FleetMap::NAME, reason }
}
