//! A car on an occupancy grid.
//!
//! The body keeps off everything; the look-out strip keeps off what the distance sensors would see,
//! so not off zones.

use super::layer::{FREE, Layer};
use super::sweep::{Frame, Plate, ROUNDING_M, clear, touch};
use super::{Bounds, Hit, Obstruction, OneWay, Space};
use crate::MapPose;
use crate::geometry::rect::INFRARED_STOPS_M;
use crate::geometry::{Car, Cell, Clearance, Grid, Piece};
use crate::map::Zones;
use std::sync::Arc;
use thiserror::Error;

/// What must be free ahead of the bumper in the gear that is driven, because the first level stops
/// at anything nearer: the memorandum's infrared rule is 25 cm across ± 17.5 cm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LookOut {
    /// Beyond the bumper, in m; 0 = off.
    pub ahead_m: f64,
    /// To either side of the middle, in m.
    pub half_width_m: f64,
}

impl LookOut {
    /// Nothing but the body counts.
    pub const OFF: Self = Self { ahead_m: 0.0, half_width_m: 0.0 };
    /// For the truck's sensors: ahead 1 cm more than stops it, the least that is worth planning with (the
    /// navigator keeps more, [`navigator::LOOK_OUT_M`](crate::navigator::LOOK_OUT_M)); to either side the
    /// outermost beams at 17.5 cm, and 2.5 cm for their width and mounting. Sensors stand 7 cm apart (§2.2)
    /// however wide the body is.
    pub const TRUCK: Self = Self { ahead_m: INFRARED_STOPS_M + 0.01, half_width_m: 0.2 };
}

/// What a world is made of, each on the cells of the grid.
#[derive(Debug, Clone, Copy)]
pub struct GridLayers<'a> {
    /// The map.
    pub grid: &'a Grid,
    /// Keep-out zones.
    pub zones: Option<&'a Zones>,
    /// For each cell the direction of driving that is allowed, in rad, or `None` for all.
    pub one_way: Option<&'a [Option<f32>]>,
    /// Points of things that are not on the map, (x, y) in m; each fills its cell.
    pub local_m: &'a [[f64; 2]],
}

impl<'a> GridLayers<'a> {
    /// The map alone.
    #[must_use]
    pub fn map(grid: &'a Grid) -> Self {
        Self { grid, zones: None, one_way: None, local_m: &[] }
    }
}

/// Why layers do not fit together.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum LayersError {
    /// A layer has another number of cells than the grid.
    #[error("the {layer} layer has {cells} cells, the grid {wanted}")]
    Cells {
        /// Which one.
        layer: &'static str,
        /// What it has.
        cells: usize,
        /// What the grid has.
        wanted: usize,
    },
    /// A cell belongs to a zone without a name.
    #[error("zone {0} has no name")]
    Unnamed(u16),
}

/// What a cell is to a car, if it is not [`FREE`]. Numbers above are zones.
const WALL: u16 = 1;
const UNKNOWN: u16 = 2;
const LOCAL: u16 = 3;
const FIRST_ZONE: u16 = 4;

/// Way after which the room around the reference point is looked at again, in m, where there is little; chosen,
/// not measured.
const ROOM_STEP_M: f64 = 0.1;

/// A car on a grid.
#[derive(Debug, Clone)]
pub struct GridSpace {
    car: Car,
    body: Plate,
    /// Beyond the bumper when driving ahead and astern.
    strips: Option<[Plate; 2]>,
    all: Arc<Layer>,
    /// Without zones; `None` = there are none.
    seen: Option<Arc<Layer>>,
    one_way: Option<OneWay>,
    zones: Vec<String>,
}

/// Its body, and its look-outs ahead and astern.
fn plates(car: &Car, look_out: LookOut) -> (Plate, Option<[Plate; 2]>) {
    let strip = |near: f64| Plate {
        front_m: near + look_out.ahead_m,
        rear_m: -near,
        half_width_m: look_out.half_width_m,
    };
    let ahead = strip(car.front_m);
    let astern = strip(car.rear_m);
    let astern = Plate { front_m: astern.rear_m, rear_m: astern.front_m, ..astern };
    let body = Plate { front_m: car.front_m, rear_m: car.rear_m, half_width_m: car.half_width_m };
    (body, (look_out.ahead_m > 0.0).then_some([ahead, astern]))
}

