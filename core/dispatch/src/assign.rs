//! Who does what: free robots and waiting tasks, by priority, then by cost.
//!
//! A task is given to a robot only when that robot is free for it, never earlier; so whenever robots
//! come, go, fail or are latched, everything that is not under way yet is decided anew. What is under
//! way is never reassigned. A robot that is nearly done ([`predicted_free`](crate::predicted_free)) is a
//! candidate that stands where it will end, with the way until then added to its cost; what falls to it waits.
//!
//! Tasks go by their level, priority plus one for each minute of waiting. Level by level, from the top:
//! small levels are solved exactly ([`exact`]), large ones by auction ([`auction`]), which is within its
//! smallest raise for each robot of the best. Since levels grow without bound, every task is once at
//! the top: none starves.

pub mod auction;
pub mod exact;

use crate::travel_cost::TravelCost;
use xtb_nav::{Car, MapPose};
use xtb_protocol::messages::{TaskId, Waypoint};

/// Pairs up to which distances are exact: up to 30 µs each on a slow machine.
const EXACT_DISTANCES: usize = 4_000;
/// Pairs up to which a level is solved exactly.
const EXACT_PAIRS: usize = 20_000;
/// Rows up to which a level is solved exactly.
const EXACT_ROWS: usize = 128;
/// Of one level, the oldest so many tasks for each free robot are looked at together.
const TASKS_PER_ROBOT: usize = 2;
/// At least so many.
const TASKS_AT_LEAST: usize = 64;
/// What may not be.
pub const INFEASIBLE: f32 = f32::INFINITY;

/// A robot that is free, or soon will be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// Where it is, or will be then.
    pub pose: MapPose,
    /// What car it is.
    pub car: Car,
    /// Added to each of its distances, in m: a battery that is getting low, the way until it is free.
    pub extra_m: f64,
}

/// A task that waits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Which.
    pub id: TaskId,
    /// Priority, and one for each minute of waiting.
    pub level: u64,
    /// Where it begins; `None` = anywhere.
    pub first: Option<Waypoint>,
}

/// Pairs of a task's and a robot's index. `penalty_m(task, robot)` says how much more than the distance it
/// costs, in m, or that it may not be.
#[must_use]
pub fn assign(
    tasks: &[Demand],
    robots: &[Candidate],
    travel_cost: &dyn TravelCost,
    penalty_m: &dyn Fn(usize, usize) -> Option<f64>,
) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..tasks.len()).collect();
    order.sort_by_key(|&task| (std::cmp::Reverse(tasks[task].level), tasks[task].id));
    let mut free: Vec<usize> = (0..robots.len()).collect();
    let mut pairs = Vec::new();
    let mut from = 0;
    while from < order.len() && !free.is_empty() {
        let level = tasks[order[from]].level;
        let most = (free.len() * TASKS_PER_ROBOT).max(TASKS_AT_LEAST);
        let of_level = order[from..].iter().take_while(|&&task| tasks[task].level == level);
        let window: Vec<usize> = of_level.take(most).copied().collect();
        from += window.len();
        let cost = costs(tasks, robots, &window, &free, travel_cost, penalty_m);
        let found = solve(&cost, window.len(), free.len());
        for &(task, robot) in &found {
            pairs.push((window[task], free[robot]));
        }
        let taken: std::collections::BTreeSet<usize> = found.iter().map(|&(_, robot)| free[robot]).collect();
        free.retain(|robot| !taken.contains(robot));
    }
    pairs
}

/// Row by row, a task each.
fn costs(
    tasks: &[Demand],
    robots: &[Candidate],
    window: &[usize],
    free: &[usize],
    travel_cost: &dyn TravelCost,
    penalty_m: &dyn Fn(usize, usize) -> Option<f64>,
) -> Vec<f32> {
    let exact = window.len() * free.len() <= EXACT_DISTANCES;
    let mut cost = Vec::with_capacity(window.len() * free.len());
    for &task in window {
        for &robot in free {
            let Some(more_m) = penalty_m(task, robot) else {
                cost.push(INFEASIBLE);
                continue;
            };
            let Candidate { pose, car, extra_m } = &robots[robot];
            let way_m = match &tasks[task].first {
                None => 0.0,
                Some(first) if exact => travel_cost.distance_m(car, pose, first),
                Some(first) => travel_cost.estimate_m(car, pose, first),
            };
            cost.push((way_m + extra_m + more_m) as f32);
        }
    }
    cost
}

/// Pairs of row and column: as many as may be, the cheapest.
#[must_use]
pub fn solve(cost: &[f32], rows: usize, columns: usize) -> Vec<(usize, usize)> {
    let wide = rows <= columns;
    let (less, more) = if wide { (rows, columns) } else { (columns, rows) };
    let turned: Vec<f32>;
    let cost = if wide {
        cost
    } else {
        turned = (0..columns).flat_map(|c| (0..rows).map(move |r| cost[r * columns + c])).collect();
        &turned
    };
    let small = less <= EXACT_ROWS && less * more <= EXACT_PAIRS;
    let found = if small { exact::solve(cost, less, more) } else { auction::solve(cost, less, more) };
    let pairs = found.into_iter().enumerate().filter_map(|(row, column)| column.map(|column| (row, column)));
    pairs.map(|(row, column)| if wide { (row, column) } else { (column, row) }).collect()
}
