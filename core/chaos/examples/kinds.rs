//! The figures of docs/vehicles.md: the vehicles of configs/vehicles all together in the lab under traffic control, the
//! whole robots on the whole vehicles, each always under way to some goal. `cargo run -p xtb-chaos --example kinds [SEEDS] [FIRST SEED] [SECONDS]`
//! (10, 1, 300). The exit code is 1 if anything was touched, or a goal
//! failed to which there was a way.

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
    let mut wrongly = 0;
    for (seed, life) in (first..).zip(&lives) {
        let Life { reached, failed, contacts, stood_s, touched, .. } = life;
        println!("| {seed} | {reached} | {} | {contacts} | {stood_s:.1} s |", failed.len());
        for failed in failed {
            let (name, here) = (FILES[failed.robot].0, failed.poses[failed.robot]);
            let held = vehicles::is_held_by_the_lane(failed);
            wrongly += u32::from(!held);
            println!(
                "  {:.0} s {name} at ({:.2}, {:.2}, {:.2}) to {:.2?}: {} ({})",
                failed.at_s,
                here.x_m,
                here.y_m,
                here.yaw_rad,
                failed.goals[failed.robot],
                failed.reason,
                if held { "held by the one-way lane" } else { "WRONGLY" }
            );
        }
        touched.iter().for_each(|words| println!("  {words}"));
    }
    let reached: u32 = lives.iter().map(|life| life.reached).sum();
    let failed: usize = lives.iter().map(|life| life.failed.len()).sum();
    let contacts: u64 = lives.iter().map(|life| life.contacts).sum();
    println!("| {} | {reached} | {failed} | {contacts} | |\n\n{wrongly} failed wrongly", lives.len());
    ExitCode::from(u8::from(wrongly > 0 || contacts > 0))
}
