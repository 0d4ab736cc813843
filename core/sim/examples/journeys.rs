//! The table of docs/navigation.md: planned goals at random, the whole robot on the whole vehicle.
//! `cargo run -p xtb-sim --example journeys [JOURNEYS] [SEED] [ROOM] [HINDER]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/journeys.rs"]
mod journeys;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use journeys::{Hinder, Journey, journeys, journeys_in_clutter};
use trips::quantile;
use xtb_protocol::messages::GoalStatus;

const ROOMS: [(&str, &str); 2] = [
    ("lab", include_str!("../../../worlds/lab.toml")),
    ("corridor", include_str!("../../../worlds/corridor.toml")),
];

fn main() {
    let argument = |n| std::env::args().nth(n).and_then(|text: String| text.parse().ok());
    let count = argument(1).unwrap_or(200);
    let first = argument(2).unwrap_or(0);
    println!(
        "| room | in the way | put there | reached | honest | to the last | contacts | off p50 | p95 | max | time of way p50 | p95 | stood max |"
    );
    let only = |n, name: &str| std::env::args().nth(n).is_none_or(|only| only == name);
    let names = ROOMS.map(|(name, _)| name).into_iter().chain(["clutter"]);
    for name in names.filter(|name| only(3, name)) {
        for hinder in Hinder::ALL.into_iter().filter(|hinder| only(4, &format!("{hinder:?}"))) {
            let seeds = first..first + count;
            let all = match ROOMS.iter().find(|room| room.0 == name) {
                Some((_, world)) => journeys(world, seeds, hinder),
                None => journeys_in_clutter(seeds, hinder),
            };
            row(name, hinder, &all);
            for bad in all.iter().filter(|journey| !journey.is_honest() || journey.contacts > 0) {
                println!("  {bad:?}");
            }
        }
    }
}

fn row(name: &str, hinder: Hinder, all: &[Journey]) {
    let reached: Vec<&Journey> =
        all.iter().filter(|journey| journey.status == Some(GoalStatus::Reached)).collect();
    let at = |part: f64, of: &dyn Fn(&Journey) -> f64| {
        quantile(reached.iter().map(|journey| of(journey)).collect(), part)
    };
    let off = |part| format!("{:.1} cm", at(part, &|journey| journey.off_m) * 100.0);
    let pace = |part| format!("{:.1}", at(part, &|journey| journey.took_s * 0.2 / journey.planned_m));
    println!(
        "| {name} | {hinder:?} | {} | {} of {} | {} | {} | {} | {} | {} | {} | {} | {} | {:.1} s |",
        all.iter().map(|journey| journey.hindered.len()).sum::<usize>(),
        reached.len(),
        all.len(),
        all.iter().filter(|journey| journey.is_honest()).count(),
        all.iter().filter(|journey| journey.is_honest_to_the_last()).count(),
        all.iter().map(|journey| journey.contacts).sum::<u64>(),
        off(0.5),
        off(0.95),
        off(1.0),
        pace(0.5),
        pace(0.95),
        all.iter().map(|journey| journey.stood_s).fold(0.0, f64::max),
    );
}
