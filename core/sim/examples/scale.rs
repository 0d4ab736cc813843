//! What a simulated robot costs, and how that grows with their number: truck, sensors, lines, robot and
//! controller, on one thread; everybody wanders in a room for all. The tables and the plot of docs/simulator.md.
//!
//! `cargo run --release -p xtb-sim --example scale [plot FILE.svg | ROBOTS …]`: 1, 10, 100 and 1,000 robots
//! unless others are given. Time is the thread's own on a processor where the system says it, so that other
//! programs disturb little.
//!
//! `… goals [ROBOTS …]`: all drive to one planned goal after the other instead, without traffic control: they hear
//! those near them and give way, and plan their ways on this thread.
//!
//! `… threads COUNT [ROBOTS …]`: on so many threads, in real time, beside one thread.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "scale/plot.rs"]
mod plot;
#[path = "scale/threads.rs"]
mod threads;

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::time::Instant;
use threads::Threads;
use xtb_control::VehicleConfig;
use xtb_protocol::messages::{Body, LinkLoss, Request, Via};
use xtb_protocol::{Name, Uuid};
use xtb_sim::{Executor, Lockstep, STEP_NS, Sequential, Simulation, TruckParameters, World};

/// Robot-seconds of each run, and how often it is made: the median counts.
const ROBOT_SECONDS: f64 = 6000.0;
/// Where ways are planned fewer, but so many seconds at least.
const GOALS_ROBOT_SECONDS: f64 = 1000.0;
const GOALS_S: f64 = 20.0;
const RUNS: usize = 5;
/// Everybody gets another goal after so long, in s, wherever it is then: few have arrived.
const GOAL_S: u64 = 10;
/// Goals are at least this far from the walls.
const WALL_M: f64 = 1.0;

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
    let drive =
        if arguments.first().is_some_and(|word| word == "goals") { Drive::Goals } else { Drive::Wander };
    let file = (arguments.first().is_some_and(|word| word == "plot")).then(|| arguments[1].clone());
    let counts: Vec<usize> = arguments.iter().filter_map(|word| word.parse().ok()).collect();
    let counts = if counts.is_empty() { vec![1, 10, 100, 1000] } else { counts };
    println!("| robots | core-µs a robot-second | least | most | × real time on one core | contacts |");
    println!("| ---: | ---: | ---: | ---: | ---: | ---: |");
    let rows: Vec<Row> = counts.into_iter().map(|robots| row(robots, drive)).collect();
    if let Some(file) = file {
        plot::draw(std::path::Path::new(&file), &rows).unwrap();
    }
}

/// What everybody does.
#[derive(Clone, Copy, PartialEq)]
enum Drive {
    Wander,
    /// Planned goals at random places, one every [`GOAL_S`].
    Goals,
}

fn row(robots: usize, drive: Drive) -> Row {
    let mut runs: Vec<(f64, u64)> = (0..RUNS).map(|_| run(robots, drive)).collect();
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
    let steps = steps(robots, ROBOT_SECONDS);
    let began = Instant::now();
    fleet.run(steps, executor);
    (steps * STEP_NS) as f64 / 1e9 / began.elapsed().as_secs_f64()
}

fn steps(robots: usize, robot_s: f64) -> u64 {
    (robot_s / robots as f64 * 1e9) as u64 / STEP_NS
}

/// Core-µs a robot-second, and the touches.
fn run(robots: usize, drive: Drive) -> (f64, u64) {
    let mut fleet = fleet(robots);
    let mut goals = (drive == Drive::Goals).then(|| Goals::new(&mut fleet));
    let robot_s = match drive {
        Drive::Wander => ROBOT_SECONDS,
        Drive::Goals => GOALS_ROBOT_SECONDS.max(GOALS_S * robots as f64),
    };
    let clock = Clock::start();
    let mut left = steps(robots, robot_s);
    while left > 0 {
        if let Some(goals) = &mut goals {
            goals.send(&mut fleet, robots);
        }
        let steps = left.min(GOAL_S * 1_000_000_000 / STEP_NS);
        go_on(&mut fleet, steps);
        left -= steps;
    }
    let us = clock.seconds() * 1e6 / robot_s;
    (us, fleet.simulation().truths().map(|truth| truth.contacts).sum())
}

/// What is measured; a function of its own for profilers (`scale/profile.py`).
#[inline(never)]
fn go_on(fleet: &mut Lockstep, steps: u64) {
    fleet.run(steps, &Sequential);
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

/// Where everybody is sent.
struct Goals {
    /// Where the room begins and how long it is, along x and y.
    room_m: [(f64, f64); 2],
    dice: Pcg32,
    asked: u128,
}

impl Goals {
    fn new(fleet: &mut Lockstep) -> Self {
        let map = fleet.simulation().world().to_map(0.05).unwrap();
        fleet.set_map(&map);
        let grid = map.grid();
        let [x_m, y_m] = grid.origin_m();
        let span_m = |cells: usize| cells as f64 * grid.resolution_m();
        let room_m = [(x_m, span_m(grid.width())), (y_m, span_m(grid.height()))];
        Self { room_m, dice: Pcg32::new(1, 1), asked: 1 << 64 }
    }

    fn send(&mut self, fleet: &mut Lockstep, robots: usize) {
        for robot in 0..robots {
            let [x_m, y_m] = self.room_m.map(|(from_m, long_m)| {
                let part = f64::from(self.dice.next_u32()) / f64::from(u32::MAX);
                from_m + WALL_M + part * (long_m - 2.0 * WALL_M)
            });
            let via = Some(Via::Planned);
            let body =
                Body::Goto { x_m, y_m, yaw_rad: None, via, on_link_loss: LinkLoss::Finish, finish_s: 300.0 };
            self.asked += 1;
            let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
            fleet.request(robot, &Name::new("bench").unwrap(), &request);
        }
    }
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
