//! Toy fleets under traffic control over many seeds, as a table; one run as a drawing.
//!
//! `cargo run -p xtb-traffic --example coordinator -- SCENE [FIRST-LAST] [--svg FILE]` with SCENE one of door,
//! sleepers, life, narrow, dead, restart, circle, corridor, lane, pocket, bay, l and seeds from FIRST to LAST; with `--svg` the first one is drawn.

#![allow(clippy::unwrap_used, clippy::print_stdout, dead_code)]

#[path = "../tests/coordinator/scenes.rs"]
mod scenes;
#[path = "../tests/coordinator/toy.rs"]
mod toy;

use plotters::prelude::*;
use std::error::Error;
use std::sync::OnceLock;
use std::time::Instant;
use toy::{Trouble, World};
use xtb_nav::{Cell, MapPose};
use xtb_traffic::coordinator::RoomGeometry;

fn clock_ms() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1000.0
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let scene = arguments.first().map_or("door", String::as_str);
    let seeds = arguments.get(1).map_or("1-5", String::as_str);
    let (first, last) = seeds.split_once('-').unwrap_or((seeds, seeds));
    let (first, last): (u64, u64) = (first.parse().unwrap(), last.parse().unwrap());
    let svg = arguments.iter().position(|text| text == "--svg").and_then(|place| arguments.get(place + 1));
    println!(
        "seed  arrived  time_s  still_s  wait_s  plans  without  deadlocks  cyclic  stalls  job_ms: median  max"
    );
    for seed in first..=last {
        if matches!(scene, "dead" | "restart") {
            hurt(scene, seed);
            continue;
        }
        let (mut world, goals) = match scene {
            "pocket" => scenes::pocket(seed, clock_ms),
            "bay" => scenes::bay(seed, clock_ms),
            "circle" => scenes::circle(seed, clock_ms),
            "l" => {
                let (world, goals) = scenes::l_corridor(seed, clock_ms);
                (world, goals.into_iter().map(|[x_m, y_m]| scenes::pose(x_m, y_m, 0.0)).collect())
            }
            "corridor" => scenes::corridor(seed, clock_ms),
            "lane" => scenes::lane(seed, clock_ms),
            "sleepers" => scenes::door(seed, 1.2 + 0.2 * (seed % 5) as f64, Trouble::SLEEPY, clock_ms),
            _ => scenes::door(seed, 1.2 + 0.2 * (seed % 5) as f64, Trouble::SOME, clock_ms),
        };
        let doors = matches!(scene, "door" | "sleepers");
        if matches!(scene, "life" | "narrow") {
            live(scene, seed);
            continue;
        }
        let rounds = if doors { 3 } else { 1 };
        let mut arrived = true;
        for round in 1..=rounds {
            let count = goals.len();
            for index in 0..count {
                let goal: MapPose = if doors { goals[(index + 2 * round) % count] } else { goals[index] };
                world.send_to(index, [goal.x_m, goal.y_m], (scene != "l").then_some(goal.yaw_rad));
            }
            arrived &= world.run(240.0);
        }
        let counters = world.counters();
        let mut jobs = world.jobs_ms.clone();
        jobs.sort_by(f64::total_cmp);
        println!(
            "{seed:4}  {:7}  {:6.1}  {:7.1}  {:6.1}  {:5}  {:7}  {:9}  {:6}  {:6}  {:14.0}  {:4.0}",
            if arrived { "all" } else { "NOT ALL" },
            world.now.s() - 1.0,
            world.longest_still_s,
            world.longest_wait_s,
            counters.plans,
            counters.without_way,
            counters.deadlocks,
            counters.cyclic,
            counters.stalls,
            jobs.get(jobs.len() / 2).unwrap_or(&0.0),
            jobs.last().unwrap_or(&0.0),
        );
        if !arrived {
            for toy in world.toys.iter().filter(|toy| toy.goal.is_some()) {
                let says = toy.says.as_ref().map(|guide| (&guide.waits_for, &guide.reason, guide.release_m));
                println!("      {} at {:?} to {:?}: {says:?}", toy.name, toy.pose, toy.goal);
            }
        }
        if let Some(file) = svg.filter(|_| seed == first) {
            draw(file, &world).unwrap();
        }
    }
}

