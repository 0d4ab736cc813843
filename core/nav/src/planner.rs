//! Finds a way for a car that goes ahead and astern: hybrid A* from both ends.
//!
//! ```text
//!   start ──► tree of driven arcs ──► Reeds–Shepp curve ◄─ tree of arcs that lead to ◄── goal
//!                     │                                             │
//!                     └── priority: cost so far + heuristic weight · max(way around everything, curves)
//! ```
//!
//! D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, *Practical search techniques in path planning for
//! autonomous driving* (2008). Two things differ. The two ends take turns, so it costs no more than
//! twice what the easier one does: a car leaves a narrow place sooner than it finds into it, and a
//! pocket without a way out is known as soon as its few poses are. And a search that has emptied a
//! coarse lattice goes on with a finer one before it says that there is no way.

mod analytic_expansion;
mod costs;
mod curve_heuristic;
mod error;
mod lattice;
mod obstacle_heuristic;
mod paged_grid;
mod request;
mod shortcuts;
pub mod space;
mod tree;

pub use error::{End, PlanError};
pub use lattice::Lattice;
pub use request::{PlannerGoal, PlannerSettings};

use crate::MapPose;
use crate::geometry::{Path, Piece};
use analytic_expansion::AnalyticExpansion;
use costs::Costs;
use curve_heuristic::CurveHeuristic;
use request::GOAL_HEADINGS;
use shortcuts::Shortcuts;
use space::{GridSpace, Hit, Obstruction, Space};
use std::f64::consts::TAU;
use tree::{SearchContext, Tree};

/// Expansions of one tree until it is the other's turn; chosen, not measured.
const TURN: usize = 16;
/// The tree from the start on, and that from the goal back.
const FORWARD: usize = 0;
const BACKWARD: usize = 1;

/// A way there.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Begins exactly at the start and meets the goal.
    pub path: Path,
    /// What it costs by the settings.
    pub cost: f64,
    /// Poses the search has looked at.
    pub expansions: usize,
}

/// The search, with memory that is used again from plan to plan.
#[derive(Debug, Default)]
pub struct Planner {
    trees: [Tree; 2],
    curves: CurveHeuristic,
    analytic: AnalyticExpansion,
    shortcuts: Shortcuts,
    goals: Vec<MapPose>,
    /// Any heading will do from which the car can drive on.
    drives_on: bool,
}

