//! Trucks that other programs move are bodies here, as long as they are told.

use crate::agent::{pulses, set_up};
use std::f64::consts::FRAC_PI_2;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_protocol::board::FrameWriter;
use xtb_sim::parameters::Body;
use xtb_sim::{BoxSpec, MOST_FOREIGN, Simulation, SimulationError, TruckParameters, World};

fn facing_north(x_m: f64, y_m: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad: FRAC_PI_2 }
}

fn simulation() -> Simulation {
    let starts = [("a", facing_north(0.0, 0.0)), ("b", facing_north(3.0, 0.0))];
    Simulation::with_starts(World::default(), &TruckParameters::default(), &starts, 1).unwrap()
}

/// For 10 s the first truck drives ahead, which takes it 2 m at least; `each` comes before every step.
fn drive(simulation: &mut Simulation, mut each: impl FnMut(&mut Simulation)) {
    let mut writer = FrameWriter::default();
    set_up(simulation, &mut writer);
    for _ in 0..2000 {
        simulation.trucks_mut()[0].board_rx(writer.pwm(&pulses(4000, 0)).as_bytes());
        each(simulation);
        simulation.step();
    }
}

fn tell(simulation: &mut Simulation, name: &str, pose: &MapPose) -> bool {
    let until = simulation.now().plus_ms(100);
    simulation.put_foreign(name, pose, &Body::default(), until)
}

fn contacts(simulation: &Simulation) -> Vec<u64> {
    simulation.truths().map(|truth| truth.contacts).collect()
}

#[test]
fn a_truck_that_drives_into_one_of_another_program_stops_and_counts_a_contact() {
    let mut simulation = simulation();
    drive(&mut simulation, |simulation| assert!(tell(simulation, "far-1", &facing_north(0.1, 1.0))));
    let truth = simulation.trucks()[0].truth();
    assert!(truth.y_m <= 0.5 && truth.y_m > 0.49, "{truth:?}");
    assert_eq!(contacts(&simulation), [1, 0]);
}

#[test]
fn one_that_is_not_told_any_more_is_gone_after_its_time() {
    let mut simulation = simulation();
    assert!(tell(&mut simulation, "far-1", &facing_north(0.1, 1.0)));
    drive(&mut simulation, |simulation| {
        let there = simulation.foreign().count();
        // It is looked for at the beginning of a step.
        let gone = simulation.now() > Stamp::from_ms(105);
        assert_eq!(there, usize::from(!gone), "at {} ms", simulation.now().ms());
    });
    assert!(simulation.trucks()[0].truth().y_m > 1.5, "{:?}", simulation.trucks()[0].truth());
    assert_eq!(contacts(&simulation), [0, 0]);
}

#[test]
fn one_that_drives_away_frees_the_way() {
    let mut simulation = simulation();
    drive(&mut simulation, |simulation| {
        let away_m = simulation.now().s();
        tell(simulation, "far-1", &facing_north(0.1 + away_m, 1.0));
    });
    assert!(simulation.trucks()[0].truth().y_m > 1.5);
    assert_eq!(contacts(&simulation), [0, 0]);
}

#[test]
fn a_change_of_the_world_keeps_it_and_nothing_is_put_into_it() {
    let mut simulation = simulation();
    assert!(tell(&mut simulation, "far-1", &facing_north(0.1, 1.0)));
    let spec = BoxSpec { x_m: 5.0, y_m: 5.0, width_m: 0.5, depth_m: 0.5, yaw_rad: 0.0 };
    simulation.put_box("crate", spec).unwrap();
    simulation.step();
    assert_eq!(simulation.foreign().collect::<Vec<_>>(), ["far-1"]);
    let occupied = simulation.place(1, facing_north(0.2, 1.1)).unwrap_err();
    assert!(matches!(&occupied, SimulationError::Occupied { other, .. } if other == "far-1"), "{occupied}");
}

#[test]
fn own_names_impossible_poses_and_too_many_are_not_taken() {
    let mut simulation = simulation();
    assert!(!tell(&mut simulation, "a", &facing_north(5.0, 5.0)), "it is a truck of this world");
    assert!(!tell(&mut simulation, "far-1", &facing_north(f64::NAN, 0.0)));
    for number in 0..MOST_FOREIGN {
        assert!(tell(&mut simulation, &format!("far-{number}"), &facing_north(-5.0, -5.0)));
    }
    assert!(!tell(&mut simulation, "one-more", &facing_north(-5.0, -5.0)));
    assert!(tell(&mut simulation, "far-7", &facing_north(-4.0, -5.0)), "it is known");
    simulation.step();
}
