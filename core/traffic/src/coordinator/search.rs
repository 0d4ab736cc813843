//! One truck's way in space and time around all others: Hybrid-A* on safe intervals.
//!
//! A node is a pose and the time at which it is reached, together with the time until which it may
//! stay there. Waiting is no move of its own: each move leaves as early as it can within that
//! interval. Two nodes of one cell compete only if the truck could have waited from one to the other
//! (M. Phillips and M. Likhachev, *SIPP: Safe interval path planning*, ICRA 2011).

use super::crowd::Crowd;
use super::lane;
use super::occupancy::{NEVER, TICK_WAY_M};
use super::order::GEAR_TICKS;
use super::task::{Leg, Other, Stuck, Task};
use crate::hybrid_a_star::{End, Expand, Tree};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::geometry::rect::{INFRARED_STOPS_M, LOOK_OUT_M, Rect, Stand};
use xtb_nav::geometry::reeds_shepp;
use xtb_nav::map::GOAL_YAWS;
use xtb_nav::navigator::{BODY_MARGINS_M, GRAZE_M, RADIUS_FACTOR};
use xtb_nav::{MapPose, Path, Piece};

/// How closely is looked.
struct Grain {
    /// Of moves that each node tries, in ticks.
    moves: &'static [u32],
    /// Side of a cell in which nodes compete, in m.
    cell_m: f64,
    /// Directions of a cell.
    directions: f64,
}

/// Moves of 28 cm, 36° on an XTB's circle as it is planned; cells and directions chosen to tell these apart.
const COARSE: Grain = Grain { moves: &[4], cell_m: 0.12, directions: 20.0 };
/// For turning between two walls: moves of 7 cm too, 9° on an XTB's circle.
const FINE: Grain = Grain { moves: &[4, 1], cell_m: 0.05, directions: 48.0 };
/// Turn and gear of the moves: on full lock or straight.
const MOVES: [(f64, f64); 6] = [(0.0, 1.0), (1.0, 1.0), (-1.0, 1.0), (0.0, -1.0), (1.0, -1.0), (-1.0, -1.0)];
/// What the estimate counts more than what has been driven: ways are found sooner and may cost up to twice as
/// much; chosen, not measured.
const HEURISTIC_WEIGHT: f64 = 2.0;
/// What a change of gear costs beyond its time, in ticks; chosen, not measured.
const GEAR_COST: f64 = 4.0;
/// What a tick astern costs more than one ahead; chosen, not measured.
const ASTERN_COST: f64 = 0.3;
/// What a tick of waiting costs: less than one of driving, or every detour is tried before. Chosen, not
/// measured.
const WAIT_COST: f64 = 0.3;
/// What a move through the place of a truck costs that has to leave it first, in ticks; chosen, not measured.
const SOFT_COST: f64 = 12.0;
/// What a tick costs more for each metre beside the lane in a corridor; chosen, not measured.
const LANE_COST: f64 = 0.6;
/// So often on its way a truck is looked at for that, in ticks: once each coarse move.
const LANE_TICKS: u32 = 4;
/// Longest wait for a gap, in ticks (100 s); chosen, not measured.
const MOST_WAIT: u32 = 400;
/// Margin of the look-out to fixed things, in m, less than the body's; chosen, not measured.
const LOOK_MARGIN_M: f64 = 0.02;
/// So near to the start what would stop a truck is all that has to be free before one that is held up, in m: it begins
/// two small moves there; chosen, not measured.
const NEAR_M: f64 = 1.5 * TICK_WAY_M;
// A robot takes a path that grazes something on its own map as little as this.
const _: () = assert!(-BODY_MARGINS_M[4] < GRAZE_M);

struct Node {
    pose: MapPose,
    gear: f64,
    tick: u32,
    safe: u32,
    cost: f64,
    legs: Vec<Leg>,
    goal: bool,
}

/// Tick of arrival, tick until which it may stay, cost.
type Seen = (u32, u32, f64);

