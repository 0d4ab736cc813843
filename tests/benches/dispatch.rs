//! Kills: a fleet of five works through 200 tasks, again and again, while somebody is killed with `kill -9` at
//! random times; the figures of `docs/dispatch.md`.
//!
//! `cargo build --release && cargo bench -p fleet-tests --bench dispatch -- WHAT [KILLS] [SEED] [SPEED]`, where
//! WHAT is one of
//!
//! - `kill`: the dispatcher's process, 0 to 1.5 s after it was ready (1,000 times; the world at 4 times real time)
//! - `standby`: the dispatcher's process and its stand-by's in turns, 0 to 1.5 s after they were a pair (200 times;
//!   the world at 4 times real time)
//! - `robots`: the robots' agents, one at a time (1,000 times; the world at real time)
//!
//! or nothing for all. Exit code 1 if anything was lost, done twice or not done, 130 after Ctrl-C.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)] // a bench that cannot go on shall end

use fleet_cli::interrupt::interrupted;
use fleet_tests::dispatch::{Storm, Whom};
use std::process::ExitCode;

const KILLS: usize = 1_000;
const KILLS_OF_PAIRS: usize = 200;
const TELL_EVERY: usize = 50;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let number = |index: usize| arguments.get(index).and_then(|word| word.parse::<f64>().ok());
    let whats = [("kill", Whom::Dispatcher), ("standby", Whom::Pair), ("robots", Whom::Robots)];
    let wanted = whats.iter().filter(|(name, _)| arguments.first().is_none_or(|what| what == name));
    let storms: Vec<(&str, Storm)> = wanted
        .map(|&(name, whom)| {
            let usual = if whom == Whom::Pair { KILLS_OF_PAIRS } else { KILLS };
            let kills = number(1).map_or(usual, |kills| kills as usize);
            let seed = number(2).map_or(1, |seed| seed as u64);
            (name, Storm { whom, kills, tasks: 200, robots: 5, seed, speed: number(3).unwrap_or(4.0) })
        })
        .collect();
    if storms.is_empty() {
        eprintln!("neither kill, standby nor robots: {}", arguments.join(" "));
        return ExitCode::from(2);
    }
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let kept = runtime.block_on(async {
        tokio::select! {
            kept = all(&storms) => Some(kept),
            () = interrupted() => None, // what is dropped here ends its processes
        }
    });
    match kept {
        Some(true) => ExitCode::SUCCESS,
        Some(false) => ExitCode::FAILURE,
        None => ExitCode::from(130),
    }
}

async fn all(storms: &[(&str, Storm)]) -> bool {
    let mut kept = true;
    for (name, storm) in storms {
        let folder = tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap();
        let each = |kill: usize| {
            if kill.is_multiple_of(TELL_EVERY) {
                println!("{name}: {kill} of {}", storm.kills);
            }
        };
        let totals = storm.pass(folder.path(), each).await;
        println!(
            "{name}, seed {}: {}\n{totals}",
            storm.seed,
            if totals.is_kept() { "kept" } else { "MISSED" }
        );
        kept &= totals.is_kept();
    }
    kept
}
