//! Both platform controllers of the memorandum (§4.8.2, §4.8.3) on the simulated pistons: the signs
//! agree, slopes are levelled, no piston is ever driven on at its end.

use crate::agent::Bench;
use crate::levelling::{LEVEL_DEG, Levelling, on_slope};
use std::f64::consts::PI;
use xtb_control::vehicle::Platform;

fn tilt_deg(bench: &Bench) -> (f64, f64) {
    bench.agent.outputs.tilt.both().unwrap()
}

#[test]
fn both_controllers_level_a_slope_of_4_degrees_in_every_direction_within_a_second() {
    for controller in [Platform::Balance, Platform::Pid] {
        for (seed, i) in (0..25).flat_map(|seed| (0..8).map(move |i| (seed, i))) {
            let bearing_rad = f64::from(i) * PI / 4.0;
            let levelling = Levelling::watch(on_slope(controller, 4.0, bearing_rad, seed), 15.0);
            let (_, x_deg, y_deg) = levelling.course[0];
            let what = format!("{controller:?}, truck {seed}, bearing {bearing_rad}");
            assert!((x_deg.hypot(y_deg) - 4.0).abs() < 0.1, "{what}: begins at {x_deg} {y_deg}");
            let settled_s = levelling.settled_s();
            assert!(settled_s.is_some_and(|s| s < 1.0), "{what}: within {LEVEL_DEG}° from {settled_s:?}");
            assert_eq!(levelling.end_stop_pushes, 0, "{what}");
        }
    }
}

#[test]
fn on_a_slope_beyond_their_travel_the_pistons_stop_before_their_ends() {
    for controller in [Platform::Balance, Platform::Pid] {
        for (seed, bearing) in [(1, 0.0), (2, PI / 2.0), (3, PI), (4, 0.8)] {
            let mut bench = on_slope(controller, 15.0, bearing, seed);
            bench.run_s(0.3);
            let before = tilt_deg(&bench);
            bench.run_s(20.0);
            let after = tilt_deg(&bench);
            let total = |(x_deg, y_deg): (f64, f64)| x_deg.hypot(y_deg);
            assert!(total(after) < total(before) - 4.0, "as level as can be: {before:?} {after:?}");
            assert!(total(after) > 5.0, "but not level: {after:?}");
            assert_eq!(bench.truck().end_stop_pushes(), 0, "{controller:?} {bearing}");
        }
    }
}

#[test]
fn the_balance_controller_rests_once_it_is_level_and_the_platform_off_leaves_the_slope() {
    let mut bench = on_slope(Platform::Balance, 0.0, 0.0, 1);
    bench.run_s(1.0);
    assert_eq!(bench.agent.outputs.pwm.pistons.map(|p| p.get()), [3750; 4]);
    let mut bench = on_slope(Platform::Off, 4.0, 0.0, 1);
    bench.run_s(5.0);
    let (x_deg, y_deg) = tilt_deg(&bench);
    assert!((x_deg + 4.0).abs() < 0.2 && y_deg.abs() < 0.2, "nose up: {x_deg} {y_deg}");
}
