//! Three kinds of vehicles in one lab under traffic control, the figures of docs/navigation.md:
//! `cargo run --release -p fleet-tests --example mixed_fleet [GOALS] [SEED] [SPEED]` (40, 1, 4).
//! Exit code 1 if a goal was not reached or something was touched.

#![allow(clippy::print_stdout)]

use fleet_tests::vehicles::three_kinds;
use std::process::ExitCode;

#[tokio::main]
async fn main() -> ExitCode {
    let argument = |place: usize| std::env::args().nth(place).and_then(|text| text.parse::<u32>().ok());
    let (goals, seed, speed) =
        (argument(1).unwrap_or(40), argument(2).unwrap_or(1), argument(3).unwrap_or(4));
    let drives = three_kinds(goals as usize, u64::from(seed), f64::from(speed)).await;
    println!(
        "seed {seed}: {} of {goals} reached, {} contacts, {:.0} s",
        drives.reached, drives.contacts, drives.took_s
    );
    drives.failed.iter().for_each(|failed| println!("  {failed}"));
    if drives.failed.is_empty() && drives.contacts == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
