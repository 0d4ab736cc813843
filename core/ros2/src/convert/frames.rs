//! The frames of a robot, and where those that never move are.

use super::pose::planar_pose;
use crate::names::RosName;
use crate::types::{Header, Pose, TfMessage, Time, Transform, TransformStamped, Vector3};
use std::f64::consts::PI;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::{RangeFinder, SLOTS};
use xtb_protocol::Name;

/// The names of a robot's frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frames {
    prefix: String,
    /// Of the odometry.
    pub odom: String,
    /// Of the robot itself.
    pub base_link: String,
    /// Of the gyro.
    pub imu: String,
    /// Of the range finders, on the front and on the rear bumper, left to right seen from above with the truck pointing
    /// up; those that are not fitted are not used.
    pub ranges: [[String; SLOTS]; 2],
}

impl Frames {
    /// Of this robot: `xtb_1/odom` and so on.
    #[must_use]
    pub fn new(robot: &Name) -> Self {
        let prefix = RosName::robot(robot).relative().to_owned();
        let frame = |name: &str| format!("{prefix}/{name}");
        let ranges =
            ["front", "rear"].map(|side| std::array::from_fn(|slot| frame(&format!("ir_{side}_{slot}"))));
        Self { odom: frame("odom"), base_link: frame("base_link"), imu: frame("imu_link"), ranges, prefix }
    }

    /// What they begin with, as the robot's namespace does: `xtb_1`.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// The sensors' frames, and where they are on the robot. Their height is that of the axles (assumed); readings of
    /// range finders are distances over the floor, so their frames lie level whatever the bumpers' angle. Those that
    /// are not fitted have none.
    #[must_use]
    pub fn sensors<'a>(&'a self, vehicle: &VehicleConfig) -> Vec<(&'a str, Pose)> {
        let height_m = vehicle.geometry.wheel_diameter_m / 2.0;
        let at = |x_m: f64, y_m: f64, yaw_rad: f64| {
            let mut pose = planar_pose(&MapPose { x_m, y_m, yaw_rad });
            pose.position.z = height_m;
            pose
        };
        let front = |finder: &RangeFinder| {
            at(vehicle.front_m() + finder.ahead_m, finder.left_m, finder.turned_deg.to_radians())
        };
        let rear = |finder: &RangeFinder| {
            at(-(vehicle.rear_m() + finder.ahead_m), finder.left_m, PI - finder.turned_deg.to_radians())
        };
        let [front_frames, rear_frames] = self.ranges.each_ref().map(|side| side.iter().map(String::as_str));
        let mut sensors = vec![(self.imu.as_str(), at(0.0, 0.0, 0.0))];
        sensors.extend(front_frames.zip(vehicle.range_finders.front.0.iter().map(front)));
        sensors.extend(rear_frames.zip(vehicle.range_finders.rear.0.iter().map(rear)));
        sensors
    }

    /// The transforms that never change.
    #[must_use]
    pub fn static_transforms(&self, stamp: &Time, vehicle: &VehicleConfig) -> TfMessage {
        let sensors = self.sensors(vehicle);
        let transforms = sensors
            .into_iter()
            .map(|(frame, pose)| transform(stamp, &self.base_link, frame, &pose))
            .collect();
        TfMessage { transforms }
    }
}

/// `child` stands at `pose` in `parent`.
pub(super) fn transform(stamp: &Time, parent: &str, child: &str, pose: &Pose) -> TransformStamped {
    let Pose { position, orientation } = pose.clone();
    TransformStamped {
        header: Header { stamp: stamp.clone(), frame_id: parent.to_owned() },
        child_frame_id: child.to_owned(),
        transform: Transform {
            translation: Vector3 { x: position.x, y: position.y, z: position.z },
            rotation: orientation,
        },
    }
}
