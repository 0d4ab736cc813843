//! What must hold for any bytes from outside: one entry point for each door of the programs.
//!
//! An entry point takes bytes as they might come in and checks more than "no panic": what is accepted
//! is in range and reads back as itself, what is refused is refused by type, and a line finds its next
//! good frame. `fuzz/` hands them to libFuzzer; `tests/it/fuzz.rs` runs the same ones from the same
//! corpus on the stable toolchain.

mod lines;
mod maps;
mod messages;
mod mutate;
mod seeds;
mod text;

pub use lines::{board, gyro};
pub use maps::{fleet_map, ros_map};
pub use messages::{command, dispatch, estop, fix, near, robot_state, route, teleop, traffic};
pub use mutate::Mutator;
pub use text::{agent_config, fleet_config, trace};

use std::path::{Path, PathBuf};

/// A file of the corpus: its name and what it holds.
pub type Seed = (String, Vec<u8>);

/// A door.
#[derive(Debug, Clone, Copy)]
pub struct Target {
    /// Of the libFuzzer target, and of the corpus' folder.
    pub name: &'static str,
    /// Checks one input and panics where something does not hold. True: something in it was accepted.
    pub check: fn(&[u8]) -> bool,
    /// What its corpus is made of.
    pub seeds: fn() -> Vec<Seed>,
    /// Mutated inputs in an ordinary test run: about 2 s unoptimised.
    pub rounds: u64,
}

/// All of them.
pub const TARGETS: [Target; 16] = [
    Target { name: "command", check: command, seeds: seeds::command, rounds: 30_000 },
    Target { name: "dispatch", check: dispatch, seeds: seeds::dispatch, rounds: 20_000 },
    Target { name: "teleop", check: teleop, seeds: seeds::teleop, rounds: 40_000 },
    Target { name: "estop", check: estop, seeds: seeds::estop, rounds: 40_000 },
    Target { name: "board", check: board, seeds: seeds::board, rounds: 20_000 },
    Target { name: "gyro", check: gyro, seeds: seeds::gyro, rounds: 40_000 },
    Target { name: "fleet_config", check: fleet_config, seeds: seeds::fleet_config, rounds: 60_000 },
    Target { name: "agent_config", check: agent_config, seeds: seeds::agent_config, rounds: 8_000 },
    Target { name: "fix", check: fix, seeds: seeds::fix, rounds: 40_000 },
    Target { name: "route", check: route, seeds: seeds::route, rounds: 20_000 },
    Target { name: "near", check: near, seeds: seeds::near, rounds: 20_000 },
    Target { name: "traffic", check: traffic, seeds: seeds::traffic, rounds: 30_000 },
    Target { name: "robot_state", check: robot_state, seeds: seeds::robot_state, rounds: 10_000 },
    Target { name: "fleet_map", check: fleet_map, seeds: seeds::fleet_map, rounds: 10_000 },
    Target { name: "ros_map", check: ros_map, seeds: seeds::ros_map, rounds: 10_000 },
    Target { name: "trace", check: trace, seeds: seeds::trace, rounds: 20_000 },
];

/// Where the corpus is kept: a folder for each target.
#[must_use]
pub fn corpus() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus")
}
