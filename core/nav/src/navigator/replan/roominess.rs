//! Room beside the body, where there is some.
//!
//! Somewhere on the way there may be hardly any: where it stands, at the goal, in a gap. A path that was planned
//! for that comes as near to walls and bodies elsewhere too, though nobody makes it. So its tight stretches are
//! planned again with the usual margin, all of them at once, or else one by one; what stays is where there is no
//! other way. Between something and another robot that is none either: where the other one stands is not known
//! so well, and it drives on.

use super::caution::{AS_SEEN, CAUTION_LEVELS, CautionLevel};
use super::job::PlanFailure;
use super::search::Search;
use crate::MapPose;
use crate::geometry::{Path, Piece};
use crate::planner::space::{GridSpace, Space};
use crate::planner::{Planner, PlannerGoal};

/// Between two places at which the body is laid on the map, in m: the usual cell of a map.
const STEP_M: f64 = 0.05;
/// A stretch is planned again from so far before it to so far behind it, in m, if there is room; chosen for
/// an XTB, which turns on 0.45 m, not measured.
const AROUND_M: f64 = 0.8;
/// Another robot that is as near as this is passed with the usual margin or not at all, in m: a little more
/// than what is kept free beside it, 0.14 m.
const ROBOT_NEAR_M: f64 = 0.15;
/// To where there is room it may be as many steps, 1 m, …
const LEAVING_STEPS: u32 = 20;
/// … in bends that are so flat against the tightest: beside a wall the tail swings out. Chosen, not measured.
const FLAT: [f64; 3] = [1.0, 0.3, 0.08];
/// As many tight stretches are planned again at most, for the time, …
const MOST: usize = 6;
/// … and one may cost this, about 0.07 s on a small computer; both chosen, not measured.
const EXPANSIONS: usize = 10_000;

impl Search<'_> {
    /// The path that was planned with this care, with more room wherever there is another one that has it.
    pub(super) fn with_room(
        &self,
        planner: &mut Planner,
        level: &CautionLevel,
        unseen: &[[f64; 2]],
        path: Path,
    ) -> Result<Path, PlanFailure> {
        let barely = self.space(level, &self.seen, unseen)?;
        let space = self.space(&CAUTION_LEVELS[AS_SEEN], &self.seen, unseen)?;
        let mut again = |from: &MapPose, goal: &PlannerGoal| {
            self.search_from(planner, &space, from, goal, EXPANSIONS).ok()
        };
        // It had to be tight where it stands only, or at the goal only, or at both.
        let (start, end) = (path.start, path.end());
        let ends = leaving(&start, &barely, &space).zip(arriving(&end, &barely, &space));
        let ends = ends.filter(|(away, last)| away.length_m() + last.length_m() > 0.0);
        let whole = ends.and_then(|(away, last)| {
            let to = if last.pieces.is_empty() { self.goal() } else { PlannerGoal::exactly(&last.start) };
            Some(away.clone().and(&again(&away.end(), &to)?).and(&last))
        });
        let whole = whole.filter(|whole| self.blind(whole).is_empty());
        let better = whole.unwrap_or_else(|| {
            let mut better = Path::standing(start);
            let mut done_m = 0.0;
            for pair in roomy(&path, &space).windows(2).take(MOST) {
                let from_m = (pair[0][1] - AROUND_M).max(pair[0][0]).max(done_m);
                let to_m = (pair[1][0] + AROUND_M).min(pair[1][1]);
                if let Some(way) = again(&path.at(from_m).0, &PlannerGoal::exactly(&path.at(to_m).0)) {
                    better = better.and(&path.tail(done_m).head(from_m - done_m)).and(&way);
                    done_m = to_m;
                }
            }
            better.and(&path.tail(done_m))
        });
        let path = if self.blind(&better).is_empty() { better } else { path };
        match self.squeezes(&path, &space) {
            Some(at) => Err(PlanFailure::at_present("another robot leaves too little room", Some(at))),
            None => Ok(path),
        }
    }

    /// Where a path leads through little room beside another robot, but for where it stands and where it goes.
    fn squeezes(&self, path: &Path, space: &GridSpace) -> Option<[f64; 2]> {
        let body = self.car.grown(ROBOT_NEAR_M);
        let steps = libm::ceil(path.length_m() / STEP_M) as u32;
        let is_tight = |pose: &MapPose| space.standing(pose).is_some();
        let last = if is_tight(&path.end()) { steps.saturating_sub(LEAVING_STEPS) } else { steps };
        (LEAVING_STEPS..=last).find_map(|step| {
            let (pose, _) = path.at(f64::from(step) * STEP_M);
            let beside = self.robots.iter().copied().find(|point| body.distance_m(&pose, *point) <= 0.0)?;
            is_tight(&pose).then_some(beside)
        })
    }
}

/// The shortest way from a place to one with room; none of any length where there is some already.
fn leaving(from: &MapPose, barely: &GridSpace, space: &GridSpace) -> Option<Path> {
    to_room(from, barely, space).find(|way| barely.drives_all(&way.start, &way.pieces))
}

/// The shortest way to a place from one with room.
fn arriving(at: &MapPose, barely: &GridSpace, space: &GridSpace) -> Option<Path> {
    // In the other gear: another bumper looks ahead then, and one-way zones are driven the other way.
    to_room(at, barely, space)
        .map(|way| way.reversed())
        .find(|way| barely.drives_all(&way.start, &way.pieces))
}

