//! How fast each guard of sensors, drive and battery sees its fault, and how often it sees one where
//! there is none: `cargo run -p xtb-sim --example guard_table`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/draw.rs"]
mod draw;
#[path = "../tests/it/hazards.rs"]
mod hazards;
#[path = "../tests/it/ordinary.rs"]
mod ordinary;
#[allow(dead_code)]
#[path = "../tests/it/whole_robot.rs"]
mod whole_robot;

use hazards::HAZARDS;
use ordinary::KINDS;
use xtb_control::VehicleConfig;

const RUNS: u64 = 200;
const DRIVES: u64 = 1000;

fn main() {
    println!("{RUNS} drives each.\n");
    println!("| hazard | fault | limit | named: worst | motor neutral: worst | fastest after it |");
    println!("| --- | --- | ---: | ---: | ---: | ---: |");
    for hazard in &HAZARDS {
        let all = hazard.measure(RUNS);
        let worst = |ms: fn(&hazards::Outcome) -> Option<u64>| {
            let times: Option<Vec<u64>> = all.iter().map(ms).collect();
            times.map_or("never".to_owned(), |times| format!("{} ms", times.into_iter().max().unwrap_or(0)))
        };
        let (named, neutral) = (worst(|outcome| outcome.named_ms), worst(|outcome| outcome.neutral_ms));
        let fastest_mps = all.iter().map(|outcome| outcome.fastest_mps).fold(0.0, f64::max);
        let (name, fault, limit_ms) = (hazard.name, hazard.fault, hazard.limit_ms);
        println!("| {name} | `{fault}` | {limit_ms} ms | {named} | {neutral} | {fastest_mps:.2} m/s |");
    }
    println!("\nFalse alarms in {DRIVES} ordinary drives each, by `guard.runaway_s` and `guard.stall_s`:\n");
    println!("| drives | 0.3 and 0.4: the default | 0.2 and 0.2 | 0.1 and 0.1 |");
    println!("| --- | --- | --- | --- |");
    for kind in KINDS {
        let [default, less, least] = [(0.3, 0.4), (0.2, 0.2), (0.1, 0.1)].map(|(runaway_s, stall_s)| {
            let mut config = VehicleConfig::default();
            (config.guard.runaway_s, config.guard.stall_s) = (runaway_s, stall_s);
            kind.alarms(DRIVES, &config)
        });
        println!("| {kind:?} | {default:?} | {less:?} | {least:?} |");
    }
}
