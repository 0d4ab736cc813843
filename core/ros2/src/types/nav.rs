//! Odometry, maps, paths and transforms.

use super::{
    Header, Pose, PoseStamped, PoseWithCovariance, Time, TransformStamped, TwistWithCovariance, cdr_structs,
};

cdr_structs! {
    /// Where the odometry has a robot, and how it moves.
    ["nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"]
    Odometry {
        /// When, and the frame of the pose.
        header: Header,
        /// The frame of the twist.
        child_frame_id: String,
        /// Where it is.
        pose: PoseWithCovariance,
        /// How it moves, seen from itself.
        twist: TwistWithCovariance,
    }

    /// How cells lie.
    MapMetaData {
        /// When the map was made.
        map_load_time: Time,
        /// Side of a cell, in m.
        resolution: f32,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// The first cell's south-west corner.
        origin: Pose,
    }

    /// A map of cells.
    ["nav_msgs/msg/OccupancyGrid", "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"]
    OccupancyGrid {
        /// When, and in which frame.
        header: Header,
        /// How the cells lie.
        info: MapMetaData,
        /// 0 free, 100 occupied, −1 unknown; rows from the origin on, along x first.
        data: Vec<i8>,
    }

    /// Poses one after the other.
    ["nav_msgs/msg/Path", "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"]
    Path {
        /// When, and in which frame.
        header: Header,
        /// The poses.
        poses: Vec<PoseStamped>,
    }

    /// Where frames are in others.
    ["tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"]
    TfMessage {
        /// Which.
        transforms: Vec<TransformStamped>,
    }
}
