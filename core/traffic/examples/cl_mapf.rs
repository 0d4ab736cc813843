//! Solves instances of the public CL-MAPF set as `fleet-cli plan` does, and prints a line for each.
//!
//! `cargo run --release -p xtb-traffic --example cl_mapf -- SECONDS FOLDER INSTANCE.yaml…`: within so many
//! seconds each; the schedules are written to the folder for the set's own `check_schedule.py`.

#![allow(clippy::print_stdout)]

#[path = "../../../fleet-cli/src/commands/plan/race.rs"]
#[allow(dead_code)]
mod race;

use race::{Planned, Race};
use std::fmt::Write;
use std::path::Path;
use std::time::{Duration, Instant};
use xtb_nav::{Car, Gears, MapPose};
use xtb_traffic::solver::{CarTask, FloorBounds, Obstacle, Problem, Schedule, Tolerance, Unsolved, check};

/// As `fleet-cli/src/commands/plan/instance.rs` has them.
const CAR: Car = Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: Gears::BOTH };
const DISC_M: f64 = 0.8;

/// The set's files have one list of numbers a line.
fn problem(text: &str) -> Problem {
    let numbers = |line: &str| -> Vec<f64> {
        let inner = line.split(['[', ']']).nth(1).unwrap_or("");
        inner.split(',').filter_map(|number| number.trim().parse().ok()).collect()
    };
    let (mut names, mut starts, mut goals) = (Vec::new(), Vec::new(), Vec::new());
    let (mut size, mut discs) = (vec![0.0, 0.0], Vec::new());
    for line in text.lines().map(str::trim) {
        match line {
            _ if line.starts_with("- start:") => starts.push(numbers(line)),
            _ if line.starts_with("goal:") => goals.push(numbers(line)),
            _ if line.starts_with("dimensions:") => size = numbers(line),
            _ if line.starts_with("- [") => discs.push(numbers(line)),
            _ => names.extend(line.strip_prefix("name: ").map(str::to_owned)),
        }
    }
    let pose = |at: &[f64]| MapPose { x_m: at[0], y_m: size[1] - at[1], yaw_rad: at[2] };
    let cars = names.into_iter().zip(starts.iter().zip(&goals));
    Problem {
        bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: size[0], north_m: size[1] },
        cars: cars
            .map(|(name, (start, goal))| CarTask { name, car: CAR, start: pose(start), goal: pose(goal) })
            .collect(),
        obstacles: discs
            .iter()
            .map(|at| Obstacle::Disc { x_m: at[0], y_m: size[1] - at[1], radius_m: DISC_M })
            .collect(),
        one_way: None,
        step_m: 2.118,
        clearance_m: 0.02,
        tolerance: Tolerance { position_m: 0.1, yaw_rad: 0.05 },
        by_order: false,
    }
}

fn yaml(schedule: &Schedule, north: f64) -> String {
    let mut text = String::from("schedule:\n");
    for way in &schedule.ways {
        let _ = writeln!(text, "  {}:", way.name);
        for row in &way.rows {
            let MapPose { x_m, y_m, yaw_rad } = row.pose;
            let _ = writeln!(text, "  - {{x: {x_m}, y: {}, yaw: {yaw_rad}, t: {}}}", north - y_m, row.step);
        }
    }
    text
}

/// The race of `fleet-cli plan`, without the command around it.
fn race(problem: &Problem, seconds: f64) -> Result<Planned, Unsolved> {
    let race = Race::start(problem, 1, Instant::now() + Duration::from_secs_f64(seconds));
    loop {
        if let Some(ended) = race.ended() {
            return ended;
        }
        std::thread::sleep(race::LOOK_EVERY);
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seconds: f64 = arguments.next().and_then(|text| text.parse().ok()).unwrap_or(20.0);
    let folder = arguments.next().unwrap_or_default();
    println!("| instance | first s | makespan | flowtime | improved | s | makespan | flowtime |");
    for file in arguments {
        let (path, begun) = (Path::new(&file), Instant::now());
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let problem = problem(&std::fs::read_to_string(path).unwrap_or_default());
        let planned = match race(&problem, seconds) {
            Ok(planned) => planned,
            Err(error) => {
                println!("| {name} | {error} |");
                continue;
            }
        };
        let Planned { schedule, first, improved } = planned;
        if let Err(fault) = check(&problem, &schedule) {
            println!("| {name} | {fault} |");
        }
        let (first_s, spent) = (first.after.as_secs_f64(), begun.elapsed().as_secs_f64());
        let text = yaml(&schedule, problem.bounds.north_m);
        if let Err(error) = std::fs::write(Path::new(&folder).join(format!("{name}.yaml")), text) {
            println!("| {name} | {error} |");
        }
        println!(
            "| {name} | {first_s:.2} | {} | {} | {improved} | {spent:.2} | {} | {} |",
            first.makespan,
            first.flowtime,
            schedule.makespan(),
            schedule.flowtime()
        );
    }
}
