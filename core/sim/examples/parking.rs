//! The table of docs/navigation.md: 500 parkings with changes of gear, the whole vehicle.
//! `cargo run -p xtb-sim --example parking [PARKINGS]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/parkings.rs"]
mod parkings;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use parkings::{Course, Eyes, Parked, measure};
use trips::quantile;

fn main() {
    let parkings = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(500);
    println!(
        "| pose | cruise | radius | reached | contacts | off the goal: p50 | p95 | most | yaw: p50 | p95 | most | beside the path: p95 | most | corner outside: p95 | most | past a stop: p95 | most | time: p50 | p95 | most |"
    );
    println!("| {}", "--- | ".repeat(20).trim_end());
    for (cruise_mps, radius_factor) in
        [(0.35, 1.05), (0.35, 1.1), (0.35, 1.15), (0.35, 1.2), (0.2, 1.1), (0.2, 1.15)]
    {
        row(parkings, &Course::new(cruise_mps, radius_factor));
    }
    row(parkings, &Course { eyes: Eyes::Odometry, ..Course::new(0.35, 1.15) });
}

fn row(parkings: u64, course: &Course) {
    let all = measure(parkings, course);
    let at = |part: f64, of: &dyn Fn(&Parked) -> f64| quantile(all.iter().map(of).collect(), part);
    let three = |unit: f64, digits: usize, of: &dyn Fn(&Parked) -> f64| {
        [0.5, 0.95, 1.0].map(|part| format!("{:.digits$}", at(part, of) * unit)).join(" | ")
    };
    let two = |of: &dyn Fn(&Parked) -> f64| {
        [0.95, 1.0].map(|part| format!("{:.1} cm", at(part, of) * 100.0)).join(" | ")
    };
    let reached = all.iter().filter(|parked| parked.reached).count();
    let contacts: u64 = all.iter().map(|parked| parked.contacts).sum();
    println!(
        "| {:?} | {} m/s | {} R | {reached} of {parkings} | {contacts} | {} | {} | {} | {} | {} | {} |",
        course.eyes,
        course.cruise_mps,
        course.radius_factor,
        three(100.0, 1, &|parked| parked.missed_m),
        three(1.0, 1, &|parked| parked.missed_deg),
        two(&|parked| parked.beside_m),
        two(&|parked| parked.outside_m),
        two(&|parked| parked.overshoot_m),
        three(1.0, 1, &|parked| parked.took_s),
    );
}
