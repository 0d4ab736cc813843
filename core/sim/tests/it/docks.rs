//! Docks of a world charge the trucks that stand at them, and no others.

use xtb_control::frames::MapPose;
use xtb_sim::{Simulation, TruckParameters, World};

const WORLD: &str = r#"
[room]
width_m = 8.0
depth_m = 8.0
[[places]]
name = "dock-1"
kind = "dock"
x_m = -2.0
y_m = 0.0
[[places]]
name = "bench"
x_m = 2.0
y_m = 0.0
"#;

#[test]
fn a_truck_at_a_dock_is_charged_and_one_elsewhere_is_not() {
    let at = |x_m: f64| MapPose { x_m, y_m: 0.0, yaw_rad: 0.3 };
    let robots = [("at", at(-1.8)), ("beside", at(-0.9)), ("place", at(2.0))];
    let world = World::from_toml(WORLD).unwrap();
    let mut simulation = Simulation::with_starts(world, &TruckParameters::default(), &robots, 3).unwrap();
    simulation.trucks_mut().iter_mut().for_each(|truck| truck.set_battery_left(0.5));
    let volts: Vec<f64> = simulation.trucks().iter().map(|truck| truck.battery_v()).collect();
    (0..200 * 120).for_each(|_| simulation.step());
    let left: Vec<f64> = simulation.trucks().iter().map(|truck| truck.battery_left()).collect();
    // 5 A more than the electronics draw for two minutes, of 3 Ah.
    assert!((left[0] - 0.5 - 5.0 / 30.0 / 3.0).abs() < 1e-3, "{left:?}");
    assert!(left[1] < 0.5 && left[1] == left[2], "{left:?}");
    assert!(simulation.trucks()[0].battery_v() > volts[0] && simulation.trucks()[1].battery_v() < volts[1]);
}
