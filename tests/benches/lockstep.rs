//! How much faster than real time the simulation runs: trucks, sensors, lines, brains, controllers.
//!
//! `cargo bench -p fleet-tests --bench lockstep`: one thread, everybody wanders in a room for all.

use std::time::Instant;
use xtb_control::VehicleConfig;
use xtb_protocol::messages::{Body, LinkLoss, Request};
use xtb_protocol::{Name, Uuid};
use xtb_sim::{Lockstep, Simulation, TruckParameters, World};

const SIMULATED_S: f64 = 60.0;

#[allow(clippy::print_stdout)]
fn main() {
    println!("robots  simulated  wall      real-time factor  µs per robot-second  contacts");
    for robots in [1, 10, 100] {
        let (wall_s, contacts) = run(robots);
        let factor = SIMULATED_S / wall_s;
        let each_us = wall_s * 1e6 / (SIMULATED_S * robots as f64);
        println!(
            "{robots:6}  {SIMULATED_S:7} s  {wall_s:6.3} s  {factor:16.0}  {each_us:19.1}  {contacts:8}"
        );
    }
}

/// Wall time of a minute, and the touches in it.
fn run(robots: usize) -> (f64, u64) {
    let parameters = TruckParameters::default();
    let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
    let world = World::for_robots(robots, &parameters.body);
    let simulation = Simulation::new(world, &parameters, &names, 1).expect("there is room");
    let name = |text: &str| Name::new(text).expect("a name");
    let mut fleet =
        Lockstep::new(simulation, &name("lab"), &VehicleConfig::default()).expect("names of robots");
    for _ in 0..100 {
        fleet.step();
    }
    for robot in 0..robots {
        let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(robot as u128), lease: None, body };
        fleet.request(robot, &name("bench"), &request);
    }
    let end_s = fleet.now().s() + SIMULATED_S;
    let began = Instant::now();
    while fleet.now().s() < end_s {
        fleet.step();
    }
    let wall_s = began.elapsed().as_secs_f64();
    (wall_s, fleet.simulation().truths().map(|truth| truth.contacts).sum())
}
