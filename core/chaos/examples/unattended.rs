//! The unattended day of docs/dispatch.md: five robots, three docks, nobody who helps.
//! `cargo run --release -p xtb-chaos --example unattended [HOURS] [SEED]`; exit code 1 if a battery was too low, a robot
//! stuck, a task failed or anything touched.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/dispatched.rs"]
mod dispatched;
#[allow(dead_code)]
#[path = "../../sim/tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/meetings.rs"]
mod meetings;
#[path = "../tests/it/unattended.rs"]
mod unattended;

use std::time::Instant;
use unattended::{Day, Figures, spend};

fn main() {
    let number = |n, default| std::env::args().nth(n).and_then(|text| text.parse().ok()).unwrap_or(default);
    let (hours, seed) = (number(1, 12), number(2, 1));
    let began = Instant::now();
    println!(
        "| hour | goals | patrols | charges | parked | least charge | driven | contacts | stuck | failed |"
    );
    println!("| ---: | ---: | ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let figures =
        spend(&Day { minutes: hours * 60, seed, capacity_mah: 3000.0, kill_each: 97, show: each_hour });
    for what in figures.failed.iter().chain(&figures.stuck) {
        println!("{what}");
    }
    println!(
        "too low for {} s, two at one dock for {} s, longest goal {:.0} s, dispatcher killed {} times; took {:.0} s",
        figures.too_low_s,
        figures.shared_s,
        figures.longest_goal_s,
        figures.kills,
        began.elapsed().as_secs_f64()
    );
    figures.check();
}

fn each_hour(figures: &Figures) {
    if !figures.at_min.is_multiple_of(60) {
        return;
    }
    let least = figures.least.iter().copied().fold(1.0, f64::min);
    println!(
        "| {} | {} | {} | {:?} | {} | {:.0} % | {:.0} m | {} | {} | {} |",
        figures.at_min / 60,
        figures.goals,
        figures.patrols,
        figures.charges,
        figures.parked,
        least * 100.0,
        figures.driven_m.iter().sum::<f64>(),
        figures.contacts,
        figures.stuck.len(),
        figures.failed.len()
    );
}
