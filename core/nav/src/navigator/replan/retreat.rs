//! A way back: to the nearest place where another robot's way does not lead.

use super::caution::{AS_SEEN, CAUTION_LEVELS};
use super::job::{PlanFailure, Planned};
use super::search::{Search, TOLERANCE_M};
use crate::MapPose;
use crate::geometry::Rect;
use crate::geometry::path::wrap_rad;
use crate::navigator::MARGIN_M;
use crate::planner::space::Space;
use crate::planner::{Planner, PlannerGoal};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Cells of the map that are looked at for a place, 150 m² at 5 cm; chosen, not measured.
const MOST_CELLS: usize = 60_000;
/// Places are this many cells apart, 30 cm at 5 cm; chosen, not measured.
const APART: i64 = 6;
/// Directions in which it may stand there, 45° apart; chosen, not measured.
const DIRECTIONS: u32 = 8;
/// Directions that are tried at one place; chosen, not measured.
const EACH: usize = 2;
/// Places that a path is looked for to; chosen, not measured.
const PLACES: usize = 10;
/// What the search for one of them may cost, about 0.13 s on a small computer; chosen, not measured.
const EXPANSIONS: usize = 20_000;
/// Between it and the other one's way, half of it on each side, in m; chosen, not measured.
const OFF_M: f64 = 0.10;
/// The yaw in which it stands there, in rad: 9° to either side, as any will do; chosen, not measured.
const TOLERANCE_RAD: f64 = 0.15;

impl Search<'_> {
    /// A path out of the way of somebody who drives through all of `sweep`.
    pub(super) fn retreat(&self, planner: &mut Planner, sweep: &[Rect]) -> Result<Planned, PlanFailure> {
        let level = &CAUTION_LEVELS[AS_SEEN];
        let space = self.space(level, &self.seen, &self.unseen[AS_SEEN])?;
        let clear = |pose: &MapPose| {
            let body = Rect::body(&self.car, pose);
            space.standing(pose).is_none() && !sweep.iter().any(|there| there.overlaps(&body, OFF_M / 2.0))
        };
        for pose in self.refuges(&clear) {
            let MapPose { x_m, y_m, yaw_rad } = pose;
            let (tolerance_m, tolerance_rad) = (TOLERANCE_M, TOLERANCE_RAD);
            let goal = PlannerGoal { x_m, y_m, yaw_rad: Some(yaw_rad), tolerance_m, tolerance_rad };
            if let Ok(path) = self.search(planner, &space, &goal, EXPANSIONS)
                && self.blind(&path).is_empty()
            {
                return Ok(Planned { path, to_vantage: false, expects_thin: true });
            }
        }
        Err(PlanFailure::at_present("no path back", None))
    }

    /// Places to stand, the nearest ones first as one has to drive.
    fn refuges(&self, clear: &dyn Fn(&MapPose) -> bool) -> Vec<MapPose> {
        let grid = self.map.map.grid();
        let (width, height) = (grid.width() as i64, grid.height() as i64);
        let from = grid.place(self.start.x_m, self.start.y_m);
        let inside = |(column, row): (i64, i64)| (0..width).contains(&column) && (0..height).contains(&row);
        if !inside(from) {
            return Vec::new();
        }
        let least_m = self.car.half_width_m + MARGIN_M / 2.0;
        let bodies: Vec<Rect> = self.others.iter().map(|(_, pose)| Rect::body(&self.car, pose)).collect();
        let open = |[x_m, y_m]: [f64; 2]| {
            self.map.clearance.at_least_m(x_m, y_m) >= least_m
                && bodies.iter().all(|body| body.distance_m(x_m, y_m) >= least_m)
        };
        let mut seen = vec![false; grid.width() * grid.height()];
        let mut queue = VecDeque::from([from]);
        let mut places = Vec::new();
        let mut looked = 0;
        while let Some((column, row)) = queue.pop_front() {
            looked += 1;
            if places.len() >= PLACES || looked > MOST_CELLS {
                break;
            }
            let [x_m, y_m] = grid.centre_m(column, row);
            if column % APART == 0 && row % APART == 0 {
                places.extend(
                    self.yaws().map(|yaw_rad| MapPose { x_m, y_m, yaw_rad }).filter(clear).take(EACH),
                );
            }
            for (right, up) in [(1, 0), (0, 1), (-1, 0), (0, -1)] {
                let next = (column + right, row + up);
                if !inside(next) {
                    continue;
                }
                let known = &mut seen[next.1 as usize * grid.width() + next.0 as usize];
                if !*known && open(grid.centre_m(next.0, next.1)) {
                    queue.push_back(next);
                }
                *known = true;
            }
        }
        places
    }

    /// The way it points now, and a little to either side of it, and so on.
    fn yaws(&self) -> impl Iterator<Item = f64> {
        let step_rad = TAU / f64::from(DIRECTIONS);
        (0..DIRECTIONS).map(move |n| {
            let side = if n % 2 == 0 { 1.0 } else { -1.0 };
            wrap_rad(self.start.yaw_rad + side * f64::from(n.div_ceil(2)) * step_rad)
        })
    }
}
