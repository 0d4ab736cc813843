//! A robot of ours in the words of ROS, and poses of ROS in ours.
//!
//! Frames (REP 105): `map` → `<robot>/odom` → `<robot>/base_link` → sensors. `base_link` is the middle between the axles,
//! on the floor, x ahead. `<robot>/odom` begins where the robot stood when its agent started, and never jumps.

mod diagnostics;
mod fleet_map;
mod frames;
mod pose;
mod robot;
mod urdf;

pub use diagnostics::{diagnostics, level};
pub use fleet_map::occupancy_grid;
pub use frames::Frames;
pub use pose::{MAP, PoseError, map_pose, planar_pose, pose_stamped, yaw_of};
pub use robot::{Robot, battery, plan};

#[cfg(test)]
mod tests;
