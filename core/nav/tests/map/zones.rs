//! Which zone holds a point or a truck.

use xtb_control::VehicleConfig;
use xtb_nav::map::MapError;
use xtb_nav::{Car, Cell, Grid, Map, MapPose, Zone, ZoneKind};

fn zone(name: &str, kind: ZoneKind, west: f64, east: f64) -> Zone {
    let points = vec![[west, 1.0], [east, 1.0], [east, 2.0], [west, 2.0]];
    Zone::new(name, kind, points).unwrap()
}

fn map() -> Map {
    let zones = vec![
        zone("lane", ZoneKind::OneWay { heading_rad: 0.0 }, 1.0, 3.0),
        zone("charger", ZoneKind::KeepOut, 2.0, 3.0),
    ];
    Map::new("lab", Grid::free(0.05, [0.0, 0.0], 100, 60).unwrap(), zones).unwrap()
}

#[test]
fn a_keep_out_comes_before_a_one_way_at_the_same_place() {
    let map = map();
    let at = |x_m, y_m| map.zone_at(x_m, y_m).map(Zone::name);
    assert_eq!((at(1.5, 1.5), at(2.5, 1.5), at(2.5, 2.5)), (Some("lane"), Some("charger"), None));
    assert_eq!(map.one_way_against(1.5, 1.5, 3.0).map(Zone::name), Some("lane"));
    assert_eq!(map.one_way_against(1.5, 1.5, 1.0), None);
    assert_eq!(map.one_way_against(0.5, 1.5, 3.0), None);
}

#[test]
fn a_truck_touches_a_keep_out_with_its_body_and_not_with_its_middle_only() {
    let (map, car) = (map(), Car::of(&VehicleConfig::default()));
    let under = |x_m, y_m, yaw_rad| map.keep_out_under(&car, &MapPose { x_m, y_m, yaw_rad }).map(Zone::name);
    assert_eq!(under(1.76, 1.5, 0.0), Some("charger"));
    assert_eq!(under(1.74, 1.5, 0.0), None);
    assert_eq!(under(1.76, 1.5, std::f64::consts::FRAC_PI_2), None);
    // Its corner, and the charger's.
    assert_eq!(under(1.85, 0.85, std::f64::consts::FRAC_PI_4), Some("charger"));
    assert_eq!(under(1.85, 0.85, std::f64::consts::FRAC_PI_4 * 3.0), None);
    assert_eq!(under(2.5, 1.5, 0.3), Some("charger"));
}

#[test]
fn keep_outs_can_be_drawn_into_the_grid() {
    let map = map();
    let grid = map.grid_with_keep_outs();
    assert_eq!((grid.at(2.5, 1.5), grid.at(1.5, 1.5)), (Cell::Occupied, Cell::Free));
    assert_eq!(map.grid().at(2.5, 1.5), Cell::Free);
}

#[test]
fn impossible_maps_are_refused() {
    let grid = || Grid::free(0.05, [0.0, 0.0], 2, 2).unwrap();
    let twice = vec![zone("a", ZoneKind::KeepOut, 0.0, 1.0), zone("a", ZoneKind::KeepOut, 2.0, 3.0)];
    assert_eq!(Map::new("m", grid(), twice), Err(MapError::ZoneNamedTwice("a".into())));
    assert_eq!(Map::new(" m", grid(), vec![]), Err(MapError::Name(" m".into())));
    let many = (0..201).map(|i| zone(&i.to_string(), ZoneKind::KeepOut, 0.0, 1.0)).collect();
    assert_eq!(Map::new("m", grid(), many), Err(MapError::TooManyZones(201)));
}
