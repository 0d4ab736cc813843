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
//! more. The path is cut into samples; for each cell of the floor it is known where on the path a
//! beam first passes over it and where the body first gets there. A cell that the body gets to first is blind.
//! Looks are added one by one, each time the one that shows most blind cells for its time, until none is worth
//! it any more.

use super::blind::{SIGHT_M, STOPS_WITHIN_M};
use super::follow::TIGHT;
use crate::car::Car;
use crate::path::{Path, Piece};
use crate::space::{GridSpace, Space};
use crate::{Cell, Grid, MapPose};

/// Between two samples of a path, in m.
const STEP_M: f64 = 0.04;
/// Of a path so much is looked at, in m.
const WATCHED_M: f64 = 12.0;
/// So far beyond it floor is watched, in m: a look leads away from it.
const BEYOND_M: f64 = 1.2;
/// What a look shows counts if the body gets there within this way of the first blind cell, in m.
const WINDOW_M: f64 = 1.0;
/// Looks begin so far before the first blind cell, in m.
const BEFORE_M: [f64; 9] = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0];
/// Longest way aside, in m.
const MOST_ASIDE_M: f64 = 0.5;
/// Looks on one path.
const MOST_LOOKS: usize = 64;
/// The body gets as far as this beyond its outline: off the path, and half of a leg, in m.
const TOUCH_M: f64 = 0.035;
/// Side of a cell that is watched, in m.
const CELL_M: f64 = 0.025;
/// A look shows so many more blind cells than it is blind for itself, at least.
const LEAST_CELLS: i32 = 1;
/// A look takes as long as this for its stops, in s, …
const STOPS_S: f64 = 4.0;
/// … and its way at this speed, in m/s.
const ASIDE_MPS: f64 = 0.12;
/// Where nothing was worth it, the next blind cell is one so much farther on, in m.
const ON_M: f64 = 0.15;
/// From the middle of a bumper to either side a beam sees a leg, in m: the outermost one, half of its width,
/// and half of the leg's.
const BESIDE_M: f64 = 0.175 + 0.012 + 0.010;
/// And so much more where the body swings.
const SWING_M: f64 = 0.045;
/// It does from so far behind a stop until so far before one, in m, but not in a tight bend.
const SWINGS_M: [f64; 2] = [0.10, 0.25];

/// A way aside, and where on the path it begins.
#[derive(Debug, Clone, Copy)]
struct Look {
    at_m: f64,
    aside: Piece,
}

