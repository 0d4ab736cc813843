//! A fleet that wanders in lockstep, one step at a time, as every version of the simulator can: for counting what a
//! robot-second costs by commits (docs/simulator.md). `cost ROBOTS SECONDS`; the difference of two runs is the cost.
//!
//! ```sh
//! git checkout COMMIT && cp …/cost.rs core/sim/examples/    # beside the code of each commit
//! export CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16
//! cargo build --release -p xtb-sim --example cost
//! for seconds in 2 12; do
//!   valgrind --tool=callgrind --callgrind-out-file=/dev/null target/release/examples/cost 10 $seconds
//! done
//! ```

#![allow(clippy::print_stdout, clippy::unwrap_used)] // a measurement's program; what cannot go on shall end

use xtb_control::VehicleConfig;
use xtb_protocol::messages::{Body, LinkLoss, Request};
use xtb_protocol::{Name, Uuid};
use xtb_sim::{Lockstep, Simulation, TruckParameters, World};

fn main() {
    let arguments: Vec<usize> = std::env::args().skip(1).map(|text| text.parse().unwrap()).collect();
    let [robots, seconds] = arguments[..] else { panic!("cost ROBOTS SECONDS") };
    let parameters = TruckParameters::default();
    let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
    let world = World::for_robots(robots, &parameters.body);
    let simulation = Simulation::new(world, &parameters, &names, 1).unwrap();
    let name = |text: &str| Name::new(text).unwrap();
    let mut fleet = Lockstep::new(simulation, &name("lab"), &VehicleConfig::default()).unwrap();
    for _ in 0..100 {
        fleet.step();
    }
    for robot in 0..robots {
        let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(robot as u128), lease: None, body };
        fleet.request(robot, &name("bench"), &request);
    }
    let end_s = fleet.now().s() + seconds as f64;
    while fleet.now().s() < end_s {
        fleet.step();
    }
    let contacts: u64 = fleet.simulation().truths().map(|truth| truth.contacts).sum();
    println!("{robots} robots, {seconds} s, {contacts} contacts");
}
