//! A car on an occupancy grid.
//!
//! The body keeps off everything; the look-out strip keeps off what the distance sensors would see,
//! so not off zones. Both are rectangles: accepted or refused by the distance field where circles
//! decide, and cell by cell where they do not.

use super::sweep::{Frame, FreeSpace, Plate, touch};
use super::{Bounds, Hit, OneWay, Space, What};
use crate::MapPose;
use crate::geometry::rect::INFRARED_STOPS_M;
use crate::geometry::{Car, Cell, Clearance, Grid, Piece};
use crate::map::Zones;
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
pub struct Layers<'a> {
    /// The map.
    pub grid: &'a Grid,
    /// Keep-out zones.
    pub zones: Option<&'a Zones>,
    /// For each cell the direction of driving that is allowed, in rad, or `None` for all.
    pub one_way: Option<&'a [Option<f32>]>,
    /// Points of things that are not on the map, (x, y) in m; each fills its cell.
    pub local_m: &'a [[f64; 2]],
}

impl<'a> Layers<'a> {
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

/// What a cell is to a car. Numbers above are zones.
const FREE: u16 = 0;
const WALL: u16 = 1;
const UNKNOWN: u16 = 2;
const LOCAL: u16 = 3;
const FIRST_ZONE: u16 = 4;

/// A car on a grid.
#[derive(Debug, Clone)]
pub struct GridSpace {
    car: Car,
    body: Plate,
    /// Beyond the bumper when driving ahead and astern.
    strips: Option<[Plate; 2]>,
    all: Layer,
    /// Without zones; `None` = there are none.
    seen: Option<Layer>,
    one_way: Option<OneWay>,
    zones: Vec<String>,
}

impl GridSpace {
    /// A car in this world.
    ///
    /// # Errors
    /// If a layer does not belong to the grid.
    pub fn new(layers: &Layers<'_>, car: Car, look_out: LookOut) -> Result<Self, LayersError> {
        let wanted = layers.grid.cells().len();
        if let Some(cells) = layers.zones.map(|zones| zones.cells.len()).filter(|&cells| cells != wanted) {
            return Err(LayersError::Cells { layer: "zone", cells, wanted });
        }
        let one_way = layers.one_way.map(|allowed| OneWay::new(layers.grid, allowed.to_vec())).transpose()?;
        let mut cells = things(layers);
        let zones = layers.zones.filter(|zones| zones.cells.iter().any(|&zone| zone != 0));
        let seen = zones.map(|_| Layer::new(layers.grid, cells.clone()));
        for (cell, &zone) in cells.iter_mut().zip(zones.map_or(&[][..], |zones| &zones.cells)) {
            if zone != 0 && zones.is_none_or(|zones| zones.names.len() < usize::from(zone)) {
                return Err(LayersError::Unnamed(zone));
            }
            if zone != 0 && *cell == FREE {
                *cell = FIRST_ZONE.saturating_add(zone - 1);
            }
        }
        let strip = |near: f64| Plate {
            front_m: near + look_out.ahead_m,
            rear_m: -near,
            half_width_m: look_out.half_width_m,
        };
        let ahead = strip(car.front_m);
        let astern = strip(car.rear_m);
        let astern = Plate { front_m: astern.rear_m, rear_m: astern.front_m, ..astern };
        Ok(Self {
            car,
            body: Plate { front_m: car.front_m, rear_m: car.rear_m, half_width_m: car.half_width_m },
            strips: (look_out.ahead_m > 0.0).then_some([ahead, astern]),
            all: Layer::new(layers.grid, cells),
            seen,
            one_way,
            zones: zones.map_or_else(Vec::new, |zones| zones.names.clone()),
        })
    }

    /// The distance field of everything, zones included.
    #[must_use]
    pub fn clearance(&self) -> &Clearance {
        &self.all.clearance
    }

    /// Where the piece stops being free: the rectangle, the layer it touches something of, and the way.
    fn touch(&self, from: &MapPose, piece: &Piece) -> Option<(Plate, &Layer, f64)> {
        let frame = Frame::of(from);
        let body = touch(&self.all, &self.body, &frame, piece).map(|way| (self.body, &self.all, way));
        body.or_else(|| {
            let strip = self.strips.as_ref()?[usize::from(piece.gear() < 0.0)];
            let seen = self.seen.as_ref().unwrap_or(&self.all);
            touch(seen, &strip, &frame, piece).map(|way| (strip, seen, way))
        })
    }

