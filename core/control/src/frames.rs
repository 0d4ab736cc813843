//! The only place where frames are converted: the odometry's compass convention to the map's.
//!
//! * `odom`: x right, y ahead of where the odometry started, yaw clockwise from +y, degrees.
//! * `map`: ENU, metres, yaw counter-clockwise from +x, radians (REP-103); one for the whole fleet.
//!
//! x and y agree in both conventions; yaw_map = π/2 − heading.

use crate::odometry::OdomPose;
use crate::units::Heading;
use nalgebra::{Isometry2, Point2, Vector2};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, PI};

/// A pose in the map.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct MapPose {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x, in (−π, π].
    pub yaw_rad: f64,
}

impl Default for MapPose {
    /// The start pose for which `map` and `odom` coincide.
    fn default() -> Self {
        Self { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_2 }
    }
}

impl MapPose {
    fn isometry(self) -> Isometry2<f64> {
        Isometry2::new(Vector2::new(self.x_m, self.y_m), self.yaw_rad)
    }
}

/// The transform from `odom` to `map`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapFromOdom(Isometry2<f64>);

impl MapFromOdom {
    /// The transform that puts a truck whose odometry says `odom` at `map`.
    #[must_use]
    pub fn aligning(odom: &OdomPose, map: &MapPose) -> Self {
        Self(map.isometry() * enu(odom).isometry().inverse())
    }

    /// A pose of the odometry in the map.
    #[must_use]
    pub fn pose(&self, odom: &OdomPose) -> MapPose {
        let pose = self.0 * enu(odom).isometry();
        MapPose { x_m: pose.translation.x, y_m: pose.translation.y, yaw_rad: wrap_rad(pose.rotation.angle()) }
    }

    /// A point of the map in the odometry's frame: (x_m, y_m).
    #[must_use]
    pub fn point_to_odom(&self, x_m: f64, y_m: f64) -> (f64, f64) {
        let point = self.0.inverse_transform_point(&Point2::new(x_m, y_m));
        (point.x, point.y)
    }
}

/// An odometry pose in the ENU convention, in its own frame.
fn enu(odom: &OdomPose) -> MapPose {
    MapPose { x_m: odom.x_m, y_m: odom.y_m, yaw_rad: wrap_rad(FRAC_PI_2 - odom.yaw.rad()) }
}

/// The compass heading of a yaw in the map's convention.
#[must_use]
pub fn heading_of(yaw_rad: f64) -> Heading {
    Heading::from_deg((FRAC_PI_2 - yaw_rad).to_degrees())
}

/// An angle brought into (−π, π].
#[must_use]
pub fn wrap_rad(rad: f64) -> f64 {
    // The remainder of what is less than a turn is itself.
    let wrapped = if rad.abs() < 2.0 * PI { rad } else { libm::fmod(rad, 2.0 * PI) };
    if wrapped > PI {
        wrapped - 2.0 * PI
    } else if wrapped <= -PI {
        wrapped + 2.0 * PI
    } else {
        wrapped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn odom(x_m: f64, y_m: f64, heading_deg: f64) -> OdomPose {
        OdomPose { x_m, y_m, yaw: Heading::from_deg(heading_deg) }
    }

    #[test]
    fn with_the_default_start_pose_x_and_y_agree_and_yaw_is_mirrored() {
        let map = MapFromOdom::aligning(&OdomPose::default(), &MapPose::default());
        let pose = map.pose(&odom(1.0, 2.0, 90.0));
        assert!((pose.x_m - 1.0).abs() < 1e-12 && (pose.y_m - 2.0).abs() < 1e-12);
        assert!(pose.yaw_rad.abs() < 1e-12);
    }

    #[test]
    fn a_truck_that_starts_facing_east_drives_ahead_to_the_east() {
        let start = MapPose { x_m: 5.0, y_m: -1.0, yaw_rad: 0.0 };
        let map = MapFromOdom::aligning(&OdomPose::default(), &start);
        let pose = map.pose(&odom(0.0, 2.0, 0.0));
        assert!((pose.x_m - 7.0).abs() < 1e-12 && (pose.y_m + 1.0).abs() < 1e-12, "{pose:?}");
    }

    #[test]
    fn points_and_poses_agree() {
        let start = MapPose { x_m: 3.0, y_m: 4.0, yaw_rad: 2.5 };
        let here = odom(0.7, -0.3, 200.0);
        let map = MapFromOdom::aligning(&here, &start);
        let back = map.pose(&here);
        assert!((back.x_m - 3.0).abs() < 1e-12 && (back.yaw_rad - 2.5).abs() < 1e-12);
        let (x, y) = map.point_to_odom(3.0, 4.0);
        assert!((x - 0.7).abs() < 1e-12 && (y + 0.3).abs() < 1e-12);
        assert!((heading_of(FRAC_PI_2).deg()).abs() < 1e-12);
    }
}
