//! What the cheapest Reeds–Shepp curve costs, remembered: the least that a car needs where nothing is
//! in the way.

use super::costs::Costs;
use crate::MapPose;
use crate::geometry::path::wrap_rad;
use crate::geometry::reeds_shepp;
use crate::geometry::reeds_shepp::Curve;
use std::f64::consts::PI;

/// Steps per radius along x and y; chosen for the table's size, not measured.
const STEPS_PER_RADIUS: f64 = 3.0;
/// Entries to one side along x and y, so up to 10 radii: the table has 91 000 numbers, 0.4 MB.
const REACH: i64 = 30;
/// Entries of a turn: the headings of the first lattice.
const TURNS: i64 = 48;
/// Longer words than this many times the shortest are hardly cheaper, and not tried; chosen, not measured.
pub(super) const MOST_DETOUR: f64 = 1.5;

/// A table over (x, |y|, yaw), with the sign of the yaw mirrored with that of y; filled as it is asked.
#[derive(Debug, Default)]
pub(super) struct CurveHeuristic {
    radius_m: f64,
    costs: Option<Costs>,
    table: Vec<f32>,
    curves: Vec<Curve>,
}

impl CurveHeuristic {
    /// Keeps the table when nothing that counts has changed.
    pub(super) fn begin(&mut self, radius_m: f64, costs: &Costs) {
        if self.radius_m != radius_m || self.costs != Some(*costs) {
            (self.radius_m, self.costs) = (radius_m, Some(*costs));
            self.table.clear();
            self.table.resize(((2 * REACH + 1) * (REACH + 1) * TURNS) as usize, f32::NAN);
        }
    }

    /// About the cost from one pose to the other; the straight line when they are far apart.
    pub(super) fn cost(&mut self, from: &MapPose, to: &MapPose) -> f64 {
        self.cost_towards(from, libm::sincos(from.yaw_rad), to)
    }

    /// The same from a pose whose yaw has this sine and cosine.
    pub(super) fn cost_towards(&mut self, from: &MapPose, (sin, cos): (f64, f64), to: &MapPose) -> f64 {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let steps = STEPS_PER_RADIUS / self.radius_m;
        let (ahead, left) = ((dx * cos + dy * sin) * steps, (dy * cos - dx * sin) * steps);
        let yaw = wrap_rad(to.yaw_rad - from.yaw_rad);
        let (left, yaw) = if left < 0.0 { (-left, -yaw) } else { (left, yaw) };
        let (column, row) = (floor(ahead + 0.5), floor(left + 0.5));
        if column.abs() > REACH || row > REACH {
            return libm::sqrt(dx * dx + dy * dy);
        }
        let turn = floor(yaw * (TURNS as f64 / (2.0 * PI)) + 0.5).rem_euclid(TURNS);
        let entry = (((column + REACH) * (REACH + 1) + row) * TURNS + turn) as usize;
        if self.table[entry].is_nan() {
            self.table[entry] = self.exact(column, row, turn) as f32;
        }
        f64::from(self.table[entry])
    }

    fn exact(&mut self, column: i64, row: i64, turn: i64) -> f64 {
        let step_m = self.radius_m / STEPS_PER_RADIUS;
        let there = MapPose {
            x_m: column as f64 * step_m,
            y_m: row as f64 * step_m,
            yaw_rad: wrap_rad(turn as f64 * (2.0 * PI / TURNS as f64)),
        };
        let origin = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
        reeds_shepp::curves(&origin, &there, self.radius_m, MOST_DETOUR, &mut self.curves);
        let costs = self.curves.iter().map(|curve| self.costs.map_or(0.0, |costs| costs.curve(curve)));
        costs.fold(f64::INFINITY, f64::min)
    }
}

/// The whole number below: `libm::floor` in fewer steps.
fn floor(value: f64) -> i64 {
    let whole = value as i64;
    whole.saturating_sub(i64::from(whole as f64 > value))
}
