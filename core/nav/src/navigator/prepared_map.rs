//! A map made ready for driving on it: measured once, where there is time, and shared from then on.

use super::traffic_guidance::BODY_MARGINS_M;
use super::turn::TargetPose;
use crate::MapPose;
use crate::geometry::{Car, Cell, Clearance};
use crate::map::{Map, Zone, ZoneLayers};

/// A map with what planning and following ask of it. Making one takes milliseconds for a room, seconds for
/// the largest maps: not for a control loop.
#[derive(Debug, Clone)]
pub struct PreparedMap {
    pub(super) map: Map,
    pub(super) zones: ZoneLayers,
    pub(super) clearance: Clearance,
}

impl PreparedMap {
    /// Of this map.
    #[must_use]
    pub fn of(map: Map) -> Self {
        Self { zones: ZoneLayers::of(&map), clearance: Clearance::of(map.grid()), map }
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Map {
        &self.map
    }

    /// A point of a car's body that is not on free floor, (x, y) in m.
    #[must_use]
    pub fn hit_by(&self, car: &Car, pose: &MapPose) -> Option<[f64; 2]> {
        let near = self.clearance.at_least_m(pose.x_m, pose.y_m) <= car.reach_m();
        let hit = |[x_m, y_m]: &[f64; 2]| self.map.grid().at(*x_m, *y_m) != Cell::Free;
        near.then(|| car.body_points(pose).into_iter().find(hit)).flatten()
    }

    /// The keep-out zone that a car stands in.
    #[must_use]
    pub fn keep_out_under(&self, car: &Car, pose: &MapPose) -> Option<&str> {
        self.map.keep_out_under(car, pose).map(Zone::name)
    }

    /// The keep-out zone that a goal lies in.
    #[must_use]
    pub fn keep_out_at(&self, car: &Car, target: &TargetPose) -> Option<&str> {
        let TargetPose { x_m, y_m, yaw_rad } = *target;
        match yaw_rad {
            Some(yaw_rad) => self.keep_out_under(car, &MapPose { x_m, y_m, yaw_rad }),
            None => self.map.keep_outs().find(|zone| zone.holds(x_m, y_m)).map(Zone::name),
        }
    }

    /// The margin, in m, that traffic control would keep for a robot that stands at `from`, if with it there is no room
    /// at a goal: then the goal would never be reached under its guidance.
    #[must_use]
    pub fn too_near_for_traffic(&self, car: &Car, from: &MapPose, target: &TargetPose) -> Option<f64> {
        let has_room = |pose: &MapPose, margin_m: f64| {
            self.map.has_room(car, [pose.x_m, pose.y_m], Some(pose.yaw_rad), margin_m)
        };
        let margin_m = BODY_MARGINS_M.into_iter().find(|margin_m| has_room(from, *margin_m))?;
        let TargetPose { x_m, y_m, yaw_rad } = *target;
        (!self.map.has_room(car, [x_m, y_m], yaw_rad, margin_m)).then_some(margin_m)
    }

    /// What keeps a car from standing at a goal, whatever its yaw.
    #[must_use]
    pub fn in_the_way_at(&self, car: &Car, target: &TargetPose) -> Option<&'static str> {
        let grid = self.map.grid();
        let (column, row) = grid.place(target.x_m, target.y_m);
        let (width, height) = (grid.width() as i64, grid.height() as i64);
        if !(0..width).contains(&column) || !(0..height).contains(&row) {
            return Some("outside the map");
        }
        let least_m = car.core_m() - grid.resolution_m();
        let room_m = self.clearance.at_least_m(target.x_m, target.y_m);
        (room_m < least_m).then_some("occupied on the map")
    }
}
