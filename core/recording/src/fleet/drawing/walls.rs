//! The map as boxes: occupied cells that lie together become one wall, zones a line around them.

use super::parts::{line, rgb};
use super::{Time, entity};
use crate::fleet::well_known::{
    Color, KeyValuePair, Point3, Pose, SceneEntity, SolidPrimitive, Span, Vector3,
};
use std::collections::BTreeMap;
use xtb_protocol::messages::{FleetMap, MapCell, MapZoneKind};

/// Boxes at most: a map of pure noise has millions.
const MOST_BOXES: usize = 20_000;
const HIGH_M: f64 = 0.4;
const WALL: Color = rgb(0.6, 0.6, 0.62);
const KEEP_OUT: Color = rgb(0.85, 0.2, 0.15);
const ONE_WAY: Color = rgb(0.15, 0.55, 0.9);

/// Cells from one column to the one before another, and from one row to the one before another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Block {
    pub(super) columns: (u32, u32),
    pub(super) rows: (u32, u32),
}

/// The map, until another one comes.
pub(super) fn room(at: Time, map: &FleetMap) -> SceneEntity {
    let (blocks, left_out) = blocks(map);
    let mut walls = entity(at, "map".to_owned());
    walls.lifetime = Span::default();
    walls.cubes = blocks.iter().map(|block| wall(map, block)).collect();
    for zone in &map.zones {
        let color = match zone.kind {
            MapZoneKind::KeepOut => KEEP_OUT,
            MapZoneKind::OneWay { .. } => ONE_WAY,
        };
        let points = zone.points.iter().map(|&[x, y]| Point3 { x, y, z: 0.01 }).collect();
        walls.lines.push(line(1, points, 0.05, color));
    }
    let pair = |key: &str, value: String| KeyValuePair { key: key.to_owned(), value };
    walls.metadata = vec![
        pair("map", map.name.clone()),
        pair("hash", map.hash.to_string()),
        pair("walls_left_out", left_out.to_string()),
    ];
    walls
}

fn wall(map: &FleetMap, block: &Block) -> SolidPrimitive {
    let along = |origin_m: f64, (from, to): (u32, u32)| {
        let (from_m, to_m) = (f64::from(from) * map.resolution_m, f64::from(to) * map.resolution_m);
        (origin_m + (from_m + to_m) / 2.0, to_m - from_m)
    };
    let (x_m, wide_m) = along(map.origin_m[0], block.columns);
    let (y_m, deep_m) = along(map.origin_m[1], block.rows);
    SolidPrimitive {
        pose: Pose::flat(x_m, y_m, HIGH_M / 2.0, 0.0),
        size: Vector3 { x: wide_m, y: deep_m, z: HIGH_M },
        color: WALL,
    }
}

/// Occupied cells as blocks, row by row: runs of equal columns in rows that follow each other are one
/// block. And how many did not fit.
pub(super) fn blocks(map: &FleetMap) -> (Vec<Block>, u64) {
    let mut open: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let mut found = Vec::new();
    let mut left_out = 0;
    let mut close = |columns, rows| match found.len() < MOST_BOXES {
        true => found.push(Block { columns, rows }),
        false => left_out += 1,
    };
    let mut runs = rows(map).peekable();
    for row in 0..map.height {
        let mut here = BTreeMap::new();
        while let Some((_, columns)) = runs.next_if(|(at, _)| *at == row) {
            here.insert(columns, open.remove(&columns).unwrap_or(row));
        }
        for (columns, from) in std::mem::replace(&mut open, here) {
            close(columns, (from, row));
        }
    }
    open.into_iter().for_each(|(columns, from)| close(columns, (from, map.height)));
    (found, left_out)
}

/// Occupied runs: in which row, from which column to before which; a run over several rows is cut.
fn rows(map: &FleetMap) -> impl Iterator<Item = (u32, (u32, u32))> + '_ {
    let width = u64::from(map.width.max(1));
    let mut next = 0_u64;
    let runs = map.cells.iter().map(move |(cell, length)| {
        let from = next;
        next += u64::from(*length);
        (*cell, from, next)
    });
    runs.filter(|(cell, ..)| *cell == MapCell::Occupied).flat_map(move |(_, from, to)| {
        (from / width..to.div_ceil(width)).map(move |row| {
            let (first, last) = (from.max(row * width), to.min((row + 1) * width));
            (row as u32, ((first - row * width) as u32, (last - row * width) as u32))
        })
    })
}
