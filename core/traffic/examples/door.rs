//! Five trucks through a door of 1 m between two rooms of 8 × 4 m, so many of them from the other side: the table of
//! docs/navigation.md.
//!
//! `cargo run --release -p xtb-traffic --example door [SEEDS] [FIRST] [SECONDS]`: of each number from the other side
//! so many seeds, which choose the places, with the two threads of `fleet-cli plan`.

#![allow(clippy::print_stdout)] // a measurement's table

#[path = "../../../fleet-cli/src/commands/plan/race.rs"]
#[allow(dead_code)]
mod race;

use race::Race;
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::f64::consts::FRAC_PI_2;
use std::time::{Duration, Instant};
use xtb_nav::{Car, Gears, MapPose};
use xtb_traffic::solver::{CarTask, FloorBounds, Obstacle, Problem, Tolerance, check};

const TRUCKS: usize = 5;
const SECONDS: f64 = 20.0;
/// A truck with 0.27 m of look-out at both ends, the steps and the clearance of `fleet-cli plan`.
const CAR: Car = Car { front_m: 0.52, rear_m: 0.52, half_width_m: 0.2, radius_m: 0.39, gears: Gears::BOTH };
const STEP_M: f64 = 0.273;
const CLEARANCE_M: f64 = 0.05;
/// Between two trucks that stand side by side, in m.
const APART_M: f64 = 1.2;
/// What a seed moves a place by at most, in m.
const ASIDE_M: f64 = 0.3;

fn wall(west_m: f64, east_m: f64) -> Obstacle {
    Obstacle::Box {
        middle: MapPose { x_m: (west_m + east_m) / 2.0, y_m: 4.0, yaw_rad: 0.0 },
        half_length_m: (east_m - west_m) / 2.0,
        half_width_m: 0.05,
    }
}

/// The places of both rooms in a row; who starts in the north, and whose goal is where, by the seed.
fn problem(from_north: usize, seed: u64) -> Problem {
    let mut random = Pcg32::new(seed, 8);
    let mut draw = |below: usize| ((u64::from(random.next_u32()) * below as u64) >> 32) as usize;
    let mut shuffled = || -> Vec<usize> {
        let mut row: Vec<usize> = (0..TRUCKS).collect();
        (1..TRUCKS).rev().for_each(|last| row.swap(last, draw(last + 1)));
        row
    };
    let (south, north) = (shuffled(), shuffled());
    let mut moved = || (draw(2001) as f64 / 1000.0 - 1.0) * ASIDE_M;
    let mut place = |number: usize, y_m: f64, yaw_rad: f64| MapPose {
        x_m: 4.0 + (number as f64 - 2.0) * APART_M + moved() / 2.0,
        y_m: y_m + moved(),
        yaw_rad,
    };
    let task = |truck: usize| {
        let yaw_rad = if truck < from_north { -FRAC_PI_2 } else { FRAC_PI_2 };
        let (one, other) = (place(south[truck], 2.0, yaw_rad), place(north[truck], 6.0, yaw_rad));
        let (start, goal) = if truck < from_north { (other, one) } else { (one, other) };
        CarTask { name: format!("xtb-{}", truck + 1), car: CAR, start, goal }
    };
    Problem {
        bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: 8.0, north_m: 8.0 },
        cars: (0..TRUCKS).map(task).collect(),
        obstacles: vec![wall(0.0, 3.5), wall(4.5, 8.0)],
        one_way: None,
        step_m: STEP_M,
        clearance_m: CLEARANCE_M,
        tolerance: Tolerance::default(),
        by_order: true,
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|text| text.parse::<f64>().ok());
    let mut number = |default: f64| arguments.next().unwrap_or(default);
    let (seeds, first, seconds) = (number(20.0) as u64, number(1.0) as u64, number(SECONDS));
    println!("| from the other side | solved | within 2 s | first schedule, median | longest | not solved |");
    println!("|{}", " ---: |".repeat(6));
    for from_north in 0..=TRUCKS / 2 {
        let (mut took, mut unsolved) = (Vec::new(), Vec::new());
        for seed in first..first + seeds {
            let problem = problem(from_north, seed);
            let race = Race::start(&problem, seed, Instant::now() + Duration::from_secs_f64(seconds));
            let ended = loop {
                if let Some(ended) = race.ended() {
                    break ended;
                }
                std::thread::sleep(race::LOOK_EVERY);
            };
            match ended {
                Ok(planned) if check(&problem, &planned.schedule).is_ok() => {
                    took.push(planned.first.after.as_secs_f64());
                }
                Ok(_) => unsolved.push(format!("{seed} (contact)")),
                Err(_) => unsolved.push(seed.to_string()),
            }
        }
        took.sort_by(f64::total_cmp);
        let within = took.iter().filter(|&&s| s <= 2.0).count();
        let (median, longest) = (took.get(took.len() / 2), took.last());
        let s = |s: Option<&f64>| s.map_or("".to_owned(), |s| format!("{s:.2} s"));
        println!(
            "| {from_north} | {} of {seeds} | {within} | {} | {} | {} |",
            took.len(),
            s(median),
            s(longest),
            unsolved.join(", ")
        );
    }
}
