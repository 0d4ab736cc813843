//! Storms of the model of tests/it, as many as wanted, with totals.
//! `cargo run -p xtb-dispatch --example storms [SEEDS] [FIRST]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/model/mod.rs"]
mod model;
#[allow(dead_code)]
#[path = "../tests/it/robots.rs"]
mod robots;

use model::{Weather, World};
use std::process::ExitCode;
use xtb_dispatch::Record;
use xtb_protocol::messages::TaskState;

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map_while(|word| word.parse::<u64>().ok());
    let seeds = numbers.next().unwrap_or(1000);
    let first = numbers.next().unwrap_or(0);
    let (mut tasks, mut drives, mut writes, mut crashes, mut breaches) = (0, 0, 0, 0, 0);
    let (mut done, mut failed, mut cancelled) = (0, 0, 0);
    for seed in first..first + seeds {
        let worse =
            Weather { slow_ms: 6000, loss: 0.2, robots: 5, tasks: 20, dwell_s: 0.0, ..Weather::STORM };
        let mut world = World::new(seed, if seed % 2 == 0 { Weather::STORM } else { worse });
        if let Err(breach) = world.run() {
            println!("seed {seed}: {breach}");
            breaches += 1;
        }
        writes += world.writes;
        crashes += world.crashes;
        drives += world.ledger.iter().filter(|entry| matches!(entry.record, Record::Reached { .. })).count();
        for task in world.dispatcher.iter().flat_map(|dispatcher| dispatcher.store().tasks()) {
            tasks += 1;
            match task.state {
                TaskState::Done => done += 1,
                TaskState::Failed => failed += 1,
                TaskState::Cancelled => cancelled += 1,
                _ => {}
            }
        }
    }
    println!(
        "{seeds} storms: {tasks} tasks, {done} done, {failed} failed with a reason, {cancelled} cancelled"
    );
    println!("{drives} drives, {writes} writes, {crashes} crashes at a write; {breaches} breaches");
    ExitCode::from(u8::from(breaches > 0))
}
