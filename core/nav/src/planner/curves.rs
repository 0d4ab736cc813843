//! Reeds–Shepp lengths to a pose, remembered: what a car needs at least where nothing is in the way.

use crate::path::wrap_rad;
use crate::{MapPose, reeds_shepp};
use std::f64::consts::PI;

/// Steps per radius along x and y.
const STEPS_PER_RADIUS: f64 = 4.0;
/// Entries to one side along x and y, so up to 10 radii.
const REACH: i64 = 40;
/// Entries of a turn.
const TURNS: i64 = 72;

/// A table over (x, |y|, yaw), with the sign of the yaw mirrored with that of y; filled as it is asked.
#[derive(Debug, Default)]
pub(super) struct Curves {
    radius_m: f64,
    lengths: Vec<f32>,
}

impl Curves {
    /// Keeps the table when the radius is the same.
    pub(super) fn begin(&mut self, radius_m: f64) {
        if self.radius_m != radius_m {
            self.radius_m = radius_m;
            self.lengths.clear();
            self.lengths.resize(((2 * REACH + 1) * (REACH + 1) * TURNS) as usize, f32::NAN);
        }
    }

    /// About the length from one pose to the other, in m; the straight line when they are far apart.
    pub(super) fn length_m(&mut self, from: &MapPose, to: &MapPose) -> f64 {
        let (sin, cos) = libm::sincos(to.yaw_rad);
        let (dx, dy) = (from.x_m - to.x_m, from.y_m - to.y_m);
        let steps = STEPS_PER_RADIUS / self.radius_m;
        let (ahead, left) = ((dx * cos + dy * sin) * steps, (dy * cos - dx * sin) * steps);
        let yaw = wrap_rad(from.yaw_rad - to.yaw_rad);
        let (left, yaw) = if left < 0.0 { (-left, -yaw) } else { (left, yaw) };
        let (column, row) = (libm::floor(ahead + 0.5) as i64, libm::floor(left + 0.5) as i64);
        if column.abs() > REACH || row > REACH {
            return libm::sqrt(dx * dx + dy * dy);
        }
        let turn = (libm::floor(yaw * (TURNS as f64 / (2.0 * PI)) + 0.5) as i64).rem_euclid(TURNS);
        let entry = (((column + REACH) * (REACH + 1) + row) * TURNS + turn) as usize;
        if self.lengths[entry].is_nan() {
            self.lengths[entry] = self.exact_m(column, row, turn) as f32;
        }
        f64::from(self.lengths[entry])
    }

    fn exact_m(&self, column: i64, row: i64, turn: i64) -> f64 {
        let step_m = self.radius_m / STEPS_PER_RADIUS;
        let there = MapPose {
            x_m: column as f64 * step_m,
            y_m: row as f64 * step_m,
            yaw_rad: wrap_rad(turn as f64 * (2.0 * PI / TURNS as f64)),
        };
        reeds_shepp::distance_m(&there, &MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 }, self.radius_m)
    }
}
