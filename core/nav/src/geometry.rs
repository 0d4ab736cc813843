//! What takes room on the floor, and how far apart things are: the footprint of a car, grids, paths of exact
//! arcs, Reeds–Shepp curves, distance fields.

pub mod car;
pub mod clearance;
pub mod grid;
pub mod path;
pub mod rect;
pub mod reeds_shepp;

pub use car::Car;
pub use clearance::Clearance;
pub use grid::{Cell, Grid};
pub use path::{Path, Piece};
pub use rect::Rect;

use crate::MapPose;

/// From the middle of one pose to that of another, in m.
pub(crate) fn distance_m(a: &MapPose, b: &MapPose) -> f64 {
    libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m)
}

/// Between two points, in m.
pub(crate) fn apart_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}
