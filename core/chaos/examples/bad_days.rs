//! Days of the virtual fleet on all cores: `cargo run -p xtb-chaos --example bad_days [-- SEEDS [FIRST]]`.
//! Prints each broken rule with its last lines, then totals. Ends with 1 if a rule was broken.
//!
//! `-- guards [SEEDS]` instead switches each rule of the agent off in turn and prints the first seed that
//! finds it out.

#![allow(clippy::print_stdout)]

use std::collections::BTreeMap;
use std::ops::Range;
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;
use xtb_chaos::{DayReport, ScenarioError, ScenarioOptions};
use xtb_robot::{Guard, Guards};

/// Violations printed in full.
const SHOWN: usize = 5;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let number = |i: usize, default: u64| args.get(i).and_then(|arg| arg.parse().ok()).unwrap_or(default);
    if args.first().is_some_and(|arg| arg == "guards") {
        return guards(number(1, 300));
    }
    let (count, first) = (number(0, 10_000), number(1, 0));
    let began = Instant::now();
    let mut broken: Vec<DayReport> = Vec::new();
    let (mut fleet_s, mut robot_s, mut total) = (0.0, 0.0, xtb_chaos::DayCounts::default());
    let all = Mutex::new(|report: DayReport| {
        fleet_s += report.lasted_ms as f64 / 1000.0;
        robot_s += report.lasted_ms as f64 / 1000.0 * report.robots as f64;
        total += report.counts;
        if report.violation.is_some() {
            broken.push(report);
        }
    });
    on_all_cores(first..first + count, ScenarioOptions::default(), |seed, day| match day {
        Ok(report) => all.lock().unwrap_or_else(PoisonError::into_inner)(report),
        Err(error) => println!("seed {seed}: {error}"),
    });
    let wall_s = began.elapsed().as_secs_f64();
    broken.sort_by_key(|report| report.seed);
    let mut kinds: BTreeMap<_, Vec<u64>> = BTreeMap::new();
    for report in &broken {
        let Some(violation) = &report.violation else { continue };
        kinds.entry(violation.invariant).or_default().push(report.seed);
    }
    for report in broken.iter().take(SHOWN) {
        println!("{report}\n");
    }
    for (invariant, seeds) in &kinds {
        println!("{invariant}: broken by {} seeds, first {:?}", seeds.len(), &seeds[..seeds.len().min(12)]);
    }
    println!("{count} days, {} rules broken; {total}", broken.len());
    println!(
        "{fleet_s:.0} fleet-seconds ({robot_s:.0} robot-seconds) in {wall_s:.1} s: {:.0} fleet-seconds a second",
        fleet_s / wall_s
    );
    if broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// With each rule switched off, the first seed that breaks an invariant.
fn guards(count: u64) -> ExitCode {
    let mut unseen = 0;
    println!("| rule switched off | first seed | of {count} | invariant |\n| --- | ---: | ---: | --- |");
    for guard in Guard::ALL {
        let found = Mutex::new(BTreeMap::new());
        on_all_cores(0..count, ScenarioOptions { guards: Guards::without(guard) }, |seed, day| {
            if let Ok(DayReport { violation: Some(violation), .. }) = day {
                found.lock().unwrap_or_else(PoisonError::into_inner).insert(seed, violation.invariant);
            }
        });
        let found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
        match found.first_key_value() {
            Some((seed, invariant)) => println!("| {guard:?} | {seed} | {} | {invariant} |", found.len()),
            None => println!("| {guard:?} | none | 0 | |"),
        }
        unseen += u32::from(found.is_empty());
    }
    if unseen == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// The days of these seeds; `ended` hears of each, on any thread.
fn on_all_cores(
    seeds: Range<u64>,
    options: ScenarioOptions,
    ended: impl Fn(u64, Result<DayReport, ScenarioError>) + Sync,
) {
    let seeds = Mutex::new(seeds);
    let next = || seeds.lock().unwrap_or_else(PoisonError::into_inner).next();
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| xtb_chaos::run_all(std::iter::from_fn(next), options, &ended));
        }
    });
}
