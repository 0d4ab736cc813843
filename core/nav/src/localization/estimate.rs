//! What the filter says: a pose, and how sure it is.

use super::model::{DELAY, DRIFT, SCALE, State, X, Y, YAW};
use crate::MapPose;
use std::f64::consts::PI;

/// A delay is known from this standard deviation down, in s: half of what it is before any fix
/// (`filter.delay_s`).
const KNOWN_DELAY_S: f64 = 0.05;

/// What became of all fixes since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FixCounts {
    /// They corrected the pose.
    pub accepted: u64,
    /// Outliers.
    pub rejected: u64,
    /// Came while the heading was lost.
    pub relocalizing: u64,
    /// Repeated an earlier one while the wheels turned.
    pub repeated: u64,
    /// Measured too long ago.
    pub too_old: u64,
    /// How often the filter started again where fixes agreed.
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
    /// By how much fixes are older than they say, in s; 0 as long as nothing was learnt.
    pub delay_s: f64,
    /// Its standard deviation.
    pub delay_sigma_s: f64,
    /// Fixes say another pose, and it is not known which is right: the standard deviations reach there.
    pub contradicted: bool,
    /// The fixes repeat one pose while the wheels turn; none of them counts.
    pub frozen: bool,
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
            delay_s: state.mean[DELAY],
            delay_sigma_s: sigma(DELAY),
            contradicted: false,
            frozen: false,
            fixes,
        }
    }

    /// By how much fixes are older than they say, in ms; `None` = not known.
    #[must_use]
    pub fn fix_delay_ms(&self) -> Option<i64> {
        let known = self.fixes.accepted > 0 && self.delay_sigma_s <= KNOWN_DELAY_S;
        known.then(|| libm::round(self.delay_s * 1000.0) as i64)
    }

    /// Fixes say that it is so far off: three standard deviations reach there.
    pub(crate) fn with_contradiction(mut self, off_m: f64, off_rad: f64) -> Self {
        let (sigma_m, sigma_rad) = (off_m / 3.0, off_rad / 3.0);
        for (place, sigma) in [(0, sigma_m), (1, sigma_m), (2, sigma_rad)] {
            self.covariance[place][place] += sigma * sigma;
        }
        self.sigma_m = libm::hypot(self.sigma_m, sigma_m);
        self.sigma_yaw_rad = libm::hypot(self.sigma_yaw_rad, sigma_rad).min(PI);
        self.contradicted = true;
        self
    }
}
