//! The fleet's map: an occupancy grid, zones drawn as polygons, a hash of both, and named places.
//!
//! A [`Map`] comes from our world files (`xtb_sim::World::to_map`), from the files of ROS's map_server
//! ([`ros`]) or from the wire ([`wire`]), and whatever way it came, the same floor has the same
//! [`Map::hash`]: programs that plan together compare it first.
//!
//! The hash is CRC-64/XZ over canonical bytes, from the crate `crc` that the frames of the I/O board
//! use already. It tells different floors apart (any two by chance the same: once in 10¹⁹); it is no
//! protection against somebody who wants two maps to look the same.

pub mod check;
mod layers;
mod places;
pub mod polygon;
pub mod raster;
pub mod ros;
pub mod wire;
mod zone;

pub use layers::{ZoneLayers, Zones};
pub use places::{check_places, places_hash};
pub use zone::{Zone, ZoneError, ZoneKind};

use crate::MapPose;
use crate::geometry::{Car, Cell, Grid, Rect};
use crc::{CRC_64_XZ, Crc};
use std::f64::consts::TAU;
use thiserror::Error;
use xtb_protocol::messages::{MAX_ZONES, MapContent, MapHash, MapPlace, is_map_name};

/// Why a map cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MapError {
    /// See [`is_map_name`].
    #[error("{0:?} cannot be a map's name: 1 to 64 characters, no blank at either end")]
    Name(String),
    /// More than [`MAX_ZONES`].
    #[error("{0} zones, at most {MAX_ZONES} are allowed")]
    TooManyZones(usize),
    /// Two zones of one name could not be told apart.
    #[error("two zones have the name {0:?}")]
    ZoneNamedTwice(String),
    /// Two places of one name, too many of them, or one that is impossible.
    #[error("{0}")]
    Places(String),
}

/// So many headings, all around, are tried at a goal of any yaw.
pub const GOAL_YAWS: u32 = 16;

/// A floor: every value of this type has passed the checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    name: String,
    grid: Grid,
    zones: Vec<Zone>,
    places: Vec<MapPlace>,
    /// Of grid and zones, which never change.
    hash: MapHash,
}

impl Map {
    /// A map of this name.
    ///
    /// # Errors
    /// See [`MapError`].
    pub fn new(name: &str, grid: Grid, zones: Vec<Zone>) -> Result<Self, MapError> {
        if !is_map_name(name) {
            return Err(MapError::Name(name.chars().take(100).collect()));
        }
        if zones.len() > MAX_ZONES {
            return Err(MapError::TooManyZones(zones.len()));
        }
        let again = |(i, zone): (usize, &Zone)| zones[..i].iter().any(|other| other.name() == zone.name());
        if let Some(i) = (0..zones.len()).find(|&i| again((i, &zones[i]))) {
            return Err(MapError::ZoneNamedTwice(zones[i].name().to_owned()));
        }
        let hash = hash_of(&grid, &zones);
        Ok(Self { name: name.to_owned(), grid, zones, places: Vec::new(), hash })
    }

    /// The same with these places, which its hash does not cover: no robot plans on them.
    ///
    /// # Errors
    /// [`MapError::Places`].
    pub fn with_places(self, places: Vec<MapPlace>) -> Result<Self, MapError> {
        check_places(&places)?;
        Ok(Self { places, ..self })
    }

    /// As people call it; not part of the hash.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What stands where; zones are not drawn into it.
    #[must_use]
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// All zones.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// All places.
    #[must_use]
    pub fn places(&self) -> &[MapPlace] {
        &self.places
    }

    /// The zones that no robot may touch.
    pub fn keep_outs(&self) -> impl Iterator<Item = &Zone> {
        self.zones.iter().filter(|zone| zone.kind() == ZoneKind::KeepOut)
    }

    /// The zone that holds a point, in m; a keep-out before any other.
    #[must_use]
    pub fn zone_at(&self, x_m: f64, y_m: f64) -> Option<&Zone> {
        let mut here = self.zones.iter().filter(|zone| zone.holds(x_m, y_m));
        self.keep_outs().find(|zone| zone.holds(x_m, y_m)).or_else(|| here.next())
    }

