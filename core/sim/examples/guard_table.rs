//! How fast each guard of sensors, drive and battery sees its fault: `cargo run -p xtb-sim --example
//! guard_table`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/draw.rs"]
mod draw;
#[path = "../tests/it/hazards.rs"]
mod hazards;
#[allow(dead_code)]
#[path = "../tests/it/whole_robot.rs"]
mod whole_robot;

use hazards::HAZARDS;

const RUNS: u64 = 200;

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
}