/// Ways from a place to others with room, the shortest first, driven or not.
fn to_room(from: &MapPose, barely: &GridSpace, space: &GridSpace) -> impl Iterator<Item = Path> {
    let tight_per_m = 1.0 / barely.car().radius_m;
    let shapes = [[0.0, 0.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]];
    let bent = move |flat: f64| shapes.map(|bends| bends.map(|bend| bend * flat * tight_per_m));
    let ways = (0..=LEAVING_STEPS).flat_map(move |steps| {
        let half_m = f64::from(steps) * STEP_M / 2.0;
        let both = FLAT.into_iter().flat_map(bent).flat_map(|bends| [1.0, -1.0].map(|gear| (bends, gear)));
        both.map(move |(bends, gear)| {
            let piece = |curvature_per_m| Piece { length_m: gear * half_m, curvature_per_m };
            Path::standing(*from).and(&Path { start: *from, pieces: bends.map(piece).to_vec() })
        })
    });
    ways.filter(|way| space.standing(&way.end()).is_none())
}

/// From where to where along a path there is room, in m.
fn roomy(path: &Path, space: &GridSpace) -> Vec<[f64; 2]> {
    let steps = libm::ceil(path.length_m() / STEP_M) as u32;
    let mut stretches: Vec<[f64; 2]> = Vec::new();
    let mut is_open = false;
    for step in 0..=steps {
        let way_m = (f64::from(step) * STEP_M).min(path.length_m());
        let is_free = space.standing(&path.at(way_m).0).is_none();
        match stretches.last_mut() {
            Some(stretch) if is_free && is_open => stretch[1] = way_m,
            _ if is_free => stretches.push([way_m, way_m]),
            _ => {}
        }
        is_open = is_free;
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::super::{PlanDone, PlanJob};
    use crate::MapPose;
    use crate::geometry::{Car, Cell, Grid, Rect};
    use crate::map::Map;
    use crate::navigator::{MARGIN_M, PreparedMap, TargetPose};
    use crate::obstacle_layer::ObstacleLayer;
    use crate::planner::Planner;
    use std::sync::Arc;
    use xtb_control::{Stamp, VehicleConfig};

    const CELL_M: f64 = 0.05;

    /// An L: 6 m to the east and 6 m to the north, 1.5 m wide, its inner corner at (1.5, 1.5).
    fn corner() -> Map {
        let is_free = |index: usize| index % 120 < 30 || index / 120 < 30;
        let cells = (0..120 * 120).map(|index| if is_free(index) { Cell::Free } else { Cell::Occupied });
        Map::new("l", Grid::new(CELL_M, [0.0, 0.0], 120, 120, cells.collect()).unwrap(), Vec::new()).unwrap()
    }

    /// What is planned from the wall on the inner side, with 2 cm between, round the corner.
    fn round_the_corner(others: Vec<(String, MapPose)>) -> PlanDone {
        let (map, car) = (corner(), Car::of(&VehicleConfig::default()));
        let job = PlanJob {
            number: 1,
            now: Stamp::ZERO,
            obstacles: ObstacleLayer::new(car, Some(map.grid())),
            map: Arc::new(PreparedMap::of(map)),
            seen_within_ms: u64::MAX,
            vantage_allowed: false,
            car,
            cruise_mps: 0.5,
            start: MapPose { x_m: 4.5, y_m: 1.5 - car.half_width_m - 0.02, yaw_rad: std::f64::consts::PI },
            target: TargetPose { x_m: 0.75, y_m: 4.5, yaw_rad: None },
            others,
            retreat: None,
        };
        job.run(&mut Planner::new())
    }

    #[test]
    fn who_stands_at_a_wall_drives_on_with_room() {
        let (map, car) = (corner(), Car::of(&VehicleConfig::default()));
        let path = round_the_corner(Vec::new()).result.unwrap().path;
        let grid = map.grid_with_keep_outs();
        let meets = |body: &Rect, (column, row): (usize, usize)| {
            let [x_m, y_m] = grid.centre_m(column as i64, row as i64);
            grid.cell(column as i64, row as i64) != Cell::Free
                && body.meets_square(x_m, y_m, grid.resolution_m() / 2.0, MARGIN_M - 0.01)
        };
        let mut way_m = 1.0;
        while way_m < path.length_m() {
            let (pose, _) = path.at(way_m);
            let body = Rect::body(&car, &pose);
            let mut cells =
                (0..grid.height()).flat_map(|row| (0..grid.width()).map(move |column| (column, row)));
            assert!(!cells.any(|cell| meets(&body, cell)), "{way_m:.2} m: {pose:?}");
            way_m += 0.05;
        }
    }

    #[test]
    fn between_a_wall_and_another_robot_it_does_not_squeeze_itself() {
        // Crosswise: 47 cm to the wall with what is kept free beside it, for a body of 40 cm.
        let other = MapPose { x_m: 2.8, y_m: 0.70, yaw_rad: std::f64::consts::FRAC_PI_2 };
        let done = round_the_corner(vec![("xtb-2".to_owned(), other)]);
        assert!(done.result.is_err(), "{done:?}");
        assert_eq!(done.by.unwrap().name, "xtb-2");
    }
}
