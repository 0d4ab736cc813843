//! The figures of `docs/safety.md` that need real processes and real time.
//!
//! `cargo build --release && cargo bench -p fleet-tests --bench safety -- [--identities] WHAT [COUNT]`, where WHAT is
//! one of `kill`, `freeze`, `router`, `stops`, `flood` (COUNT in seconds) or nothing for all; with `--identities`
//! over TLS and with the rules of a registry, without `flood`, whose strangers would not come in. Exit code 1 if a
//! limit is missed.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)] // a bench that cannot go on shall end

use fleet_tests::load::{self, Flood};
use fleet_tests::processes::Process;
use fleet_tests::{Rig, Trial};
use std::process::{Command, ExitCode};
use std::time::Duration;

/// What a stranger sends in a millisecond.
const FLOOD_A_MS: usize = 20;
/// The first argument of the process of a stranger; the second is the router's endpoint.
const STRANGER: &str = "stranger";
const IDENTITIES: &str = "--identities";

fn main() -> ExitCode {
    let mut arguments: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    if let [STRANGER, endpoint] = arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        return runtime.block_on(async {
            let _flood = Flood::from(endpoint, FLOOD_A_MS).await;
            std::future::pending().await
        });
    }
    let identities = arguments.iter().any(|word| word == IDENTITIES);
    arguments.retain(|word| word != IDENTITIES);
    let (what, count) = (arguments.first(), arguments.get(1).and_then(|count| count.parse().ok()));
    let wanted = |name: &str| what.is_none_or(|what| what == name);
    let mut kept = true;
    runtime.block_on(async {
        if wanted("kill") {
            kept &= agents("kill -9 of the agent", count.unwrap_or(200), false, identities).await;
        }
        if wanted("freeze") {
            kept &= agents("SIGSTOP of the agent", count.unwrap_or(200), true, identities).await;
        }
        if wanted("router") {
            kept &= routers(count.unwrap_or(200), identities).await;
        }
        if wanted("stops") {
            kept &= stops(count.unwrap_or(1000), identities).await;
        }
        if wanted("flood") && !identities {
            kept &= flood(count.unwrap_or(60)).await;
        }
    });
    if kept { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// One line of trials: how long until neutral, and whether anything moved by itself afterwards.
fn told(what: &str, trials: &[Trial], limit_s: f64) -> bool {
    let mut took: Vec<f64> = trials.iter().map(|trial| trial.neutral_s * 1000.0).collect();
    took.sort_by(f64::total_cmp);
    let at = |share: f64| took[((took.len() - 1) as f64 * share) as usize];
    let (late, moved) = (took.iter().filter(|ms| **ms > limit_s * 1000.0).count(), moved(trials));
    println!(
        "{what}: {} times, neutral after {:.0} ms in the median, {:.0} p99, {:.0} at most (limit {:.0}): {late} late, {moved} moved by themselves",
        took.len(),
        at(0.5),
        at(0.99),
        at(1.0),
        limit_s * 1000.0
    );
    late == 0 && moved == 0
}

fn moved(trials: &[Trial]) -> usize {
    trials.iter().filter(|trial| trial.moved).count()
}

/// Some number between 0 and 1, another each time.
fn part(n: usize) -> f64 {
    (n as f64 * 0.618_033_988_75).fract()
}

/// The trials of one of the rigs, each with its own trucks and router; they run side by side.
async fn killed(count: usize, freeze: bool, identities: bool) -> Vec<Trial> {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(1, folder.path(), identities).await;
    let mut trials = Vec::new();
    for n in 0..count {
        eprint!("\r{n} of {count} ");
        trials.push(match freeze {
            false => rig.kill_agent(1, part(n) * 2.0).await,
            true => rig.freeze_agent(1, part(n) * 3.0).await,
        });
    }
    rig.end().await;
    trials
}

async fn agents(what: &str, count: usize, freeze: bool, identities: bool) -> bool {
    let third = count.div_ceil(3);
    let some = |count| killed(count, freeze, identities);
    let (first, second, last) = tokio::join!(some(third), some(third), some(count - 2 * third));
    told(what, &[first, second, last].concat(), 0.2)
}

/// Trials of teleop and of goals that halt, and how many of the goals that finish were reached.
async fn routed(count: usize, identities: bool) -> (Vec<Trial>, Vec<Trial>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(3, folder.path(), identities).await;
    let (mut teleop, mut halt, mut arrived) = (Vec::new(), Vec::new(), 0);
    for n in 0..count {
        eprint!("\r{n} of {count} ");
        let (first, second, missed) = rig.kill_router().await;
        teleop.push(first);
        halt.push(second);
        arrived += usize::from(missed.is_none());
        missed.iter().for_each(|why| eprintln!("not arrived: {why}"));
    }
    rig.end().await;
    (teleop, halt, arrived)
}

async fn routers(count: usize, identities: bool) -> bool {
    let third = count.div_ceil(3);
    let some = |count| routed(count, identities);
    let (first, second, last) = tokio::join!(some(third), some(third), some(count - 2 * third));
    let kept = told("kill -9 of the router, teleop", &[first.0, second.0, last.0].concat(), 0.25);
    let arrived = first.2 + second.2 + last.2;
    println!("kill -9 of the router, goal that finishes: {arrived} of {count} arrived");
    let halt = told("kill -9 of the router, goal that halts", &[first.1, second.1, last.1].concat(), 0.7);
    halt && kept && arrived == count
}

async fn stops(count: usize, identities: bool) -> bool {
    let load::Stops { took, lost, others_per_s } = load::stops(count, 1, identities).await;
    let at = |share: f64| took[((took.len() - 1) as f64 * share) as usize].as_secs_f64() * 1000.0;
    println!(
        "estop put → neutral frame, {count} times beside {others_per_s:.0} messages/s: p50 {:.1} ms, p99.9 {:.1} ms, max {:.1} ms, {lost} lost (limit 50 ms p99.9)",
        at(0.5),
        at(0.999),
        at(1.0)
    );
    lost == 0 && at(0.999) <= 50.0
}

async fn flood(seconds: usize) -> bool {
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::start(1, folder.path(), false).await;
    // Another process than the world's, as in life: the truck's board does not wait for who floods.
    let stranger = async |router: &str| {
        Process::start(Command::new(std::env::current_exe().unwrap()).args([STRANGER, router]))
    };
    let flooded = load::flood(&rig, stranger, Duration::from_secs(seconds as u64)).await;
    rig.end().await;
    let at =
        |share: f64| flooded.late_us[((flooded.late_us.len() - 1) as f64 * share) as usize] as f64 / 1000.0;
    let (turns, late) = flooded.turns;
    println!(
        "flood of {:.0} messages/s for {seconds} s: {late} of {turns} turns came more than 5 ms late (limit 0.1 %); the worst of each 50 ms by {:.2} ms p50, {:.2} p99, {:.2} max; {:.1} states/s; memory {:+} KiB (limit 32768); {}",
        flooded.arrived_per_s,
        at(0.5),
        at(0.99),
        at(1.0),
        flooded.states_hz,
        flooded.growth_kib,
        flooded.stood.as_ref().map_or("drove all the time".to_owned(), |why| format!("stood: {why}"))
    );
    late * 1000 <= turns
        && flooded.growth_kib <= 32 * 1024
        && flooded.states_hz >= 19.0
        && flooded.stood.is_none()
}