/// Looks for a way, and closer where what is fixed leaves none to large steps; out of a place where that leaves none
/// either (a thing, or a wall that it has ended near to) with less look-out. At most so many nodes are expanded, and each counts one down in `left`.
pub(super) fn search(task: &Task<'_>, most: u32, left: &mut u32) -> Result<Vec<Leg>, Stuck> {
    let mut budget = most.min(*left);
    *left -= budget;
    let mut look =
        |task: &Task<'_>, grain, first_look_m| Search::new(task, grain, first_look_m)?.run(&mut budget);
    let mut found = look(task, &COARSE, LOOK_OUT_M);
    let things: Vec<Other<'_>> = task.others.iter().filter(|other| other.is_thing).copied().collect();
    let alone = Task { others: &things, ..*task };
    if found == Err(Stuck::Nowhere)
        && (things.len() == task.others.len() || look(&alone, &COARSE, LOOK_OUT_M) == Err(Stuck::Nowhere))
    {
        found = look(task, &FINE, LOOK_OUT_M);
        if found == Err(Stuck::Nowhere) {
            found = look(task, &FINE, INFRARED_STOPS_M);
        }
    }
    *left += budget;
    found
}

struct Search<'a> {
    task: &'a Task<'a>,
    grain: &'static Grain,
    /// So far beyond the bumper must be free of what is fixed as long as it is near the start, in m.
    first_look_m: f64,
    radius_m: f64,
    body_margin_m: f64,
    crowd: Crowd<'a>,
    /// No goal can be entered for good before this tick: whoever is there sooner waits, wherever that is.
    free_from: u32,
    goals: Vec<MapPose>,
    closed: BTreeMap<(i32, i32, i32), Vec<Seen>>,
    sweep: Vec<Stand>,
}

impl<'a> Search<'a> {
    fn new(task: &'a Task<'a>, grain: &'static Grain, first_look_m: f64) -> Result<Self, Stuck> {
        let here = Rect::body(task.car, &task.start);
        let body_margin_m = BODY_MARGINS_M
            .into_iter()
            .find(|&margin| task.room.is_free(&here, margin))
            .ok_or(Stuck::Start)?;
        let radius_m = task.car.radius_m * RADIUS_FACTOR;
        let (goals, closed, sweep) = (Vec::new(), BTreeMap::new(), Vec::new());
        let reach_m = Rect::looking(task.car, &task.start, 1.0).reach_m();
        let crowd = Crowd::new(task.others, reach_m);
        let free_from = 0;
        let mut search = Self {
            task,
            grain,
            first_look_m,
            radius_m,
            body_margin_m,
            crowd,
            free_from,
            goals,
            closed,
            sweep,
        };
        if let Some(target) = &task.target {
            let yaws: Vec<f64> = match target.yaw_rad {
                Some(yaw_rad) => vec![yaw_rad],
                None => (0..GOAL_YAWS).map(|n| wrap_rad(f64::from(n) * TAU / f64::from(GOAL_YAWS))).collect(),
            };
            let poses = yaws.into_iter().map(|yaw_rad| MapPose { x_m: target.x_m, y_m: target.y_m, yaw_rad });
            search.goals = poses.filter(|pose| search.may_stay(pose)).collect();
            if search.goals.is_empty() {
                return Err(Stuck::Goal);
            }
            if target.yaw_rad.is_none() && search.goals.iter().any(|pose| search.lets_drive_on(pose)) {
                search.goals =
                    search.goals.iter().copied().filter(|pose| search.lets_drive_on(pose)).collect();
            }
            let free_from = |pose: &MapPose| search.crowd.free_from(&Stand::still(task.car, pose));
            search.free_from = search.goals.iter().map(free_from).min().unwrap_or(0);
        }
        Ok(search)
    }

