//! Looking aside before a bend: a little forwards with the wheels turned, and back again, so that beams pass
//! over the floor that the body is about to turn over.
//!
//! ```text
//!          ╱ beams                 The beams look straight ahead. In a bend the inner side of the body
//!    ┌──┐ ╱                        and its tail pass over floor that they never get to; so do corners
//!    │  │╱   ──► then the bend     that swing out. From a place before the bend, turned, they do.
//!    └──┘
//! ```
//! This is done only near something thin that is not on the map: where one leg of a table was met there are
//! more. Looks are added one by one, each time the one that shows most blind cells ([`VisibilityGrid`]) for its
//! time, until none is worth it any more.

use super::visibility_grid::{Effect, VisibilityGrid};
use crate::MapPose;
use crate::geometry::{Path, Piece};
use crate::navigator::following::BEND_MPS;
use crate::navigator::visibility::{BODY_STEP_M, STOPS_WITHIN_M};
use crate::planner::space::{GridSpace, Space};

/// What a look shows counts if the body gets there within this way of the first blind cell, in m; chosen, not
/// measured.
const WINDOW_M: f64 = 1.0;
/// Looks begin so far before the first blind cell, in m: closer where they are short; chosen, not measured.
const BEFORE_M: [f64; 9] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0];
/// Longest way aside, in m; chosen, not measured.
const MOST_ASIDE_M: f64 = 0.5;
/// Looks on one path, so that it ends; chosen, not measured.
const MOST_SCANS: usize = 64;
/// A look shows so many more blind cells than it is blind for itself, at least: any gain.
const LEAST_CELLS: i32 = 1;
/// A look takes as long as this for its stops, in s, and its way as in a bend: more than two changes of gear;
/// chosen, not measured.
const SCAN_STOPS_S: f64 = 4.0;
/// Where nothing was worth it, the next blind cell is one so much farther on, in m; chosen, not measured.
const ON_M: f64 = 0.15;

/// A way aside, and where on the path it begins.
#[derive(Debug, Clone, Copy)]
struct SideScan {
    at_m: f64,
    aside: Piece,
}

/// The path with these looks in it, each to and fro.
fn with(path: &Path, mut looks: Vec<SideScan>) -> Path {
    looks.sort_by(|a, b| a.at_m.total_cmp(&b.at_m));
    let mut looking = Path::standing(path.start);
    let (mut from_m, mut looks) = (0.0, looks.into_iter().peekable());
    for piece in &path.pieces {
        let to_m = from_m + piece.length_m.abs();
        while let Some(SideScan { at_m, aside }) = looks.next_if(|look| look.at_m < to_m) {
            looking.push(Piece { length_m: (at_m - from_m) * piece.gear(), ..*piece });
            looking.push(aside);
            looking.push(Piece { length_m: -aside.length_m, ..aside });
            from_m = at_m;
        }
        looking.push(Piece { length_m: (to_m - from_m) * piece.gear(), ..*piece });
        from_m = to_m;
    }
    looking
}

/// What one way aside gets to.
struct Scratch {
    /// For each cell the way aside at which a beam first passes over it.
    looked_m: Vec<f64>,
    /// Cells that are counted already.
    counted: Vec<bool>,
    /// Those to be cleared.
    got: Vec<usize>,
}

impl Scratch {
    fn new(cells: usize) -> Self {
        Self { looked_m: vec![f64::MAX; cells], counted: vec![false; cells], got: Vec::new() }
    }

    fn begin(&mut self) {
        for cell in self.got.drain(..) {
            (self.looked_m[cell], self.counted[cell]) = (f64::MAX, false);
        }
    }
}

