//! Any car by its settings: by file and drawn at random, each with what follows from them.
//! `cargo run -p xtb-sim --example vehicles` prints the figures of docs/vehicles.md.

use crate::agent::{Bench, pulses};
use crate::any_car::{Came, FILES, all_drawn, file, in_the_lab};
use crate::parkings::{self, Course};
use crate::pillars::Margins;
use crate::trips::{self, quantile};
use std::f64::consts::FRAC_PI_2;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::Drivetrain;
use xtb_nav::Car;
use xtb_protocol::board::FrameWriter;
use xtb_sim::{Simulation, TruckParameters, VehicleFile, World};

#[test]
fn the_xtbs_file_is_what_an_agent_believes_without_one() {
    assert_eq!(file(FILES[0]), VehicleFile::default());
}

#[test]
fn a_front_steered_truck_rolls_about_its_rear_axle_on_the_circle_that_its_settings_give() {
    let mut vehicle = VehicleConfig { drivetrain: Drivetrain::FrontAxle, ..VehicleConfig::default() };
    vehicle.geometry.body_ahead_m = 0.04;
    let mut truck = TruckParameters::of(&vehicle);
    truck.steering.play_deg = 0.0;
    truck.steering.centre_tolerance_counts = 0.0;
    truck.steering.slope_tolerance = 0.0;
    let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_2 };
    let world = World::from_toml("").unwrap();
    let mut simulation = Simulation::with_starts(world, &truck, &[("xtb-1", start)], 1).unwrap();
    let mut writer = FrameWriter::default();
    // Wheels to the right first, then a few seconds on the circle.
    crate::agent::drive(&mut simulation, &mut writer, &pulses(3750, -975), 1.0);
    let (mut beside_m, mut most_m): (f64, f64) = (0.0, 0.0);
    let radius_m = Car::of(&vehicle).radius_m;
    for _ in 0..160 {
        crate::agent::drive(&mut simulation, &mut writer, &pulses(3920, -975), 0.1);
        let truth = simulation.trucks()[0].truth();
        let off_m = libm::hypot(truth.x_m - radius_m, truth.y_m) - radius_m;
        (beside_m, most_m) = (beside_m.max(off_m.abs()), most_m.max(truth.x_m));
    }
    assert!(beside_m < 0.002, "{beside_m} m off its circle");
    assert!(most_m > 1.9 * radius_m, "half a circle at least: {most_m}");
}

#[test]
fn every_vehicle_goes_from_a_to_b_and_touches_nothing() {
    for named in FILES {
        let all = trips::measure_file(60, &file(named));
        let ratios: Vec<f64> = all.iter().filter_map(|arrival| arrival.ratio).collect();
        assert_eq!(ratios.len(), all.len(), "{}: all arrive", named.0);
        let missed_m = quantile(all.iter().map(|arrival| arrival.missed_m).collect(), 1.0);
        assert!(missed_m < 0.8, "{}: {missed_m} m from the goal, with drift and wheel scale", named.0);
        assert_eq!(all.iter().map(|arrival| arrival.contacts).sum::<u64>(), 0, "{}", named.0);
    }
}

#[test]
fn every_vehicle_parks_between_things_as_near_as_a_planner_leaves_them() {
    for named in FILES {
        let margins = Some(Margins { body_m: 0.03, look_out_m: 0.30 });
        let all = parkings::measure(12, &Course { margins, file: file(named), ..Course::new(0.35, 1.15) });
        let wrong: Vec<_> = all.iter().filter(|p| !p.reached || p.contacts > 0 || p.alarmed).collect();
        assert!(wrong.is_empty(), "{}: {wrong:?}", named.0);
        assert!(all.iter().all(|parked| parked.cusps > 0), "{}", named.0);
    }
}

#[test]
fn every_vehicle_reaches_planned_goals_in_the_lab() {
    for named in FILES {
        for way in in_the_lab(&file(named), 4) {
            assert!(
                way.came == Came::Reached && way.contacts == 0 && way.missed_m < 0.3,
                "{}: {way:?}",
                named.0
            );
        }
    }
}

#[test]
fn two_hundred_cars_drawn_at_random_arrive_or_are_refused_with_the_reason_before_they_move() {
    let all = all_drawn(200);
    let failed: Vec<_> = all.iter().filter(|way| matches!(way.came, Came::Failed(_))).collect();
    assert!(failed.is_empty(), "{failed:?}");
    assert_eq!(all.iter().map(|way| way.contacts).sum::<u64>(), 0);
    assert!(all.iter().all(|way| !way.unseen), "nobody drives where it does not look");
    let reached = all.iter().filter(|way| way.came == Came::Reached).count();
    assert!((80..190).contains(&reached), "{reached} of 200 arrive, the others are refused");
    let missed_m = all.iter().filter(|way| way.came == Came::Reached).map(|way| way.missed_m);
    assert!(missed_m.fold(0.0, f64::max) < 0.4);
    assert!(all.iter().all(|way| way.came != Came::Refused(String::new())));
}

#[test]
fn a_front_steered_agents_rear_output_stays_at_its_centre() {
    let file = file(FILES[1]);
    let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
    let world = World::from_toml("").unwrap();
    let mut bench = Bench::with_config(world, &file.truth, start, 1, file.vehicle.clone());
    let command = xtb_nav::path_follower::setpoint(0.1, 1.0, &file.vehicle);
    bench.command(xtb_control::Command::Teleop { rpm: command.0, steering: command.1 });
    bench.run_s(0.5);
    let pwm = bench.agent.outputs.pwm;
    assert_eq!(f64::from(pwm.steer_rear.get()), file.vehicle.steering.rear_centre);
    // 1 / m with a lever of 0.313 m: 17.4° of 30°, to the left.
    assert!((f64::from(pwm.steer_front.get()) - (3750.0 + 900.0 * 17.38 / 30.0)).abs() < 2.0, "{pwm:?}");
}
