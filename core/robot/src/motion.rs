//! The odometry as others want it, such as ROS: one frame that never jumps, and how fast the robot turns.
//!
//! The controller sets its odometry back to zero at each autonomous mode (§4.9); here that is undone.

use xtb_control::Stamp;
use xtb_control::frames::{MapFromOdom, MapPose, wrap_rad};
use xtb_control::odometry::OdomPose;

/// The yaw rate is the turn over at least this long, in ms: a count of the gyro is then 0.1°/s.
const RATE_OVER_MS: u64 = 50;
/// Two samples that are farther apart say nothing of the rate now, in ms.
const RATE_LOST_MS: u64 = 500;

/// Where the odometry has the robot, and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// In the frame of the odometry, as ROS has it: x ahead at the start, yaw counter-clockwise.
    pub pose: MapPose,
    /// Of the middle between the axles, + = ahead, in m/s; `None` = the encoder has not been heard lately.
    pub speed_mps: Option<f64>,
    /// Counter-clockwise, in rad/s; `None` = not measured.
    pub yaw_rate_radps: Option<f64>,
}

/// Follows the controller's odometry.
#[derive(Debug, Clone, Default)]
pub struct MotionTracker {
    alignment: Option<MapFromOdom>,
    pose: Option<MapPose>,
    /// When the rate was last measured, and the yaw then.
    since: Option<(Stamp, f64)>,
    yaw_rate_radps: Option<f64>,
}

impl MotionTracker {
    /// A step of the controller: `odom` is its odometry after it, `rezeroed` whether that step set it back. No step
    /// with `rezeroed` may be left out; of the others as many as one likes.
    pub fn step(&mut self, now: Stamp, odom: &OdomPose, rezeroed: bool) {
        let here = self.pose.unwrap_or(MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        if rezeroed || self.alignment.is_none() {
            self.alignment = Some(MapFromOdom::aligning(odom, &here));
        }
        let pose = self.alignment.map_or(here, |alignment| alignment.pose(odom));
        self.pose = Some(pose);
        let Some((since, yaw_rad)) = self.since else {
            self.since = Some((now, pose.yaw_rad));
            return;
        };
        let ms = now.since_ms(since);
        if ms >= RATE_OVER_MS {
            let turned = wrap_rad(pose.yaw_rad - yaw_rad);
            self.yaw_rate_radps = (ms <= RATE_LOST_MS).then_some(turned / (ms as f64 / 1000.0));
            self.since = Some((now, pose.yaw_rad));
        }
    }

    /// How it moves now; `None` before the first step. `gyro_heard`: whether the gyro has been heard lately.
    #[must_use]
    pub fn motion(&self, speed_mps: Option<f64>, gyro_heard: bool) -> Option<Motion> {
        let yaw_rate_radps = self.yaw_rate_radps.filter(|_| gyro_heard);
        self.pose.map(|pose| Motion { pose, speed_mps, yaw_rate_radps })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI};
    use xtb_control::odometry::Odometry as Controller;

    fn near(a: &MapPose, b: &MapPose) -> bool {
        let turn = xtb_control::frames::wrap_rad(a.yaw_rad - b.yaw_rad);
        (a.x_m - b.x_m).abs() < 1e-9 && (a.y_m - b.y_m).abs() < 1e-9 && turn.abs() < 1e-9
    }

    #[test]
    fn the_odometry_starts_ahead_and_never_jumps() {
        let (mut controller, mut tracker) = (Controller::default(), MotionTracker::default());
        assert_eq!(tracker.motion(None, true), None);
        controller.yaw(1000);
        tracker.step(Stamp::from_ms(0), &controller.pose(), false);
        // A metre ahead, a quarter to the right, set back to zero, another metre.
        controller.advance(60.0, 1.0, 1.0 / PI);
        tracker.step(Stamp::from_ms(50), &controller.pose(), false);
        controller.yaw(1000 + 16_384);
        tracker.step(Stamp::from_ms(100), &controller.pose(), false);
        let turning = tracker.motion(Some(0.1), true).unwrap();
        assert!((turning.yaw_rate_radps.unwrap() + FRAC_PI_2 / 0.05).abs() < 1e-9, "{turning:?}");
        assert_eq!(tracker.motion(None, false).unwrap().yaw_rate_radps, None, "the gyro is silent");
        controller.rezero();
        tracker.step(Stamp::from_ms(105), &controller.pose(), true);
        let corner = MapPose { x_m: 1.0, y_m: 0.0, yaw_rad: -FRAC_PI_2 };
        assert!(near(&tracker.motion(None, true).unwrap().pose, &corner));
        controller.advance(60.0, 1.0, 1.0 / PI);
        tracker.step(Stamp::from_ms(155), &controller.pose(), false);
        let end = MapPose { x_m: 1.0, y_m: -1.0, yaw_rad: -FRAC_PI_2 };
        assert!(near(&tracker.motion(None, true).unwrap().pose, &end));
        tracker.step(Stamp::from_ms(5000), &controller.pose(), false);
        assert_eq!(tracker.motion(None, true).unwrap().yaw_rate_radps, None, "nobody looked for 5 s");
    }
}
