//! The table of docs/first-level.md: approaches to walls and boxes with and without the fold-back
//! latch. `cargo run -p xtb-sim --example wall_table`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/approaches.rs"]
mod approaches;
#[path = "../tests/it/draw.rs"]
mod draw;

use approaches::{Approach, late, run_all};
use xtb_control::VehicleConfig;
use xtb_sim::TruckParameters;

fn main() {
    let most_mps = VehicleConfig::default().admitted_mps();
    println!("Up to {most_mps:.3} m/s.\n");
    println!("| | latch | approaches | touch while rolling | touch after standing | nearest to a wall |");
    println!("| --- | --- | ---: | ---: | ---: | ---: |");
    for latch in [Latch::On, Latch::Off] {
        row("the simulated truck, any approach", latch, 10_000, &TruckParameters::default(), |seed| {
            Approach::any(seed, most_mps)
        });
    }
    for latch in [Latch::On, Latch::HalfASecond, Latch::Off] {
        row("one that coasts for 0.3 s longer, straight ahead", latch, 1000, &late(), |seed| {
            Approach::straight(seed, most_mps)
        });
    }
}

/// What releases the latch.
#[derive(Clone, Copy, PartialEq)]
enum Latch {
    /// Backing off alone.
    On,
    /// Also half a second of clear readings.
    HalfASecond,
    /// There is none.
    Off,
}

fn row(
    name: &str,
    latch: Latch,
    count: u64,
    parameters: &TruckParameters,
    approach: impl Fn(u64) -> Approach + Sync,
) {
    let mut config = VehicleConfig::default();
    config.obstacle.foldback_latch = latch != Latch::Off;
    config.obstacle.foldback_clear_s = if latch == Latch::HalfASecond { 0.5 } else { 0.0 };
    let all = run_all(0..count, &config, parameters, approach);
    assert!(all.iter().all(|(_, outcome)| outcome.seen));
    let touched = all.iter().filter(|(_, outcome)| outcome.touched).count();
    let rolling = all.iter().filter(|(_, outcome)| outcome.touched_rolling).count();
    let nearest_cm = all.iter().filter_map(|(_, outcome)| outcome.nearest_m).fold(f64::MAX, f64::min) * 100.0;
    let latch = match latch {
        Latch::On => "on",
        Latch::HalfASecond => "on, for 0.5 s",
        Latch::Off => "off",
    };
    println!("| {name} | {latch} | {count} | {rolling} | {} | {nearest_cm:.1} cm |", touched - rolling);
}
