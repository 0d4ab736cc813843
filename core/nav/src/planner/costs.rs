//! What a path costs, in m of free floor driven ahead.

use super::PlannerSettings;
use super::space::Space;
use crate::MapPose;
use crate::geometry::reeds_shepp::Curve;
use crate::geometry::{Path, Piece};

/// Way between two looks at the clearance, in m: two of the usual cells of a map; chosen, not measured.
const LOOK_M: f64 = 0.1;

/// What is weighed, with the car's narrowest half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Costs {
    reverse_factor: f64,
    gear_change_m: f64,
    bend_change_m: f64,
    near_m: f64,
    near_factor: f64,
    core_m: f64,
}

impl Costs {
    pub(super) fn new(settings: &PlannerSettings, core_m: f64) -> Self {
        let PlannerSettings { reverse_factor, gear_change_m, bend_change_m, near_m, near_factor, .. } =
            *settings;
        Self { reverse_factor, gear_change_m, bend_change_m, near_m, near_factor, core_m }
    }

    /// Of an arc by itself, wherever it is.
    pub(super) fn arc(&self, piece: &Piece) -> f64 {
        piece.length_m.abs() * if piece.length_m < 0.0 { self.reverse_factor } else { 1.0 }
    }

    /// Of going over from one arc to another.
    pub(super) fn change(&self, from: &Piece, to: &Piece) -> f64 {
        let gear = if from.gear() == to.gear() { 0.0 } else { self.gear_change_m };
        gear + if from.curvature_per_m == to.curvature_per_m { 0.0 } else { self.bend_change_m }
    }

    /// More on each metre at a point, for what is near.
    pub(super) fn near(&self, space: &impl Space, x_m: f64, y_m: f64) -> f64 {
        if self.near_factor <= 0.0 {
            return 0.0;
        }
        let spare_m = (space.clearance_m(x_m, y_m) - self.core_m).max(0.0);
        self.near_factor * (1.0 - spare_m / self.near_m).max(0.0)
    }

    /// Of a curve, but for what is near.
    pub(super) fn curve(&self, curve: &Curve) -> f64 {
        let changes: f64 = curve.pieces().windows(2).map(|pair| self.change(&pair[0], &pair[1])).sum();
        changes + curve.pieces().iter().map(|piece| self.arc(piece)).sum::<f64>()
    }

    /// Of arcs from a pose on; with where they end.
    pub(super) fn pieces(&self, space: &impl Space, from: &MapPose, pieces: &[Piece]) -> (f64, MapPose) {
        let changes: f64 = pieces.windows(2).map(|pair| self.change(&pair[0], &pair[1])).sum();
        pieces.iter().fold((changes, *from), |(cost, pose), piece| {
            let parts = libm::ceil(piece.length_m.abs() / LOOK_M).max(1.0);
            let near = (0..parts as usize).map(|part| {
                let there = piece.after(&pose, piece.length_m * (part as f64 + 0.5) / parts);
                self.near(space, there.x_m, there.y_m)
            });
            let near = near.sum::<f64>() / parts * piece.length_m.abs();
            (cost + self.arc(piece) + near, piece.end(&pose))
        })
    }

    /// Of a whole path.
    pub(super) fn path(&self, space: &impl Space, path: &Path) -> f64 {
        self.pieces(space, &path.start, &path.pieces).0
    }
}
