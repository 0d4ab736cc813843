//! One search: from the start on, or from the goal back. It grows by the pose that promises most.

use super::costs::Costs;
use super::curve_heuristic::CurveHeuristic;
use super::lattice::{Heading, Lattice, Moves};
use super::obstacle_heuristic::ObstacleHeuristic;
use super::paged_grid::{Key, PagedGrid};
use super::space::Space;
use crate::MapPose;
use crate::geometry::Piece;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// The move of a root.
const NO_MOVE: u8 = u8::MAX;

#[derive(Debug, Clone, Copy)]
struct Node {
    at_m: [f64; 2],
    cost: f32,
    left: f32,
    parent: u32,
    heading: u16,
    step: u8,
    done: bool,
}

/// What both searches look at while they grow.
pub(super) struct SearchContext<'a, S: Space> {
    pub(super) space: &'a S,
    pub(super) costs: &'a Costs,
    pub(super) heuristic_weight: f64,
}

#[derive(Debug, Default)]
pub(super) struct Tree {
    backward: bool,
    moves: Moves,
    nodes: Vec<Node>,
    open: BinaryHeap<Reverse<u64>>,
    cells: PagedGrid,
    /// Around everything, to the end that is looked for.
    pub(super) distances: ObstacleHeuristic,
    /// The end that is looked for, with the sine and cosine of its yaw.
    target: Option<(MapPose, (f64, f64))>,
    low_m: [f64; 2],
    cell_m: f64,
    best: Option<u32>,
    /// Expansions until the next analytic expansion.
    pub(super) until_analytic: u32,
}

impl Tree {
    /// Begins anew; roots follow.
    pub(super) fn begin<S: Space>(
        &mut self,
        context: &SearchContext<'_, S>,
        lattice: &Lattice,
        root: (MapPose, bool),
        target: Option<MapPose>,
    ) {
        let (bounds, cell_m) = (context.space.bounds(), lattice.cell_m);
        self.moves.begin(lattice, context.space.car().radius_m, root.0.yaw_rad);
        self.nodes.clear();
        self.open.clear();
        (self.backward, self.best, self.until_analytic) = (root.1, None, 0);
        self.target = target.map(|pose| (pose, libm::sincos(pose.yaw_rad)));
        self.cell_m = cell_m;
        // The first root stands in the middle of a square.
        let aligned = |low: f64, at: f64| at - (libm::ceil((at - low) / cell_m) + 0.5) * cell_m;
        self.low_m = [aligned(bounds.low_m[0], root.0.x_m), aligned(bounds.low_m[1], root.0.y_m)];
        let squares =
            |axis: usize| libm::ceil((bounds.high_m[axis] - self.low_m[axis]) / cell_m).max(1.0) as usize;
        self.cells.begin(squares(0), squares(1), usize::from(lattice.headings));
    }

    /// A pose to begin at.
    pub(super) fn add_root<S: Space>(
        &mut self,
        context: &SearchContext<'_, S>,
        curves: &mut CurveHeuristic,
        pose: &MapPose,
    ) {
        let heading = self.moves.nearest(pose.yaw_rad);
        let at_m = [pose.x_m, pose.y_m];
        let Some(key) = self.key(at_m, heading) else { return };
        let left = self.left_m(context.space, curves, pose, libm::sincos(pose.yaw_rad)) as f32;
        self.add(
            key,
            Node { at_m, cost: 0.0, left, parent: 0, heading, step: NO_MOVE, done: false },
            context.heuristic_weight,
        );
    }

    /// The most promising pose that is left; `None` = all that can be reached has been.
    pub(super) fn pop(&mut self) -> Option<u32> {
        while let Some(Reverse(entry)) = self.open.pop() {
            let index = !(entry as u32);
            let node = self.nodes[index as usize];
            let current = self.key(node.at_m, node.heading).and_then(|key| self.cells.get(key));
            if node.done || current != Some(index) {
                continue;
            }
            self.nodes[index as usize].done = true;
            if self.best.is_none_or(|best| node.left < self.nodes[best as usize].left) {
                self.best = Some(index);
            }
            return Some(index);
        }
        None
    }

