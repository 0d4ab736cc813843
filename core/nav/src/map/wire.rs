//! A map as a message, and back: nothing of a message is believed before its hash fits.

use super::{Map, MapError, Zone, ZoneError, ZoneKind};
use crate::geometry::grid::GridError;
use crate::geometry::{Cell, Grid};
use thiserror::Error;
use xtb_protocol::messages::{FleetMap, FleetPlaces, MapCell, MapHash, MapZone, MapZoneKind};

/// Why a message is no map.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum WireError {
    /// Its cells make no grid.
    #[error("{0}")]
    Grid(#[from] GridError),
    /// A zone is impossible.
    #[error("{0}")]
    Zone(#[from] ZoneError),
    /// Name and zones make no map.
    #[error("{0}")]
    Map(#[from] MapError),
    /// It is not the map that it says it is.
    #[error("the map states the hash {said}, but its hash is {found}")]
    Hash {
        /// In the message.
        said: MapHash,
        /// Of what it holds.
        found: MapHash,
    },
}

impl From<&Zone> for MapZone {
    fn from(zone: &Zone) -> Self {
        Self {
            name: zone.name().to_owned(),
            kind: match zone.kind() {
                ZoneKind::KeepOut => MapZoneKind::KeepOut,
                ZoneKind::OneWay { heading_rad } => MapZoneKind::OneWay { heading_rad },
            },
            points: zone.points().to_vec(),
        }
    }
}

impl TryFrom<&MapZone> for Zone {
    type Error = ZoneError;

    fn try_from(zone: &MapZone) -> Result<Self, ZoneError> {
        let kind = match zone.kind {
            MapZoneKind::KeepOut => ZoneKind::KeepOut,
            MapZoneKind::OneWay { heading_rad } => ZoneKind::OneWay { heading_rad },
        };
        Self::new(&zone.name, kind, zone.points.clone())
    }
}

impl From<&Map> for FleetMap {
    fn from(map: &Map) -> Self {
        let grid = map.grid();
        // Sides of a grid are far below this.
        let side = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
        Self {
            name: map.name().to_owned(),
            hash: map.hash(),
            resolution_m: grid.resolution_m(),
            origin_m: grid.origin_m(),
            width: side(grid.width()),
            height: side(grid.height()),
            cells: runs(grid.cells()),
            zones: map.zones().iter().map(MapZone::from).collect(),
        }
    }
}

impl From<&Map> for FleetPlaces {
    fn from(map: &Map) -> Self {
        Self { map: map.hash(), places: map.places().to_vec() }
    }
}

impl TryFrom<&FleetMap> for Map {
    type Error = WireError;

    fn try_from(message: &FleetMap) -> Result<Self, WireError> {
        let (width, height) = (message.width as usize, message.height as usize);
        let length: u64 = message.cells.iter().map(|(_, length)| u64::from(*length)).sum();
        if length > Grid::MOST_CELLS as u64 {
            return Err(GridError::Size { width, height }.into());
        }
        let mut cells = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
        for (cell, length) in &message.cells {
            let cell = match cell {
                MapCell::Free => Cell::Free,
                MapCell::Occupied => Cell::Occupied,
                MapCell::Unknown => Cell::Unknown,
            };
            cells.extend(std::iter::repeat_n(cell, *length as usize));
        }
        let grid = Grid::new(message.resolution_m, message.origin_m, width, height, cells)?;
        let zones = message.zones.iter().map(Zone::try_from).collect::<Result<_, ZoneError>>()?;
        let map = Map::new(&message.name, grid, zones)?;
        let found = map.hash();
        if found == message.hash { Ok(map) } else { Err(WireError::Hash { said: message.hash, found }) }
    }
}

fn runs(cells: &[Cell]) -> Vec<(MapCell, u32)> {
    let mut runs: Vec<(MapCell, u32)> = Vec::new();
    for cell in cells {
        let cell = match cell {
            Cell::Free => MapCell::Free,
            Cell::Occupied => MapCell::Occupied,
            Cell::Unknown => MapCell::Unknown,
        };
        match runs.last_mut() {
            Some((last, length)) if *last == cell => *length += 1,
            _ => runs.push((cell, 1)),
        }
    }
    runs
}
