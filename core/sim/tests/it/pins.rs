//! A truck at its board's pins: another board in the simulated one's place hears, sees and drives.

use crate::agent::steps;
use std::sync::{Arc, Mutex};
use xtb_control::units::Stamp;
use xtb_control::vehicle::USUAL_SLOTS;
use xtb_sim::{
    DriveFault, EncoderFault, ExternalBoard, Pins, Pulses, STEP_NS, SensorFaults, Simulation, Transmitter,
    TruckParameters, World,
};

const REST: [u16; 10] = [3750, 3710, 4179, 3750, 3750, 3750, 3750, 3750, 3750, 3750];

/// Gives fixed pulses, sends back what it hears, and keeps what it sees.
#[derive(Debug)]
struct Echo {
    pulses: Pulses,
    seen: Vec<Pins>,
}

impl ExternalBoard for Echo {
    fn step(&mut self, from_agent: &[u8], pins: &Pins, to_agent: &mut Vec<u8>) -> Pulses {
        to_agent.extend_from_slice(from_agent);
        self.seen.push(pins.clone());
        self.pulses
    }
}

/// A truck with its nose to a wall 30 cm ahead or in free space, and the board.
fn truck(world: &str) -> (Simulation, Arc<Mutex<Echo>>) {
    let world = World::from_toml(world).unwrap();
    let start = xtb_control::frames::MapPose::default();
    let parameters = TruckParameters::default();
    let mut simulation = Simulation::with_starts(world, &parameters, &[("xtb-1", start)], 5).unwrap();
    let pulses = Pulses { counts: REST, begun: Stamp::ZERO };
    let board = Arc::new(Mutex::new(Echo { pulses, seen: Vec::new() }));
    simulation.trucks_mut()[0].set_external_board(board.clone());
    (simulation, board)
}

fn run_s(simulation: &mut Simulation, seconds: f64) {
    (0..steps(seconds)).for_each(|_| simulation.step());
}

fn give(board: &Mutex<Echo>, motor: u16, begun: Stamp) {
    let mut board = board.lock().unwrap();
    board.pulses.counts[0] = motor;
    board.pulses.begun = begun;
}

#[test]
fn its_pulses_drive_and_the_encoders_edges_measure_the_way() {
    let (mut simulation, board) = truck("");
    give(&board, 4500, Stamp::ZERO);
    run_s(&mut simulation, 3.0);
    let truth = simulation.trucks()[0].truth();
    assert_eq!((truth.motor_counts, truth.neutral_since_s), (4500, None));

    let seen = std::mem::take(&mut board.lock().unwrap().seen);
    assert_eq!(seen.len() as u64, steps(3.0));
    for pins in &seen {
        let during = pins.now.ns() - STEP_NS..=pins.now.ns();
        assert!(pins.encoder_edges.iter().all(|edge| during.contains(&edge.ns())), "{pins:?}");
    }
    let edges: Vec<Stamp> = seen.iter().flat_map(|pins| pins.encoder_edges.clone()).collect();
    assert!(edges.windows(2).all(|pair| pair[0] < pair[1]), "one after the other");
    let encoder = TruckParameters::default().encoder;
    let turns = edges.len() as f64 / (encoder.pulses_per_rev * encoder.gear_ratio);
    let way_m = turns * std::f64::consts::PI * encoder.wheel_diameter_m;
    let (driven_m, part) = (truth.x_m.hypot(truth.y_m), encoder.scale_tolerance + 0.01);
    assert!(driven_m > 1.0 && (way_m / driven_m - 1.0).abs() < part, "{way_m} m for {driven_m} m");

    let begun = simulation.now();
    give(&board, 0, begun);
    run_s(&mut simulation, 2.0);
    let truth = simulation.trucks()[0].truth();
    assert_eq!((truth.motor_counts, truth.neutral_since_s), (3750, Some(begun.s())), "no pulse: at rest");
    assert!(board.lock().unwrap().seen.last().unwrap().encoder_edges.is_empty(), "it stands");
}

#[test]
fn bytes_pass_it_both_ways_whatever_breaks_in_the_simulated_board() {
    let (mut simulation, _board) = truck("");
    let truck = &mut simulation.trucks_mut()[0];
    truck.set_sensor_faults(SensorFaults { encoder: EncoderFault::Wild, ..SensorFaults::default() });
    truck.set_drive_fault(DriveFault::Held);
    let mut heard = Vec::new();
    for i in 0..200 {
        simulation.trucks_mut()[0].board_rx(&[i, 0]);
        simulation.step();
        simulation.trucks_mut()[0].take_board_tx(&mut heard);
    }
    let sent: Vec<u8> = (0..200).flat_map(|i| [i, 0]).collect();
    assert_eq!(heard, sent, "and nothing of the simulated board's");
    assert_eq!(simulation.trucks()[0].board_counters().frames, 0);
}

#[test]
fn it_has_the_voltages_of_what_is_before_the_truck_and_the_receivers_pulses() {
    let wall = "[[boxes]]\nname = \"wall\"\nx_m = 0.0\ny_m = 0.75\nwidth_m = 3.0\ndepth_m = 0.2";
    let (mut simulation, board) = truck(wall);
    run_s(&mut simulation, 0.5);
    let pins = board.lock().unwrap().seen.last().unwrap().clone();
    let truck = &simulation.trucks()[0];
    let gap_cm = (0.65 - TruckParameters::default().body.length_m / 2.0) * 100.0;
    // The inverse of the memorandum's formula (§4.5).
    let expected_v = (6787.0 / (gap_cm + 4.0) + 3.0) * 5.0 / 1024.0;
    for (i, v) in pins.range_finders_v.iter().enumerate() {
        let right = if i < USUAL_SLOTS { (v - expected_v).abs() < 0.1 } else { *v < 0.5 };
        assert!(right, "range finder {i}: {v} V, {expected_v} V before the wall");
    }
    assert_eq!(pins.battery_v, truck.battery_v());
    assert_eq!(pins.pistons_v, [2.5; 4], "in the middle");
    assert!((pins.tilt_v[0] - 2.525).abs() < 1e-9 && (pins.tilt_v[1] - 2.503).abs() < 1e-9, "{pins:?}");
    assert!(pins.receiver_ms.is_some_and(|[speed, steering, _]| (speed, steering) == (1.5, 1.5)), "{pins:?}");

    simulation.trucks_mut()[0].set_transmitter(Transmitter { on: false, ..Transmitter::default() });
    simulation.step();
    assert_eq!(board.lock().unwrap().seen.last().unwrap().receiver_ms, None);
}
