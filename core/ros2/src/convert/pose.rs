//! Poses on the floor: to ROS, and from ROS with everything checked that a person or a program can get wrong.

use crate::types::{Header, Point, Pose, PoseStamped, Quaternion, Time};
use thiserror::Error;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{MAX_COORDINATE_M, PoseState};

/// The fleet's frame.
pub const MAP: &str = "map";
/// A quaternion's length may be off by this much: 32-bit senders round.
const LENGTH_TOLERANCE: f64 = 0.01;
/// Most that a pose may lean out of the floor's plane, in rad.
const MOST_TILT_RAD: f64 = 0.1;

/// A pose that no robot can be sent to.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PoseError {
    /// In another frame.
    #[error("the pose is in the frame {0:?}; send it in {MAP:?}")]
    Frame(String),
    /// Not a number, or farther away than any goal.
    #[error("({x_m}, {y_m}) is outside ±{MAX_COORDINATE_M} m")]
    Place {
        /// East.
        x_m: f64,
        /// North.
        y_m: f64,
    },
    /// Its length is not 1.
    #[error("the orientation is no unit quaternion: its length is {0}")]
    Quaternion(f64),
    /// Not about the vertical.
    #[error("the orientation leans by {0:.2} rad; a car stands upright")]
    Tilt(f64),
}

/// The yaw of an upright orientation, counter-clockwise from +x, in rad.
///
/// # Errors
/// [`PoseError::Quaternion`], [`PoseError::Tilt`].
pub fn yaw_of(orientation: &Quaternion) -> Result<f64, PoseError> {
    let Quaternion { x, y, z, w } = *orientation;
    let length = libm::sqrt(x * x + y * y + z * z + w * w);
    if !length.is_finite() || (length - 1.0).abs() > LENGTH_TOLERANCE {
        return Err(PoseError::Quaternion(length));
    }
    let tilt_rad = 2.0 * libm::asin((libm::hypot(x, y) / length).min(1.0));
    if tilt_rad > MOST_TILT_RAD {
        return Err(PoseError::Tilt(tilt_rad));
    }
    Ok(libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
}

/// A pose of the map frame that a robot may be sent to, or told that it stands at. Its height is nobody's.
///
/// # Errors
/// See [`PoseError`]; the words are for the sender.
pub fn map_pose(header: &Header, pose: &Pose) -> Result<MapPose, PoseError> {
    if header.frame_id.strip_prefix('/').unwrap_or(&header.frame_id) != MAP {
        return Err(PoseError::Frame(header.frame_id.chars().take(64).collect()));
    }
    let (x_m, y_m) = (pose.position.x, pose.position.y);
    // What is no number is in no range.
    let range = -MAX_COORDINATE_M..=MAX_COORDINATE_M;
    if !range.contains(&x_m) || !range.contains(&y_m) {
        return Err(PoseError::Place { x_m, y_m });
    }
    Ok(MapPose { x_m, y_m, yaw_rad: yaw_of(&pose.orientation)? })
}

/// A pose on the floor.
#[must_use]
pub fn planar_pose(pose: &MapPose) -> Pose {
    let (z, w) = libm::sincos(pose.yaw_rad / 2.0);
    Pose {
        position: Point { x: pose.x_m, y: pose.y_m, z: 0.0 },
        orientation: Quaternion { x: 0.0, y: 0.0, z, w },
    }
}

/// Where a robot is.
#[must_use]
pub fn pose_stamped(stamp: &Time, pose: &PoseState) -> PoseStamped {
    stamped(stamp, &MapPose { x_m: pose.x_m, y_m: pose.y_m, yaw_rad: pose.yaw_rad })
}

pub(super) fn stamped(stamp: &Time, pose: &MapPose) -> PoseStamped {
    PoseStamped { header: in_map(stamp), pose: planar_pose(pose) }
}

pub(super) fn in_map(stamp: &Time) -> Header {
    Header { stamp: stamp.clone(), frame_id: MAP.to_owned() }
}
