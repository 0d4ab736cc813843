//! Odometry (§4.9): dead reckoning from wheel turns and yaw, run by each encoder window.
//!
//! Frame: x to the right, y ahead, yaw clockwise from +y in degrees: a compass, the gyro's frame.
//! [`crate::frames`] converts to the map's.

use crate::units::{Heading, wrap_deg};
use std::f64::consts::PI;

/// Degrees per count of the gyro's Euler angles (3DM-G: 360 / 65536).
pub const GYRO_DEG_PER_COUNT: f64 = 360.0 / 65_536.0;

/// Where the odometry believes the truck to be.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OdomPose {
    /// To the right of the start, in m.
    pub x_m: f64,
    /// Ahead of the start, in m.
    pub y_m: f64,
    /// Clockwise from +y.
    pub yaw: Heading,
}

/// Pose and yaw offset.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Odometry {
    pose: OdomPose,
    offset: Option<i16>,
    newest: i16,
}

impl Odometry {
    /// The present pose.
    #[must_use]
    pub fn pose(&self) -> OdomPose {
        self.pose
    }

    /// Whether a yaw has been read yet.
    #[must_use]
    pub fn has_yaw(&self) -> bool {
        self.offset.is_some()
    }

    /// A gyro reading: the first one is the offset, so yaw starts at 0 (§4.9).
    pub fn yaw(&mut self, counts: i16) {
        self.newest = counts;
        let offset = *self.offset.get_or_insert(counts);
        let turned = f64::from(counts) - f64::from(offset);
        self.pose.yaw = Heading::from_deg(wrap_deg(turned * GYRO_DEG_PER_COUNT));
    }

    /// Starts again here: the newest yaw is the offset, the pose is 0 (§4.9: "when the autonomous mode
    /// is initialized").
    pub fn rezero(&mut self) {
        self.pose = OdomPose::default();
        self.offset = self.offset.map(|_| self.newest);
    }

    /// An encoder window: d = rps · t_s · π · D; Δx = d sin α, Δy = d cos α (§4.9).
    pub fn advance(&mut self, rpm: f64, window_s: f64, wheel_diameter_m: f64) {
        let d = rpm / 60.0 * window_s * PI * wheel_diameter_m;
        let (sin, cos) = libm::sincos(self.pose.yaw.rad());
        self.pose.x_m += d * sin;
        self.pose.y_m += d * cos;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn yaw_starts_at_zero_whatever_the_first_reading() {
        let mut odometry = Odometry::default();
        odometry.yaw(-20_000);
        assert_eq!(odometry.pose().yaw.deg(), 0.0);
        odometry.yaw(-3_616);
        assert_eq!(odometry.pose().yaw.deg(), 90.0);
    }

    #[test]
    fn a_rezero_makes_here_and_this_way_the_origin() {
        let mut odometry = Odometry::default();
        odometry.yaw(100);
        odometry.yaw(16_484);
        odometry.advance(60.0, 1.0, 1.0);
        odometry.rezero();
        assert_eq!(odometry.pose(), OdomPose::default());
        odometry.yaw(16_484);
        assert_eq!(odometry.pose().yaw.deg(), 0.0);
    }

    #[test]
    fn driving_at_yaw_90_goes_to_the_right() {
        let mut odometry = Odometry::default();
        odometry.yaw(0);
        odometry.yaw(16_384);
        odometry.advance(60.0, 1.0, 1.0);
        assert!((odometry.pose().x_m - PI).abs() < 1e-12);
        assert!(odometry.pose().y_m.abs() < 1e-12);
    }
}