impl VisibilityGrid<'_> {
    /// The path with looks aside before its bends, where that is worth its time.
    pub(super) fn looking_aside(&mut self, path: &Path, space: &GridSpace) -> Path {
        if !space.car().gears.are_both() {
            return path.clone(); // a look is driven to and fro
        }
        with(path, self.looks(path, space))
    }

    /// Looks that are worth their time; what they show is not blind any more.
    fn looks(&mut self, path: &Path, space: &GridSpace) -> Vec<SideScan> {
        let (mut looks, mut passed_m) = (Vec::new(), f64::MIN);
        let mut scratch = Scratch::new(self.looked_m.len());
        while looks.len() < MOST_SCANS {
            let blind = (0..self.looked_m.len()).filter(|cell| self.is_blind(*cell));
            let blind_m = blind.map(|cell| self.touched_m[cell]).filter(|way_m| *way_m > passed_m);
            let Some(first_m) = blind_m.reduce(f64::min) else { break };
            match self.best(path, first_m, space, &mut scratch) {
                Some(look) => {
                    self.take(path, &look);
                    looks.push(look);
                }
                None => passed_m = first_m + ON_M,
            }
        }
        looks
    }

    /// The look that shows most for its time of what is blind from there on.
    fn best(&self, path: &Path, first_m: f64, space: &GridSpace, scratch: &mut Scratch) -> Option<SideScan> {
        let tight_per_m = 1.0 / space.car().radius_m;
        let mut best: Option<(f64, SideScan)> = None;
        for at_m in BEFORE_M.map(|before_m| first_m - before_m).into_iter().filter(|at_m| *at_m >= 0.0) {
            let (pose, Some(piece)) = path.at(at_m) else { continue };
            for gear in [piece.gear(), -piece.gear()] {
                for turn in [1.0, -1.0, 0.5, -0.5] {
                    let aside = Piece { length_m: MOST_ASIDE_M * gear, curvature_per_m: turn * tight_per_m };
                    self.worth(
                        &pose,
                        [at_m, first_m + WINDOW_M],
                        &aside,
                        space,
                        scratch,
                        |worth, length_m| {
                            if best.as_ref().is_none_or(|best| worth > best.0) {
                                best = Some((worth, SideScan { at_m, aside: Piece { length_m, ..aside } }));
                            }
                        },
                    );
                }
            }
        }
        best.map(|(_, look)| look)
    }

    /// What a way aside from `pose` is worth, in cells a second, at each of its lengths at which it is worth
    /// something. It counts what the body gets to on the path between `ways_m`.
    fn worth(
        &self,
        pose: &MapPose,
        ways_m: [f64; 2],
        aside: &Piece,
        space: &GridSpace,
        scratch: &mut Scratch,
        mut is: impl FnMut(f64, f64),
    ) {
        scratch.begin();
        let [at_m, to_m] = ways_m;
        let (mut gained, mut from) = (0, *pose);
        for step in 1..=(aside.length_m.abs() / BODY_STEP_M) as u32 {
            let way_m = f64::from(step) * BODY_STEP_M;
            if !space.drives(&from, &Piece { length_m: BODY_STEP_M * aside.gear(), ..*aside }) {
                return;
            }
            from = aside.after(pose, way_m * aside.gear());
            let mut is_doubtful = false;
            self.around(&from, false, |cell, gets| {
                let blind = match gets {
                    Effect::Seen => {
                        if scratch.looked_m[cell] == f64::MAX {
                            scratch.looked_m[cell] = way_m;
                            scratch.got.push(cell);
                        }
                        let touched_m = self.touched_m[cell];
                        if !(self.is_blind(cell) && (at_m + STOPS_WITHIN_M..=to_m).contains(&touched_m)) {
                            return;
                        }
                        false
                    }
                    Effect::Touched => {
                        let is_known = self.looked_m[cell].min(self.touched_m[cell]) <= at_m;
                        if is_known || scratch.looked_m[cell] <= way_m - STOPS_WITHIN_M {
                            return;
                        }
                        is_doubtful |= self.doubted[cell];
                        true
                    }
                };
                if !std::mem::replace(&mut scratch.counted[cell], true) {
                    scratch.got.push(cell);
                    gained += if blind { -1 } else { 1 };
                }
            });
            if is_doubtful {
                return;
            }
            if gained >= LEAST_CELLS {
                is(f64::from(gained) / (SCAN_STOPS_S + 2.0 * way_m / BEND_MPS), way_m * aside.gear());
            }
        }
    }

    /// What this look shows is not blind any more.
    fn take(&mut self, path: &Path, look: &SideScan) {
        let (pose, _) = path.at(look.at_m);
        let steps = libm::round(look.aside.length_m.abs() / BODY_STEP_M) as u32;
        let mut got = Vec::new();
        for step in 1..=steps {
            let here = look.aside.after(&pose, f64::from(step) * BODY_STEP_M * look.aside.gear());
            self.around(&here, false, |cell, _| got.push(cell));
        }
        for cell in got {
            self.looked_m[cell] = self.looked_m[cell].min(look.at_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Car, Grid};
    use crate::obstacle_layer::Sight;
    use crate::planner::space::{GridLayers, LookOut};
    use xtb_control::VehicleConfig;

    const TIGHT_PER_M: f64 = 2.2;

    fn car() -> Car {
        Car::of(&VehicleConfig::default())
    }

    /// A metre straight, a quarter to the left as tight as planned, half a metre straight.
    fn bend() -> Path {
        let pieces = [(1.0, 0.0), (std::f64::consts::FRAC_PI_2 / TIGHT_PER_M, TIGHT_PER_M), (0.5, 0.0)];
        let piece = |(length_m, curvature_per_m)| Piece { length_m, curvature_per_m };
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        Path { start, pieces: pieces.map(piece).to_vec() }
    }

    fn looks(is_open: &dyn Fn([f64; 2]) -> bool, doubts: &[[f64; 2]]) -> (f64, Vec<SideScan>, f64) {
        let grid = Grid::free(0.05, [-4.0, -4.0], 160, 160).unwrap();
        let layers = GridLayers { grid: &grid, zones: None, one_way: None, local_m: &[] };
        let planned = Car { radius_m: 1.0 / TIGHT_PER_M, ..car() };
        let space = GridSpace::new(&layers, planned, LookOut { ahead_m: 0.3, half_width_m: 0.2 }).unwrap();
        let (car, path) = (car(), bend());
        let sight = Sight::default();
        let mut visibility = VisibilityGrid::new(&path, (&car, &sight), &grid, is_open, doubts);
        let before_m2 = visibility.blind_m2();
        let looks = visibility.looks(&path, &space);
        (before_m2, looks, visibility.blind_m2())
    }

    #[test]
    fn looks_aside_show_most_of_what_a_bend_takes_the_body_over() {
        // Where it stands at first, and what lies before its bumpers, it has looked.
        let (before_m2, looks, after_m2) = looks(&|[x_m, y_m]| x_m > 0.6 || y_m.abs() > 0.24, &[]);
        assert!(before_m2 > 0.05 && after_m2 < before_m2 / 4.0, "{before_m2} to {after_m2} m²: {looks:?}");
    }

    #[test]
    fn floor_that_is_known_needs_no_look() {
        let (before_m2, looks, _) = looks(&|_| false, &[]);
        assert!(before_m2 == 0.0 && looks.is_empty(), "{looks:?}");
    }

    #[test]
    fn no_look_leads_where_something_may_stand_for_all_that_is_known() {
        let doubts: Vec<[f64; 2]> =
            (0..40).flat_map(|x| [[f64::from(x) * 0.05, 0.27], [f64::from(x) * 0.05, -0.27]]).collect();
        let (_, looks, _) = looks(&|_| true, &doubts);
        let ahead = |look: &SideScan| look.at_m < 0.9 && look.aside.length_m.abs() > 0.3;
        assert!(!looks.iter().any(ahead), "{looks:?}");
    }

    #[test]
    fn a_path_with_a_look_ends_where_it_did() {
        let (path, aside) = (bend(), Piece { length_m: 0.2, curvature_per_m: -TIGHT_PER_M });
        let looking = with(&path, vec![SideScan { at_m: 1.1, aside }, SideScan { at_m: 0.4, aside }]);
        let (a, b) = (path.end(), looking.end());
        assert!(libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m) < 1e-9 && (a.yaw_rad - b.yaw_rad).abs() < 1e-9);
        assert!((looking.length_m() - path.length_m() - 0.8).abs() < 1e-9 && looking.cusps() == 4);
    }
}
