//! World files: the ones that come with the project, and those that are refused.

use std::f64::consts::FRAC_PI_2;
use xtb_sim::{BoxSpec, FREE_AHEAD_M, Simulation, TruckParameters, World, WorldError};

fn refused(toml: &str) -> String {
    World::from_toml(toml).unwrap_err().to_string()
}

#[test]
fn the_worlds_of_the_project_hold_the_robots_that_they_are_for() {
    let worlds = [
        (include_str!("../../../../worlds/lab.toml"), "lab", 6),
        (include_str!("../../../../worlds/corridor.toml"), "corridor", 3),
        (include_str!("../../../../worlds/ramps.toml"), "ramps", 3),
    ];
    for (text, name, robots) in worlds {
        let world = World::from_toml(text).unwrap();
        assert_eq!(world.name(), Some(name));
        let names: Vec<String> = (1..=robots).map(|i| format!("xtb-{i}")).collect();
        let mut simulation = Simulation::new(world, &TruckParameters::default(), &names, 1).unwrap();
        (0..200).for_each(|_| simulation.step());
        assert!(simulation.truths().all(|truth| truth.contacts == 0));
    }
}

#[test]
fn robot_1_starts_at_the_origin_facing_north_and_everybody_has_3_m_free_ahead() {
    let body = TruckParameters::default().body;
    for robots in (1..=20).chain([50, 100, 150]) {
        let world = World::for_robots(robots, &body);
        let poses = world.start_poses(robots, &body).unwrap();
        assert_eq!(poses.len(), robots);
        assert_eq!((poses[0].x_m, poses[0].y_m, poses[0].yaw_rad), (0.0, 0.0, FRAC_PI_2));
        for (i, a) in poses.iter().enumerate() {
            assert_eq!(a.yaw_rad, FRAC_PI_2);
            for b in &poses[i + 1..] {
                let (dx, dy) = ((a.x_m - b.x_m).abs(), (a.y_m - b.y_m).abs());
                let apart = dx >= body.width_m || dy >= body.length_m + FREE_AHEAD_M;
                assert!(apart, "{robots} robots: {a:?} and {b:?}");
            }
        }
    }
    assert_eq!(World::for_robots(10, &body), World::default());
    let row = World::default().start_poses(3, &body).unwrap();
    assert_eq!(row.iter().map(|p| (p.x_m, p.y_m)).collect::<Vec<_>>(), [(0.0, 0.0), (2.0, 0.0), (-2.0, 0.0)]);
}

#[test]
fn starts_of_the_file_come_first_and_the_rest_is_placed_around_them() {
    let world = World::from_toml(
        "[room]\nwidth_m = 14.0\ndepth_m = 14.0\n[[starts]]\nx_m = 2.0\ny_m = 0.1\nyaw_rad = 0.0",
    );
    let body = TruckParameters::default().body;
    let poses = world.unwrap().start_poses(3, &body).unwrap();
    let found: Vec<_> = poses.iter().map(|p| (p.x_m, p.y_m)).collect();
    // (2, 0) is taken and (4, 0) stands in the first robot's way.
    assert_eq!(found, [(2.0, 0.1), (0.0, 0.0), (-2.0, 0.0)]);
}

#[test]
fn too_many_robots_for_a_room_are_refused_with_the_number_that_fits() {
    let world = World::from_toml("[room]\nwidth_m = 4.0\ndepth_m = 8.0").unwrap();
    let error = world.start_poses(9, &TruckParameters::default().body).unwrap_err();
    assert_eq!(error, WorldError::TooManyRobots { asked: 9, placed: 1 });
}

#[test]
fn impossible_worlds_are_refused_with_the_reason() {
    let cases = [
        ("[room]\nwidth_m = 0.5\ndepth_m = 3.0", "the room: width_m = 0.5 is outside 1..=1000"),
        ("[room]\nwidth_m = nan\ndepth_m = 3.0", "the room: width_m = NaN is outside 1..=1000"),
        ("[[walls]]\npoints = [[0.0, 0.0]]", "wall 1: 1 point(s), a wall needs at least 2"),
        ("[[walls]]\npoints = [[0.0, 0.0], [1.0, inf]]", "wall 1: point = inf is outside -1000..=1000"),
        (
            "[[walls]]\npoints = [[1.0, 2.0], [1.0, 2.0]]",
            "wall 1: segment length = 0.0 is outside 0.001..=4000",
        ),
        (
            "[[boxes]]\nx_m = 1.0\ny_m = 1.0\nwidth_m = 0.0\ndepth_m = 1.0",
            "box 1: width_m = 0.0 is outside 0.001..=1000",
        ),
        (
            "[[boxes]]\nname = \"crate\"\nx_m = 0.0\ny_m = 0.2\nwidth_m = 1.0\ndepth_m = 1.0\n\
             [[starts]]\nx_m = 0.0\ny_m = 0.0\nyaw_rad = 0.0",
            "start 1 is inside box \"crate\"",
        ),
        (
            "[[starts]]\nx_m = 0.0\ny_m = 0.0\nyaw_rad = 0.0\n\
             [[starts]]\nx_m = 0.3\ny_m = 0.1\nyaw_rad = 1.0",
            "starts 1 and 2 overlap",
        ),
        (
            "[room]\nwidth_m = 4.0\ndepth_m = 4.0\n[[starts]]\nx_m = 5.0\ny_m = 0.0\nyaw_rad = 0.0",
            "start 1 is outside the room",
        ),
        (
            "[[ramps]]\nx_m = 0.0\ny_m = 0.0\nlength_m = 1.0\nwidth_m = 1.0\nslope_deg = 80.0\n\
             uphill_rad = 0.0",
            "ramp 1: slope_deg = 80.0 is outside 0..=30",
        ),
    ];
    for (toml, reason) in cases {
        assert_eq!(refused(toml), reason);
    }
    assert!(refused("[room]\nwidth = 3.0").contains("unknown field `width`"));
    let twice = "[[boxes]]\nname = \"a\"\nx_m = 1.0\ny_m = 1.0\nwidth_m = 1.0\ndepth_m = 1.0\n";
    assert_eq!(refused(&twice.repeat(2)), "two boxes have the name \"a\"");
}

#[test]
fn a_box_put_twice_moves() {
    let mut world = World::default();
    let spec = BoxSpec { x_m: 1.0, y_m: 1.0, width_m: 0.5, depth_m: 0.5, yaw_rad: 0.0 };
    world.put_box("crate", spec).unwrap();
    world.put_box("crate", BoxSpec { x_m: 2.0, ..spec }).unwrap();
    world.remove_box("crate").unwrap();
    assert_eq!(world, World::default());
    assert_eq!(world.remove_box("crate"), Err(WorldError::NoSuchBox { name: "crate".into() }));
}

#[test]
fn two_trucks_of_one_name_are_refused() {
    let error = Simulation::new(World::default(), &TruckParameters::default(), &["a", "a"], 1).unwrap_err();
    assert_eq!(error.to_string(), "two trucks have the name \"a\"");
}
