//! What a simulated robot costs, and how that grows with their number: truck, sensors, lines, robot and
//! controller, on one thread; everybody wanders in a room for all. The table and the plot of docs/simulator.md.
//!
//! `cargo run --release -p xtb-sim --example scale [plot FILE.svg | ROBOTS …]`: 1, 10, 100 and 1,000 robots
//! unless others are given. Time is the thread's own on a processor where the system says it, so that other
//! programs disturb little.
//!
//! `… threads COUNT [ROBOTS …]`: on so many threads, in real time, beside one thread.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "scale/plot.rs"]
mod plot;
#[path = "scale/threads.rs"]
mod threads;

use std::time::Instant;
use threads::Threads;
use xtb_control::VehicleConfig;
use xtb_protocol::messages::{Body, LinkLoss, Request};
use xtb_protocol::{Name, Uuid};
use xtb_sim::{Executor, Lockstep, STEP_NS, Sequential, Simulation, TruckParameters, World};

/// Robot-seconds of each run, and how often it is made: the median counts.
const ROBOT_SECONDS: f64 = 6000.0;
const RUNS: usize = 5;

/// One line of the table.
pub(crate) struct Row {
    pub(crate) robots: usize,
    /// Of a processor core for a robot-second, in µs: least, median and most of the runs.
    pub(crate) us: [f64; 3],
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.first().is_some_and(|word| word == "threads") {
        return on_threads(&arguments[1..]);
    }
    let file = (arguments.first().is_some_and(|word| word == "plot")).then(|| arguments[1].clone());
    let counts: Vec<usize> = arguments.iter().filter_map(|word| word.parse().ok()).collect();
    let counts = if counts.is_empty() { vec![1, 10, 100, 1000] } else { counts };
    println!("| robots | core-µs a robot-second | least | most | × real time on one core | contacts |");
    println!("| ---: | ---: | ---: | ---: | ---: | ---: |");
    let rows: Vec<Row> = counts.into_iter().map(row).collect();
    if let Some(file) = file {
        plot::draw(std::path::Path::new(&file), &rows).unwrap();
    }
}

fn row(robots: usize) -> Row {
    let mut runs: Vec<(f64, u64)> = (0..RUNS).map(|_| run(robots)).collect();
    runs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let us = [runs[0].0, runs[RUNS / 2].0, runs[RUNS - 1].0];
    let contacts = runs[0].1;
    println!(
        "| {robots} | {:.0} | {:.0} | {:.0} | {:.0} | {contacts} |",
        us[1],
        us[0],
        us[2],
        1e6 / us[1] / robots as f64
    );
    Row { robots, us }
}

/// Real time on one thread and on so many.
fn on_threads(arguments: &[String]) {
    let mut numbers = arguments.iter().filter_map(|word| word.parse().ok());
    let threads = numbers.next().unwrap_or(2);
    let counts: Vec<usize> = numbers.collect();
    let counts = if counts.is_empty() { vec![10, 100, 1000] } else { counts };
    println!("| robots | × real time, 1 thread | {threads} threads | ratio |");
    println!("| ---: | ---: | ---: | ---: |");
    for robots in counts {
        let (mut one, mut many): (Vec<f64>, Vec<f64>) =
            (0..RUNS).map(|_| (speed(robots, &Sequential), speed(robots, &Threads(threads)))).unzip();
        [&mut one, &mut many].into_iter().for_each(|runs| runs.sort_by(f64::total_cmp));
        let (one, many) = (one[RUNS / 2], many[RUNS / 2]);
        println!("| {robots} | {one:.1} | {many:.1} | {:.2} |", many / one);
    }
}

/// Simulated over real time.
fn speed(robots: usize, executor: &impl Executor) -> f64 {
    let mut fleet = fleet(robots);
    let steps = steps(robots);
    let began = Instant::now();
    fleet.run(steps, executor);
    (steps * STEP_NS) as f64 / 1e9 / began.elapsed().as_secs_f64()
}

fn steps(robots: usize) -> u64 {
    (ROBOT_SECONDS / robots as f64 * 1e9) as u64 / STEP_NS
}

/// Core-µs a robot-second, and the touches.
fn run(robots: usize) -> (f64, u64) {
    let mut fleet = fleet(robots);
    let clock = Clock::start();
    fleet.run(steps(robots), &Sequential);
    let us = clock.seconds() * 1e6 / ROBOT_SECONDS;
    (us, fleet.simulation().truths().map(|truth| truth.contacts).sum())
}

/// All of them wandering, half a second after they were switched on.
fn fleet(robots: usize) -> Lockstep {
    let parameters = TruckParameters::default();
    let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
    let world = World::for_robots(robots, &parameters.body);
    let simulation = Simulation::new(world, &parameters, &names, 1).unwrap();
    let name = |text: &str| Name::new(text).unwrap();
    let mut fleet = Lockstep::new(simulation, &name("lab"), &VehicleConfig::default()).unwrap();
    for _ in 0..100 {
        fleet.step();
    }
    for robot in 0..robots {
        let body = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
        let request = Request { id: Uuid::from_u128(robot as u128), lease: None, body };
        fleet.request(robot, &name("bench"), &request);
    }
    fleet
}

/// This thread's time on a processor; of the clock on the wall where the system does not say it.
struct Clock {
    began: Instant,
    used_ns: Option<u64>,
}

impl Clock {
    fn start() -> Self {
        Self { began: Instant::now(), used_ns: used_ns() }
    }

    fn seconds(&self) -> f64 {
        match (self.used_ns, used_ns()) {
            (Some(from), Some(to)) => (to - from) as f64 / 1e9,
            _ => self.began.elapsed().as_secs_f64(),
        }
    }
}

fn used_ns() -> Option<u64> {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    stat.split_whitespace().next()?.parse().ok()
}
