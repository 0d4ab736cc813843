//! The figures of docs/vehicles.md: the vehicles of configs/vehicles all together in the lab under traffic control, the
//! whole robots on the whole vehicles. `cargo run -p xtb-chaos --example vehicles [SEEDS] [FIRST SEED] [SECONDS]`
//! (10, 1, 300). The exit code is 1 if anything was touched or a goal was not reached.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../../sim/tests/it/any_car.rs"]
mod any_car;
#[allow(dead_code)]
#[path = "../../sim/tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../../sim/tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/lifelong.rs"]
mod lifelong;
#[allow(dead_code)]
#[path = "../tests/it/vehicles.rs"]
mod vehicles;

use any_car::FILES;
use lifelong::Life;
use std::process::ExitCode;

fn main() -> ExitCode {
    let argument = |n, default| std::env::args().nth(n).and_then(|text| text.parse().ok()).unwrap_or(default);
    let (seeds, first, seconds) = (argument(1, 10), argument(2, 1), argument(3, 300));
    println!(
        "| seed | reached | failed | contacts | nobody moved for |\n| ---: | ---: | ---: | ---: | ---: |"
    );
    let lives = draw::in_parallel(first..first + seeds, |seed| vehicles::all_kinds(seed, seconds as f64));
    for (seed, life) in (first..).zip(&lives) {
        let Life { reached, failed, contacts, stood_s, touched, .. } = life;
        println!("| {seed} | {reached} | {} | {contacts} | {stood_s:.1} s |", failed.len());
        for failed in failed {
            let (goal, (name, _)) = (failed.goals[failed.robot], FILES[failed.robot]);
            println!(
                "  {:.0} s {name} at {:.2?} to {goal:.2?}: {}",
                failed.at_s, failed.poses[failed.robot], failed.reason
            );
        }
        touched.iter().for_each(|words| println!("  {words}"));
    }
    let reached: u32 = lives.iter().map(|life| life.reached).sum();
    let failed: usize = lives.iter().map(|life| life.failed.len()).sum();
    let contacts: u64 = lives.iter().map(|life| life.contacts).sum();
    println!("| {} | {reached} | {failed} | {contacts} | |", lives.len());
    ExitCode::from(u8::from(failed > 0 || contacts > 0))
}
