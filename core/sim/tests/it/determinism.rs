//! Same seed, same bits: whatever the order of the trucks or the number of threads.

use crate::agent::{Agent, set_up, steps};
use xtb_control::{Command, VehicleConfig};
use xtb_protocol::board::FrameWriter;
use xtb_sim::{Simulation, Truck, TruckParameters, World};

const TRUCKS: usize = 12;

#[derive(Clone, Copy)]
enum Order {
    Serial,
    Backwards,
    Threads(usize),
}

fn step(simulation: &mut Simulation, order: Order) {
    let (context, trucks) = simulation.split_step();
    match order {
        Order::Serial => trucks.iter_mut().for_each(|truck| truck.step(&context)),
        Order::Backwards => trucks.iter_mut().rev().for_each(|truck| truck.step(&context)),
        Order::Threads(count) => std::thread::scope(|scope| {
            for chunk in trucks.chunks_mut(TRUCKS.div_ceil(count)) {
                scope.spawn(move || chunk.iter_mut().for_each(|truck| truck.step(&context)));
            }
        }),
    }
}

/// Bits of everything that a run shows: all bytes of both lines and all true states.
fn run(seed: u64, order: Order) -> (Vec<u8>, Vec<[u64; 5]>) {
    let names: Vec<String> = (1..=TRUCKS).map(|i| format!("xtb-{i}")).collect();
    let parameters = TruckParameters::default();
    let mut simulation = Simulation::new(World::default(), &parameters, &names, seed).unwrap();
    let mut agents: Vec<Agent> = (0..TRUCKS).map(|_| Agent::new(VehicleConfig::default())).collect();
    agents.iter_mut().for_each(|agent| agent.command(simulation.now(), Command::Wander));
    let mut bytes = Vec::new();
    for _ in 0..steps(12.0) {
        let now = simulation.now();
        for (agent, truck) in agents.iter_mut().zip(simulation.trucks_mut()) {
            let mut copy: Truck = truck.clone();
            copy.take_board_tx(&mut bytes);
            copy.take_gyro_tx(&mut bytes);
            agent.turn(now, truck);
        }
        step(&mut simulation, order);
    }
    let truths = simulation
        .truths()
        .map(|t| [t.x_m.to_bits(), t.y_m.to_bits(), t.yaw_rad.to_bits(), t.speed_mps.to_bits(), t.contacts]);
    (bytes, truths.collect())
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_one_does_not() {
    let first = run(42, Order::Serial);
    assert!(first.0.len() > 100_000);
    assert!(first == run(42, Order::Serial));
    assert!(first.0 != run(43, Order::Serial).0);
}

#[test]
fn neither_order_nor_threads_change_a_bit() {
    let serial = run(7, Order::Serial);
    assert!(serial == run(7, Order::Backwards));
    assert!(serial == run(7, Order::Threads(2)));
    assert!(serial == run(7, Order::Threads(5)));
}

#[test]
fn further_trucks_do_not_change_what_is_individual_about_the_first() {
    let start_bytes = |names: &[&str]| {
        let world = World::default();
        let mut simulation = Simulation::new(world, &TruckParameters::default(), names, 9).unwrap();
        set_up(&mut simulation, &mut FrameWriter::default());
        (0..200).for_each(|_| simulation.step());
        let mut bytes = Vec::new();
        simulation.trucks_mut()[0].take_board_tx(&mut bytes);
        bytes
    };
    assert_eq!(start_bytes(&["a"]), start_bytes(&["a", "b", "c"]));
}
