//! A map's zones as the planner takes them: cells that may not be driven on, or in one direction only.

use super::{Map, ZoneKind, raster};
use crate::geometry::{Cell, Grid};

/// Cells that may not be driven on although nothing stands there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Zones {
    /// Names of the zones.
    pub names: Vec<String>,
    /// For each cell of the grid 0 or the number of its zone, from 1 in the order of the names.
    pub cells: Vec<u16>,
}

/// Zones on the cells of a map's grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ZoneLayers {
    /// Keep-outs.
    pub keep_outs: Zones,
    /// For each cell the direction allowed, in rad; `None` = the map has no one-way zone.
    pub one_way: Option<Vec<Option<f32>>>,
}

impl ZoneLayers {
    /// Of this map. Where zones overlap, the later one holds.
    #[must_use]
    pub fn of(map: &Map) -> Self {
        let grid = map.grid();
        let mut layers = Self::default();
        layers.keep_outs.cells = vec![0; grid.cells().len()];
        for zone in map.zones() {
            let cells = cells_under(grid, zone.points());
            match zone.kind() {
                ZoneKind::KeepOut => {
                    layers.keep_outs.names.push(zone.name().to_owned());
                    let number = u16::try_from(layers.keep_outs.names.len()).unwrap_or(u16::MAX);
                    cells.for_each(|index| layers.keep_outs.cells[index] = number);
                }
                ZoneKind::OneWay { heading_rad } => {
                    let allowed = layers.one_way.get_or_insert_with(|| vec![None; grid.cells().len()]);
                    cells.for_each(|index| allowed[index] = Some(heading_rad as f32));
                }
            }
        }
        layers
    }
}

/// Indices of the cells that a polygon touches.
fn cells_under(grid: &Grid, points: &[[f64; 2]]) -> impl Iterator<Item = usize> {
    let blank = Grid::free(grid.resolution_m(), grid.origin_m(), grid.width(), grid.height());
    let mut drawn = blank.unwrap_or_else(|_| grid.clone()); // the grid's own numbers make a grid
    raster::polygon(&mut drawn, points, Cell::Occupied);
    let under: Vec<usize> =
        (0..drawn.cells().len()).filter(|&i| drawn.cells()[i] == Cell::Occupied).collect();
    under.into_iter()
}
