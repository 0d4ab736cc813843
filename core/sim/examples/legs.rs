//! The table of docs/navigation.md: planned goals among the legs of tables that no map knows of.
//! `cargo run --release -p xtb-sim --example legs [ROOMS] [SEED] [legs|empty]`

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
#[path = "../tests/it/legs.rs"]
mod legs;
#[allow(dead_code)]
#[path = "../tests/it/trips.rs"]
mod trips;

use legs::{LegJourney, rooms_of_legs};
use trips::quantile;
use xtb_protocol::messages::GoalStatus;

/// Rooms that are worked off before something is printed.
const AT_ONCE: u64 = 20;

fn main() {
    let argument = |n| std::env::args().nth(n).and_then(|text: String| text.parse().ok());
    let (rooms, first) = (argument(1).unwrap_or(100), argument(2).unwrap_or(0));
    let only = std::env::args().nth(3);
    for (name, with_legs) in [("legs", true), ("empty", false)] {
        if only.as_ref().is_some_and(|only| only != name) {
            continue;
        }
        let mut all = Vec::new();
        for from in (first..first + rooms).step_by(AT_ONCE as usize) {
            let some = rooms_of_legs(from..(from + AT_ONCE).min(first + rooms), with_legs);
            for journey in some.iter().filter(|journey| !journey.contacts.is_empty() || journey.false_failure)
            {
                println!("  {journey:?}");
            }
            all.extend(some);
        }
        println!(
            "| room | goals | contacts | goals with one | arrived | failed, truly | falsely | `stalled` | time p50 | all |"
        );
        row(name, &all);
    }
}

fn row(name: &str, all: &[LegJourney]) {
    let count = |is: &dyn Fn(&LegJourney) -> bool| all.iter().filter(|journey| is(journey)).count();
    let reached = |journey: &LegJourney| journey.status == Some(GoalStatus::Reached);
    let times: Vec<f64> = all.iter().map(|journey| journey.took_s).collect();
    println!(
        "| {name} | {} | {} | {} | {} | {} | {} | {} | {:.1} s | {:.0} s |",
        all.len(),
        all.iter().map(|journey| journey.contacts.len()).sum::<usize>(),
        count(&|journey| !journey.contacts.is_empty()),
        count(&reached),
        count(&|journey| !reached(journey) && !journey.false_failure),
        count(&|journey| journey.false_failure),
        count(&LegJourney::stalled),
        quantile(times.clone(), 0.5),
        times.iter().sum::<f64>(),
    );
}
