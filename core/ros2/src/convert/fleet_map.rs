//! The fleet's map as a grid of ROS. Zones are not drawn: they are rules of ours, nothing that stands there.

use super::pose::{in_map, planar_pose};
use crate::types::{MapMetaData, OccupancyGrid, Time};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{FleetMap, MAX_MAP_CELLS, MapCell};

/// A map that has been validated, as ROS has it; `stamp` is when it was loaded. Cells that it does not tell of are
/// unknown.
#[must_use]
pub fn occupancy_grid(stamp: &Time, map: &FleetMap) -> OccupancyGrid {
    let [x_m, y_m] = map.origin_m;
    let cells = (u64::from(map.width) * u64::from(map.height)).min(MAX_MAP_CELLS) as usize;
    let mut data = Vec::with_capacity(cells);
    for (cell, length) in &map.cells {
        let value = match cell {
            MapCell::Free => 0,
            MapCell::Occupied => 100,
            MapCell::Unknown => -1,
        };
        data.extend(std::iter::repeat_n(value, (*length as usize).min(cells - data.len())));
    }
    data.resize(cells, -1);
    OccupancyGrid {
        header: in_map(stamp),
        info: MapMetaData {
            map_load_time: stamp.clone(),
            resolution: map.resolution_m as f32,
            width: map.width,
            height: map.height,
            origin: planar_pose(&MapPose { x_m, y_m, yaw_rad: 0.0 }),
        },
        data,
    }
}
