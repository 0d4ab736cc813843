//! The floor as lines: outlines of what stands on it, and of its zones; and its places.

use xtb_protocol::messages::{FleetMap, MapCell, MapHash, MapPlace, MapZoneKind};

/// From (x, y) to (x, y), in m.
pub(super) type Segment = [(f64, f64); 2];

/// A map, made ready for drawing.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Floor {
    /// Of the map that it was made from.
    pub(super) hash: MapHash,
    /// As people call it.
    pub(super) name: String,
    /// Smallest and largest x and y, in m.
    pub(super) bounds: ([f64; 2], [f64; 2]),
    /// Edges between what is occupied and what is not.
    pub(super) walls: Vec<Segment>,
    /// Zones.
    pub(super) zones: Vec<Zone>,
    /// Places; they change without the map.
    pub(super) places: Vec<MapPlace>,
}

/// A zone's outline.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Zone {
    /// As people call it.
    pub(super) name: String,
    /// Which way one drives through it; `None` = nobody may be inside.
    pub(super) heading_rad: Option<f64>,
    /// Its edges.
    pub(super) edges: Vec<Segment>,
    /// Its middle.
    pub(super) middle: (f64, f64),
}

impl Floor {
    /// From a map that has been checked.
    pub(super) fn of(map: &FleetMap) -> Self {
        let (width, height) = (map.width as usize, map.height as usize);
        let cells = map.cells.iter();
        let cells = cells
            .flat_map(|(cell, length)| std::iter::repeat_n(*cell == MapCell::Occupied, *length as usize));
        let cells: Vec<bool> = cells.collect();
        let occupied =
            |x: usize, y: usize| x < width && y < height && cells.get(y * width + x) == Some(&true);
        let at = |x: usize, y: usize| {
            let along = |origin_m: f64, cell: usize| origin_m + cell as f64 * map.resolution_m;
            (along(map.origin_m[0], x), along(map.origin_m[1], y))
        };
        let mut walls = Vec::new();
        for y in 0..=height {
            // `wrapping_sub` of 0 is beyond every map, and so not occupied.
            let edge = |x: usize| occupied(x, y) != occupied(x, y.wrapping_sub(1));
            runs(width, edge, |from, to| walls.push([at(from, y), at(to, y)]));
        }
        for x in 0..=width {
            let edge = |y: usize| occupied(x, y) != occupied(x.wrapping_sub(1), y);
            runs(height, edge, |from, to| walls.push([at(x, from), at(x, to)]));
        }
        let (low, high) = (at(0, 0), at(width, height));
        let zones = map.zones.iter().map(|zone| Zone {
            name: zone.name.clone(),
            heading_rad: match zone.kind {
                MapZoneKind::KeepOut => None,
                MapZoneKind::OneWay { heading_rad } => Some(heading_rad),
            },
            edges: edges(&zone.points),
            middle: middle(&zone.points),
        });
        Self {
            hash: map.hash,
            name: map.name.clone(),
            bounds: ([low.0, high.0], [low.1, high.1]),
            walls,
            zones: zones.collect(),
            places: Vec::new(),
        }
    }
}

/// Calls `each` with the bounds of every run of positions below `end` for which `is` holds.
fn runs(end: usize, is: impl Fn(usize) -> bool, mut each: impl FnMut(usize, usize)) {
    let mut from = None;
    for position in 0..end {
        match (is(position), from) {
            (true, None) => from = Some(position),
            (false, Some(began)) => {
                each(began, position);
                from = None;
            }
            _ => {}
        }
    }
    if let Some(began) = from {
        each(began, end);
    }
}

fn edges(points: &[[f64; 2]]) -> Vec<Segment> {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| [(a[0], a[1]), (b[0], b[1])]).collect()
}

fn middle(points: &[[f64; 2]]) -> (f64, f64) {
    let count = points.len().max(1) as f64;
    let sum = points.iter().fold((0.0, 0.0), |sum, point| (sum.0 + point[0], sum.1 + point[1]));
    (sum.0 / count, sum.1 / count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::MapZone;

    #[test]
    fn an_occupied_cell_has_four_edges_and_a_zone_its_own() {
        let map = FleetMap {
            name: "yard".into(),
            hash: MapHash::new(1),
            resolution_m: 0.5,
            origin_m: [-1.0, 2.0],
            width: 4,
            height: 2,
            // Row 0 is free; in row 1 the last two cells are occupied.
            cells: vec![(MapCell::Free, 5), (MapCell::Unknown, 1), (MapCell::Occupied, 2)],
            zones: vec![MapZone {
                name: "chargers".into(),
                kind: MapZoneKind::KeepOut,
                points: vec![[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]],
            }],
        };
        let floor = Floor::of(&map);
        assert_eq!(floor.bounds, ([-1.0, 1.0], [2.0, 3.0]));
        let walls = [
            [(0.0, 2.5), (1.0, 2.5)],
            [(0.0, 3.0), (1.0, 3.0)],
            [(0.0, 2.5), (0.0, 3.0)],
            [(1.0, 2.5), (1.0, 3.0)],
        ];
        assert_eq!(floor.walls, walls);
        assert_eq!((floor.zones[0].edges.len(), floor.zones[0].middle), (3, (1.0, 1.0)));
    }
}
