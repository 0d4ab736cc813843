//! Worlds as maps.

use crate::draw::Draw;
use xtb_control::VehicleConfig;
use xtb_nav::map::check::check;
use xtb_nav::map::ros::{Description, Files};
use xtb_nav::{Car, Cell, Map, MapPose, ZoneKind};
use xtb_sim::{BoxSpec, MAP_RESOLUTION_M, ToMapError, TruckParameters, World, WorldError};

fn map_of(toml: &str) -> Map {
    World::from_toml(toml).unwrap().to_map(MAP_RESOLUTION_M).unwrap()
}

#[test]
fn a_room_is_its_floor_and_its_walls() {
    let map = World::default().to_map(0.05).unwrap();
    let grid = map.grid();
    assert_eq!((map.name(), grid.origin_m(), grid.width(), grid.height()), ("world", [-7.1; 2], 284, 284));
    assert_eq!((grid.at(6.99, 0.0), grid.at(7.01, 0.0)), (Cell::Free, Cell::Occupied));
    let free = grid.cells().iter().filter(|cell| **cell == Cell::Free).count();
    assert_eq!(free, 280 * 280);
}

#[test]
fn every_point_of_a_wall_or_a_box_is_occupied() {
    let mut draw = Draw::new(5);
    for _ in 0..20 {
        let mut world = World::default();
        let (x_m, y_m) = (draw.uniform(-6.0, 6.0), draw.uniform(-6.0, 6.0));
        let yaw_rad = draw.uniform(-3.0, 3.0);
        let spec = BoxSpec { x_m, y_m, width_m: draw.uniform(0.01, 2.0), depth_m: 0.3, yaw_rad };
        world.put_box("box", spec).unwrap();
        let map = world.to_map(0.05).unwrap();
        let (sin, cos) = spec.yaw_rad.sin_cos();
        for _ in 0..500 {
            let a = draw.uniform(-0.4999, 0.4999) * spec.width_m;
            let b = draw.uniform(-0.4999, 0.4999) * spec.depth_m;
            let (x_m, y_m) = (spec.x_m + a * cos - b * sin, spec.y_m + a * sin + b * cos);
            assert_eq!(map.grid().at(x_m, y_m), Cell::Occupied, "({x_m}, {y_m}) of {spec:?}");
        }
    }
}

#[test]
fn ramps_are_floor_and_zones_are_rules() {
    let map = map_of(
        "name = \"hall\"\n[room]\nwidth_m = 8.0\ndepth_m = 6.0\n\
         [[ramps]]\nx_m = 1.0\ny_m = 1.0\nlength_m = 1.0\nwidth_m = 1.0\nslope_deg = 6.0\nuphill_rad = 0.0\n\
         [[zones]]\nname = \"charger\"\nkind = \"keep_out\"\npoints = [[-4, -3], [-3.0, -3.0], [-3.0, -2.0]]\n\
         [[zones]]\nname = \"lane\"\nkind = \"one_way\"\nheading_rad = 1.5\npoints = [[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]]\n",
    );
    assert!(map.grid().cells().iter().filter(|cell| **cell == Cell::Free).count() == 160 * 120);
    assert_eq!(map.zone_at(-3.1, -2.9).map(|zone| zone.name()), Some("charger"));
    assert_eq!(map.zone_at(0.9, 0.5).map(|zone| zone.kind()), Some(ZoneKind::OneWay { heading_rad: 1.5 }));
    assert_eq!(map.name(), "hall");
}

#[test]
fn impossible_zones_are_refused_with_the_reason() {
    let zone =
        "[[zones]]\nname = \"z\"\nkind = \"keep_out\"\npoints = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\n";
    let refused = |toml: &str| World::from_toml(toml).unwrap_err().to_string();
    let twice = World::from_toml(&zone.repeat(2)).unwrap_err();
    assert_eq!(twice, WorldError::ZoneNamedTwice { name: "z".into() });
    assert!(refused(&zone.replace("[1.0, 1.0]", "[2.0, 0.0]")).contains("zone \"z\": the side from point"));
    assert!(refused(&zone.replace("keep_out", "one_way")).contains("a one_way needs heading_rad"));
    assert!(refused(&zone.replace("keep_out", "no_go")).contains("unknown variant `no_go`"));
    assert!(refused(&format!("{zone}heading_rad = 1.0\n")).contains("a keep_out has no heading_rad"));
}

#[test]
fn what_no_start_leads_to_is_unknown_and_cut_off() {
    let map = map_of(include_str!("../../../../worlds/corridor.toml"));
    let grid = map.grid();
    // From the west wall's outer face to that of the side arm.
    assert_eq!((grid.origin_m(), grid.width(), grid.height()), ([-1.25, -8.05], 146, 402));
    assert_eq!((grid.at(0.0, 0.0), grid.at(4.5, 5.2)), (Cell::Free, Cell::Free));
    assert_eq!((grid.at(3.0, 0.0), grid.at(3.0, 10.0)), (Cell::Unknown, Cell::Unknown));
}

#[test]
fn the_trucks_of_the_projects_worlds_start_free_on_one_island() {
    let car = Car::of(&VehicleConfig::default());
    for (toml, robots) in [
        (include_str!("../../../../worlds/lab.toml"), 6),
        (include_str!("../../../../worlds/corridor.toml"), 3),
        (include_str!("../../../../worlds/ramps.toml"), 3),
    ] {
        let map = map_of(toml);
        let report = check(&map, &car);
        assert_eq!((report.islands.len(), report.zones.len()), (1, 0), "{}: {report:?}", map.name());
        let starts = World::from_toml(toml).unwrap();
        for pose in starts.start_poses(robots, &TruckParameters::default().body).unwrap() {
            let MapPose { x_m, y_m, yaw_rad } = pose;
            let corners = car.corners(&MapPose { x_m, y_m, yaw_rad });
            assert!(corners.iter().all(|p| map.grid().at(p[0], p[1]) == Cell::Free), "{pose:?}");
            assert_eq!(map.keep_out_under(&car, &pose), None);
        }
    }
}

#[test]
fn a_world_too_large_for_its_resolution_is_refused() {
    let world = World::from_toml("[room]\nwidth_m = 1000.0\ndepth_m = 1000.0").unwrap();
    assert!(matches!(world.to_map(0.05), Err(ToMapError::Grid(_))));
    assert_eq!(world.to_map(0.5).unwrap().grid().width(), 2002);
    for resolution_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert!(matches!(world.to_map(resolution_m), Err(ToMapError::Grid(_))), "{resolution_m}");
    }
}

#[test]
fn a_world_and_its_files_have_the_same_hash() {
    let map = map_of(include_str!("../../../../worlds/lab.toml"));
    let files = Files::of(&map, "lab.pgm").unwrap();
    let read = Description::from_yaml(&files.yaml).unwrap().map("other", &files.image).unwrap();
    assert_eq!((read.hash(), read.zones().len()), (map.hash(), 2));
}
