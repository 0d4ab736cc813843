//! A map's zones as the planner takes them: cells that may not be driven on, or in one direction only.

use super::{Map, ZoneKind, raster};

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
            match zone.kind() {
                ZoneKind::KeepOut => {
                    layers.keep_outs.names.push(zone.name().to_owned());
                    let number = u16::try_from(layers.keep_outs.names.len()).unwrap_or(u16::MAX);
                    let cells = &mut layers.keep_outs.cells;
                    raster::polygon_runs(grid, zone.points(), |run| cells[run].fill(number));
                }
                ZoneKind::OneWay { heading_rad } => {
                    let allowed = layers.one_way.get_or_insert_with(|| vec![None; grid.cells().len()]);
                    let heading_rad = Some(heading_rad as f32);
                    raster::polygon_runs(grid, zone.points(), |run| allowed[run].fill(heading_rad));
                }
            }
        }
        layers
    }
}
