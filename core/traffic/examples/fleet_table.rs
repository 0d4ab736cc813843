//! Solves random problems like the public CL-MAPF families, and prints a line for each family.
//!
//! `cargo run --release -p xtb-traffic --example fleet_table -- [PROBLEMS [SECONDS]]`: so many of each
//! (default 15), each within so many seconds (default 20), on one thread, without improvements.

#![allow(clippy::print_stdout)]

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::{Duration, Instant};
use xtb_nav::{Car, Gears, MapPose};
use xtb_traffic::solver::{
    CarTask, FloorBounds, Obstacle, Problem, Solver, SolverSettings, Tolerance, check,
};

const CAR: Car = Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: Gears::BOTH };
const DISC_M: f64 = 0.8;

struct Family {
    side_m: f64,
    discs: usize,
    cars: usize,
    /// Between two starts, or two goals, in m.
    spacing_m: f64,
    by_order: bool,
}

const FAMILIES: [Family; 11] = [
    Family::small(5),
    Family::small(10),
    Family::small(15),
    Family::small(20),
    Family::small(25),
    Family::small(30),
    Family { by_order: true, ..Family::small(20) },
    Family::large(10),
    Family::large(20),
    Family::large(30),
    Family::large(60),
];

impl Family {
    const fn small(cars: usize) -> Self {
        Self { side_m: 50.0, discs: 25, cars, spacing_m: 5.6, by_order: false }
    }

    const fn large(cars: usize) -> Self {
        Self { side_m: 100.0, discs: 50, cars, spacing_m: 7.8, by_order: false }
    }

    /// Discs anywhere; places on whole metres, in four directions, off the discs.
    fn problem(&self, seed: u64) -> Problem {
        let &Self { side_m, discs, cars, spacing_m, by_order } = self;
        let mut random = Pcg32::new(seed, 17);
        let mut uniform =
            |low: f64, high: f64| low + (high - low) * f64::from(random.next_u32()) / 4_294_967_296.0;
        let obstacles: Vec<Obstacle> = (0..discs)
            .map(|_| Obstacle::Disc {
                x_m: uniform(0.0, side_m),
                y_m: uniform(0.0, side_m),
                radius_m: DISC_M,
            })
            .collect();
        let mut place = |taken: &[MapPose]| loop {
            let yaw_rad = [0.0, FRAC_PI_2, PI, -FRAC_PI_2][uniform(0.0, 4.0) as usize];
            let (x_m, y_m) = (uniform(2.0, side_m - 1.0).floor(), uniform(2.0, side_m - 1.0).floor());
            let pose = MapPose { x_m, y_m, yaw_rad };
            let off = obstacles.iter().all(|disc| CAR.distance_m(&pose, disc.middle_m()) > DISC_M);
            if off && taken.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > spacing_m) {
                return pose;
            }
        };
        let (mut starts, mut goals) = (Vec::new(), Vec::new());
        for _ in 0..cars {
            let (start, goal) = (place(&starts), place(&goals));
            starts.push(start);
            goals.push(goal);
        }
        let places = starts.into_iter().zip(goals).enumerate();
        Problem {
            bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: side_m, north_m: side_m },
            cars: places
                .map(|(i, (start, goal))| CarTask { name: format!("car-{i}"), car: CAR, start, goal })
                .collect(),
            obstacles,
            one_way: None,
            step_m: 2.118,
            clearance_m: 0.02,
            tolerance: Tolerance::default(),
            by_order,
        }
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter_map(|text| text.parse().ok());
    let (problems, seconds) = (arguments.next().unwrap_or(15), arguments.next().unwrap_or(20));
    println!("| map | cars | solved | median s | worst s | of these for the compass s | mean makespan |");
    println!("|---|---|---|---|---|---|---|");
    for family in FAMILIES {
        let (mut times, mut compass, mut makespans) = (Vec::new(), 0.0, 0);
        for seed in 1..=problems {
            let (problem, begun) = (family.problem(seed), Instant::now());
            let mut go_on = || begun.elapsed() < Duration::from_secs(seconds);
            let solved = Solver::new(&problem, &mut go_on).and_then(|solver| {
                compass += begun.elapsed().as_secs_f64();
                solver.solve(&SolverSettings { seed, ..SolverSettings::default() }, &mut go_on)
            });
            match solved.map(|schedule| (check(&problem, &schedule), schedule)) {
                Ok((Ok(()), schedule)) => {
                    times.push(begun.elapsed().as_secs_f64());
                    makespans += schedule.makespan();
                }
                Ok((Err(fault), _)) => println!("problem {seed}: {fault}"),
                Err(error) => println!("problem {seed}: {error}"),
            }
        }
        times.sort_by(f64::total_cmp);
        let at = |part: usize| times.get((times.len() * part / 100).min(times.len().saturating_sub(1)));
        println!(
            "| {side} × {side}{order} | {cars} | {solved}/{problems} | {median:.2} | {worst:.2} | {compass:.2} | {makespan:.0} |",
            side = family.side_m,
            order = if family.by_order { ", by order" } else { "" },
            cars = family.cars,
            solved = times.len(),
            median = at(50).unwrap_or(&f64::NAN),
            worst = at(100).unwrap_or(&f64::NAN),
            compass = compass / problems as f64,
            makespan = makespans as f64 / times.len().max(1) as f64,
        );
    }
}
