//! The hash is of the floor, and of nothing else.

use crate::any;
use proptest::prelude::*;
use xtb_nav::{Cell, Grid, Map, Zone, ZoneKind};

fn lab() -> Map {
    let mut grid = Grid::free(0.05, [-1.0, 0.5], 30, 20).unwrap();
    grid.set(3, 4, Cell::Occupied);
    grid.set(4, 4, Cell::Unknown);
    let points = vec![[0.0, 0.6], [0.2, 0.6], [0.2, 0.9]];
    let zones = vec![
        Zone::new("lane", ZoneKind::OneWay { heading_rad: 1.5 }, points.clone()).unwrap(),
        Zone::new("charger", ZoneKind::KeepOut, points).unwrap(),
    ];
    Map::new("lab", grid, zones).unwrap()
}

/// Another value would make every fleet's maps strangers to each other.
#[test]
fn the_hash_of_a_known_map_stays_what_it_is() {
    assert_eq!(lab().hash().to_string(), "17ac03f87e077be9");
}

#[test]
fn a_name_changes_nothing_and_everything_else_does() {
    let lab = lab();
    let with = |grid: Grid, zones: Vec<Zone>| Map::new("x", grid, zones).unwrap().hash();
    let (grid, zones) = (lab.grid().clone(), lab.zones().to_vec());
    assert_eq!(with(grid.clone(), zones.clone()), lab.hash());
    let cells = || grid.cells().to_vec();
    let mut other = grid.clone();
    other.set(29, 19, Cell::Occupied);
    let mut hashes = vec![
        lab.hash(),
        with(other, zones.clone()),
        with(Grid::new(0.051, [-1.0, 0.5], 30, 20, cells()).unwrap(), zones.clone()),
        with(Grid::new(0.05, [-1.0, 0.51], 30, 20, cells()).unwrap(), zones.clone()),
        with(Grid::new(0.05, [-1.0, 0.5], 20, 30, cells()).unwrap(), zones.clone()),
        with(grid.clone(), vec![]),
        with(grid.clone(), vec![zones[1].clone(), zones[0].clone()]),
        with(grid.clone(), vec![zones[1].clone()]),
        with(grid, vec![Zone::new("lane", ZoneKind::KeepOut, zones[0].points().to_vec()).unwrap()]),
    ];
    let count = hashes.len();
    hashes.sort();
    hashes.dedup();
    assert_eq!(hashes.len(), count);
}

#[test]
fn zero_has_one_hash() {
    let with =
        |zero: f64| Map::new("m", Grid::free(0.05, [zero, zero], 2, 2).unwrap(), vec![]).unwrap().hash();
    assert_eq!(with(0.0), with(-0.0));
}

proptest! {
    #[test]
    fn one_cell_more_or_less_is_another_map(map in any::map(), at in any::<prop::sample::Index>(), cell in any::cell()) {
        let mut grid = map.grid().clone();
        let i = at.index(grid.cells().len());
        let (column, row) = ((i % grid.width()) as i64, (i / grid.width()) as i64);
        prop_assume!(grid.cell(column, row) != cell);
        grid.set(column, row, cell);
        let other = Map::new(map.name(), grid, map.zones().to_vec()).unwrap();
        prop_assert_ne!(other.hash(), map.hash());
    }
}
