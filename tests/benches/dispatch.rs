//! Kills: a fleet of five works through 200 tasks, again and again, while somebody is killed with `kill -9` at
//! random times; the figures of `docs/dispatch.md`.
//!
//! `cargo build --release && cargo bench -p fleet-tests --bench dispatch -- WHAT [KILLS] [SEED] [SPEED]`, where
//! WHAT is one of
//!
//! - `kill`: the dispatcher's process, 0 to 1.5 s after it was ready (1,000 times; the world at 4 times real time)
//! - `standby`: the dispatcher's process and its stand-by's in turns, 0 to 1.5 s after they were a pair, each second
//!   time two of them within 0.8 s (200 times; the world at 4 times real time)
//! - `robots`: the robots' agents, one at a time (1,000 times; the world at real time)
//! - `cuts`: cables between three computers (network namespaces) with two robots each, a dispatcher at one and its
//!   stand-by at another one, for 0.3 to 10 s each (100 times; real time)
//!
//! or nothing for all. Exit code 1 if anything was lost, done twice or not done, 130 after Ctrl-C.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)] // a bench that cannot go on shall end

use fleet_cli::interrupt::interrupted;
use fleet_tests::dispatch::{Storm, Whom};
use fleet_tests::mesh::Cuts;
use std::process::ExitCode;

const KILLS: usize = 1_000;
const KILLS_OF_PAIRS: usize = 200;
const CUTS: usize = 100;
const TELL_EVERY: usize = 50;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let number = |index: usize| arguments.get(index).and_then(|word| word.parse::<f64>().ok());
    let first = arguments.first().map(String::as_str);
    let seed = number(2).map_or(1, |seed| seed as u64);
    let whats = [("kill", Whom::Dispatcher), ("standby", Whom::Pair), ("robots", Whom::Robots)];
    let wanted = whats.iter().filter(|(name, _)| first.is_none_or(|what| what == *name));
    let storms: Vec<(&str, Storm)> = wanted
        .map(|&(name, whom)| {
            let usual = if whom == Whom::Pair { KILLS_OF_PAIRS } else { KILLS };
            let kills = number(1).map_or(usual, |kills| kills as usize);
            (name, Storm { whom, kills, tasks: 200, robots: 5, seed, speed: number(3).unwrap_or(4.0) })
        })
        .collect();
    let cuts = number(1).map_or(CUTS, |cuts| cuts as usize);
    let cuts = first.is_none_or(|what| what == "cuts").then(|| Cuts::random(cuts, seed));
    if storms.is_empty() && cuts.is_none() {
        eprintln!("neither kill, standby, robots nor cuts: {}", arguments.join(" "));
        return ExitCode::from(2);
    }
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let kept = runtime.block_on(async {
        tokio::select! {
            kept = all(&storms, cuts, seed) => Some(kept),
            () = interrupted() => None, // what is dropped here ends its processes
        }
    });
    match kept {
        Some(true) => ExitCode::SUCCESS,
        Some(false) => ExitCode::FAILURE,
        None => ExitCode::from(130),
    }
}

async fn all(storms: &[(&str, Storm)], cuts: Option<Cuts>, seed: u64) -> bool {
    let mut kept = true;
    for (name, storm) in storms {
        let folder = folder();
        let totals = storm.pass(folder.path(), |kill| tell(name, kill, storm.kills)).await;
        kept &= judge(name, seed, totals.is_kept(), &totals);
    }
    if let Some(cuts) = cuts {
        let folder = folder();
        match cuts.pass(folder.path(), |cut| tell("cuts", cut, cuts.0.len())).await {
            Ok(totals) => kept &= judge("cuts", seed, totals.is_kept(), &totals),
            Err(why) => println!("cuts: no network namespaces here: {why}"),
        }
    }
    kept
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir_in(env!("CARGO_TARGET_TMPDIR")).unwrap()
}

fn tell(name: &str, done: usize, of: usize) {
    if done.is_multiple_of(TELL_EVERY) {
        println!("{name}: {done} of {of}");
    }
}

fn judge(name: &str, seed: u64, is_kept: bool, totals: &dyn std::fmt::Display) -> bool {
    println!("{name}, seed {seed}: {}\n{totals}", if is_kept { "kept" } else { "MISSED" });
    is_kept
}
