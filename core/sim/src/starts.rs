//! Where the robots start: at the file's `[[starts]]`, then on the free places of the lattice, and of a map wherever
//! else there is room, in nobody's lane.

use crate::geometry::{Bounds, OrientedBox};
use crate::lattice::{fine_places, footprint, lane, places};
use crate::parameters::Body;
use crate::world::World;
use crate::world_error::WorldError;
use xtb_control::frames::MapPose;

/// Side of the square that a world without a room offers.
const OPEN_SIDE_M: f64 = 64.0;

impl World {
    /// Start poses for `robots` robots whose bodies are `body`, in their order: the file's own,
    /// then places with [`FREE_AHEAD_M`](crate::FREE_AHEAD_M) free ahead. Robots never overlap, and none that is placed
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
        let floor = self
            .floor()
            .or_else(|| self.map_bounds())
            .unwrap_or_else(|| Bounds::around(0.0, 0.0, OPEN_SIDE_M, OPEN_SIDE_M));
        let fine = self.map_bounds().into_iter().flat_map(fine_places);
        for pose in places(floor, body).chain(fine) {
            if poses.len() == robots {
                break;
            }
            let (here, ahead) = (footprint(&pose, body), lane(&pose, body));
            // The quickest question first: of a map there are many places and many solids.
            let known = self.is_known_free(&here) && self.is_known_free(&ahead);
            let free = known && clear(&here, &solids) && clear(&here, &bodies) && clear(&here, &lanes);
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