impl GridSpace {
    /// A car in this world.
    ///
    /// # Errors
    /// If a layer does not belong to the grid.
    pub fn new(layers: &GridLayers<'_>, car: Car, look_out: LookOut) -> Result<Self, LayersError> {
        let wanted = layers.grid.cells().len();
        if let Some(cells) = layers.zones.map(|zones| zones.cells.len()).filter(|&cells| cells != wanted) {
            return Err(LayersError::Cells { layer: "zone", cells, wanted });
        }
        let one_way = layers.one_way.map(|allowed| OneWay::new(layers.grid, allowed.to_vec())).transpose()?;
        let mut cells = things(layers);
        let zones = layers.zones.filter(|zones| zones.cells.iter().any(|&zone| zone != 0));
        let seen = zones.map(|_| Arc::new(Layer::new(layers.grid, cells.clone())));
        for (cell, &zone) in cells.iter_mut().zip(zones.map_or(&[][..], |zones| &zones.cells)) {
            if zone != 0 && zones.is_none_or(|zones| zones.names.len() < usize::from(zone)) {
                return Err(LayersError::Unnamed(zone));
            }
            if zone != 0 && *cell == FREE {
                *cell = FIRST_ZONE.saturating_add(zone - 1);
            }
        }
        let zones = zones.map_or_else(Vec::new, |zones| zones.names.clone());
        let (body, strips) = plates(&car, look_out);
        Ok(Self { car, body, strips, all: Arc::new(Layer::new(layers.grid, cells)), seen, one_way, zones })
    }

    /// The same world for another car.
    #[must_use]
    pub fn with_car(&self, car: Car, look_out: LookOut) -> Self {
        let (body, strips) = plates(&car, look_out);
        Self { car, body, strips, ..self.clone() }
    }

    /// The distance field of everything, zones included.
    #[must_use]
    pub fn clearance(&self) -> &Clearance {
        &self.all.clearance
    }

    /// Where the piece stops being free: the rectangle, the layer it touches something of, and the way.
    fn touch(&self, frame: &Frame, piece: &Piece) -> Option<(Plate, &Layer, f64)> {
        let all = &*self.all;
        let body = touch(all, &self.body, frame, piece).map(|way| (self.body, all, way));
        body.or_else(|| {
            let (strip, seen) = self.strip(piece)?;
            touch(seen, &strip, frame, piece).map(|way| (strip, seen, way))
        })
    }

    /// The look-out strip in the gear of a piece, and what it keeps off.
    fn strip(&self, piece: &Piece) -> Option<(Plate, &Layer)> {
        let strip = self.strips.as_ref()?[usize::from(piece.gear() < 0.0)];
        Some((strip, self.seen.as_deref().unwrap_or(&self.all)))
    }

    /// Whether there may be room around the reference point on all of a piece: by the distance field alone,
    /// here and there, which refuses most curves across a room.
    fn middle_has_room(&self, from: &Frame, piece: &Piece) -> bool {
        let (core_m, gear) = (self.car.core_m() - ROUNDING_M, piece.gear());
        let mut way_m = 0.0;
        while way_m < piece.length_m.abs() {
            let at = from.after(gear * way_m, piece.curvature_per_m);
            let (least_m, most_m) = self.all.clearance.bounds_m(at.x_m, at.y_m);
            if most_m < core_m {
                return false;
            }
            way_m += (least_m - core_m).max(ROOM_STEP_M);
        }
        true
    }

    /// Where the reference point would go against a one-way zone.
    fn against(&self, from: &MapPose, piece: &Piece) -> Option<[f64; 2]> {
        self.one_way.as_ref()?.against(from, piece)
    }

    fn what(&self, cell: u16) -> Obstruction {
        match cell {
            WALL => Obstruction::Wall,
            UNKNOWN => Obstruction::Unknown,
            LOCAL => Obstruction::Local,
            zone => {
                let name = self.zones.get(usize::from(zone.saturating_sub(FIRST_ZONE)));
                Obstruction::KeepOut(name.cloned().unwrap_or_default())
            }
        }
    }

