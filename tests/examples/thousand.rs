//! Measures a simulated fleet as people use it: the tables of docs/simulator.md.
//! `cargo build --release --workspace && cargo run --release -p fleet-tests --example thousand [wander|drive] [split] [N…]`
//!
//! For each number of robots a `fleet-cli sim` as a process of its own, or with `split` two that each move half of them
//! in one world; all wander, or drive alone to planned goals (pairs of neighbours swap their places, again and again). Measured from outside: states, CPU time,
//! memory, `list`, the page, and the time from `stop --all` until the last truck's motor is neutral, by the ground
//! truth. This program and the commands that it runs take their part of the same machine.
//!
//! It prints a table as it goes and a line of JSON for each size; the machine and its load are in both.

#![allow(clippy::print_stdout)] // a measurement's table

#[path = "thousand/fleet.rs"]
mod fleet;

use fleet::{LOOK_EVERY, PATIENCE, Result, Witness, Work, cli, simulators, until};
use fleet_tests::processes::Process;
use rustix::param::clock_ticks_per_second;
use serde_json::json;
use std::process::Stdio;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

const SIZES: [usize; 5] = [50, 100, 200, 500, 1000];
/// States that a robot sends in a second.
const STATE_HZ: f64 = 20.0;
/// Until the figures settle, and how long they are taken.
const SETTLE: Duration = Duration::from_secs(10);
const WINDOW: Duration = Duration::from_secs(20);
/// How often each command is measured; the median counts.
const TIMES: usize = 5;
/// The real time factors that are promised on 2 cores, for this many robots.
const FLOORS: [(usize, f64); 2] = [(500, 0.9), (1000, 0.5)];

#[tokio::main]
async fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |word: &str| arguments.iter().any(|it| it == word);
    let work = if has("drive") { Work::Drive } else { Work::Wander };
    let parts = if has("split") { 2 } else { 1 };
    let mut sizes: Vec<usize> = arguments.iter().filter_map(|it| it.parse().ok()).collect();
    if sizes.is_empty() {
        sizes = SIZES.to_vec();
    }
    let cores = std::thread::available_parallelism()?;
    println!("All robots {work:?}, simulators: {parts}; {cores} cores, load {} before.\n", load());
    println!(
        "| robots | ready | real time | states of those due | of those sent | CPU, cores | RSS, MiB | MiB a robot | threads | `list` | page, all robots | a look at `/metrics` | drive at the stop | `stop --all` | last motor neutral | contacts |"
    );
    println!("|{}", " ---: |".repeat(16));
    let mut rows = Vec::new();
    for robots in sizes {
        match measure(robots, parts, work).await {
            Ok(row) => rows.push(row),
            Err(error) => println!("| {robots} | **{error}** |{}", " |".repeat(14)),
        }
    }
    println!();
    for row in &rows {
        println!("{}", row.json(work, parts, cores.get()));
        for (robots, floor) in FLOORS {
            if row.robots == robots && row.real_time < floor {
                println!(
                    "{robots} robots: real time {:.2}, missed: {floor} is promised on 2 cores",
                    row.real_time
                );
            }
        }
    }
    Ok(())
}

/// One size.
#[derive(Debug)]
struct Row {
    robots: usize,
    load: String,
    ready_s: f64,
    real_time: f64,
    /// Of those that 20 Hz of real time make.
    of_due: f64,
    /// Of those that the robots numbered: what was lost on the way.
    of_sent: f64,
    cores: f64,
    rss_mib: f64,
    threads: u64,
    list_s: f64,
    list_code: Option<i32>,
    page_s: Option<f64>,
    look_s: Option<f64>,
    /// Robots that drive when they are stopped.
    moving: usize,
    stop_s: f64,
    stop_code: Option<i32>,
    neutral_s: Option<f64>,
    contacts: u64,
}

impl Row {
    fn print(&self) {
        let seconds = |s: Option<f64>| s.map_or("never".to_owned(), |s| format!("{s:.2} s"));
        let code = |code: Option<i32>| match code {
            Some(0) => String::new(),
            code => format!(" (exit {})", code.map_or("none".to_owned(), |code| code.to_string())),
        };
        println!(
            "| {} | {:.1} s | {:.2} | {:.1} % | {:.1} % | {:.2} | {:.0} | {:.2} | {} | {:.2} s{} | {} | {} | {} | {:.2} s{} | {} | {} |",
            self.robots,
            self.ready_s,
            self.real_time,
            100.0 * self.of_due,
            100.0 * self.of_sent,
            self.cores,
            self.rss_mib,
            self.rss_mib / self.robots as f64,
            self.threads,
            self.list_s,
            code(self.list_code),
            seconds(self.page_s),
            seconds(self.look_s),
            self.moving,
            self.stop_s,
            code(self.stop_code),
            seconds(self.neutral_s),
            self.contacts,
        );
    }

    fn json(&self, work: Work, parts: usize, cores: usize) -> serde_json::Value {
        json!({
            "robots": self.robots, "work": format!("{work:?}"), "simulators": parts, "machine_cores": cores, "load": self.load,
            "ready_s": self.ready_s, "real_time": self.real_time, "states_of_due": self.of_due,
            "states_of_sent": self.of_sent, "cpu_cores": self.cores, "rss_mib": self.rss_mib,
            "threads": self.threads, "list_s": self.list_s, "list_code": self.list_code,
            "page_s": self.page_s, "metrics_s": self.look_s, "moving": self.moving, "stop_s": self.stop_s,
            "stop_code": self.stop_code, "neutral_s": self.neutral_s, "contacts": self.contacts,
        })
    }
}

