//! How well the second level's follower parks: goals with changes of gear, the whole vehicle.
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
#[path = "../tests/it/pillars.rs"]
mod pillars;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use parkings::{Course, Eyes, Parked, measure};
use pillars::Margins;
use trips::quantile;

const MARGINS: Option<Margins> = Some(Margins { body_m: 0.02, look_out_m: 0.28 });

fn main() {
    let parkings = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(500);
    println!(
        "| | reached | contacts | held | alarms | off the goal, cm: p50 | p95 | most | yaw, °: p50 | p95 | most | beside the path, cm: p95 | most | corner outside, cm: p95 | most | past a stop, cm: p95 | most | time, s: p50 | p95 | most |"
    );
    println!("| --- {}|", "| ---: ".repeat(19));
    let between =
        |cruise_mps, radius_factor| Course { margins: MARGINS, ..Course::new(cruise_mps, radius_factor) };
    for radius_factor in [1.05, 1.1, 1.15, 1.2] {
        row(
            &format!("0.35 m/s, {radius_factor} R, between pillars"),
            parkings,
            &between(0.35, radius_factor),
        );
    }
    row("0.2 m/s, 1.1 R, between pillars", parkings, &between(0.2, 1.1));
    row("0.2 m/s, 1.15 R, between pillars", parkings, &between(0.2, 1.15));
    row("0.35 m/s, 1.15 R, up to 3 m away", parkings, &Course { reach_m: 3.0, ..Course::new(0.35, 1.15) });
    row(
        "0.35 m/s, 1.15 R, pose from fixes",
        parkings,
        &Course { eyes: Eyes::Fixes, ..Course::new(0.35, 1.15) },
    );
    row(
        "0.35 m/s, 1.15 R, odometry alone",
        parkings,
        &Course { eyes: Eyes::Odometry, ..Course::new(0.35, 1.15) },
    );
}

fn row(name: &str, parkings: u64, course: &Course) {
    let all = measure(parkings, course);
    let at = |part: f64, of: &dyn Fn(&Parked) -> f64| quantile(all.iter().map(of).collect(), part);
    let parts = |parts: &[f64], unit: f64, of: &dyn Fn(&Parked) -> f64| {
        parts.iter().map(|part| format!("{:.1}", at(*part, of) * unit)).collect::<Vec<_>>().join(" | ")
    };
    let count = |holds: &dyn Fn(&Parked) -> bool| all.iter().filter(|parked| holds(parked)).count();
    println!(
        "| {name} | {} of {parkings} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
        count(&|parked| parked.reached),
        all.iter().map(|parked| parked.contacts).sum::<u64>(),
        count(&|parked| parked.blocked_s > 0.0),
        count(&|parked| parked.alarmed),
        parts(&[0.5, 0.95, 1.0], 100.0, &|parked| parked.missed_m),
        parts(&[0.5, 0.95, 1.0], 1.0, &|parked| parked.missed_deg),
        parts(&[0.95, 1.0], 100.0, &|parked| parked.beside_m),
        parts(&[0.95, 1.0], 100.0, &|parked| parked.outside_m),
        parts(&[0.95, 1.0], 100.0, &|parked| parked.overshoot_m),
        parts(&[0.5, 0.95, 1.0], 1.0, &|parked| parked.took_s),
    );
}
