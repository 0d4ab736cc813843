//! Where the robots start.
//!
//! The file's `[[starts]]` come first. Every further robot takes the next place of a lattice that
//! is free, faces north, has 3 m free ahead of its bumper and stands in nobody's lane:
//!
//! ```text
//!     row 0      4   2   1   3   5      2 m apart, robot 1 at the room's centre
//!     row −1     9   7   6   8   10     4 m behind: 3.5 m from bumper to bumper
//! ```

use crate::geometry::{Bounds, OrientedBox};
use crate::parameters::Body;
use crate::world::World;
use crate::world_error::WorldError;
use std::f64::consts::FRAC_PI_2;
use xtb_control::frames::MapPose;

/// Free way ahead of every robot that starts on the lattice, in m.
pub const FREE_AHEAD_M: f64 = 3.0;
/// More than that, so that rounding cannot make it less.
const LANE_M: f64 = FREE_AHEAD_M + 0.01;
const COLUMN_M: f64 = 2.0;
const GAP_M: f64 = 0.5;
/// Kept free to the sides and behind.
const MARGIN_M: f64 = 0.3;
/// Side of the square that a world without a room offers.
const OPEN_SIDE_M: f64 = 64.0;

/// Where a truck of this size stands.
pub(crate) fn footprint(pose: &MapPose, body: &Body) -> OrientedBox {
    OrientedBox::new(pose.x_m, pose.y_m, pose.yaw_rad, body.length_m, body.width_m)
}

/// The strip ahead of its bumper that a robot needs free.
fn lane(pose: &MapPose, body: &Body) -> OrientedBox {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let to_middle_m = (body.length_m + LANE_M) / 2.0;
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
    let ahead_m = half_depth_m - body.length_m / 2.0 - LANE_M;
    let behind_m = half_depth_m - body.length_m / 2.0 - MARGIN_M;
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

impl World {
    /// Start poses for `robots` robots whose bodies are `body`, in their order: the file's own,
    /// then places with [`FREE_AHEAD_M`] free ahead. Robots never overlap, and none that is placed
    /// here stands in another one's free way.
    ///
    /// # Errors
    /// A start of the file that is impossible for this body, or too little room.
    pub fn start_poses(&self, robots: usize, body: &Body) -> Result<Vec<MapPose>, WorldError> {
        self.check_starts(body)?;
        let mut poses: Vec<MapPose> = self.starts().iter().take(robots).copied().collect();
        let solids: Vec<_> = self.solids().map(|solid| solid.shape).collect();
        let mut bodies: Vec<_> = poses.iter().map(|pose| footprint(pose, body)).collect();
        let mut lanes: Vec<_> = poses.iter().map(|pose| lane(pose, body)).collect();
        let clear = |shape: &OrientedBox, of: &[OrientedBox]| of.iter().all(|o| shape.separation_m(o) > 0.0);
        let floor = self.floor().unwrap_or_else(|| Bounds::around(0.0, 0.0, OPEN_SIDE_M, OPEN_SIDE_M));
        for pose in places(floor, body) {
            if poses.len() == robots {
                break;
            }
            let (here, ahead) = (footprint(&pose, body), lane(&pose, body));
            let free = clear(&here, &solids) && clear(&here, &bodies) && clear(&here, &lanes);
            if free && clear(&ahead, &solids) && clear(&ahead, &bodies) {
                poses.push(pose);
                bodies.push(here);
                lanes.push(ahead);
            }
        }
        if poses.len() < robots {
            return Err(WorldError::TooManyRobots { asked: robots, placed: poses.len() });
        }
        Ok(poses)
    }

    /// Refuses starts beyond the walls, inside something or inside each other.
    pub(crate) fn check_starts(&self, body: &Body) -> Result<(), WorldError> {
        let bodies: Vec<_> = self.starts().iter().map(|pose| footprint(pose, body)).collect();
        for (i, here) in bodies.iter().enumerate() {
            let start = i + 1;
            if let Some(solid) = self.solids().find(|solid| here.separation_m(&solid.shape) <= 0.0) {
                return Err(WorldError::StartBlocked { start, what: solid.what });
            }
            let (x_m, y_m) = here.centre_m();
            if self.floor().is_some_and(|floor| !floor.holds(x_m, y_m)) {
                return Err(WorldError::StartOutside { start });
            }
            if let Some(first) = bodies[..i].iter().position(|other| here.separation_m(other) <= 0.0) {
                return Err(WorldError::StartsOverlap { first: first + 1, second: start });
            }
        }
        Ok(())
    }
}