async fn measure(robots: usize, parts: usize, work: Work) -> Result<Row> {
    let load = load();
    let began = Instant::now();
    let (sims, endpoint) = simulators(robots, parts).await?;
    let ready_s = began.elapsed().as_secs_f64();
    let fleet = Arc::new(Witness::open(&endpoint, parts).await?);
    let worker = tokio::spawn(fleet.clone().employ(work));
    // Where all plan alone in a crowd, most wait for others: as many as drive by then.
    let _ = until("a quarter of the robots drives", || fleet.moving() * 4 >= robots).await;
    tokio::time::sleep(SETTLE).await;

    let before = (Instant::now(), cpu_s(&sims)?, fleet.time_s());
    fleet.count_states(true);
    tokio::time::sleep(WINDOW).await;
    fleet.count_states(false);
    let window_s = before.0.elapsed().as_secs_f64();
    let cores = (cpu_s(&sims)? - before.1) / window_s;
    let real_time = (fleet.time_s() - before.2) / window_s;
    let (delivered, sent) = fleet.counted();
    let rss_mib = sims.iter().map(Process::memory_kib).sum::<u64>() as f64 / 1024.0;
    let threads = sims.iter().map(threads).sum::<Result<u64>>()?;

    let (list_s, list_code) = run(&endpoint, &["list"], TIMES).await?;
    let (page_s, look_s) = page(&endpoint, robots).await?;
    // What is on its way to the robots would begin after the stop.
    fleet.is_over.store(true, Ordering::Relaxed);
    worker.await?;
    let moving = fleet.moving();
    let at = Instant::now();
    let stopping = tokio::spawn({
        let endpoint = endpoint.clone();
        async move { run(&endpoint, &["stop", "--all"], 1).await }
    });
    let neutral = until("all are neutral", || fleet.is_neutral()).await;
    let neutral_s = neutral.is_ok().then(|| at.elapsed().as_secs_f64());
    let (stop_s, stop_code) = stopping.await??;
    let row = Row {
        robots,
        load,
        ready_s,
        real_time,
        of_due: delivered as f64 / (robots as f64 * STATE_HZ * window_s),
        of_sent: delivered as f64 / sent.max(1) as f64,
        cores,
        rss_mib,
        threads,
        list_s,
        list_code,
        page_s,
        look_s,
        moving,
        stop_s,
        stop_code,
        neutral_s,
        contacts: fleet.contacts(),
    };
    row.print();
    Ok(row)
}

/// The median time of a command, and the worst exit code.
async fn run(endpoint: &str, arguments: &[&str], times: usize) -> Result<(f64, Option<i32>)> {
    let (mut took, mut worst) = (Vec::new(), Some(0));
    for _ in 0..times {
        let mut command = cli(&["--connect", endpoint]);
        command.args(arguments).stdout(Stdio::null());
        let began = Instant::now();
        let status = tokio::task::spawn_blocking(move || Process::start(&mut command).0.wait()).await??;
        took.push(began.elapsed().as_secs_f64());
        if status.code() != Some(0) {
            worst = status.code();
        }
    }
    Ok((median(took), worst))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// How long the dashboard takes from its start until it shows all robots, and to answer one look then.
async fn page(endpoint: &str, robots: usize) -> Result<(Option<f64>, Option<f64>)> {
    let mut command = cli(&["--connect", endpoint, "dashboard", "--listen", "127.0.0.1:0"]);
    let began = Instant::now();
    let (_dashboard, line) = tokio::task::spawn_blocking(move || Process::start_ready(&mut command)).await?;
    let address = line.split("http://").nth(1).and_then(|rest| rest.split(['/', '"']).next());
    let address = address.ok_or("the dashboard does not start")?.to_owned();
    let all = format!("xtb_fleet_robots{{present=\"true\"}} {robots}.0");
    while !look(&address).await.is_ok_and(|text| text.contains(&all)) {
        if began.elapsed() > PATIENCE {
            return Ok((None, None));
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
    let page_s = began.elapsed().as_secs_f64();
    let mut took = Vec::new();
    for _ in 0..TIMES {
        let began = Instant::now();
        look(&address).await?;
        took.push(began.elapsed().as_secs_f64());
    }
    Ok((Some(page_s), Some(median(took))))
}

async fn look(address: &str) -> Result<String> {
    let mut stream = TcpStream::connect(address).await?;
    let request = format!("GET /metrics HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).await?;
    let mut text = Vec::new();
    tokio::time::timeout(PATIENCE, stream.read_to_end(&mut text)).await??;
    Ok(String::from_utf8_lossy(&text).into_owned())
}

/// CPU time that the processes have used so far, in s.
fn cpu_s(processes: &[Process]) -> Result<f64> {
    let mut ticks = 0;
    for process in processes {
        let text = std::fs::read_to_string(format!("/proc/{}/stat", process.0.id()))?;
        // The fields after the name in parentheses, from the third on; user and system time are the 14th and 15th.
        let fields = text.rsplit_once(')').ok_or("no /proc/PID/stat")?.1.split_whitespace();
        ticks += fields.skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum::<u64>();
    }
    Ok(ticks as f64 / clock_ticks_per_second() as f64)
}

fn threads(process: &Process) -> Result<u64> {
    let text = std::fs::read_to_string(format!("/proc/{}/status", process.0.id()))?;
    let line = text.lines().find_map(|line| line.strip_prefix("Threads:"));
    Ok(line.ok_or("no /proc/PID/status")?.trim().parse()?)
}

/// Over the last minute, five minutes and a quarter of an hour.
fn load() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().take(3).collect::<Vec<_>>().join(" ")
}
