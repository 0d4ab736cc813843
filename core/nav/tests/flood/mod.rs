//! Exhaustive search, to judge planners by: everything that can be driven to, with no estimate of
//! what is left, no budget and another lattice than the planner's.
//!
//! One flood from a base pose on (where it can get) and one back to it (from where it can be reached)
//! answer all questions of a room. A start that connects into the second and a goal that connects out
//! of the first are joined through the base; both connections are real driven curves, so "reachable"
//! is never a matter of rounding. Without a look-out strip motions can be driven back and both floods
//! are the same one.

use std::collections::VecDeque;
use xtb_nav::geometry::reeds_shepp::{self, Curve};
use xtb_nav::{MapPose, Piece, Space};

const CELL_M: f64 = 0.05;
const HEADINGS: usize = 64;
const TURN_RAD: f64 = std::f64::consts::TAU / HEADINGS as f64;

/// Poses from which, or to which, a pose can be driven.
pub(crate) struct Flood<'a, S: Space> {
    space: &'a S,
    backward: bool,
    size: [usize; 2],
    cells: Vec<u32>,
    poses: Vec<MapPose>,
    queue: VecDeque<u32>,
}

impl<'a, S: Space> Flood<'a, S> {
    pub(crate) fn new(space: &'a S, root: &MapPose, backward: bool) -> Self {
        let bounds = space.bounds();
        let size =
            [0, 1].map(|axis| ((bounds.high_m[axis] - bounds.low_m[axis]) / CELL_M).ceil() as usize + 1);
        let cells = vec![u32::MAX; size[0] * size[1] * HEADINGS];
        let mut flood = Self { space, backward, size, cells, poses: Vec::new(), queue: VecDeque::new() };
        flood.add(root);
        flood
    }

    fn cell(&self, pose: &MapPose, offset: [i64; 3]) -> Option<usize> {
        let low = self.space.bounds().low_m;
        let place = [(pose.x_m - low[0]) / CELL_M, (pose.y_m - low[1]) / CELL_M];
        let column = usize::try_from(place[0].floor() as i64 + offset[0]).ok()?;
        let row = usize::try_from(place[1].floor() as i64 + offset[1]).ok()?;
        let heading =
            ((pose.yaw_rad / TURN_RAD).floor() as i64 + offset[2]).rem_euclid(HEADINGS as i64) as usize;
        (column < self.size[0] && row < self.size[1])
            .then_some((row * self.size[0] + column) * HEADINGS + heading)
    }

    fn add(&mut self, pose: &MapPose) {
        let Some(cell) = self.cell(pose, [0; 3]) else { return };
        if self.cells[cell] == u32::MAX {
            self.cells[cell] = self.poses.len() as u32;
            self.queue.push_back(self.poses.len() as u32);
            self.poses.push(*pose);
        }
    }

    /// Looks at one more pose; `None` = there is none left.
    pub(crate) fn step(&mut self) -> Option<MapPose> {
        let here = self.poses[self.queue.pop_front()? as usize];
        let radius_m = self.space.car().radius_m;
        let arc_m = TURN_RAD * radius_m;
        for gear in [1.0, -1.0] {
            for (length_m, curvature) in [
                (arc_m, 1.0),
                (arc_m, -1.0),
                (0.052, 0.0),
                (0.074, 0.0),
                (2.0 * arc_m, 0.5),
                (2.0 * arc_m, -0.5),
            ] {
                let piece = Piece { length_m: gear * length_m, curvature_per_m: curvature / radius_m };
                let there = piece.after(&here, if self.backward { -piece.length_m } else { piece.length_m });
                let known = self.cell(&there, [0; 3]).is_none_or(|cell| self.cells[cell] != u32::MAX);
                if !known && self.space.drives(if self.backward { &there } else { &here }, &piece) {
                    self.add(&there);
                }
            }
        }
        Some(here)
    }

    pub(crate) fn finish(&mut self) -> usize {
        while self.step().is_some() {}
        self.poses.len()
    }