/// One dies in the doorway, or the coordinator dies three times.
fn hurt(scene: &str, seed: u64) {
    let door_m = 1.2 + 0.2 * (seed % 5) as f64;
    let mut world = if scene == "dead" {
        scenes::dead(seed, door_m, clock_ms).0
    } else {
        let (mut world, places) = scenes::door(seed, door_m, Trouble::SOME, clock_ms);
        (0..5).for_each(|index| world.send(index, places[(index + 2) % 5]));
        let mut draw = toy::Draw::new(seed + 1000);
        for _ in 0..3 {
            world.run(draw.uniform(3.0, 15.0));
            world.kill_coordinator();
            world.run(draw.uniform(0.3, 8.0));
            world.start_coordinator();
        }
        world
    };
    let arrived = world.run(200.0);
    let open: Vec<String> = world
        .toys
        .iter()
        .filter(|toy| toy.goal.is_some() && toy.alive)
        .map(|toy| format!("{}: {:?}", toy.name, toy.says.as_ref().and_then(|guide| guide.reason.clone())))
        .collect();
    println!(
        "{seed:4}  all there: {arrived} after {:.1} s, stood {:.1} s, waited {:.1} s, {:?}; open: {open:?}",
        world.now.s(),
        world.longest_still_s,
        world.longest_wait_s,
        world.counters()
    );
}

/// Everybody who arrives is sent on: ten minutes in the two rooms, five in narrow ones.
fn live(scene: &str, seed: u64) {
    let mut draw = toy::Draw::new(seed + 1000);
    let world = if scene == "life" {
        let (mut world, places) = scenes::life(seed, Trouble::SOME, clock_ms);
        while world.now.s() < 600.0 {
            scenes::send_on(&mut world, &places, &mut draw);
            world.turn();
        }
        world
    } else {
        let mut world = scenes::narrow(seed, clock_ms);
        let (mut still, mut most) = (0.0_f64, (0.0_f64, 0.0));
        while world.now.s() < 300.0 {
            for index in 0..world.toys.len() {
                while world.toys[index].goal.is_none() {
                    let place = scenes::free_place(&world.room, &mut draw);
                    let near = |toy: &toy::Toy| {
                        let [x_m, y_m] =
                            toy.goal.map_or([toy.pose.x_m, toy.pose.y_m], |goal| [goal.x_m, goal.y_m]);
                        (x_m - place[0]).hypot(y_m - place[1]) < 1.0
                    };
                    if !world.toys.iter().any(near) {
                        world.send_to(index, place, None);
                    }
                }
            }
            world.turn();
            still = if world.toys.iter().any(|toy| toy.still_since == world.now) { 0.0 } else { still + 0.1 };
            most = if still > most.0 { (still, world.now.s()) } else { most };
        }
        println!("{} trucks, all stood {:.1} s until {:.1} s", world.toys.len(), most.0, most.1);
        world
    };
    let arrived: u32 = world.toys.iter().map(|toy| toy.arrived).sum();
    let mut jobs = world.jobs_ms.clone();
    jobs.sort_by(f64::total_cmp);
    println!(
        "{seed:4}  {arrived} arrivals, stood {:.1} s, waited {:.1} s, {} jobs: median {:.0} ms, longest {:.0} ms, {:?}",
        world.longest_still_s,
        world.longest_wait_s,
        jobs.len(),
        jobs.get(jobs.len() / 2).unwrap_or(&0.0),
        jobs.last().unwrap_or(&0.0),
        world.counters(),
    );
}

/// The room, and the way that each truck drove.
fn draw(file: &str, world: &World) -> Result<(), Box<dyn Error>> {
    /// Pixels of a metre.
    const SCALE: f64 = 160.0;
    let [_, [width, height]] = world.room.corners_m();
    let root = SVGBackend::new(file, ((width * SCALE) as u32, (height * SCALE) as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    let chart = ChartBuilder::on(&root).build_cartesian_2d(0.0..width, 0.0..height)?;
    let floor = chart.plotting_area();
    let grid = world.room.grid();
    let half = grid.resolution_m() / 2.0;
    for row in 0..grid.height() as i64 {
        for column in 0..grid.width() as i64 {
            if grid.cell(column, row) != Cell::Free {
                let [x, y] = grid.centre_m(column, row);
                let corners = [(x - half, y - half), (x + half, y + half)];
                floor.draw(&Rectangle::new(corners, BLACK.filled()))?;
            }
        }
    }
    for (index, toy) in world.toys.iter().enumerate() {
        // The golden angle never comes round to the same colour.
        let colour = HSLColor((index as f64 * 0.381_966).fract(), 0.67, 0.45);
        let way: Vec<(f64, f64)> = toy.trace.iter().map(|pose| (pose.x_m, pose.y_m)).collect();
        floor.draw(&PathElement::new(way, colour.stroke_width(4)))?;
        for pose in [toy.trace[0], toy.pose] {
            let [a, b, c, d] = toy.car.corners(&pose).map(<(f64, f64)>::from);
            floor.draw(&Polygon::new(vec![a, b, c, d], colour.mix(0.3)))?;
            floor.draw(&PathElement::new(vec![a, b, c, d, a], colour.stroke_width(2)))?;
        }
    }
    root.present()?;
    Ok(())
}
