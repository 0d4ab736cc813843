//! Fixes: what something else than the truck says of its pose, checked where it comes in.

use nalgebra::SMatrix;
use thiserror::Error;
use xtb_control::units::Stamp;
use xtb_protocol::messages::FixSource;

/// Farthest coordinate, in m: the same as for straight goals.
const LIMIT_M: f64 = xtb_control::goto::GotoGoal::LIMIT_M;
/// Standard deviations that can be meant, in m and in rad: no tracker is better than a tenth of a millimetre,
/// and beyond a hundred metres nothing is measured.
const SIGMA: std::ops::RangeInclusive<f64> = 1.0e-4..=100.0;

/// A pose in the map as measured from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedFix {
    /// When it was measured, on the robot's own clock.
    pub stamp: Stamp,
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Counter-clockwise from +x; not every source has one.
    pub yaw_rad: Option<f64>,
    /// Of x, y and yaw, in m², m·rad and rad²; the yaw's part counts only if there is a yaw.
    pub covariance: [[f64; 3]; 3],
    /// Who measured it.
    pub source: FixSource,
}

impl StampedFix {
    /// A covariance without correlations.
    #[must_use]
    pub fn independent(sigma_m: f64, sigma_rad: f64) -> [[f64; 3]; 3] {
        let (m2, rad2) = (sigma_m * sigma_m, sigma_rad * sigma_rad);
        [[m2, 0.0, 0.0], [0.0, m2, 0.0], [0.0, 0.0, rad2]]
    }

    /// The numbers of a fix that can be.
    pub(crate) fn check(&self, now: Stamp) -> Result<Measurement, FixError> {
        for (what, value, limit) in [
            ("x_m", self.x_m, LIMIT_M),
            ("y_m", self.y_m, LIMIT_M),
            ("yaw_rad", self.yaw_rad.unwrap_or(0.0), 100.0),
        ] {
            if !(value.is_finite() && value.abs() <= limit) {
                return Err(FixError::Value { what, value, limit });
            }
        }
        if self.stamp > now {
            return Err(FixError::Future { ahead_s: self.stamp.since_s(now) });
        }
        let used = if self.yaw_rad.is_some() { 3 } else { 2 };
        for row in 0..used {
            let variance = self.covariance[row][row];
            if !(variance.is_finite() && SIGMA.contains(&variance.max(0.0).sqrt())) {
                return Err(FixError::Variance { variance });
            }
            for column in 0..row {
                let (here, there) = (self.covariance[row][column], self.covariance[column][row]);
                if !(here.is_finite() && (here - there).abs() <= 1e-6 * (here.abs() + there.abs())) {
                    return Err(FixError::NotSymmetric { row, column, here, there });
                }
            }
        }
        let measurement =
            Measurement { place_m: [self.x_m, self.y_m], yaw_rad: self.yaw_rad, covariance: self.covariance };
        let positive = if used == 3 {
            measurement.noise::<3>().cholesky().is_some()
        } else {
            measurement.noise::<2>().cholesky().is_some()
        };
        if positive { Ok(measurement) } else { Err(FixError::NotPositive) }
    }
}

/// Why a fix cannot be one.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum FixError {
    /// A value that is not finite or too large.
    #[error("{what} {value} is not within ± {limit}")]
    Value {
        /// Which one.
        what: &'static str,
        /// As it came, in m or rad.
        value: f64,
        /// Largest one allowed.
        limit: f64,
    },
    /// A variance of nothing, or of more than anything.
    #[error("a variance of {variance} is outside the squares of 0.0001 to 100 m or rad")]
    Variance {
        /// As it came, in m² or rad².
        variance: f64,
    },
    /// Two entries that should be the same.
    #[error("the covariance is not symmetric: {here} in row {row}, column {column}, but {there} opposite")]
    NotSymmetric {
        /// From 0.
        row: usize,
        /// From 0.
        column: usize,
        /// In that place.
        here: f64,
        /// In the place mirrored.
        there: f64,
    },
    /// Correlations that no measurement can have.
    #[error("the covariance is not positive definite")]
    NotPositive,
    /// Measured later than now.
    #[error("the fix was measured {ahead_s} s in the future")]
    Future {
        /// By so much.
        ahead_s: f64,
    },
}

/// What became of a fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum FixOutcome {
    /// It corrected the pose.
    Accepted {
        /// Squared distance from what was expected, in its standard deviations.
        mahalanobis: f64,
        /// More would have been an outlier.
        limit: f64,
    },
    /// An outlier, or one of several that contradict the pose.
    Rejected {
        /// Squared distance from what was expected, in its standard deviations.
        mahalanobis: f64,
        /// Most that is accepted: 1 in 1000 good fixes is farther away (with the gate as it is by default).
        limit: f64,
    },
    /// The heading is lost: fixes are kept until enough of them agree.
    Relocalizing {
        /// Kept so far.
        have: usize,
        /// So many have to agree.
        need: usize,
    },
    /// Enough fixes agreed, and against a sure pose moved as the truck did: the filter started again where they say.
    Restarted {
        /// The pose jumped by so much.
        moved_m: f64,
        /// And turned by so much.
        turned_rad: f64,
    },
    /// It repeats an earlier one although the wheels have turned since: its source is frozen.
    Repeated,
    /// Measured too long ago, or before the pose was set anew.
    TooOld {
        /// Since it was measured.
        age_s: f64,
        /// Most that can be used.
        limit_s: f64,
    },
}

/// A fix that passed [`Fix::check`], without what the filter does not need.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measurement {
    pub(crate) place_m: [f64; 2],
    pub(crate) yaw_rad: Option<f64>,
    covariance: [[f64; 3]; 3],
}

impl Measurement {
    /// Of the first `D` of x, y and yaw.
    pub(crate) fn noise<const D: usize>(&self) -> SMatrix<f64, D, D> {
        SMatrix::from_fn(|row, column| self.covariance[row][column])
    }

    /// χ² with two and with three degrees of freedom that 1 in 1000 exceeds, for `gate` times its distance.
    pub(crate) fn limit(&self, gate: f64) -> f64 {
        let chi2 = if self.yaw_rad.is_some() { 16.266 } else { 13.816 };
        gate * gate * chi2
    }

    /// Standard deviation of the place along the axes' mean.
    pub(crate) fn sigma_m(&self) -> f64 {
        ((self.covariance[0][0] + self.covariance[1][1]) / 2.0).sqrt()
    }

    /// Standard deviation of the yaw.
    pub(crate) fn sigma_rad(&self) -> f64 {
        self.covariance[2][2].sqrt()
    }
}