    /// Where the reference point would go against a one-way zone.
    fn against(&self, from: &MapPose, piece: &Piece) -> Option<[f64; 2]> {
        self.one_way.as_ref()?.against(from, piece)
    }

    fn what(&self, cell: u16) -> What {
        match cell {
            WALL => What::Wall,
            UNKNOWN => What::Unknown,
            LOCAL => What::Local,
            zone => {
                let name = self.zones.get(usize::from(zone.saturating_sub(FIRST_ZONE)));
                What::KeepOut(name.cloned().unwrap_or_default())
            }
        }
    }

    /// What the rectangle touches at a pose, or would touch if it were the least bit larger.
    fn hit(&self, layer: &Layer, at: &Frame, plate: &Plate) -> Option<Hit> {
        let (column, row) = layer.touched(at, plate)?;
        let centre = |origin: f64, n: i64| origin + (n as f64 + 0.5) * layer.resolution_m;
        let what = layer.index((column, row)).map_or(What::Edge, |index| self.what(layer.cells[index]));
        Some(Hit { x_m: centre(layer.origin_m[0], column), y_m: centre(layer.origin_m[1], row), what })
    }
}

impl Space for GridSpace {
    fn car(&self) -> &Car {
        &self.car
    }

    fn bounds(&self) -> Bounds {
        let Layer { origin_m: low_m, resolution_m, width, height, .. } = self.all;
        let high_m = [low_m[0] + width as f64 * resolution_m, low_m[1] + height as f64 * resolution_m];
        Bounds { low_m, high_m }
    }

    fn standing(&self, pose: &MapPose) -> Option<Hit> {
        self.hit(&self.all, &Frame::of(pose), &self.body)
    }

    fn drives(&self, from: &MapPose, piece: &Piece) -> bool {
        self.touch(from, piece).is_none() && self.against(from, piece).is_none()
    }