impl Planner {
    /// A search without memory yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// A path from `start` to `goal` for the car of the space. `keep_going` is asked now and then
    /// whether the search may go on.
    ///
    /// # Errors
    /// Why there is none, see [`PlanError`].
    pub fn plan(
        &mut self,
        space: &impl Space,
        start: &MapPose,
        goal: &PlannerGoal,
        settings: &PlannerSettings,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Plan, PlanError> {
        request::check(start, goal, settings)?;
        self.ends(space, start, goal)?;
        let costs = Costs::new(settings, space.car().core_m());
        self.curves.begin(space.car().radius_m, &costs);
        if let Some(path) = self.at_once(space, &costs, start) {
            return Ok(self.finished(space, &costs, settings, path, 0));
        }
        self.around_everything(space, start, goal, settings)?;
        let query = Query { space, costs: &costs, start, goal, settings };
        let (path, expansions) = self.search(&query, keep_going)?;
        Ok(self.finished(space, &costs, settings, path, expansions))
    }

    /// [`Planner::plan`] on a grid, compiled with this library's optimisation whoever calls it.
    ///
    /// # Errors
    /// Why there is no path, see [`PlanError`].
    pub fn plan_on_grid(
        &mut self,
        space: &GridSpace,
        start: &MapPose,
        goal: &PlannerGoal,
        settings: &PlannerSettings,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<Plan, PlanError> {
        self.plan(space, start, goal, settings, keep_going)
    }

    /// A single curve that does it.
    fn at_once(&mut self, space: &impl Space, costs: &Costs, start: &MapPose) -> Option<Path> {
        nearest_goals(&mut self.curves, &self.goals, start).find_map(|goal| {
            let way = self.analytic.free(space, costs, (start, &self.goals[goal]), f64::INFINITY)?;
            let mut path = Path::standing(*start);
            way.pieces().iter().for_each(|piece| path.push(*piece));
            Some(path)
        })
    }

    fn finished(
        &mut self,
        space: &impl Space,
        costs: &Costs,
        settings: &PlannerSettings,
        mut path: Path,
        expansions: usize,
    ) -> Plan {
        for _ in 0..settings.rounds {
            let shorter = self.shortcuts.path(space, costs, &mut self.analytic, &mut self.curves, &path);
            // Another round would look at the same curves again.
            let Some(shorter) = shorter else { break };
            path = shorter;
        }
        Plan { cost: costs.path(space, &path), path, expansions }
    }

    /// Whether the car can stand at both ends, and in which headings at the goal.
    fn ends(&mut self, space: &impl Space, start: &MapPose, goal: &PlannerGoal) -> Result<(), PlanError> {
        if let Some(hit) = space.standing(start) {
            return Err(PlanError::StartInCollision(hit));
        }
        let turned = |parts: u16| move |n: u16| f64::from(n) * TAU / f64::from(parts);
        let (first, others) = match goal.yaw_rad {
            Some(yaw) => (yaw, [-0.5, 0.5, -1.0, 1.0].map(|part| yaw + part * goal.tolerance_rad).to_vec()),
            None => (0.0, (1..GOAL_HEADINGS).map(turned(GOAL_HEADINGS)).collect()),
        };
        let hit = space.standing(&goal.pose(first));
        self.goals.clear();
        if hit.is_none() {
            self.goals.push(goal.pose(first));
        }
        if goal.yaw_rad.is_none() || hit.is_some() {
            let free =
                others.into_iter().map(|yaw| goal.pose(yaw)).filter(|pose| space.standing(pose).is_none());
            self.goals.extend(free.take(if goal.yaw_rad.is_some() { 1 } else { usize::MAX }));
        }
        self.drives_on = goal.yaw_rad.is_none() && self.goals.iter().any(|pose| space.lets_drive_on(pose));
        if self.drives_on {
            self.goals.retain(|pose| space.lets_drive_on(pose));
        }
        match hit {
            Some(at) if self.goals.is_empty() => Err(match &at.what {
                Obstruction::KeepOut(name) => PlanError::GoalKeptOut { name: name.clone(), at },
                _ => PlanError::GoalInCollision(at),
            }),
            _ => Ok(()),
        }
    }

    /// Whether there is a way around everything for a car that turns on the spot.
    fn around_everything(
        &mut self,
        space: &impl Space,
        start: &MapPose,
        goal: &PlannerGoal,
        settings: &PlannerSettings,
    ) -> Result<(), PlanError> {
        let (start_m, goal_m) = ([start.x_m, start.y_m], [goal.x_m, goal.y_m]);
        let [ahead, back] = &mut self.trees;
        ahead.distances.begin(space, settings.square_m, goal_m, start_m);
        let reached = ahead.distances.way_m(space, start.x_m, start.y_m).is_finite();
        back.distances.begin_opposite(&ahead.distances, start_m, goal_m);
        if reached {
            return Ok(());
        }
        let goal_is_walled_in = ahead.distances.finish(space) <= back.distances.finish(space);
        let (end, inside, outside_m) = match goal_is_walled_in {
            true => (End::Goal, &ahead.distances, start_m),
            false => (End::Start, &back.distances, goal_m),
        };
        let at_m = inside.nearest_m(outside_m).unwrap_or(if goal_is_walled_in { goal_m } else { start_m });
        Err(PlanError::Unreachable { end, at_m, by: first_hit(space, at_m, outside_m) })
    }

    fn search<S: Space>(
        &mut self,
        query: &Query<'_, S>,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Result<(Path, usize), PlanError> {
        let Query { space, costs, settings, .. } = *query;
        let context = SearchContext { space, costs, heuristic_weight: settings.heuristic_weight };
        let (mut expansions, mut own, mut levels) = (0, [0; 2], [0; 2]);
        self.add_root(query, &context, FORWARD, 0);
        self.add_root(query, &context, BACKWARD, 0);
        loop {
            for tree in [FORWARD, BACKWARD] {
                for _ in 0..TURN {
                    let popped = self.trees[tree].pop();
                    let finer = settings.lattices.get(levels[tree] + 1);
                    let (poses, spent) = (
                        self.trees[tree].len(),
                        own[tree] >= settings.lattices[levels[tree]].most_expansions,
                    );
                    match (popped, finer) {
                        (None, Some(finer)) if poses <= finer.pocket => {}
                        (Some(_), Some(_)) if spent => {}
                        (None, _) if self.full() => return Err(self.spent(query, expansions)),
                        (None, _) => return Err(self.walled_in(query, tree)),
                        (Some(node), _) => {
                            (expansions, own[tree]) = (expansions + 1, own[tree] + 1);
                            if let Some(path) = self.connect(query, tree, node) {
                                return Ok((path, expansions));
                            }
                            self.trees[tree].expand(&context, &mut self.curves, node);
                            continue;
                        }
                    }
                    (own[tree], levels[tree]) = (0, levels[tree] + 1);
                    self.add_root(query, &context, tree, levels[tree]);
                }
            }
            if self.full() || expansions >= settings.most_expansions || !keep_going() {
                return Err(self.spent(query, expansions));
            }
        }
    }

    /// Begins a tree anew on a lattice.
    fn add_root<S: Space>(
        &mut self,
        query: &Query<'_, S>,
        context: &SearchContext<'_, S>,
        tree: usize,
        level: usize,
    ) {
        let lattice = &query.settings.lattices[level];
        let own = &mut self.trees[tree];
        if tree == FORWARD {
            let goal = query.goal.yaw_rad.and_then(|_| self.goals.first().copied());
            own.begin(context, lattice, (*query.start, false), goal);
            own.add_root(context, &mut self.curves, query.start);
        } else {
            own.begin(context, lattice, (self.goals[0], true), Some(*query.start));
            self.goals.iter().for_each(|pose| own.add_root(context, &mut self.curves, pose));
        }
    }

    /// A path through a node, if it is at the goal, near the other tree, or a free curve leads to the other end.
    fn connect<S: Space>(&mut self, query: &Query<'_, S>, tree: usize, node: u32) -> Option<Path> {
        let pose = self.trees[tree].pose(node);
        let drives_on = !self.drives_on || pose == *query.start || query.space.lets_drive_on(&pose);
        if tree == FORWARD && query.goal.met_by(&pose) && drives_on {
            return Some(self.joined(query.start, node, &[], None));
        }
        if let Some(met) = self.trees[1 - tree].near(&pose) {
            let other = self.trees[1 - tree].pose(met);
            if let Some(path) = self.join_analytically(query, tree, (node, &pose), (met, &other)) {
                return Some(path);
            }
        }
        if self.trees[tree].until_analytic > 0 {
            self.trees[tree].until_analytic -= 1;
            return None;
        }
        let left_m = self.trees[tree].left_from_m(node);
        self.trees[tree].until_analytic = (left_m / query.settings.analytic_spacing_m) as u32;
        if tree == BACKWARD {
            return self.join_analytically(query, tree, (node, &pose), (0, query.start));
        }
        nearest_goals(&mut self.curves, &self.goals, &pose).find_map(|root| {
            let goal = self.goals[root];
            self.join_analytically(query, tree, (node, &pose), (root as u32, &goal))
        })
    }

    /// A path by a curve between nodes of both trees.
    fn join_analytically<S: Space>(
        &mut self,
        query: &Query<'_, S>,
        tree: usize,
        node: (u32, &MapPose),
        other: (u32, &MapPose),
    ) -> Option<Path> {
        let (from, to) = if tree == FORWARD { (node, other) } else { (other, node) };
        let way = self.analytic.free(query.space, query.costs, (from.1, to.1), f64::INFINITY)?;
        Some(self.joined(query.start, from.0, way.pieces(), Some(to.0)))
    }

    /// From the start to a node, by these pieces, and from a node of the other tree to the goal.
    fn joined(&self, start: &MapPose, from: u32, way: &[Piece], to: Option<u32>) -> Path {
        let mut path = Path::standing(*start);
        let driven: Vec<Piece> = self.trees[FORWARD].pieces(from).collect();
        driven.iter().rev().chain(way).for_each(|piece| path.push(*piece));
        if let Some(to) = to {
            self.trees[BACKWARD].pieces(to).for_each(|piece| path.push(piece));
        }
        path
    }

    fn walled_in<S: Space>(&self, query: &Query<'_, S>, tree: usize) -> PlanError {
        let (start_m, goal_m) = ([query.start.x_m, query.start.y_m], [query.goal.x_m, query.goal.y_m]);
        let (end, own_m, other_m) =
            if tree == FORWARD { (End::Start, start_m, goal_m) } else { (End::Goal, goal_m, start_m) };
        let best = self.trees[tree].best().map(|node| self.trees[tree].pose(node));
        let at_m = best.map_or(own_m, |pose| [pose.x_m, pose.y_m]);
        PlanError::Unreachable { end, at_m, by: first_hit(query.space, at_m, other_m) }
    }

    fn spent<S: Space>(&self, query: &Query<'_, S>, expansions: usize) -> PlanError {
        let tree = &self.trees[FORWARD];
        let best = tree.best();
        let nearest = best.map_or(*query.start, |node| tree.pose(node));
        let left_m = best.map_or(f64::INFINITY, |node| tree.left_from_m(node));
        let by = first_hit(query.space, [nearest.x_m, nearest.y_m], [query.goal.x_m, query.goal.y_m]);
        PlanError::Budget { expansions, nearest, left_m, by }
    }

    /// Whether there is no memory left for new places.
    fn full(&self) -> bool {
        self.trees.iter().any(Tree::full)
    }

    /// Poses in memory after the last search.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.trees.iter().map(Tree::len).sum()
    }
}

/// What one search is about.
struct Query<'a, S: Space> {
    space: &'a S,
    costs: &'a Costs,
    start: &'a MapPose,
    goal: &'a PlannerGoal,
    settings: &'a PlannerSettings,
}

