//! The planner's table of docs/navigation.md: random queries in three rooms against an exhaustive search.
//! `cargo run -p xtb-nav --example rooms [queries [seed]]`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "../tests/flood/mod.rs"]
mod flood;

use flood::Reachable;
use std::time::Instant;
use xtb_nav::planner::space::{GridLayers, LookOut};
use xtb_nav::rooms::{Draw, RoomKind};
use xtb_nav::{Car, Gears, GridSpace, MapPose, PlanError, Planner, PlannerGoal, PlannerSettings, Space};

const TRUCK: Car =
    Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.393, gears: Gears::BOTH };

fn main() {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u64>().unwrap());
    let (queries, seed) = (numbers.next().unwrap_or(2000), numbers.next().unwrap_or(1));
    for (title, look_out) in [("Body alone", LookOut::OFF), ("With the look-out strip", LookOut::TRUCK)] {
        println!("\n{title}, {queries} queries a room:\n");
        println!(
            "| room | reachable | solved | unreachable | solved there | median ms | p95 ms | max ms | median expansions | max | mean m |"
        );
        println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
        for room in RoomKind::ALL {
            row(room, look_out, queries, seed);
        }
    }
}

/// A pose with much room around it.
fn roomy(space: &GridSpace, draw: &mut Draw) -> MapPose {
    let poses = (0..100).map(|_| draw.free_pose(space).unwrap());
    let room = |pose: &MapPose| space.clearance_m(pose.x_m, pose.y_m);
    poses.max_by(|a, b| room(a).total_cmp(&room(b))).unwrap()
}

struct Answer {
    start: MapPose,
    goal: MapPose,
    solved: bool,
    ms: f64,
    expansions: usize,
}

fn row(room: RoomKind, look_out: LookOut, queries: u64, seed: u64) {
    let grid = room.grid(seed);
    let space = GridSpace::new(&GridLayers::map(&grid), TRUCK, look_out).unwrap();
    let (mut draw, mut planner, settings) = (Draw::new(seed), Planner::new(), PlannerSettings::default());
    let (mut stretch, mut answers) = (0.0, Vec::new());
    for _ in 0..queries {
        let (start, goal) = (draw.free_pose(&space).unwrap(), draw.free_pose(&space).unwrap());
        let began = Instant::now();
        let plan =
            planner.plan_on_grid(&space, &start, &PlannerGoal::exactly(&goal), &settings, &mut || true);
        let ms = began.elapsed().as_secs_f64() * 1e3;
        let expansions = match &plan {
            Ok(plan) => plan.expansions,
            Err(PlanError::Budget { expansions, .. }) => *expansions,
            Err(_) => planner.nodes(),
        };
        stretch += plan.as_ref().map_or(0.0, |plan| plan.path.length_m());
        answers.push(Answer { start, goal, solved: plan.is_ok(), ms, expansions });
    }
    let mut reachable = Reachable::new(&space, &roomy(&space, &mut draw), look_out == LookOut::OFF);
    let truth: Vec<bool> = answers.iter().map(|answer| reachable.is(&answer.start, &answer.goal)).collect();
    let count = |solved, can| {
        let pairs = answers.iter().zip(&truth);
        pairs.filter(|(answer, truth)| answer.solved == solved && **truth == can).count()
    };
    let mut times: Vec<f64> = answers.iter().map(|answer| answer.ms).collect();
    times.sort_by(f64::total_cmp);
    let mut expansions: Vec<usize> = answers.iter().map(|answer| answer.expansions).collect();
    expansions.sort_unstable();
    let at = |part: f64| ((answers.len() as f64 * part) as usize).min(answers.len() - 1);
    println!(
        "| {} | {} | {} | {} | {} | {:.2} | {:.1} | {:.0} | {} | {} | {:.2} |",
        room.name(),
        count(true, true) + count(false, true),
        count(true, true),
        count(true, false) + count(false, false),
        count(true, false),
        times[at(0.5)],
        times[at(0.95)],
        times[times.len() - 1],
        expansions[at(0.5)],
        expansions[expansions.len() - 1],
        stretch / (count(true, true) + count(true, false)).max(1) as f64,
    );
    for (answer, truth) in
        answers.iter().zip(&truth).filter(|(answer, truth)| answer.solved != **truth).take(10)
    {
        let ends =
            [answer.start, answer.goal].map(|p| format!("({:.3}, {:.3}, {:.3})", p.x_m, p.y_m, p.yaw_rad));
        println!("  {} but {truth}: {} → {}", answer.solved, ends[0], ends[1]);
    }
    let unsolved: Vec<f64> = answers.iter().filter(|answer| !answer.solved).map(|answer| answer.ms).collect();
    let worst = unsolved.iter().copied().fold(0.0, f64::max);
    println!(
        "  flood {} poses, {} not solved, worst of these {worst:.0} ms",
        reachable.len(),
        unsolved.len()
    );
}