    fn driving(&self, from: &MapPose, piece: &Piece) -> Option<Hit> {
        if let Some((plate, layer, way_m)) = self.touch(from, piece) {
            let at = Frame::of(from).after(way_m, piece.curvature_per_m);
            let margin_m = super::sweep::FINEST_M;
            return self
                .hit(layer, &at, &plate)
                .or_else(|| self.hit(layer, &at, &plate.grown(margin_m, piece.curvature_per_m)));
        }
        let [x_m, y_m] = self.against(from, piece)?;
        Some(Hit { x_m, y_m, what: What::OneWay })
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
fn things(layers: &Layers<'_>) -> Vec<u16> {
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

/// Cells and how far each point is from those that are not free.
#[derive(Debug, Clone)]
struct Layer {
    resolution_m: f64,
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    cells: Vec<u16>,
    clearance: Clearance,
}

impl Layer {
    fn new(grid: &Grid, cells: Vec<u16>) -> Self {
        Self {
            resolution_m: grid.resolution_m(),
            origin_m: grid.origin_m(),
            width: grid.width(),
            height: grid.height(),
            clearance: Clearance::around(grid, |index| cells[index] != FREE),
            cells,
        }
    }

    fn place(&self, x_m: f64, y_m: f64) -> (i64, i64) {
        let along = |v: f64, origin: f64| libm::floor((v - origin) / self.resolution_m) as i64;
        (along(x_m, self.origin_m[0]), along(y_m, self.origin_m[1]))
    }

    fn index(&self, (column, row): (i64, i64)) -> Option<usize> {
        let (column, row) = (usize::try_from(column).ok()?, usize::try_from(row).ok()?);
        (column < self.width && row < self.height).then(|| row * self.width + column)
    }

    /// A cell that is not free, or lies outside, and that the rectangle touches. Exact: row by row,
    /// the part of a convex shape that lies within the row covers all columns from its least to its
    /// greatest x there.
    fn touched(&self, at: &Frame, plate: &Plate) -> Option<(i64, i64)> {
        let corners =
            [(plate.front_m, 1.0), (-plate.rear_m, 1.0), (-plate.rear_m, -1.0), (plate.front_m, -1.0)]
                .map(|(ahead, left)| at.point_m(ahead, left * plate.half_width_m))
                .map(|[x, y]| {
                    [(x - self.origin_m[0]) / self.resolution_m, (y - self.origin_m[1]) / self.resolution_m]
                });
        let edges = [0, 1, 2, 3].map(|i| Edge::between(corners[i], corners[(i + 1) % 4]));
        let span = |axis: usize| {
            corners
                .iter()
                .map(|p| p[axis])
                .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((west, east), (south, north)) = (span(0), span(1));
        if !(west >= 0.0 && south >= 0.0 && east <= self.width as f64 && north <= self.height as f64) {
            return Some(self.place(at.x_m, at.y_m)).filter(|&place| self.index(place).is_none()).or_else(
                || {
                    let column = if west < 0.0 {
                        -1
                    } else if east > self.width as f64 {
                        self.width as i64
                    } else {
                        west as i64
                    };
                    let row = if south < 0.0 {
                        -1
                    } else if north > self.height as f64 {
                        self.height as i64
                    } else {
                        south as i64
                    };
                    Some((column, row))
                },
            );
        }
        let last = (north as usize).min(self.height - 1);
        (south as usize..=last).find_map(|row| {
            let (low, high) = (row as f64, (row + 1) as f64);
            let (left, right) = edges.iter().fold((f64::MAX, f64::MIN), |(left, right), edge| {
                edge.within(low, high).map_or((left, right), |(a, b)| (left.min(a), right.max(b)))
            });
            if left > right {
                return None;
            }
            let (first, last) = (left.max(0.0) as usize, (right.max(0.0) as usize).min(self.width - 1));
            let cells = self.cells.get(row * self.width + first..=row * self.width + last)?;
            cells.iter().position(|&cell| cell != FREE).map(|at| ((first + at) as i64, row as i64))
        })
    }
}

/// A side of a rectangle in cells, from south to north.
struct Edge {
    low: [f64; 2],
    high: [f64; 2],
    slope: f64,
}

impl Edge {
    fn between(a: [f64; 2], b: [f64; 2]) -> Self {
        let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
        Self { low, high, slope: (high[0] - low[0]) / (high[1] - low[1]) }
    }

    /// Least and greatest x between two rows.
    fn within(&self, south: f64, north: f64) -> Option<(f64, f64)> {
        if self.high[1] < south || self.low[1] > north {
            return None;
        }
        let x = |y: f64| self.low[0] + (y - self.low[1]) * self.slope;
        let a = if self.low[1] >= south { self.low[0] } else { x(south) };
        let b = if self.high[1] <= north { self.high[0] } else { x(north) };
        Some((a.min(b), a.max(b)))
    }
}

impl FreeSpace for Layer {
    /// Circles around the rectangle, or around its halves, prove it free; the one within proves it
    /// is not; what they leave open is looked at cell by cell.
    fn free(&self, at: &Frame, plate: &Plate) -> bool {
        let middle_m = 0.5 * (plate.front_m - plate.rear_m);
        let (half_m, half_width_m) = (0.5 * (plate.front_m + plate.rear_m), plate.half_width_m);
        let least = |ahead_m: f64| {
            let [x_m, y_m] = at.point_m(middle_m + ahead_m, 0.0);
            self.clearance.at_least_m(x_m, y_m)
        };
        let middle = least(0.0);
        if middle * middle > half_m * half_m + half_width_m * half_width_m {
            return true;
        }
        let reach = 0.25 * half_m * half_m + half_width_m * half_width_m;
        let (front, rear) = (least(0.5 * half_m), least(-0.5 * half_m));
        if front * front > reach && rear * rear > reach {
            return true;
        }
        let [x_m, y_m] = at.point_m(middle_m, 0.0);
        if self.clearance.at_most_m(x_m, y_m) < half_m.min(half_width_m) {
            return false;
        }
        self.touched(at, plate).is_none()
    }
}

#[cfg(test)]
#[path = "grid_space_tests.rs"]
mod tests;