    fn run(&mut self, budget: &mut u32) -> Result<Vec<Leg>, Stuck> {
        let Task { car, start: pose, gear, tick, .. } = *self.task;
        let safe = self.crowd.safe_until(&Stand::still(car, &pose), tick);
        let heuristic = self.heuristic(&pose).ok_or(Stuck::Nowhere)?;
        let root = Node { pose, gear, tick, safe, cost: 0.0, legs: Vec::new(), goal: false };
        let mut tree = Tree::new();
        tree.plant(root, self.estimate(0.0, tick, heuristic));
        match tree.search(self, budget) {
            Ok(goal) => Ok(tree.chain(goal).into_iter().flat_map(|node| node.legs.clone()).collect()),
            Err(End::Nowhere) => Err(Stuck::Nowhere),
            Err(End::Budget) => Err(Stuck::Budget),
        }
    }

    /// Straight to the goal along a Reeds–Shepp curve.
    fn shoot(&mut self, tree: &mut Tree<Node>, index: u32, pose: &MapPose) {
        let (radius_m, gears) = (self.radius_m, self.task.car.gears);
        let way = |goal| reeds_shepp::shortest_in(gears, pose, goal, radius_m);
        let mut ways: Vec<Path> = self.goals.iter().filter_map(way).collect();
        ways.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        for way in ways.iter().take(3) {
            if self.go(tree, index, &way.pieces, true) {
                break;
            }
        }
    }

    /// Drives these pieces from a node as early as possible, and once more in a later gap. True if
    /// there is a gap.
    fn go(&mut self, tree: &mut Tree<Node>, from: u32, pieces: &[Piece], goal: bool) -> bool {
        let Node { pose, gear, tick, safe, cost, .. } = *tree.node(from);
        let mut sweep = std::mem::take(&mut self.sweep);
        let swept = self.sweep_over(&mut sweep, pose, gear, pieces);
        let Some((end, end_gear, legs, extra)) = swept else {
            self.sweep = sweep;
            return false;
        };
        let heuristic = if goal { Some(0.0) } else { self.heuristic(&end) };
        let Some(heuristic) = heuristic else {
            self.sweep = sweep;
            return false;
        };
        let mut first_two = [None; 2];
        first_two
            .iter_mut()
            .zip(self.gaps(&sweep, &end, (tick, safe), goal))
            .for_each(|(place, gap)| *place = Some(gap));
        for (depart, safe) in first_two.into_iter().flatten() {
            let (arrive, waited) = (depart + sweep.len() as u32, depart - tick);
            let cost = cost + WAIT_COST * f64::from(waited) + sweep.len() as f64 + extra;
            if goal || self.is_new(&end, end_gear, arrive, safe, cost) {
                let legs = legs.iter().map(|leg| Leg { depart: leg.depart + depart, ..*leg }).collect();
                let next = Node { pose: end, gear: end_gear, tick: arrive, safe, cost, legs, goal };
                tree.push(from, next, self.estimate(cost, arrive, heuristic));
            }
        }
        self.sweep = sweep;
        first_two[0].is_some()
    }

    /// The gaps in which a sweep fits, for one that is at its start from one tick on and may stay until another one: when
    /// it leaves, and until when it may stay at the end (for good, if that is its goal). The first ones alone are cheap.
    fn gaps(
        &self,
        sweep: &[Stand],
        end: &MapPose,
        (tick, safe): (u32, u32),
        goal: bool,
    ) -> impl Iterator<Item = (u32, u32)> {
        let still = sweep
            .last()
            .map_or_else(|| Stand::still(self.task.car, end), |stand| Stand { look: None, ..*stand });
        let (mut delay, mut met) = (0, 0);
        std::iter::from_fn(move || {
            while delay <= MOST_WAIT && tick + delay <= safe {
                let depart = tick + delay;
                if !self.crowd.is_clear(sweep, depart, &mut met) {
                    if depart > self.crowd.still {
                        break;
                    }
                    delay += 2;
                    continue;
                }
                let arrive = depart + sweep.len() as u32;
                let safe_then = self.crowd.safe_until(&still, arrive);
                if goal && safe_then != NEVER {
                    delay += 4;
                    continue;
                }
                delay = if safe_then == NEVER { NEVER } else { delay + safe_then - arrive + 1 };
                return Some((depart, safe_then));
            }
            delay = NEVER;
            None
        })
    }