    /// The keep-out that a car touches when it stands at `pose`; its border counts.
    #[must_use]
    pub fn keep_out_under(&self, car: &Car, pose: &MapPose) -> Option<&Zone> {
        let corners = car.corners(pose);
        self.keep_outs().find(|zone| zone.touches(&corners))
    }

    /// Whether the body of a car, grown by a margin in m, has room at a point, in m, on free floor and outside of
    /// keep-outs: at this yaw, else at any of [`GOAL_YAWS`].
    #[must_use]
    pub fn has_room(&self, car: &Car, [x_m, y_m]: [f64; 2], yaw_rad: Option<f64>, margin_m: f64) -> bool {
        let is_blocked = |column: i64, row: i64| {
            let [x_m, y_m] = self.grid.centre_m(column, row);
            self.grid.cell(column, row) != Cell::Free || self.keep_outs().any(|zone| zone.holds(x_m, y_m))
        };
        let has_room = |yaw_rad: f64| {
            let body = Rect::body(car, &MapPose { x_m, y_m, yaw_rad });
            body.is_free_on(&self.grid, margin_m, is_blocked)
        };
        let mut yaws = (0..GOAL_YAWS).map(|n| f64::from(n) * TAU / f64::from(GOAL_YAWS));
        yaw_rad.map_or_else(|| yaws.any(has_room), has_room)
    }

    /// The one-way zone that forbids to be at a point while driving on this course (the direction of
    /// motion, counter-clockwise from +x): more than 90° off its heading.
    #[must_use]
    pub fn one_way_against(&self, x_m: f64, y_m: f64, course_rad: f64) -> Option<&Zone> {
        self.zones.iter().find(|zone| !zone.allows(course_rad) && zone.holds(x_m, y_m))
    }

    /// The grid with the keep-outs drawn into it as occupied.
    #[must_use]
    pub fn grid_with_keep_outs(&self) -> Grid {
        let mut grid = self.grid.clone();
        for zone in self.keep_outs() {
            raster::polygon(&mut grid, zone.points(), Cell::Occupied);
        }
        grid
    }

    /// What it holds, floor, zones and places, as hashes.
    #[must_use]
    pub fn content(&self) -> MapContent {
        MapContent { map: self.hash, places: places_hash(&self.places) }
    }

    /// The same floor with other zones and places.
    ///
    /// # Errors
    /// See [`MapError`].
    pub fn with(&self, zones: Vec<Zone>, places: Vec<MapPlace>) -> Result<Self, MapError> {
        Self::new(&self.name, self.grid.clone(), zones)?.with_places(places)
    }

    /// The same for the same resolution, origin, cells and zones, in whatever form they came.
    #[must_use]
    pub fn hash(&self) -> MapHash {
        self.hash
    }
}

fn hash_of(grid: &Grid, zones: &[Zone]) -> MapHash {
    const CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);
    let mut digest = CRC.digest();
    digest.update(b"xtb map 1");
    let [x_m, y_m] = grid.origin_m();
    for number in [grid.resolution_m(), x_m, y_m] {
        digest.update(&canonical(number));
    }
    for count in [grid.width(), grid.height(), zones.len()] {
        digest.update(&(count as u64).to_le_bytes());
    }
    for row in grid.cells().chunks(grid.width()) {
        let bytes: Vec<u8> = row.iter().map(|cell| cell_code(*cell)).collect();
        digest.update(&bytes);
    }
    for zone in zones {
        zone.feed(&mut |bytes| digest.update(bytes));
    }
    MapHash::new(digest.finalize())
}

fn cell_code(cell: Cell) -> u8 {
    match cell {
        Cell::Free => 0,
        Cell::Occupied => 1,
        Cell::Unknown => 2,
    }
}

/// The bytes of a number; −0 is 0.
fn canonical(number: f64) -> [u8; 8] {
    (number + 0.0).to_bits().to_le_bytes()
}
