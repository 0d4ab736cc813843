//! Robots in each other's way, live: real processes, real Zenoh, real time; the figures of `docs/navigation.md`.
//!
//! `cargo build --release && cargo bench -p fleet-tests --bench traffic -- WHAT [ROUNDS]`, where WHAT is one of
//!
//! - `door`: five swap places through one door, and back (20 rounds)
//! - `circle`: ten swap across a circle in 8 × 8 m (3 rounds, each a new fleet)
//! - `corridor`: nose to nose in a narrow place, one must back out (3)
//! - `killed`: the door, each agent a process, that of the first truck in the doorway is killed (3)
//! - `restart`: the door, traffic control is killed in each round and comes back (3)
//!
//! or nothing for all. The scenes are those of `core/chaos/tests/it/together.rs`. With `SHOW=5` everybody is shown
//! each 5 s. Exit code 1 if a limit is missed, 130 after Ctrl-C.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)] // a bench that cannot go on shall end

use fleet_cli::interrupt::interrupted;
use fleet_tests::Live;
use fleet_tests::live::{Told, Trouble};
use std::process::ExitCode;
use xtb_chaos::meetings::{Meeting, ObservedRobot, Setting};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let (what, count) = (arguments.first(), arguments.get(1).and_then(|count| count.parse().ok()));
    let scenes = [("door", 20), ("circle", 3), ("corridor", 3), ("killed", 3), ("restart", 3)];
    let wanted = scenes.iter().filter(|(name, _)| what.is_none_or(|what| what == name));
    let wanted: Vec<_> = wanted.map(|&(name, rounds)| (name, count.unwrap_or(rounds))).collect();
    if wanted.is_empty() {
        eprintln!("no such scene: {}", arguments.join(" "));
        return ExitCode::from(2);
    }
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let kept = runtime.block_on(async {
        tokio::select! {
            kept = all(&wanted) => Some(kept),
            () = interrupted() => None, // what is dropped here ends its processes
        }
    });
    match kept {
        Some(true) => ExitCode::SUCCESS,
        Some(false) => ExitCode::FAILURE,
        None => ExitCode::from(130),
    }
}

async fn all(wanted: &[(&'static str, usize)]) -> bool {
    let mut rows = Vec::new();
    for &(name, rounds) in wanted {
        let told = scene(name, rounds).await;
        rows.push(row(name, &told));
    }
    println!();
    println!(
        "| scene | rounds kept | reached | contacts | stood | waited | a round | real time | turns late |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    rows.iter().for_each(|(line, _)| println!("{line}"));
    println!("limits: 0 contacts, stood 15 s (not for a named moving truck), waited 60 s (whatever for)");
    rows.iter().all(|(_, kept)| *kept)
}

async fn scene(name: &str, rounds: usize) -> Vec<Told> {
    let trouble = match name {
        "killed" => Trouble::Death,
        "restart" => Trouble::Restart,
        _ => Trouble::None,
    };
    // The door's rounds go on where the last one ended, unless a truck stays in it.
    let goes_on = matches!(name, "door" | "restart");
    let (mut live, mut told) = (None, Vec::new());
    for round in 1..=rounds {
        let setting = match name {
            "circle" => Setting::circle(10),
            "corridor" => Setting::narrow(),
            "killed" => Setting::door(1),
            _ => Setting::door(round),
        };
        let (mut fleet, folder) = match live.take() {
            Some(fleet) => fleet,
            None => {
                let folder = tempfile::tempdir().unwrap();
                (Live::start(&setting, round as u64, name == "killed", folder.path()).await, folder)
            }
        };
        let made = fleet.meet(&setting.goals, trouble, &mut show()).await;
        tell(name, round, &made);
        told.push(made);
        live = goes_on.then_some((fleet, folder));
    }
    told
}

/// With `SHOW=5`, everybody in a line each 5 s.
fn show() -> impl FnMut(&Meeting, &[ObservedRobot]) + Send {
    let every_s: Option<f64> = std::env::var("SHOW").ok().and_then(|text| text.parse().ok());
    let mut next_s = 0.0;
    move |made, sights| {
        let Some(every_s) = every_s.filter(|_| made.took_s >= next_s) else { return };
        next_s += every_s;
        println!("{:.1} s", made.took_s);
        sights.iter().for_each(|sight| println!("  {}", sight.words()));
    }
}

/// A round in a line, and what was wrong with it.
fn tell(name: &str, round: usize, told: &Told) {
    let Meeting { reached, contacts, stood_s, waited_s, took_s, .. } = &told.meeting;
    println!(
        "{name} {round}: {reached} of {} reached, {contacts} contacts, stood {stood_s:.1} s, waited {waited_s:.1} s, \
         took {took_s:.0} s in {:.0} s, {} turns late{}{}",
        told.meeting.ends.len(),
        told.wall_s,
        told.turns_late,
        told.killed.as_ref().map_or_else(String::new, |robot| format!(", {robot} killed")),
        if told.is_kept() { "" } else { ": MISSED" }
    );
    if told.is_kept() {
        return;
    }
    told.meeting.touched.iter().for_each(|touched| println!("  touched: {touched}"));
    println!("  stood for: {}", told.meeting.stood_for);
    println!("  ends: {:?}", told.meeting.ends);
    told.latched.iter().for_each(|latched| println!("  latched: {latched}"));
}

/// A scene in a line of the table, and whether every round kept its limits.
fn row(name: &str, told: &[Told]) -> (String, bool) {
    let most = |of: fn(&Meeting) -> f64| told.iter().map(|one| of(&one.meeting)).fold(0.0, f64::max);
    let sum = |of: fn(&Told) -> f64| told.iter().map(of).sum::<f64>();
    let kept = told.iter().filter(|one| one.is_kept()).count();
    let line = format!(
        "| {name} | {kept} of {} | {} of {} | {} | {:.1} s | {:.1} s | {:.0} s | × {:.2} | {} |",
        told.len(),
        told.iter().map(|one| one.meeting.reached).sum::<usize>(),
        told.iter().map(|one| one.meeting.ends.len()).sum::<usize>(),
        told.iter().map(|one| one.meeting.contacts).sum::<u64>(),
        most(|made| made.stood_s),
        most(|made| made.waited_s),
        sum(|one| one.meeting.took_s) / told.len().max(1) as f64,
        sum(|one| one.meeting.took_s) / sum(|one| one.wall_s),
        told.iter().map(|one| one.turns_late).sum::<u64>(),
    );
    (line, kept == told.len())
}