    /// The stands tick by tick, the end, and what the pieces cost beyond their time; `None` if
    /// something fixed is in the way. The legs' times count from the departure.
    fn sweep_over(
        &self,
        sweep: &mut Vec<Stand>,
        from: MapPose,
        gear: f64,
        pieces: &[Piece],
    ) -> Option<(MapPose, f64, Vec<Leg>, f64)> {
        sweep.clear();
        let (mut pose, mut gear, mut extra, mut legs) = (from, gear, 0.0, Vec::with_capacity(pieces.len()));
        let (car, room) = (self.task.car, self.task.room);
        for piece in pieces {
            if room.one_way().is_some_and(|zones| zones.against(&pose, piece).is_some()) {
                return None;
            }
            let next = piece.gear();
            if next != gear {
                let still = Stand::still(car, &pose);
                sweep.extend([still; GEAR_TICKS as usize]);
                extra += GEAR_COST;
                gear = next;
            }
            let ticks = libm::ceil(piece.length_m.abs() / TICK_WAY_M - 1e-6).max(1.0) as u32;
            legs.push(Leg { piece: *piece, depart: sweep.len() as u32, ticks });
            let mut before = pose;
            for tick in 1..=ticks {
                let there = piece.after(&pose, piece.length_m * f64::from(tick) / f64::from(ticks));
                let (body, look) = (Rect::body(car, &there), Rect::looking(car, &before, gear));
                if !room.is_free(&body, self.body_margin_m)
                    || !self.looks_free(&look, [&before, &there], gear)
                {
                    return None;
                }
                sweep.push(Stand { body, look: Some(look) });
                before = there;
                if tick % LANE_TICKS == 0 || tick == ticks {
                    let share = if tick % LANE_TICKS == 0 { LANE_TICKS } else { tick % LANE_TICKS };
                    extra += LANE_COST * f64::from(share) * lane::beside_m(room, car, &there, gear);
                }
            }
            if gear < 0.0 {
                extra += ASTERN_COST * f64::from(ticks);
            }
            pose = piece.end(&pose);
        }
        if sweep.last().is_some_and(|end| self.task.soft.iter().any(|rect| rect.overlaps(&end.body, 0.05))) {
            extra += SOFT_COST;
        }
        Some((pose, gear, legs, extra))
    }

    /// Whether nothing fixed is in the look-out of a truck that drives on from there; near the start neither there nor
    /// where this leads is anything that would stop it.
    fn looks_free(&self, look: &Rect, [from, to]: [&MapPose; 2], gear: f64) -> bool {
        let Task { car, room, start, .. } = self.task;
        let is_near = libm::hypot(from.x_m - start.x_m, from.y_m - start.y_m) < NEAR_M;
        if is_near && self.first_look_m < LOOK_OUT_M {
            let least = [from, to].map(|pose| Rect::looking_to(car, pose, gear, self.first_look_m));
            return least.iter().all(|look| room.is_free(look, self.body_margin_m.min(0.0)));
        }
        room.is_free(look, LOOK_MARGIN_M.min(self.body_margin_m))
    }

    /// Whether the truck can stand there for good.
    fn may_stay(&self, pose: &MapPose) -> bool {
        let stand = Stand::still(self.task.car, pose);
        self.task.room.is_free(&stand.body, self.body_margin_m) && self.crowd.leaves_free(&stand)
    }

