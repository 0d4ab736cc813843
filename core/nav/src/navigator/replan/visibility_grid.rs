//! For each cell of the floor around a path: where on the path a beam first passes over it, and where the body
//! first gets there. A cell that the body gets to first is blind.

use crate::MapPose;
use crate::geometry::{Car, Cell, Grid, Path};
use crate::navigator::following::TIGHT;
use crate::navigator::visibility::{BODY_STEP_M, STOPS_WITHIN_M};
use crate::obstacle_layer::{LEG_HALF_WIDTH_M, SURE_WITHIN_M, SWEPT_CELL_M as CELL_M, Sight};

/// Of a path so much is looked at, in m, for time and memory; chosen, not measured.
const WATCHED_M: f64 = 12.0;
/// So far beyond it floor is watched, in m, as a look aside leads away from it: the longest way aside (0.5)
/// and what an XTB and its beams reach (0.60). Of a longer truck's looks less is watched.
const BEYOND_M: f64 = 1.2;
/// The body gets as far as this beyond its outline, in m: 2.5 cm off the path, and half of a leg.
const TOUCH_M: f64 = 0.025 + LEG_HALF_WIDTH_M;
/// A beam sees a leg so much farther to the side where the body swings, in m: 6° at 43 cm from an XTB's
/// middle, 18 cm before its bumper. A shorter truck's beams swing less far.
const SWING_SIGHT_M: f64 = 0.045;
/// It does from so far behind a stop until so far before one, in m, but not in a tight bend: about where the
/// swing has grown, and begins to fade (`path_follower/swing.rs`).
const SWINGS_M: [f64; 2] = [0.10, 0.25];

/// The floor around a path.
pub(super) struct VisibilityGrid<'a> {
    car: &'a Car,
    sight: &'a Sight,
    /// South-western corner.
    first_m: [f64; 2],
    columns: usize,
    rows: usize,
    /// For each cell the way on the path at which a beam first passes over it; before all of it where that does
    /// not matter.
    pub(super) looked_m: Vec<f64>,
    /// And the way at which the body first gets there.
    pub(super) touched_m: Vec<f64>,
    /// Whether something may stand there, since it stands beside: no look leads there blindly.
    pub(super) doubted: Vec<bool>,
}

/// What a body at a pose does to a cell.
pub(super) enum Effect {
    Touched,
    Seen,
}

impl<'a> VisibilityGrid<'a> {
    /// What of the floor that `is_open` is blind on a path. No look leads blindly to one of these `doubts`.
    pub(super) fn new(
        path: &Path,
        (car, sight): (&'a Car, &'a Sight),
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
        let mut visibility = Self { car, sight, first_m, columns, rows, looked_m, touched_m, doubted };
        for cell in 0..columns * rows {
            let at = visibility.middle_m(cell % columns, cell / columns);
            let (column, row) = grid.place(at[0], at[1]);
            if grid.cell(column, row) == Cell::Free && is_open(at) {
                visibility.looked_m[cell] = f64::MAX;
            }
        }
        for [x_m, y_m] in doubts {
            let half_m = grid.resolution_m() / 2.0;
            let [columns, rows] = visibility.span([x_m - half_m, y_m - half_m], [x_m + half_m, y_m + half_m]);
            for cell in
                rows.flat_map(|row| columns.clone().map(move |column| row * visibility.columns + column))
            {
                visibility.doubted[cell] = true;
            }
        }
        for (way_m, pose, swings) in samples {
            let mut got = Vec::new();
            visibility.around(&pose, swings, |cell, gets| got.push((cell, gets)));
            for (cell, gets) in got {
                let first_m = match gets {
                    Effect::Touched => &mut visibility.touched_m[cell],
                    Effect::Seen => &mut visibility.looked_m[cell],
                };
                *first_m = first_m.min(way_m);
            }
        }
        visibility
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
    pub(super) fn around(&self, pose: &MapPose, swings: bool, mut gets: impl FnMut(usize, Effect)) {
        let reach_m = self.car.front_m.max(self.car.rear_m) + SURE_WITHIN_M;
        let swing_m = if swings { SWING_SIGHT_M } else { 0.0 };
        // Ahead and astern.
        let sides_m = [true, false].map(|ahead| self.sight.leg_half_width_m(ahead) + swing_m);
        let beside_m = sides_m[0].max(sides_m[1]);
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
                    gets(cell, Effect::Touched);
                }
                if (0.0..=SURE_WITHIN_M).contains(&beyond_m) && left_m <= sides_m[usize::from(ahead_m <= 0.0)]
                {
                    gets(cell, Effect::Seen);
                }
            }
        }
    }

    pub(super) fn is_blind(&self, cell: usize) -> bool {
        let touched_m = self.touched_m[cell];
        touched_m < f64::MAX && self.looked_m[cell] > touched_m - STOPS_WITHIN_M
    }

    /// How much floor is blind, in m².
    pub(super) fn blind_m2(&self) -> f64 {
        let blind = (0..self.looked_m.len()).filter(|cell| self.is_blind(*cell)).count();
        blind as f64 * CELL_M * CELL_M
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
    let steps = libm::ceil(length_m / BODY_STEP_M) as u32;
    let sample = |step: u32| {
        let way_m = (f64::from(step) * BODY_STEP_M).min(length_m);
        let (pose, piece) = path.at(way_m);
        let tight = piece.is_some_and(|piece| piece.curvature_per_m.abs() * car.radius_m >= TIGHT);
        let [behind_m, before_m] = SWINGS_M;
        let at_stop = stops_m.iter().any(|stop_m| (stop_m - before_m..stop_m + behind_m).contains(&way_m));
        (way_m, pose, !tight && !at_stop)
    };
    (0..=steps).map(sample).collect()
}
