//! A little to and fro on straight ways, so that the beams of the bumpers pass over the strips between them.
//!
//! The beams are parallel and 7 cm apart; what stands midway between two is seen by neither, however near it
//! comes. Turning the body by an angle ψ moves a beam sideways by D ψ at the distance D from the body's
//! middle, and the body itself by nearly nothing:
//!
//! ```text
//!   ψ(s) = A sin ω s        κ(s) = ± A ω cos ω s        y(s) = ∓ A / ω cos ω s
//! ```
//! With A = 3° that is 2.6 cm to either side half a metre ahead, and 3 mm beside the path. A bend sweeps by
//! itself; on the last way before a stop nothing is left to be seen.

use super::track::{Stretch, Track};
use std::f64::consts::TAU;

/// Way of a whole swing, in m.
const SWING_M: f64 = 0.5;
/// Of the sharpest steering so much is for path and swing together: the rest is for errors.
const STEERS: f64 = 0.9;
/// A bend begins and ends over about this way, in m.
const SMOOTH_M: f64 = 0.10;
/// It grows over this way, in m.
const BEGINS_M: f64 = 0.3;
/// So far before a stop it is straight …
const STRAIGHT_M: f64 = 0.12;
/// … and before that it becomes so over this way, in m.
const FADES_M: f64 = 0.15;

/// Where the body is meant to be beside its path.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sweep {
    /// Against the path's yaw.
    pub(super) heading_rad: f64,
    /// + = to the left of the path, seen along the yaw.
    pub(super) cross_m: f64,
    /// On top of the path's own.
    pub(super) curvature_per_m: f64,
}

impl Sweep {
    /// At a place of a stretch, by at most `swing_rad`, for a car that can steer as sharply as `most_per_m`.
    pub(super) fn at(track: &Track, stretch: &Stretch, way_m: f64, swing_rad: f64, most_per_m: f64) -> Self {
        let bend_per_m = track.mean_curvature(stretch, way_m - SMOOTH_M, way_m + SMOOTH_M).abs();
        let per_m = TAU / SWING_M;
        let spare_per_m = (most_per_m * STEERS - bend_per_m).max(0.0);
        let ends = ((stretch.to_m - way_m - STRAIGHT_M) / FADES_M).clamp(0.0, 1.0);
        let begins = ((way_m - stretch.from_m) / BEGINS_M).clamp(0.0, 1.0);
        let most_rad = swing_rad.min(spare_per_m / per_m) * ends * begins;
        let (sin, cos) = libm::sincos((way_m - stretch.to_m) * per_m);
        Self {
            heading_rad: most_rad * sin,
            cross_m: -stretch.gear * most_rad / per_m * cos,
            curvature_per_m: stretch.gear * most_rad * per_m * cos,
        }
    }
}
