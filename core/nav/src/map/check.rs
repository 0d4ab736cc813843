//! What a map is worth to a truck: floor that it can reach, doors too narrow for it, zones that are wrong.
//!
//! The truck counts as a disc as wide as its body: the least that it needs to pass between two things
//! straight ahead. Where the disc does not fit, the truck does not either; where it does, turning and the
//! planner's own margins may still need more.

mod islands;

use super::{Map, polygon};
use crate::geometry::{Car, Grid};
use islands::Islands;

/// Islands that hangs together for the truck.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Island {
    /// Where its middle can be, in m².
    pub area_m2: f64,
    /// The place in it with the most room around, (x, y) in m.
    pub at_m: [f64; 2],
}

/// A place too narrow for the truck, between two islands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Narrow {
    /// Where, (x, y) in m.
    pub at_m: [f64; 2],
    /// How wide it is, to about a cell, in m.
    pub width_m: f64,
}

/// Something wrong with zones.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ZoneFinding {
    /// No part of it lies on the map.
    Outside {
        /// Which zone.
        zone: String,
    },
    /// A part of it lies beyond the map's border.
    PartlyOutside {
        /// Which zone.
        zone: String,
    },
    /// Keep-outs cut floor in pieces that would hang together without them.
    Cut {
        /// Those that lie between pieces.
        zones: Vec<String>,
        /// How many pieces of one island.
        pieces: usize,
    },
}

/// What was found.
#[derive(Debug, Clone, PartialEq)]
pub struct MapReport {
    /// Free cells, in m².
    pub free_m2: f64,
    /// Occupied cells, in m².
    pub occupied_m2: f64,
    /// Unknown cells, in m².
    pub unknown_m2: f64,
    /// Islands at least as large as the truck, largest first, keep-outs taken away.
    pub islands: Vec<Island>,
    /// Narrow places between islands, widest first.
    pub narrows: Vec<Narrow>,
    /// What is wrong with zones.
    pub zones: Vec<ZoneFinding>,
}

/// What a map is worth to this car.
#[must_use]
pub fn check(map: &Map, car: &Car) -> MapReport {
    let bare = Islands::of(map.grid(), car);
    let mut zones: Vec<ZoneFinding> = map.zones().iter().filter_map(|zone| off_the_map(map, zone)).collect();
    let (mut free, mut occupied, mut unknown) = (0_usize, 0_usize, 0_usize);
    for cell in map.grid().cells() {
        match cell {
            crate::geometry::Cell::Free => free += 1,
            crate::geometry::Cell::Occupied => occupied += 1,
            crate::geometry::Cell::Unknown => unknown += 1,
        }
    }
    let fenced = map.keep_outs().next().map(|_| Islands::of(&map.grid_with_keep_outs(), car));
    if let Some(fenced) = &fenced {
        zones.extend(cuts(map, car, &bare, fenced));
    }
    let m2 = |cells: usize| cells as f64 * map.grid().resolution_m() * map.grid().resolution_m();
    MapReport {
        free_m2: m2(free),
        occupied_m2: m2(occupied),
        unknown_m2: m2(unknown),
        islands: fenced.as_ref().unwrap_or(&bare).islands(map.grid()),
        narrows: bare.narrows(map.grid()),
        zones,
    }
}

/// South-west and north-east corner of a grid, in m.
fn borders(grid: &Grid) -> ([f64; 2], [f64; 2]) {
    let low = grid.origin_m();
    let size = [grid.width(), grid.height()].map(|cells| cells as f64 * grid.resolution_m());
    (low, [low[0] + size[0], low[1] + size[1]])
}

fn off_the_map(map: &Map, zone: &super::Zone) -> Option<ZoneFinding> {
    let (low, high) = borders(map.grid());
    let all = [low, [high[0], low[1]], high, [low[0], high[1]]];
    // A zone drawn along the border is meant to end there.
    let beyond = map.grid().resolution_m();
    let out = |p: &[f64; 2]| (0..2).any(|i| p[i] < low[i] - beyond || p[i] > high[i] + beyond);
    let name = zone.name().to_owned();
    if !polygon::touch(zone.points(), &all) {
        Some(ZoneFinding::Outside { zone: name })
    } else if zone.points().iter().any(out) {
        Some(ZoneFinding::PartlyOutside { zone: name })
    } else {
        None
    }
}

/// Each island of the bare floor of which the keep-outs leave several.
fn cuts(map: &Map, car: &Car, bare: &Islands, fenced: &Islands) -> Vec<ZoneFinding> {
    let whole_of = |piece: u32| bare.island_at(fenced.peak_of(piece));
    let pieces = fenced.ids();
    let mut found = Vec::new();
    for whole in bare.ids() {
        let parts: Vec<u32> =
            pieces.iter().copied().filter(|piece| whole_of(*piece) == Some(whole)).collect();
        if parts.len() < 2 {
            continue;
        }
        let between = map.keep_outs().filter(|zone| pieces_beside(map, car, fenced, zone, &parts) >= 2);
        let zones = between.map(|zone| zone.name().to_owned()).collect();
        found.push(ZoneFinding::Cut { zones, pieces: parts.len() });
    }
    found
}

/// How many of these pieces a truck that just touches the zone can stand in.
fn pieces_beside(map: &Map, car: &Car, fenced: &Islands, zone: &super::Zone, parts: &[u32]) -> usize {
    let grid = map.grid();
    let reach_m = car.half_width_m + 2.0 * grid.resolution_m();
    let (low, high) = polygon::bounds(zone.points());
    let (west, south) = grid.place(low[0] - reach_m, low[1] - reach_m);
    let (east, north) = grid.place(high[0] + reach_m, high[1] + reach_m);
    let (width, height) = (grid.width() as i64, grid.height() as i64);
    let mut beside: Vec<u32> = Vec::new();
    for row in south.max(0)..=north.min(height - 1) {
        for column in west.max(0)..=east.min(width - 1) {
            let Some(piece) = fenced.island_at((row * width + column) as usize) else { continue };
            let new = parts.contains(&piece) && !beside.contains(&piece);
            if new && polygon::distance_m(zone.points(), grid.centre_m(column, row)) <= reach_m {
                beside.push(piece);
            }
        }
    }
    beside.len()
}