    /// What the rectangle touches at a pose, or would touch if it were the least bit larger.
    fn hit(&self, layer: &Layer, at: &Frame, plate: &Plate) -> Option<Hit> {
        let (column, row) = layer.touched(at, plate)?;
        let centre = |origin: f64, n: i64| origin + (n as f64 + 0.5) * layer.resolution_m;
        let what =
            layer.index((column, row)).map_or(Obstruction::Edge, |index| self.what(layer.cells[index]));
        Some(Hit { x_m: centre(layer.origin_m[0], column), y_m: centre(layer.origin_m[1], row), what })
    }
}

impl Space for GridSpace {
    fn car(&self) -> &Car {
        &self.car
    }

    fn bounds(&self) -> Bounds {
        let Layer { origin_m: low_m, resolution_m, width, height, .. } = *self.all;
        let high_m = [low_m[0] + width as f64 * resolution_m, low_m[1] + height as f64 * resolution_m];
        Bounds { low_m, high_m }
    }

    fn standing(&self, pose: &MapPose) -> Option<Hit> {
        self.hit(&self.all, &Frame::of(pose), &self.body)
    }

    fn drives(&self, from: &MapPose, piece: &Piece) -> bool {
        let (sin, cos) = libm::sincos(from.yaw_rad);
        self.drives_towards(from, (sin, cos), piece)
    }

    fn drives_towards(&self, from: &MapPose, (sin, cos): (f64, f64), piece: &Piece) -> bool {
        let frame = Frame { x_m: from.x_m, y_m: from.y_m, sin, cos };
        self.car.gears.allow(piece.length_m)
            && clear(&*self.all, &self.body, &frame, piece)
            && self.strip(piece).is_none_or(|(strip, seen)| clear(seen, &strip, &frame, piece))
            && self.against(from, piece).is_none()
    }

    fn may_drive_all(&self, from: &MapPose, pieces: &[Piece]) -> bool {
        let mut at = Frame::of(from);
        pieces.iter().all(|piece| {
            let has_room = self.car.gears.allow(piece.length_m) && self.middle_has_room(&at, piece);
            at = at.after(piece.length_m, piece.curvature_per_m);
            has_room
        })
    }

    fn driving(&self, from: &MapPose, piece: &Piece) -> Option<Hit> {
        if !self.car.gears.allow(piece.length_m) {
            return Some(Hit { x_m: from.x_m, y_m: from.y_m, what: Obstruction::Unseen });
        }
        let frame = Frame::of(from);
        if let Some((plate, layer, way_m)) = self.touch(&frame, piece) {
            let at = frame.after(way_m, piece.curvature_per_m);
            let margin_m = super::sweep::FINEST_M;
            return self
                .hit(layer, &at, &plate)
                .or_else(|| self.hit(layer, &at, &plate.grown(margin_m, piece.curvature_per_m)));
        }
        let [x_m, y_m] = self.against(from, piece)?;
        Some(Hit { x_m, y_m, what: Obstruction::OneWay })
    }

    fn lets_drive_on(&self, pose: &MapPose) -> bool {
        self.one_way.as_ref().is_none_or(|zones| zones.lets_drive_on(pose))
    }

    fn clearance_m(&self, x_m: f64, y_m: f64) -> f64 {
        self.all.clearance.at_least_m(x_m, y_m)
    }

    fn most_clearance_m(&self, x_m: f64, y_m: f64, around_m: f64) -> f64 {
        self.all.clearance.at_most_m(x_m, y_m) + around_m
    }
}

/// Map and local obstacles, cell by cell.
fn things(layers: &GridLayers<'_>) -> Vec<u16> {
    let grid = layers.grid;
    let known = |cell: &Cell| match cell {
        Cell::Free => FREE,
        Cell::Occupied => WALL,
        Cell::Unknown => UNKNOWN,
    };
    let mut cells: Vec<u16> = grid.cells().iter().map(known).collect();
    for point in layers.local_m {
        let (column, row) = grid.place(point[0], point[1]);
        let (Ok(column), Ok(row)) = (usize::try_from(column), usize::try_from(row)) else { continue };
        if column < grid.width() && row < grid.height() {
            let cell = &mut cells[row * grid.width() + column];
            *cell = if *cell == FREE { LOCAL } else { *cell };
        }
    }
    cells
}

#[cfg(test)]
#[path = "grid_space_tests.rs"]
mod tests;
