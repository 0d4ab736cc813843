//! Solves public multi-car planning instances and prints one line for each.
#![allow(clippy::approx_constant, clippy::print_stdout, clippy::unwrap_used)]

use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::Deserialize;
use std::time::Instant;
use xtb_nav::traffic::{Bounds, Obstacle, Problem, Settings, Solver, Task, Tolerance, check};
use xtb_nav::{Car, MapPose};

#[derive(Deserialize)]
struct Instance {
    agents: Vec<Agent>,
    map: Map,
}
#[derive(Deserialize)]
struct Agent {
    name: String,
    start: [f64; 3],
    goal: [f64; 3],
}
#[derive(Deserialize)]
struct Map {
    dimensions: [f64; 2],
    obstacles: Vec<[f64; 2]>,
}

/// random:SIDE:DISCS:CARS:SPACING:SEED
fn random(what: &str) -> Instance {
    let n: Vec<f64> = what.split(':').skip(1).map(|n| n.parse().unwrap()).collect();
    let (side, spacing) = (n[0], n[3]);
    let mut random = Pcg32::new(n[4] as u64, 17);
    let mut uniform =
        |low: f64, high: f64| low + (high - low) * f64::from(random.next_u32()) / 4_294_967_296.0;
    let obstacles: Vec<[f64; 2]> =
        (0..n[1] as usize).map(|_| [uniform(0.0, side), uniform(0.0, side)]).collect();
    let car = Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0 };
    let pose = |p: &[f64; 3]| MapPose { x_m: p[0], y_m: side - p[1], yaw_rad: p[2] };
    let mut place = |taken: &[[f64; 3]]| loop {
        let p = [
            uniform(2.0, side - 1.0).floor(),
            uniform(2.0, side - 1.0).floor(),
            [0.0, 1.57, 3.14, -1.57][uniform(0.0, 4.0) as usize],
        ];
        let off = obstacles.iter().all(|o| car.distance_m(&pose(&p), [o[0], side - o[1]]) > 0.8);
        if off
            && taken.iter().all(|q| {
                !car.overlaps(&pose(&p), &car, &pose(q)) && (p[0] - q[0]).hypot(p[1] - q[1]) > spacing
            })
        {
            return p;
        }
    };
    let (mut starts, mut goals) = (Vec::new(), Vec::new());
    for _ in 0..n[2] as usize {
        let start = place(&starts);
        starts.push(start);
        let goal = place(&goals);
        goals.push(goal);
    }
    let agents = starts
        .into_iter()
        .zip(goals)
        .enumerate()
        .map(|(i, (start, goal))| Agent { name: format!("agent{i}"), start, goal })
        .collect();
    Instance { agents, map: Map { dimensions: [side, side], obstacles } }
}

fn main() {
    let mut args = std::env::args().skip(1);
    let limit: f64 = args.next().unwrap().parse().unwrap();
    let seed: u64 = args.next().unwrap().parse().unwrap();
    let first = args.next().unwrap() == "p";
    let (mut solved, mut times, mut count) = (0, Vec::new(), 0);
    for path in args {
        count += 1;
        let i: Instance = if path.starts_with("random:") {
            random(&path)
        } else {
            serde_saphyr::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap()
        };
        let car = Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0 };
        let [w, h] = i.map.dimensions;
        let pose = |p: [f64; 3]| MapPose { x_m: p[0], y_m: h - p[1], yaw_rad: p[2] };
        let problem = Problem {
            bounds: Bounds { west_m: 0.0, south_m: 0.0, east_m: w, north_m: h },
            obstacles: i
                .map
                .obstacles
                .iter()
                .map(|o| Obstacle::Disc { x_m: o[0], y_m: h - o[1], radius_m: 0.8 })
                .collect(),
            cars: i
                .agents
                .iter()
                .map(|a| Task { name: a.name.clone(), car, start: pose(a.start), goal: pose(a.goal) })
                .collect(),
            step_m: 2.118,
            clearance_m: 0.02,
            tolerance: Tolerance { position_m: 0.1, yaw_rad: 0.05 },
            by_order: std::env::var_os("BY_ORDER").is_some(),
        };
        let begin = Instant::now();
        let mut go = || begin.elapsed().as_secs_f64() < limit;
        let solver = Solver::new(&problem, &mut go);
        let prepared = begin.elapsed().as_secs_f64();
        let result = solver.and_then(|solver| {
            solver.solve(&Settings { seed, priorities_first: first, ..Settings::default() }, &mut go)
        });
        let time = begin.elapsed().as_secs_f64();
        let name = path.rsplit('/').next().unwrap();
        match result {
            Ok(schedule) => {
                let fine = check(&problem, &schedule);
                if fine.is_ok() {
                    solved += 1;
                    times.push(time);
                }
                println!(
                    "{name} {fine:?} {time:.2} s (prep {prepared:.2}) makespan {} flowtime {}",
                    schedule.makespan(),
                    schedule.flowtime()
                );
            }
            Err(error) => println!("{name} UNSOLVED {time:.2} s (prep {prepared:.2}): {error}"),
        }
    }
    times.sort_by(f64::total_cmp);
    println!(
        "solved {solved} of {count}, median {:.2} s, worst {:.2}",
        times.get(times.len() / 2).unwrap_or(&0.0),
        times.last().unwrap_or(&0.0)
    );
}
