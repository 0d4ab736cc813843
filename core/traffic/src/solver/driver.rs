//! One car as the search needs it: body, places, moves, and the heuristic to its goal.

use super::body::Body;
use super::cost_to_go::{CostToGo, Grain};
use super::motion::Spot;
use super::obstacle_index::{Keep, ObstacleIndex};
use super::places::Places;
use super::problem::{CarTask, Problem};
use std::sync::Arc;
use xtb_nav::{Gears, MapPose, Piece};

/// One car, ready for the search.
#[derive(Debug)]
pub(crate) struct Driver {
    pub(crate) name: String,
    pub(crate) body: Body,
    pub(crate) radius: f64,
    /// In which directions it drives.
    pub(crate) gears: Gears,
    pub(crate) start: Spot,
    pub(crate) goal: MapPose,
    /// Straight, left and right, ahead and astern as its gears allow.
    pub(crate) moves: Vec<Piece>,
    /// From obstacles.
    pub(crate) keep: Keep,
    pub(crate) to_goal: Arc<CostToGo>,
}

impl Driver {
    /// A car at its places, with a coarse heuristic, or that of the same car on the way to the same goal.
    /// `None` when it was told not to go on.
    pub(crate) fn new(
        problem: &Problem,
        obstacles: &ObstacleIndex,
        (task, body, keep, places): (&CarTask, Body, Keep, &Places),
        known: Option<&Self>,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let (name, radius, gears, goal) = (task.name.clone(), task.car.radius_m, task.car.gears, places.goal);
        let (start, moves) = (Spot::new(&places.start), Vec::new());
        if let Some(known) = known {
            let (moves, to_goal) = (known.moves.clone(), known.to_goal.clone());
            return Some(Self { name, body, radius, gears, start, goal, moves, keep, to_goal });
        }
        let to_goal = Arc::new(CostToGo::unknown(problem));
        let mut driver = Self { name, body, radius, gears, start, goal, moves, keep, to_goal };
        driver.look(problem, obstacles, Grain::COARSE, keep_going)?;
        Some(driver)
    }

    /// Looks for the goal from everywhere, as finely as the grain says.
    pub(crate) fn look(
        &mut self,
        problem: &Problem,
        obstacles: &ObstacleIndex,
        grain: Grain,
        keep_going: &mut dyn FnMut() -> bool,
    ) -> Option<()> {
        self.moves = grain.moves(problem.step_m, self.radius);
        self.moves.retain(|piece| self.gears.allow(piece.length_m));
        let (car, ends) = ((&self.body, &self.moves[..], &self.keep), (&self.start, &Spot::new(&self.goal)));
        self.to_goal = Arc::new(CostToGo::flood(problem, grain, obstacles, car, ends, keep_going)?);
        Some(())
    }
}