    /// Whether who ends there in any heading can drive on: by the lanes, and with what is fixed at least a small move.
    fn lets_drive_on(&self, pose: &MapPose) -> bool {
        let mut sweep = Vec::new();
        let mut goes = |(turn, gear)| {
            let piece = self.piece(FINE.moves[1], turn, gear);
            self.sweep_over(&mut sweep, *pose, gear, &[piece]).is_some()
        };
        self.task.room.one_way().is_none_or(|zones| zones.lets_drive_on(pose))
            && MOVES.into_iter().filter(|(_, gear)| self.task.car.gears.allow(*gear)).any(&mut goes)
    }

    /// A move of so many ticks, + = to the left and ahead.
    fn piece(&self, ticks: u32, turn: f64, gear: f64) -> Piece {
        let length_m = TICK_WAY_M * f64::from(ticks) * gear;
        Piece { length_m, curvature_per_m: turn / self.radius_m }
    }

    /// Ticks to the goal at least, or nearly; `None` where none can be reached.
    fn heuristic(&self, pose: &MapPose) -> Option<f64> {
        let flat_m = self.task.field.distance_m(pose.x_m, pose.y_m)?;
        let Some(target) = &self.task.target else { return Some(flat_m / TICK_WAY_M) };
        let curved_m = match (target.yaw_rad, self.goals.first()) {
            (Some(_), Some(goal)) => reeds_shepp::distance_m(pose, goal, self.radius_m),
            _ => 0.0,
        };
        Some(flat_m.max(curved_m) / TICK_WAY_M)
    }

    /// What a way through a node reached at this tick costs, roughly. The wait until the goal is free counts wherever
    /// it is spent: otherwise all that could be reached meanwhile would be looked at before the goal.
    fn estimate(&self, cost: f64, tick: u32, heuristic: f64) -> u64 {
        let wait = (f64::from(self.free_from) - f64::from(tick) - heuristic).max(0.0);
        // Floats that are not negative sort like their bits.
        (cost + heuristic * HEURISTIC_WEIGHT + WAIT_COST * wait).to_bits()
    }

    /// Whether no earlier node of this cell could have waited until then for less.
    fn is_new(&mut self, pose: &MapPose, gear: f64, tick: u32, safe: u32, cost: f64) -> bool {
        let along = |v: f64| libm::floor(v / self.grain.cell_m) as i32;
        let turn = libm::floor((pose.yaw_rad / TAU + 0.5) * self.grain.directions) as i32;
        let key = (along(pose.x_m), along(pose.y_m), turn * 2 + i32::from(gear > 0.0));
        let seen = self.closed.entry(key).or_default();
        if seen.iter().any(|&(from, until, least)| from <= tick && tick <= until && least <= cost + 1.0) {
            return false;
        }
        seen.retain(|&(from, until, least)| {
            !(tick <= from && from <= safe && cost <= least && until <= safe)
        });
        seen.push((tick, safe, cost));
        true
    }
}

impl Expand for Search<'_> {
    type Node = Node;

    fn is_goal(&self, node: &Node) -> bool {
        let evaded = self.task.target.is_none() && node.safe == NEVER;
        node.goal || evaded && (node.legs.is_empty() || self.lets_drive_on(&node.pose))
    }

    fn expand(&mut self, tree: &mut Tree<Node>, index: u32) {
        let pose = tree.node(index).pose;
        let left_m = self.heuristic(&pose).map_or(f64::MAX, |ticks| ticks * TICK_WAY_M);
        if left_m < 3.0 || f64::from(tree.expanded) % libm::ceil(left_m / 2.0) == 0.0 {
            self.shoot(tree, index, &pose);
        }
        for &ticks in self.grain.moves {
            for (turn, gear) in MOVES {
                if self.task.car.gears.allow(gear) {
                    let piece = self.piece(ticks, turn, gear);
                    self.go(tree, index, &[piece], false);
                }
            }
        }
    }
}

fn rank(path: &Path) -> f64 {
    path.length_m() + TICK_WAY_M * GEAR_COST * path.cusps() as f64
}

mod same_way;
pub(super) use same_way::keep_to;

#[cfg(test)]
mod tests;
