//! The table of docs/navigation.md: how fast a truck goes whose wheels are not what the settings say, on planned
//! goals with fixes at 2 Hz. `cargo run --release -p xtb-sim --example wheels [TRUCKS [FIRST_SEED]]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/wheels.rs"]
mod wheels;

const SECONDS: f64 = 300.0;
/// Part of the pulses that the settings say.
const PULSES: [f64; 7] = [0.75, 0.8, 0.9, 1.0, 1.1, 1.2, 1.25];

fn main() {
    let numbers: Vec<u64> = std::env::args().skip(1).map(|word| word.parse().unwrap()).collect();
    let trucks = numbers.first().copied().unwrap_or(20);
    let first = numbers.get(1).copied().unwrap_or(6000);
    println!(
        "| pulses | known after, at most | fastest before | fastest after | p95 | said off by, p95 | fault | refused | reached |"
    );
    println!("| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for pulses in PULSES {
        let made = wheels::runs(first..first + trucks, pulses, SECONDS);
        let most = |of: &dyn Fn(&wheels::WheelRun) -> f64| made.iter().map(of).fold(0.0, f64::max);
        let all = |of: fn(&wheels::WheelRun) -> &Vec<f64>| {
            let mut values: Vec<f64> = made.iter().flat_map(of).copied().collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let at = |values: &[f64], part: f64| {
            values.get((part * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(f64::NAN)
        };
        let (after, off) = (all(|run| &run.after_mps), all(|run| &run.said_off_mps));
        let count = |is: fn(&wheels::WheelRun) -> bool| made.iter().filter(|run| is(run)).count();
        println!(
            "| {:.0} % | {:.0} s | {:.2} m/s | {:.2} m/s | {:.2} m/s | {:.3} m/s | {} | {} | {} |",
            100.0 * pulses,
            most(&|run| run.known_s.unwrap_or(f64::INFINITY)),
            most(&|run| run.before_mps),
            at(&after, 1.0),
            at(&after, 0.95),
            at(&off, 0.95),
            count(|run| run.fault),
            count(|run| run.refused),
            made.iter().map(|run| run.reached).sum::<u32>(),
        );
    }
}
