//! The table of docs/first-level.md: A-to-B trips of the whole vehicle with ours and with the
//! published law. `cargo run -p xtb-sim --example goto_table`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use trips::{Arrival, measure, quantile};
use xtb_control::VehicleConfig;
use xtb_control::vehicle::GotoLaw;

const TRIPS: u64 = 2000;

#[derive(serde::Deserialize)]
struct Published {
    vehicle: VehicleConfig,
}

fn main() {
    let ours = VehicleConfig::default();
    let mut edges = ours.clone();
    edges.goto.hysteresis_deg = 0.0;
    let mut law = ours.clone();
    law.goto.law = GotoLaw::Published;
    let profile: Published = toml::from_str(include_str!("../../../configs/published.toml")).unwrap();
    println!(
        "| | arrived | time / straight line: p50 | p95 | most | gear changes: none | one | 2 or 3 | more | most | off the goal: p50 | p95 |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    row("`goto.law = \"hysteresis\"`, 5°: the default", &ours);
    row("the same, `goto.hysteresis_deg = 0`", &edges);
    row("`goto.law = \"published\"`, all else ours", &law);
    row("`configs/published.toml`", &profile.vehicle);
}

fn row(name: &str, config: &VehicleConfig) {
    let all = measure(TRIPS, config);
    let share = |holds: &dyn Fn(&Arrival) -> bool| {
        format!("{:.1} %", 100.0 * all.iter().filter(|arrival| holds(arrival)).count() as f64 / TRIPS as f64)
    };
    let gears = |from: usize, to: usize| share(&move |arrival| (from..=to).contains(&arrival.gear_changes));
    let ratios: Vec<f64> = all.iter().filter_map(|arrival| arrival.ratio).collect();
    let ratio = |part: f64| quantile(ratios.clone(), part);
    let missed_m = |part: f64| quantile(all.iter().map(|arrival| arrival.missed_m).collect(), part);
    println!(
        "| {name} | {} | {:.2} | {:.2} | {:.2} | {} | {} | {} | {} | {} | {:.2} m | {:.2} m |",
        share(&|arrival| arrival.ratio.is_some()),
        ratio(0.5),
        ratio(0.95),
        ratio(1.0),
        gears(0, 0),
        gears(1, 1),
        gears(2, 3),
        gears(4, usize::MAX),
        all.iter().map(|arrival| arrival.gear_changes).max().unwrap_or(0),
        missed_m(0.5),
        missed_m(0.95),
    );
}
