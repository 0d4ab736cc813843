//! Where the robot is: the odometry and its scale, the pose filter, and what is wrong with either.

use super::{Agent, RobotIdentity, TurnView};
use std::sync::Arc;
use xtb_control::frames::MapPose;
use xtb_control::odometry::OdomPose;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::NavSettings;
use xtb_nav::localization::PoseFilter;
use xtb_protocol::messages::{Fault, PoseSource, PoseState};

impl Agent {
    /// The odometry was set back: the pose in the map stays what it was.
    pub fn rezeroed(&mut self, before: &OdomPose, after: &OdomPose) {
        self.filter.rezeroed(before, after);
    }

    /// The odometry, into the filter.
    pub(super) fn locate(&mut self, now: Stamp, view: TurnView<'_>) {
        // A pose that is not finite is left out: the odometry never makes one.
        let _ = self.filter.odometry(now, &view.outputs.pose);
        self.odometry_scale.learn(now, self.filter.wheel_scale(), self.filter.is_contradicted());
    }

    /// Where the robot is in the map.
    #[must_use]
    pub fn pose(&self, now: Stamp, view: TurnView<'_>) -> PoseState {
        let estimate = self.filter.estimate(now);
        let MapPose { x_m, y_m, yaw_rad } = estimate.pose;
        let age_ms = view.ages.gyro.zip(view.ages.encoder).map(|(gyro, encoder)| gyro.max(encoder));
        let source = match (age_ms, estimate.fix_age_ms) {
            (None, _) => PoseSource::Start,
            (Some(_), None) => PoseSource::Odometry,
            (Some(_), Some(_)) => PoseSource::Fixes,
        };
        PoseState {
            x_m,
            y_m,
            yaw_rad,
            source,
            age_ms,
            sigma_m: estimate.sigma_m,
            sigma_yaw_rad: estimate.sigma_yaw_rad,
            fix_age_ms: estimate.fix_age_ms,
            odometry_scale: (estimate.fixes.accepted > 0).then_some(1.0 + estimate.wheel_scale),
            odometry_scale_sigma: (estimate.fixes.accepted > 0).then_some(estimate.wheel_scale_sigma),
            fix_delay_ms: estimate.fix_delay_ms(),
        }
    }

    /// How far the truck goes for each metre that its encoder counts; 1 as long as fixes have not shown it.
    #[must_use]
    pub fn odometry_scale(&self) -> f64 {
        self.odometry_scale.way()
    }

    /// What is wrong with odometry and pose fixes, with what was seen.
    #[must_use]
    pub fn pose_faults(&self, now: Stamp) -> Vec<(Fault, Option<Arc<str>>)> {
        let scale = self.odometry_scale.fault().map(|words| (Fault::OdometryScale, Some(words.into())));
        let frozen = self.filter.is_frozen(now).then_some((Fault::FixesFrozen, None));
        let contradict = self.filter.is_contradicted().then_some((Fault::FixesContradict, None));
        [scale, frozen, contradict].into_iter().flatten().collect()
    }
}

/// A filter of a robot that stands at its start pose.
pub(super) fn filter(
    vehicle: &VehicleConfig,
    settings: &NavSettings,
    identity: &RobotIdentity,
) -> PoseFilter {
    PoseFilter::new(vehicle, settings.filter(), Stamp::ZERO, &OdomPose::default(), &identity.start_pose)
}