/// The two headings at the goal that are the cheapest to get to from a pose where nothing is in the way.
fn nearest_goals(
    curves: &mut CurveHeuristic,
    goals: &[MapPose],
    from: &MapPose,
) -> impl Iterator<Item = usize> + use<> {
    let mut best = [(f64::INFINITY, usize::MAX); 2];
    for (index, goal) in goals.iter().enumerate() {
        let cost = curves.cost(from, goal);
        if cost < best[0].0 {
            best = [(cost, index), best[0]];
        } else if cost < best[1].0 {
            best[1] = (cost, index);
        }
    }
    best.into_iter().map(|(_, index)| index).filter(|&index| index != usize::MAX)
}

/// What a car that goes straight from one point to another would touch first.
fn first_hit(space: &impl Space, from_m: [f64; 2], to_m: [f64; 2]) -> Option<Hit> {
    /// Less than half of the usual cell of a map, in m.
    const STEP_M: f64 = 0.02;
    let (dx, dy) = (to_m[0] - from_m[0], to_m[1] - from_m[1]);
    let yaw_rad = libm::atan2(dy, dx);
    let steps = libm::ceil(libm::hypot(dx, dy) / STEP_M).max(1.0);
    (0..=steps as usize).find_map(|step| {
        let part = step as f64 / steps;
        space.standing(&MapPose { x_m: from_m[0] + part * dx, y_m: from_m[1] + part * dy, yaw_rad })
    })
}
