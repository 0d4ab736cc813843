//! How much floor a path takes the body over that nobody has looked at.
//!
//! Turning does it: the inner side of a bend and the tail pass over some 3 dm² a radian that no beam gets to,
//! whatever the radius. So of several ways the one that turns less, turns wider, or turns where it has looked,
//! is worth some time. How much depends on what is known of the place: where something thin has been met that is
//! not on the map, more of it is likely, and it also looks aside (`side_scan`).

use super::caution::CautionLevel;
use super::job::Planned;
use super::search::Search;
use super::visibility_grid::VisibilityGrid;
use crate::geometry::Path;
use crate::navigator::following::{BEND_MPS, TIGHT};
use crate::navigator::visibility::{BODY_STEP_M, blind_points};
use crate::obstacle_layer::ObstacleLayer;
use crate::planner::Planner;
use crate::planner::space::GridSpace;

/// Circles that are tried beside the tightest, as multiples of its radius; chosen, not measured.
const WIDER: [f64; 2] = [2.0, 3.5];
/// What the search for one of these may cost: where it is not easy, it is not worth it.
const EXPANSIONS: usize = 8_000;
/// As much time is a square metre of such floor worth, in s: a turn by one radian passes over 0.03 m², 2 s;
/// chosen, not measured.
const WORTH_S_PER_M2: f64 = 60.0;
/// And near something thin, 30 s for such a turn; chosen, not measured.
const WORTH_NEAR_S_PER_M2: f64 = 1000.0;
/// A change of gear takes this long, in s: to stand (`follower.standing_s`), to turn the wheels and to start;
/// chosen, not measured.
const CUSP_S: f64 = 1.5;
/// Longer paths are taken as they are, in m, for the time that it takes to value them; chosen, not measured.
const MOST_M: f64 = 30.0;

/// A path and what it costs.
struct Valued {
    planned: Planned,
    /// Its time, and what the blind floor is worth, in s.
    cost_s: f64,
}

impl Search<'_> {
    /// This path, or, where there is room, a better one with wider bends in the same world.
    pub(super) fn least_blind(
        &self,
        planner: &mut Planner,
        level: &CautionLevel,
        space: &GridSpace,
        path: Path,
    ) -> Planned {
        if path.length_m() > MOST_M {
            return Planned { path, to_vantage: false, expects_thin: true };
        }
        let mut best = self.valued(path, space);
        for wider in WIDER.into_iter().filter(|_| level.keeps_margin()) {
            let (car, look_out) = self.planned_car(level, wider);
            let wide = space.with_car(car, look_out);
            let Ok(path) = self.search(planner, &wide, &self.goal(), EXPANSIONS) else { continue };
            if self.blind(&path).is_empty() {
                let other = self.valued(path, space);
                best = if other.cost_s < best.cost_s { other } else { best };
            }
        }
        best.planned
    }

    /// The path with looks aside where something thin was met, and what it costs.
    fn valued(&self, path: Path, space: &GridSpace) -> Valued {
        let met = |at: [f64; 2]| {
            self.obstacles
                .thin_obstacles()
                .any(|[x_m, y_m]| libm::hypot(x_m - at[0], y_m - at[1]) <= ObstacleLayer::THIN_NEAR_M)
        };
        let parts = [0.0, 0.25, 0.5, 0.75, 1.0].map(|part| path.at(part * path.length_m()).0);
        let near = parts.iter().any(|pose| met([pose.x_m, pose.y_m]));
        let (worth, blind_m2, path) = match near {
            true => {
                let is_open = |at| met(at) && !self.obstacles.is_swept(at);
                let grid = self.map.map.grid();
                let eyes = (&self.car, self.obstacles.sight());
                let mut visibility = VisibilityGrid::new(&path, eyes, grid, &is_open, &self.unobserved);
                let path = visibility.looking_aside(&path, space);
                (WORTH_NEAR_S_PER_M2, visibility.blind_m2(), path)
            }
            false => (WORTH_S_PER_M2, self.blind_m2(&path), path),
        };
        let cost_s = self.duration_s(&path) + worth * blind_m2;
        Valued { planned: Planned { path, to_vantage: false, expects_thin: near }, cost_s }
    }

    /// About how long it takes.
    fn duration_s(&self, path: &Path) -> f64 {
        let tight = |curvature_per_m: f64| curvature_per_m.abs() * self.car.radius_m >= TIGHT;
        let driven_s: f64 = path
            .pieces
            .iter()
            .map(|piece| {
                let mps = if tight(piece.curvature_per_m) { BEND_MPS } else { self.cruise_mps };
                piece.length_m.abs() / mps
            })
            .sum();
        driven_s + CUSP_S * path.cusps() as f64
    }

    /// Floor that the body passes over before anybody has looked there.
    fn blind_m2(&self, path: &Path) -> f64 {
        let grid = self.map.map.grid();
        let side_m = grid.resolution_m();
        let mut cells = Vec::new();
        let steps = libm::ceil(path.length_m() / BODY_STEP_M) as u32;
        for step in 0..=steps {
            let (pose, _) = path.at(f64::from(step) * BODY_STEP_M);
            for [x_m, y_m] in self.car.body_points(&pose) {
                cells.push(grid.place(x_m, y_m));
            }
        }
        cells.sort_unstable();
        cells.dedup();
        let middles = cells.into_iter().map(|(column, row)| grid.centre_m(column, row));
        let unknown: Vec<[f64; 2]> = middles.filter(|at| !self.obstacles.is_known_free(*at)).collect();
        let eyes = (&self.car, self.obstacles.sight());
        let blind = blind_points(path, [0.0, path.length_m()], eyes, &unknown);
        blind.len() as f64 * side_m * side_m
    }
}