    /// Grows by all moves from a pose.
    pub(super) fn expand<S: Space>(
        &mut self,
        context: &SearchContext<'_, S>,
        curves: &mut CurveHeuristic,
        index: u32,
    ) {
        let node = self.nodes[index as usize];
        let last = self.moves.all.get(usize::from(node.step)).map(|step| step.piece);
        let (here, heading_here) = (self.pose_of(&node), *self.moves.numbered(node.heading));
        for number in 0..self.moves.all.len() {
            let step = self.moves.all[number];
            let (at_m, heading) = self.moves.next(&step, (node.at_m, node.heading), self.backward);
            let Some(key) = self.key(at_m, heading) else { continue };
            let change = last.map_or(0.0, |last| context.costs.change(&last, &step.piece));
            let near = context.costs.near(context.space, at_m[0], at_m[1]) * step.piece.length_m.abs();
            let cost = node.cost + (context.costs.arc(&step.piece) + change + near) as f32;
            let known = self.cells.get(key).map(|known| &self.nodes[known as usize]);
            if known.is_some_and(|known| known.done || known.cost <= cost) {
                continue;
            }
            let Heading { yaw_rad, direction, .. } = *self.moves.numbered(heading);
            let there = MapPose { x_m: at_m[0], y_m: at_m[1], yaw_rad };
            let from = if self.backward { (&there, direction) } else { (&here, heading_here.direction) };
            if !context.space.drives_towards(from.0, from.1, &step.piece) {
                continue;
            }
            let left = self.left_m(context.space, curves, &there, direction) as f32;
            let next = Node { at_m, cost, left, parent: index, heading, step: number as u8, done: false };
            self.add(key, next, context.heuristic_weight);
        }
    }

    fn add(&mut self, key: Key, node: Node, heuristic_weight: f64) {
        if !node.left.is_finite() {
            return;
        }
        let index = self.nodes.len() as u32;
        let priority = node.cost + heuristic_weight as f32 * node.left;
        self.nodes.push(node);
        self.cells.set(key, index);
        // Positive floats sort like their bits; among equals the newest is first.
        self.open.push(Reverse(u64::from(priority.to_bits()) << 32 | u64::from(!index)));
    }

    /// About the least that is left from a pose, in m.
    fn left_m(
        &mut self,
        space: &impl Space,
        curves: &mut CurveHeuristic,
        pose: &MapPose,
        direction: (f64, f64),
    ) -> f64 {
        let around = self.distances.way_m(space, pose.x_m, pose.y_m);
        let curve = self.target.map_or(0.0, |(target, target_direction)| match self.backward {
            true => curves.cost_towards(&target, target_direction, pose),
            false => curves.cost_towards(pose, direction, &target),
        });
        around.max(curve)
    }

    fn key(&self, at_m: [f64; 2], heading: u16) -> Option<Key> {
        let (u, v) = ((at_m[0] - self.low_m[0]) / self.cell_m, (at_m[1] - self.low_m[1]) / self.cell_m);
        (u >= 0.0 && v >= 0.0).then_some((u as usize, v as usize, usize::from(heading)))
    }

    /// The expanded node in whose cell a pose lies.
    pub(super) fn near(&self, pose: &MapPose) -> Option<u32> {
        let key = self.key([pose.x_m, pose.y_m], self.moves.nearest(pose.yaw_rad))?;
        self.cells.get(key).filter(|&index| self.nodes[index as usize].done)
    }

    fn pose_of(&self, node: &Node) -> MapPose {
        MapPose { x_m: node.at_m[0], y_m: node.at_m[1], yaw_rad: self.moves.numbered(node.heading).yaw_rad }
    }

    pub(super) fn pose(&self, index: u32) -> MapPose {
        self.pose_of(&self.nodes[index as usize])
    }

    /// About the least that is left from a node, in m.
    pub(super) fn left_from_m(&self, index: u32) -> f64 {
        f64::from(self.nodes[index as usize].left)
    }

    /// The expanded node with the least left.
    pub(super) fn best(&self) -> Option<u32> {
        self.best
    }

    /// Whether there is no memory left for new places.
    pub(super) fn full(&self) -> bool {
        self.cells.full()
    }

    /// Nodes in memory.
    pub(super) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// The pieces between the root and a node, from the node on.
    pub(super) fn pieces(&self, index: u32) -> impl Iterator<Item = Piece> + '_ {
        let mut index = index;
        std::iter::from_fn(move || {
            let node = &self.nodes[index as usize];
            let step = self.moves.all.get(usize::from(node.step))?;
            index = node.parent;
            Some(step.piece)
        })
    }
}
