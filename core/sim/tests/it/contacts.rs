//! Nothing is ever driven through, and every touch counts once for everybody involved.

use crate::agent::{drive, pulses, set_up};
use std::f64::consts::FRAC_PI_2;
use xtb_control::frames::MapPose;
use xtb_protocol::board::FrameWriter;
use xtb_sim::{BoxSpec, Simulation, SimulationError, TruckParameters, World};

fn simulation(starts: &[(&str, MapPose)]) -> Simulation {
    Simulation::with_starts(World::default(), &TruckParameters::default(), starts, 1).unwrap()
}

fn facing_north(x_m: f64, y_m: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad: FRAC_PI_2 }
}

fn contacts(simulation: &Simulation) -> Vec<u64> {
    simulation.truths().map(|truth| truth.contacts).collect()
}

#[test]
fn pushing_against_a_wall_is_one_contact_and_the_truck_stays_where_it_is() {
    let mut simulation = simulation(&[("a", facing_north(0.0, 6.0))]);
    let mut writer = FrameWriter::default();
    drive(&mut simulation, &mut writer, &pulses(4000, 0), 20.0);
    let truth = simulation.trucks()[0].truth();
    assert_eq!(truth.contacts, 1);
    assert!((6.74..=6.75).contains(&truth.y_m), "the bumper is at the wall: {truth:?}");
    assert!(truth.speed_mps.abs() < 0.02);
    drive(&mut simulation, &mut writer, &pulses(3500, 0), 3.0);
    let back = simulation.trucks()[0].truth();
    assert!(back.y_m < 6.5, "it gets away again: {back:?}");
    drive(&mut simulation, &mut writer, &pulses(4000, 0), 10.0);
    assert_eq!(contacts(&simulation), [2]);
}

#[test]
fn a_truck_that_runs_into_another_counts_for_both_and_not_for_a_third() {
    let starts =
        [("a", facing_north(0.0, 0.0)), ("b", facing_north(0.1, 1.0)), ("c", facing_north(3.0, 0.0))];
    let mut simulation = simulation(&starts);
    let mut writer = FrameWriter::default();
    set_up(&mut simulation, &mut writer);
    for _ in 0..2000 {
        simulation.trucks_mut()[0].board_rx(writer.pwm(&pulses(4000, 0)).as_bytes());
        simulation.step();
    }
    assert_eq!(contacts(&simulation), [1, 1, 0]);
    let truth = simulation.trucks()[0].truth();
    assert!(truth.y_m <= 0.5 && truth.y_m > 0.49, "{truth:?}");
}

#[test]
fn trucks_that_meet_head_on_can_both_back_off() {
    let south = MapPose { x_m: 0.0, y_m: 2.0, yaw_rad: -FRAC_PI_2 };
    let mut simulation = simulation(&[("a", facing_north(0.0, 0.0)), ("b", south)]);
    let mut writer = FrameWriter::default();
    drive(&mut simulation, &mut writer, &pulses(4300, 0), 4.0);
    assert_eq!(contacts(&simulation), [1, 1]);
    drive(&mut simulation, &mut writer, &pulses(3200, 0), 1.5);
    let gap_m = simulation.trucks()[1].truth().y_m - simulation.trucks()[0].truth().y_m - 0.5;
    assert!(gap_m > 0.5, "{gap_m}");
    assert_eq!(contacts(&simulation), [1, 1]);
}

#[test]
fn a_truck_can_be_put_elsewhere_but_not_into_something() {
    let mut simulation = simulation(&[("a", facing_north(0.0, 0.0)), ("b", facing_north(2.0, 0.0))]);
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(4000, 0), 1.0);
    simulation.place(0, facing_north(-3.0, -3.0)).unwrap();
    let truth = simulation.trucks()[0].truth();
    assert_eq!((truth.x_m, truth.y_m, truth.speed_mps), (-3.0, -3.0, 0.0));
    let occupied = simulation.place(0, facing_north(2.1, 0.3)).unwrap_err();
    assert_eq!(occupied.to_string(), "a would overlap b");
    let wall = simulation.place(0, facing_north(0.0, 6.9)).unwrap_err();
    assert_eq!(wall.to_string(), "a would overlap the room's north wall");
    assert!(matches!(simulation.place(7, facing_north(0.0, 0.0)), Err(SimulationError::NoSuchTruck { .. })));
    assert!(matches!(simulation.place(0, facing_north(f64::NAN, 0.0)), Err(SimulationError::Pose { .. })));
}

#[test]
fn a_box_cannot_be_put_on_a_truck() {
    let mut simulation = simulation(&[("a", facing_north(0.0, 0.0))]);
    let spec = BoxSpec { x_m: 0.0, y_m: 0.2, width_m: 1.0, depth_m: 0.2, yaw_rad: 0.0 };
    let refused = simulation.put_box("crate", spec).unwrap_err();
    assert_eq!(refused.to_string(), "box \"crate\" would overlap a");
    let refused = simulation.put_box("crate", BoxSpec { width_m: 0.0, ..spec }).unwrap_err();
    assert_eq!(refused.to_string(), "box \"crate\": width_m = 0.0 is outside 0.001..=1000");
}
