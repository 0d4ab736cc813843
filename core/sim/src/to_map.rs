//! A world as a map: what a careful person with a tape measure would draw.
//!
//! Every cell that a wall or a box reaches into is occupied, however little; ramps are floor. Floor to
//! which no way leads from any start is unknown, and borders of unknown floor are cut off: of a world
//! without a room that leaves the inside of its walls. Boxes that are put or removed later are not on
//! the map that was drawn before.

use crate::geometry::Bounds;
use crate::world::World;
use thiserror::Error;
use xtb_nav::geometry::grid::GridError;
use xtb_nav::map::{MapError, raster};
use xtb_nav::{Cell, Grid, Map};

/// Side of a cell unless another is asked for, in m.
pub const MAP_RESOLUTION_M: f64 = 0.05;
/// Of a world without a name.
const NAMELESS: &str = "world";
/// This part of a cell is rounding.
const EDGE: f64 = 1e-6;

/// Why a world has no map.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ToMapError {
    /// Too large for this resolution, or a resolution that no map has.
    #[error("the world's map: {0}")]
    Grid(#[from] GridError),
    /// Its name or its zones make no map.
    #[error("the world's map: {0}")]
    Map(#[from] MapError),
}

impl World {
    /// The map of this world, with its zones and places; `resolution_m` is the side of a cell. A world that was made
    /// of a map has that one, in its own cells.
    ///
    /// # Errors
    /// See [`ToMapError`].
    pub fn to_map(&self, resolution_m: f64) -> Result<Map, ToMapError> {
        if let Some(map) = self.map() {
            return Ok(map.clone());
        }
        let mut grid = empty(self.extent(), resolution_m)?;
        for solid in self.solids() {
            raster::polygon(&mut grid, &solid.shape.corners(), Cell::Occupied);
        }
        if !self.starts().is_empty() {
            let starts: Vec<_> = self.starts().iter().map(|pose| grid.place(pose.x_m, pose.y_m)).collect();
            grid = known(&grid, &starts)?;
        }
        let map = Map::new(self.name().unwrap_or(NAMELESS), grid, self.zones().to_vec())?;
        Ok(map.with_places(self.places().to_vec())?)
    }
}

/// Free cells over all of this.
fn empty(extent: Bounds, resolution_m: f64) -> Result<Grid, GridError> {
    // A resolution that is none is the grid's to refuse.
    let first = |min_m: f64| libm::floor(min_m / resolution_m + EDGE);
    let end = |max_m: f64| libm::ceil(max_m / resolution_m - EDGE);
    let (west, south) = (first(extent.min_x_m), first(extent.min_y_m));
    let size = |first: f64, end: f64| (end - first).max(1.0) as usize;
    // -6.1 instead of -6.1000000000000005: people read it.
    let round = |cells: f64| libm::round(cells * resolution_m * 1e9) / 1e9;
    let (width, height) = (size(west, end(extent.max_x_m)), size(south, end(extent.max_y_m)));
    Grid::free(resolution_m, [round(west), round(south)], width, height)
}

/// The same with free cells that no way leads to from the starts as unknown, and without borders of
/// unknown cells only.
fn known(grid: &Grid, starts: &[(i64, i64)]) -> Result<Grid, GridError> {
    let mut reached = grid.clone();
    for row in 0..grid.height() as i64 {
        for column in 0..grid.width() as i64 {
            if grid.cell(column, row) == Cell::Free {
                reached.set(column, row, Cell::Unknown);
            }
        }
    }
    let mut open = starts.to_vec();
    while let Some((column, row)) = open.pop() {
        let new = grid.cell(column, row) == Cell::Free && reached.cell(column, row) == Cell::Unknown;
        if new {
            reached.set(column, row, Cell::Free);
            open.extend([(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)]);
        }
    }
    cropped(&reached)
}

fn cropped(grid: &Grid) -> Result<Grid, GridError> {
    let (width, height) = (grid.width() as i64, grid.height() as i64);
    let all = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
    let seen = all.filter(|&(column, row)| grid.cell(column, row) != Cell::Unknown);
    let bounds = seen.fold(None, |bounds, (column, row)| {
        let (west, south, east, north) = bounds.unwrap_or((column, row, column, row));
        Some((west.min(column), south.min(row), east.max(column), north.max(row)))
    });
    let Some((west, south, east, north)) = bounds else { return Ok(grid.clone()) };
    let rows = (south..=north).flat_map(|row| (west..=east).map(move |column| grid.cell(column, row)));
    let [x_m, y_m] = grid.origin_m();
    let shifted =
        |from_m: f64, cells: i64| libm::round((from_m + cells as f64 * grid.resolution_m()) * 1e9) / 1e9;
    let (width, height) = ((east - west + 1) as usize, (north - south + 1) as usize);
    Grid::new(grid.resolution_m(), [shifted(x_m, west), shifted(y_m, south)], width, height, rows.collect())
}
