//! What a check finds.

use xtb_control::VehicleConfig;
use xtb_nav::map::check::{MapReport, ZoneFinding, check};
use xtb_nav::map::raster;
use xtb_nav::{Car, Cell, Grid, Map, Zone, ZoneKind};

/// A room of 6 × 4 m, with a wall across its middle that has a door this wide.
fn room(door_m: f64) -> Grid {
    let mut grid = Grid::free(0.05, [-3.0, -2.0], 120, 80).unwrap();
    for wall in [[-2.0, -door_m / 2.0], [door_m / 2.0, 2.0]] {
        let points = [[-0.05, wall[0]], [0.05, wall[0]], [0.05, wall[1]], [-0.05, wall[1]]];
        raster::polygon(&mut grid, &points, Cell::Occupied);
    }
    grid
}

fn found(grid: Grid, zones: Vec<Zone>) -> MapReport {
    check(&Map::new("room", grid, zones).unwrap(), &Car::of(&VehicleConfig::default()))
}

fn keep_out(name: &str, low: [f64; 2], high: [f64; 2]) -> Zone {
    let points = vec![low, [high[0], low[1]], high, [low[0], high[1]]];
    Zone::new(name, ZoneKind::KeepOut, points).unwrap()
}

#[test]
fn a_door_that_the_truck_fits_through_makes_one_island() {
    let report = found(room(0.6), vec![]);
    assert_eq!((report.islands.len(), report.narrows.len()), (1, 0));
    let area_m2 = report.islands[0].area_m2;
    // Two rooms less 20 cm along all walls, and the doorway.
    assert!((area_m2 - (2.55 * 3.6 * 2.0 + 0.2 * 0.5)).abs() < 0.5, "{area_m2}");
    assert!((report.occupied_m2 - 0.1 * 3.4).abs() < 1e-9, "{}", report.occupied_m2);
    assert!((report.free_m2 + report.occupied_m2 - 24.0).abs() < 1e-9 && report.unknown_m2 == 0.0);
}

#[test]
fn a_door_that_is_too_narrow_is_named_with_place_and_width() {
    let report = found(room(0.3), vec![]);
    assert_eq!((report.islands.len(), report.narrows.len()), (2, 1));
    let narrow = report.narrows[0];
    assert!((narrow.width_m - 0.3).abs() <= 0.051, "{narrow:?}");
    assert!(narrow.at_m[0].abs() < 0.2 && narrow.at_m[1].abs() < 0.2, "{narrow:?}");
    assert!(report.islands[0].at_m[0] * report.islands[1].at_m[0] < 0.0);
}

#[test]
fn a_wall_without_a_door_is_no_narrow_door() {
    let report = found(room(0.0), vec![]);
    assert_eq!((report.islands.len(), report.narrows.len()), (2, 0));
}

#[test]
fn a_keep_out_that_cuts_the_room_is_named_and_one_in_a_corner_is_not() {
    let across = keep_out("across", [1.0, -2.0], [1.5, 2.0]);
    let corner = keep_out("corner", [-3.0, -2.0], [-2.0, -1.0]);
    let report = found(room(1.0), vec![corner.clone()]);
    assert_eq!((report.islands.len(), report.zones.len()), (1, 0));
    let report = found(room(1.0), vec![corner, across]);
    let cut = ZoneFinding::Cut { zones: vec!["across".into()], pieces: 2 };
    assert_eq!((report.islands.len(), report.zones), (2, vec![cut]));
}

#[test]
fn two_keep_outs_that_close_a_way_together_are_both_named() {
    let halves = vec![keep_out("south", [1.0, -2.0], [1.5, 0.0]), keep_out("north", [1.0, 0.3], [1.5, 2.0])];
    let report = found(room(1.0), halves);
    assert_eq!(report.zones, [ZoneFinding::Cut { zones: vec!["south".into(), "north".into()], pieces: 2 }]);
}

#[test]
fn zones_beyond_the_border_are_told_from_those_that_reach_over_it() {
    let zones = vec![
        keep_out("far", [10.0, 0.0], [11.0, 1.0]),
        keep_out("over", [2.5, 1.5], [3.5, 2.5]),
        keep_out("edge", [2.0, -2.0], [3.0, -1.5]),
    ];
    let report = found(room(1.0), zones);
    let far = ZoneFinding::Outside { zone: "far".into() };
    assert_eq!(report.zones, [far, ZoneFinding::PartlyOutside { zone: "over".into() }]);
}

#[test]
fn a_map_without_room_for_the_truck_has_no_island() {
    let report = found(Grid::free(0.05, [0.0, 0.0], 8, 100).unwrap(), vec![]);
    assert!(report.islands.is_empty());
}
