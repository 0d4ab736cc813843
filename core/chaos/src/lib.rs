//! The simulator of bad days: a fleet, its people and their network in virtual time, one history a seed.
//!
//! The robots are the agents' own code ([`xtb_robot::Robot`]), the people use the clients' own
//! ([`xtb_robot::Operator`]). Everything else goes wrong: messages are lost, late, doubled and
//! repeated by strangers, agents are killed, held up and restarted, lines break, sticks are held. An
//! oracle of each robot, which knows only what reached it and what it answered, checks at every turn that nothing moves without authority.
//!
//! ```text
//!   seed ─► plan: world, changes, scripts
//!                          │
//!   operators ◄──► network ┼──► inbox ─► agent ◄──► truck    one turn = 5 ms
//!                          │      └────────┬──────────┘
//!                          └───────────► oracle ─► violation, with the last lines of the event log
//! ```
//! [`meetings`] are scenes of robots in each other's way, with a judge by ground truth.
//!
//! Same seed, same history, bit for bit, on any machine and in any number of threads.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod agents;
mod change;
mod event_log;
mod fault_injection;
pub mod meetings;
mod network;
mod operators;
mod oracle;
mod plan;
mod report;
mod scenario;
mod scripts;
mod time;

use event_log::EventLog;
use scenario::Scenario;
use thiserror::Error;
use xtb_protocol::keys::NameError;
use xtb_robot::Guards;
use xtb_sim::SimulationError;

pub use report::{DayCounts, DayReport, Invariant, Violation};

/// How a scenario is to be simulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct ScenarioOptions {
    /// The rules that every robot obeys: all of them, but in the mutation check.
    pub guards: Guards,
}

/// Why there is no such scenario.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ScenarioError {
    /// The world or its trucks are impossible.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A name that cannot stand in a key.
    #[error(transparent)]
    Name(#[from] NameError),
}

/// So many scenarios go on side by side in [`run_all`]; three, four and eight were not faster.
const SIDE_BY_SIDE: usize = 2;

/// Simulates the day of this seed.
///
/// # Errors
/// A world that the seed makes impossible: a bug of this module.
pub fn run(seed: u64, options: ScenarioOptions) -> Result<DayReport, ScenarioError> {
    live(seed, options, |_| {})
}

/// Simulates the days of these seeds, some of them side by side, which is faster than one by one. `ended` hears of each
/// as soon as it is over.
pub fn run_all(
    seeds: impl IntoIterator<Item = u64>,
    options: ScenarioOptions,
    mut ended: impl FnMut(u64, Result<DayReport, ScenarioError>),
) {
    let mut seeds = seeds.into_iter().fuse();
    let (mut running, mut scenarios) = (Vec::new(), Vec::new());
    loop {
        while scenarios.len() < SIDE_BY_SIDE
            && let Some(seed) = seeds.next()
        {
            match Scenario::new(seed, options) {
                Ok(scenario) => {
                    running.push(seed);
                    scenarios.push(scenario);
                }
                Err(error) => ended(seed, Err(error)),
            }
        }
        if scenarios.is_empty() {
            return;
        }
        Scenario::turn(&mut scenarios);
        while let Some(over) = scenarios.iter().position(Scenario::is_over) {
            let (seed, scenario) = (running.swap_remove(over), scenarios.swap_remove(over));
            ended(seed, Ok(scenario.report(seed)));
        }
    }
}

/// As [`run`], and tells what happens, line by line, as it happens.
///
/// # Errors
/// As [`run`].
pub fn tell(
    seed: u64,
    options: ScenarioOptions,
    mut line: impl FnMut(&str),
) -> Result<DayReport, ScenarioError> {
    let mut told = 0;
    live(seed, options, |event_log| {
        let (lines, by_now) = event_log.since(told);
        told = by_now;
        lines.iter().for_each(|text| line(text));
    })
}

fn live(
    seed: u64,
    options: ScenarioOptions,
    mut each_turn: impl FnMut(&EventLog),
) -> Result<DayReport, ScenarioError> {
    let mut scenario = Scenario::new(seed, options)?;
    while !scenario.is_over() {
        Scenario::turn(std::slice::from_mut(&mut scenario));
        each_turn(&scenario.event_log);
    }
    Ok(scenario.report(seed))
}
