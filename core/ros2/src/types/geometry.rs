//! Poses, twists and transforms. Lengths in m, angles in rad, x ahead, y to the left, z up (REP 103).

use super::{Header, cdr_structs};

cdr_structs! {
    /// Three numbers of a direction.
    Vector3 {
        /// Ahead.
        x: f64,
        /// To the left.
        y: f64,
        /// Up.
        z: f64,
    }

    /// A place, in m.
    Point {
        /// East, or ahead.
        x: f64,
        /// North, or to the left.
        y: f64,
        /// Up.
        z: f64,
    }

    /// An orientation; of length 1.
    Quaternion {
        /// Of x.
        x: f64,
        /// Of y.
        y: f64,
        /// Of z.
        z: f64,
        /// The real part.
        w: f64,
    }

    /// Where and how something stands.
    Pose {
        /// Where.
        position: Point,
        /// How.
        orientation: Quaternion,
    }

    /// A pose and how sure it is.
    PoseWithCovariance {
        /// The pose.
        pose: Pose,
        /// Of x, y, z, and the rotations about them.
        covariance: [[f64; 6]; 6],
    }

    /// A velocity.
    ["geometry_msgs/msg/Twist", "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"]
    Twist {
        /// In m/s.
        linear: Vector3,
        /// In rad/s.
        angular: Vector3,
    }

    /// A velocity and how sure it is.
    TwistWithCovariance {
        /// The velocity.
        twist: Twist,
        /// Of x, y, z, and the rotations about them.
        covariance: [[f64; 6]; 6],
    }

    /// A velocity with its time.
    ["geometry_msgs/msg/TwistStamped", "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"]
    TwistStamped {
        /// When, and in which frame.
        header: Header,
        /// The velocity.
        twist: Twist,
    }

    /// A pose in a frame.
    ["geometry_msgs/msg/PoseStamped", "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"]
    PoseStamped {
        /// When, and in which frame.
        header: Header,
        /// The pose.
        pose: Pose,
    }

    /// A pose in a frame, and how sure it is.
    ["geometry_msgs/msg/PoseWithCovarianceStamped", "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e"]
    PoseWithCovarianceStamped {
        /// When, and in which frame.
        header: Header,
        /// The pose.
        pose: PoseWithCovariance,
    }

    /// From one frame to another.
    Transform {
        /// Where the child's origin is.
        translation: Vector3,
        /// How it is turned.
        rotation: Quaternion,
    }

    /// Where a frame is in another one.
    TransformStamped {
        /// When, and the parent.
        header: Header,
        /// The child.
        child_frame_id: String,
        /// Where that is.
        transform: Transform,
    }
}
