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

use super::FollowerSettings;
use super::track::{Stretch, Track};
use std::f64::consts::TAU;

/// A bend of this curvature sweeps enough, in 1/m.
const BEND_PER_M: f64 = 1.0;
/// A bend begins and ends over about this way, in m.
const SMOOTH_M: f64 = 0.10;
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
    /// At a place of a stretch.
    pub(super) fn at(settings: &FollowerSettings, track: &Track, stretch: &Stretch, way_m: f64) -> Self {
        let bend_per_m = track.mean_curvature(stretch, way_m - SMOOTH_M, way_m + SMOOTH_M).abs();
        let straight = (1.0 - bend_per_m / BEND_PER_M).max(0.0);
        let ends = ((stretch.to_m - way_m - STRAIGHT_M) / FADES_M).clamp(0.0, 1.0);
        let most_rad = settings.sweep_deg.to_radians() * straight * ends;
        let per_m = TAU / settings.sweep_m;
        let (sin, cos) = libm::sincos((way_m - stretch.from_m) * per_m);
        Self {
            heading_rad: most_rad * sin,
            cross_m: -stretch.gear * most_rad / per_m * cos,
            curvature_per_m: stretch.gear * most_rad * per_m * cos,
        }
    }
}