    /// Whether a driven curve joins the pose with one of the flood in the same cell or, if `around`,
    /// in one beside it; in the flood's own direction.
    pub(crate) fn joins(&self, pose: &MapPose, around: bool, curves: &mut Vec<Curve>) -> bool {
        const MOST_DETOUR: f64 = 10.0;
        let offsets = (0..if around { 27 } else { 1 }).map(|n| [n % 3, n / 3 % 3, n / 9]);
        let offsets = offsets.map(|offset| offset.map(|v| if v == 2 { -1 } else { v }));
        offsets.filter_map(|offset| self.cell(pose, offset)).any(|cell| {
            let Some(there) = self.poses.get(self.cells[cell] as usize) else { return false };
            let (from, to) = if self.backward { (pose, there) } else { (there, pose) };
            reeds_shepp::curves(from, to, self.space.car().radius_m, MOST_DETOUR, curves);
            curves.iter().any(|way| {
                let mut at = *from;
                way.pieces().iter().all(|piece| {
                    let free = self.space.drives(&at, piece);
                    at = piece.end(&at);
                    free
                })
            })
        })
    }
}

/// Floods smaller than this are not kept, and what is larger and has no cell in common is apart.
const SMALL: usize = 3000;

/// What is reachable in a room.
pub(crate) struct Reachable<'a, S: Space> {
    space: &'a S,
    /// From the base on; where every motion can be driven back, then one of each part of the room.
    parts: Vec<Flood<'a, S>>,
    /// Back to the base; missing where every motion can be driven back.
    to_base: Option<Flood<'a, S>>,
    curves: Vec<Curve>,
}

impl<'a, S: Space> Reachable<'a, S> {
    /// `reversible`: whether every motion can be driven back.
    pub(crate) fn new(space: &'a S, base: &MapPose, reversible: bool) -> Self {
        let flood = |backward| {
            let mut flood = Flood::new(space, base, backward);
            flood.finish();
            flood
        };
        Self {
            space,
            parts: vec![flood(false)],
            to_base: (!reversible).then(|| flood(true)),
            curves: Vec::new(),
        }
    }

    /// Poses of all parts.
    pub(crate) fn len(&self) -> usize {
        self.parts.iter().map(|part| part.poses.len()).sum()
    }

    /// Whether there is a way from one pose to the other.
    pub(crate) fn is(&mut self, start: &MapPose, goal: &MapPose) -> bool {
        let (mut before, mut after) =
            (Flood::new(self.space, goal, true), Flood::new(self.space, start, false));
        let Self { parts, to_base, curves, .. } = self;
        if let Some(to_base) = to_base {
            let from_base = attached(&mut before, parts, curves).is_some();
            let to_base = attached(&mut after, std::slice::from_ref(to_base), curves).is_some();
            // One that does not meet the base has been flooded to its end.
            return from_base && to_base
                || !from_base && before.joins(start, true, curves)
                || !to_base && after.joins(goal, true, curves);
        }
        let of_goal = part(before, parts, curves);
        let of_start = part(after, parts, curves);
        match (of_start, of_goal) {
            (Ok(start), Ok(goal)) => start == goal,
            (Err(pocket), Err(_)) => pocket.joins(goal, true, curves),
            _ => false,
        }
    }
}

/// The part that the flood meets, or that it becomes; a small one comes back.
fn part<'a, S: Space>(
    mut flood: Flood<'a, S>,
    parts: &mut Vec<Flood<'a, S>>,
    curves: &mut Vec<Curve>,
) -> Result<usize, Flood<'a, S>> {
    match attached(&mut flood, parts, curves) {
        Some(part) => Ok(part),
        None if flood.poses.len() < SMALL => Err(flood),
        None => {
            parts.push(flood);
            Ok(parts.len() - 1)
        }
    }
}

/// Grows the flood until one of its poses is joined to one of the others.
fn attached<S: Space>(
    flood: &mut Flood<'_, S>,
    others: &[Flood<'_, S>],
    curves: &mut Vec<Curve>,
) -> Option<usize> {
    let mut join = |pose: &MapPose, around| others.iter().position(|other| other.joins(pose, around, curves));
    while let Some(pose) = flood.step() {
        if let Some(part) = join(&pose, false) {
            return Some(part);
        }
    }
    if flood.poses.len() >= SMALL {
        return None;
    }
    flood.poses.iter().find_map(|pose| join(pose, true))
}