/// The path with these looks in it, each to and fro.
fn with(path: &Path, mut looks: Vec<Look>) -> Path {
    looks.sort_by(|a, b| a.at_m.total_cmp(&b.at_m));
    let mut looking = Path::standing(path.start);
    let (mut from_m, mut looks) = (0.0, looks.into_iter().peekable());
    for piece in &path.pieces {
        let to_m = from_m + piece.length_m.abs();
        while let Some(Look { at_m, aside }) = looks.next_if(|look| look.at_m < to_m) {
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

/// The floor around a path.
pub(super) struct Watched<'a> {
    car: &'a Car,
    /// South-western corner of what is watched.
    first_m: [f64; 2],
    columns: usize,
    rows: usize,
    /// For each cell the way on the path at which a beam first passes over it; before all of it where that does
    /// not matter.
    looked_m: Vec<f64>,
    /// And the way at which the body first gets there.
    touched_m: Vec<f64>,
    /// Whether something may stand there, since it stands beside: no look leads there blindly.
    doubted: Vec<bool>,
}

/// What one way aside gets to.
struct Aside {
    /// For each cell the way aside at which a beam first passes over it.
    looked_m: Vec<f64>,
    /// Cells that are counted already.
    counted: Vec<bool>,
    /// Those to be cleared.
    got: Vec<usize>,
}

impl Aside {
    fn new(cells: usize) -> Self {
        Self { looked_m: vec![f64::MAX; cells], counted: vec![false; cells], got: Vec::new() }
    }

    fn begin(&mut self) {
        for cell in self.got.drain(..) {
            (self.looked_m[cell], self.counted[cell]) = (f64::MAX, false);
        }
    }
}

/// What a body at a pose does to a cell.
enum Gets {
    There,
    Sight,
}

impl<'a> Watched<'a> {
    /// What of the floor that `is_open` is blind on a path. No look leads blindly to one of these `doubts`.
    pub(super) fn new(
        path: &Path,
        car: &'a Car,
        grid: &'a Grid,
        is_open: &dyn Fn([f64; 2]) -> bool,
        doubts: &[[f64; 2]],
    ) -> Self {
        let samples = samples(path, car);
        let fold = |axis: fn(&MapPose) -> f64, pick: fn(f64, f64) -> f64| {
            samples.iter().map(|(_, pose, _)| axis(pose)).reduce(pick).unwrap_or_default()
        };
        let axes: [fn(&MapPose) -> f64; 2] = [|pose| pose.x_m, |pose| pose.y_m];
        let first_m = axes.map(|axis| fold(axis, f64::min) - BEYOND_M);
        let [columns, rows]: [usize; 2] = std::array::from_fn(|axis| {
            libm::ceil((fold(axes[axis], f64::max) + BEYOND_M - first_m[axis]) / CELL_M) as usize
        });
        let (looked_m, touched_m) = (vec![f64::MIN; columns * rows], vec![f64::MAX; columns * rows]);
        let doubted = vec![false; columns * rows];
        let mut watched = Self { car, first_m, columns, rows, looked_m, touched_m, doubted };
        for cell in 0..columns * rows {
            let at = watched.middle_m(cell % columns, cell / columns);
            let (column, row) = grid.place(at[0], at[1]);
            if grid.cell(column, row) == Cell::Free && is_open(at) {
                watched.looked_m[cell] = f64::MAX;
            }
        }
        for [x_m, y_m] in doubts {
            let half_m = grid.resolution_m() / 2.0;
            let [columns, rows] = watched.span([x_m - half_m, y_m - half_m], [x_m + half_m, y_m + half_m]);
            for cell in rows.flat_map(|row| columns.clone().map(move |column| row * watched.columns + column))
            {
                watched.doubted[cell] = true;
            }
        }
        for (way_m, pose, swings) in samples {
            let mut got = Vec::new();
            watched.around(&pose, swings, |cell, gets| got.push((cell, gets)));
            for (cell, gets) in got {
                let first_m = match gets {
                    Gets::There => &mut watched.touched_m[cell],
                    Gets::Sight => &mut watched.looked_m[cell],
                };
                *first_m = first_m.min(way_m);
            }
        }
        watched
    }

    fn middle_m(&self, column: usize, row: usize) -> [f64; 2] {
        let [x_m, y_m] = self.first_m;
        [x_m + (column as f64 + 0.5) * CELL_M, y_m + (row as f64 + 0.5) * CELL_M]
    }

    /// Columns and rows of a rectangle.
    fn span(&self, from_m: [f64; 2], to_m: [f64; 2]) -> [std::ops::Range<usize>; 2] {
        std::array::from_fn(|axis| {
            let most = [self.columns, self.rows][axis];
            let place = |m: f64| ((m - self.first_m[axis]) / CELL_M).max(0.0);
            place(from_m[axis]) as usize..(libm::ceil(place(to_m[axis])) as usize).min(most)
        })
    }

    /// Cells that a body at this pose covers, or that one of its beams passes over.
    fn around(&self, pose: &MapPose, swings: bool, mut gets: impl FnMut(usize, Gets)) {
        let reach_m = self.car.front_m.max(self.car.rear_m) + SIGHT_M;
        let beside_m = BESIDE_M + if swings { SWING_M } else { 0.0 };
        let body = self.car.grown(TOUCH_M);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        // Of the rectangle from bumper to bumper with the beams.
        let half =
            |along: f64, across: f64| along.abs() * reach_m + across.abs() * beside_m.max(body.half_width_m);
        let (half_x_m, half_y_m) = (half(cos, sin), half(sin, cos));
        let [columns, rows] =
            self.span([pose.x_m - half_x_m, pose.y_m - half_y_m], [pose.x_m + half_x_m, pose.y_m + half_y_m]);
        for row in rows {
            for column in columns.clone() {
                let [x_m, y_m] = self.middle_m(column, row);
                let (dx, dy) = (x_m - pose.x_m, y_m - pose.y_m);
                let (ahead_m, left_m) = (dx * cos + dy * sin, (dy * cos - dx * sin).abs());
                let cell = row * self.columns + column;
                let beyond_m = (ahead_m - self.car.front_m).max(-self.car.rear_m - ahead_m);
                if beyond_m <= TOUCH_M && left_m <= body.half_width_m {
                    gets(cell, Gets::There);
                }
                if (0.0..=SIGHT_M).contains(&beyond_m) && left_m <= beside_m {
                    gets(cell, Gets::Sight);
                }
            }
        }
    }

    fn is_blind(&self, cell: usize) -> bool {
        let touched_m = self.touched_m[cell];
        touched_m < f64::MAX && self.looked_m[cell] > touched_m - STOPS_WITHIN_M
    }

    /// How much floor is blind, in m².
    pub(super) fn blind_m2(&self) -> f64 {
        let blind = (0..self.looked_m.len()).filter(|cell| self.is_blind(*cell)).count();
        blind as f64 * CELL_M * CELL_M
    }

    /// The path with looks aside before its bends, where that is worth its time.
    pub(super) fn looking_aside(&mut self, path: &Path, space: &GridSpace) -> Path {
        with(path, self.looks(path, space))
    }

    /// Looks that are worth their time; what they show is not blind any more.
    fn looks(&mut self, path: &Path, space: &GridSpace) -> Vec<Look> {
        let (mut looks, mut passed_m) = (Vec::new(), f64::MIN);
        let mut scratch = Aside::new(self.looked_m.len());
        while looks.len() < MOST_LOOKS {
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
    fn best(&self, path: &Path, first_m: f64, space: &GridSpace, scratch: &mut Aside) -> Option<Look> {
        let tight_per_m = 1.0 / space.car().radius_m;
        let mut best: Option<(f64, Look)> = None;
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
                                best = Some((worth, Look { at_m, aside: Piece { length_m, ..aside } }));
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
        scratch: &mut Aside,
        mut is: impl FnMut(f64, f64),
    ) {
        scratch.begin();
        let [at_m, to_m] = ways_m;
        let (mut gained, mut from) = (0, *pose);
        for step in 1..=(aside.length_m.abs() / STEP_M) as u32 {
            let way_m = f64::from(step) * STEP_M;
            if !space.drives(&from, &Piece { length_m: STEP_M * aside.gear(), ..*aside }) {
                return;
            }
            from = aside.after(pose, way_m * aside.gear());
            let mut is_doubtful = false;
            self.around(&from, false, |cell, gets| {
                let blind = match gets {
                    Gets::Sight => {
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
                    Gets::There => {
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
                is(f64::from(gained) / (STOPS_S + 2.0 * way_m / ASIDE_MPS), way_m * aside.gear());
            }
        }
    }

    /// What this look shows is not blind any more.
    fn take(&mut self, path: &Path, look: &Look) {
        let (pose, _) = path.at(look.at_m);
        let steps = libm::round(look.aside.length_m.abs() / STEP_M) as u32;
        let mut got = Vec::new();
        for step in 1..=steps {
            let here = look.aside.after(&pose, f64::from(step) * STEP_M * look.aside.gear());
            self.around(&here, false, |cell, _| got.push(cell));
        }
        for cell in got {
            self.looked_m[cell] = self.looked_m[cell].min(look.at_m);
        }
    }
}

/// Way, pose, and whether the body swings there.
fn samples(path: &Path, car: &Car) -> Vec<(f64, MapPose, bool)> {
    let mut stops_m = vec![0.0];
    let mut to_m = 0.0;
    for pair in path.pieces.windows(2) {
        to_m += pair[0].length_m.abs();
        if pair[0].gear() != pair[1].gear() {
            stops_m.push(to_m);
        }
    }
    stops_m.push(path.length_m());
    let length_m = path.length_m().min(WATCHED_M);
    let steps = libm::ceil(length_m / STEP_M) as u32;
    let sample = |step: u32| {
        let way_m = (f64::from(step) * STEP_M).min(length_m);
        let (pose, piece) = path.at(way_m);
        let tight = piece.is_some_and(|piece| piece.curvature_per_m.abs() * car.radius_m >= TIGHT);
        let [behind_m, before_m] = SWINGS_M;
        let at_stop = stops_m.iter().any(|stop_m| (stop_m - before_m..stop_m + behind_m).contains(&way_m));
        (way_m, pose, !tight && !at_stop)
    };
    (0..=steps).map(sample).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::{Layers, LookOut};
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

    fn looks(is_open: &dyn Fn([f64; 2]) -> bool, doubts: &[[f64; 2]]) -> (f64, Vec<Look>, f64) {
        let grid = Grid::free(0.05, [-4.0, -4.0], 160, 160).unwrap();
        let layers = Layers { grid: &grid, zones: None, one_way: None, local_m: &[] };
        let planned = Car { radius_m: 1.0 / TIGHT_PER_M, ..car() };
        let space = GridSpace::new(&layers, planned, LookOut { ahead_m: 0.3, half_width_m: 0.2 }).unwrap();
        let (car, path) = (car(), bend());
        let mut watched = Watched::new(&path, &car, &grid, is_open, doubts);
        let before_m2 = watched.blind_m2();
        let looks = watched.looks(&path, &space);
        (before_m2, looks, watched.blind_m2())
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
        let ahead = |look: &Look| look.at_m < 0.9 && look.aside.length_m.abs() > 0.3;
        assert!(!looks.iter().any(ahead), "{looks:?}");
    }

    #[test]
    fn a_path_with_a_look_ends_where_it_did() {
        let (path, aside) = (bend(), Piece { length_m: 0.2, curvature_per_m: -TIGHT_PER_M });
        let looking = with(&path, vec![Look { at_m: 1.1, aside }, Look { at_m: 0.4, aside }]);
        let (a, b) = (path.end(), looking.end());
        assert!(libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m) < 1e-9 && (a.yaw_rad - b.yaw_rad).abs() < 1e-9);
        assert!((looking.length_m() - path.length_m() - 0.8).abs() < 1e-9 && looking.cusps() == 4);
    }
}
