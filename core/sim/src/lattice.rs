//! Places for robots that the world file gives none.
//!
//! A lattice, each place of it facing north with 3 m free ahead of the bumper:
//!
//! ```text
//!     row 0      4   2   1   3   5      2 m apart, robot 1 at the room's centre
//!     row −1     9   7   6   8   10     4 m behind: 3.5 m from bumper to bumper
//! ```

use crate::geometry::{Bounds, OrientedBox};
use crate::parameters::Body;
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::frames::MapPose;

/// Free way ahead of every robot that starts on the lattice, in m.
pub const FREE_AHEAD_M: f64 = 3.0;
/// More than that, so that rounding cannot make it less.
const LANE_M: f64 = FREE_AHEAD_M + 0.01;
const COLUMN_M: f64 = 2.0;
const GAP_M: f64 = 0.5;
/// Kept free to the sides and behind.
const MARGIN_M: f64 = 0.3;

/// Between two places of a floor that is a map, which may have its room anywhere.
const FINE_M: f64 = 0.5;

/// Where a truck of this size stands whose reference point has this pose.
pub(crate) fn footprint(pose: &MapPose, body: &Body) -> OrientedBox {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let (x_m, y_m) = (pose.x_m + cos * body.middle_m(), pose.y_m + sin * body.middle_m());
    OrientedBox::turned(x_m, y_m, (cos, sin), body.length_m, body.width_m)
}

/// The strip ahead of its bumper that a robot needs free.
pub(crate) fn lane(pose: &MapPose, body: &Body) -> OrientedBox {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let to_middle_m = (body.length_m + LANE_M) / 2.0 + body.middle_m();
    let (x_m, y_m) = (pose.x_m + cos * to_middle_m, pose.y_m + sin * to_middle_m);
    OrientedBox::turned(x_m, y_m, (cos, sin), LANE_M, body.width_m)
}

/// 0, then `step`, −`step`, 2 `step` … (or the other way round) as far as both ends allow.
fn outwards(step: f64, low: f64, high: f64) -> impl Iterator<Item = f64> {
    let rings = (low.abs().max(high.abs()) / step.abs()) as u32 + 1;
    let both = (1..=rings).map(f64::from).flat_map(move |ring| [ring * step, -ring * step]);
    std::iter::once(0.0).chain(both).filter(move |v| (low..=high).contains(v))
}

/// Every place of the lattice that leaves a robot its margins and its lane within the bounds.
pub(crate) fn places(bounds: Bounds, body: &Body) -> impl Iterator<Item = MapPose> {
    let (centre_x_m, centre_y_m) = bounds.centre_m();
    let (half_width_m, half_depth_m) = (bounds.width_m() / 2.0, bounds.depth_m() / 2.0);
    let aside_m = half_width_m - body.width_m / 2.0 - MARGIN_M;
    let ahead_m = half_depth_m - body.front_m() - LANE_M;
    let behind_m = half_depth_m - body.rear_m() - MARGIN_M;
    let row_m = body.length_m + FREE_AHEAD_M + GAP_M;
    let column_m = COLUMN_M.max(body.width_m + GAP_M);
    outwards(-row_m, -behind_m, ahead_m).flat_map(move |y_m| {
        outwards(column_m, -aside_m, aside_m).map(move |x_m| MapPose {
            x_m: centre_x_m + x_m,
            y_m: centre_y_m + y_m,
            yaw_rad: FRAC_PI_2,
        })
    })
}

/// Every half metre from the middle outwards, in four directions: where the lattice finds too few.
pub(crate) fn fine_places(bounds: Bounds) -> impl Iterator<Item = MapPose> {
    let (centre_x_m, centre_y_m) = bounds.centre_m();
    let (half_width_m, half_depth_m) = (bounds.width_m() / 2.0, bounds.depth_m() / 2.0);
    let places = outwards(FINE_M, -half_depth_m, half_depth_m).flat_map(move |y_m| {
        outwards(FINE_M, -half_width_m, half_width_m).map(move |x_m| (centre_x_m + x_m, centre_y_m + y_m))
    });
    let yaws = [FRAC_PI_2, 0.0, -FRAC_PI_2, PI];
    places.flat_map(move |(x_m, y_m)| yaws.map(|yaw_rad| MapPose { x_m, y_m, yaw_rad }))
}
