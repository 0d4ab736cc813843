//! What the filter says: a pose, and how sure it is.

use super::model::{DRIFT, SCALE, State, X, Y, YAW};
use crate::MapPose;
use std::f64::consts::PI;

/// What became of all fixes since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FixCounts {
    /// They corrected the pose.
    pub accepted: u64,
    /// Outliers.
    pub rejected: u64,
    /// Came while the heading was lost.
    pub gathered: u64,
    /// Measured too long ago.
    pub too_old: u64,
    /// How often the filter started again where rejected fixes agreed.
    pub restarts: u64,
}

/// Where the truck is, as far as the filter knows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The most likely pose.
    pub pose: MapPose,
    /// Of x, y and yaw, in m², m·rad and rad².
    pub covariance: [[f64; 3]; 3],
    /// Standard deviation of the place along the worst direction.
    pub sigma_m: f64,
    /// Standard deviation of the yaw, at most π.
    pub sigma_yaw_rad: f64,
    /// Since the newest fix that counted was measured; `None` = there was none since the pose was set.
    pub fix_age_ms: Option<u64>,
    /// What has to be added to the gyro's rate, counter-clockwise; 0 as long as nothing was learnt.
    pub drift_radps: f64,
    /// Its standard deviation.
    pub drift_sigma_radps: f64,
    /// By this part the wheels go farther than nominal ones; 0 as long as nothing was learnt.
    pub wheel_scale: f64,
    /// Its standard deviation.
    pub wheel_scale_sigma: f64,
    /// What became of all fixes.
    pub fixes: FixCounts,
}

impl Estimate {
    pub(crate) fn of(state: &State, pose: MapPose, fix_age_ms: Option<u64>, fixes: FixCounts) -> Self {
        let of = |row: usize, column: usize| state.covariance[(row, column)];
        let sigma = |place: usize| of(place, place).max(0.0).sqrt();
        let (half_sum, half_gap) = ((of(X, X) + of(Y, Y)) / 2.0, (of(X, X) - of(Y, Y)) / 2.0);
        let largest = half_sum + libm::hypot(half_gap, of(X, Y));
        Self {
            pose,
            covariance: [X, Y, YAW].map(|row| [X, Y, YAW].map(|column| of(row, column))),
            sigma_m: largest.max(0.0).sqrt(),
            sigma_yaw_rad: sigma(YAW).min(PI),
            fix_age_ms,
            drift_radps: state.mean[DRIFT],
            drift_sigma_radps: sigma(DRIFT),
            wheel_scale: state.mean[SCALE],
            wheel_scale_sigma: sigma(SCALE),
            fixes,
        }
    }
}
