//! How fast a truck may drive that is not sure where it is.
//!
//! A body's corner may be off by u = 2 (σ + r σ_yaw), r its distance from the middle: 95 % of all times it
//! is nearer. Against the clearance c that the map leaves beside the body:
//!
//! ```text
//!   u ≤ c / 2       full speed
//!   c / 2 < u ≤ c   slower in proportion, from cruise down to 0.10 m/s
//!   u > c           stop, and ask for a fix or a pose
//! ```
//! Both parts of c can be set: [`UncertaintyLimits`]. A pose that fixes contradict allows nothing.

use super::Estimate;

/// Where the speeds change.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertaintyLimits {
    /// Part of the clearance up to which it drives as fast as planned.
    pub slow_part: f64,
    /// Part of the clearance beyond which it stands; more than `slow_part`.
    pub stop_part: f64,
    /// Fastest planned speed, in m/s.
    pub cruise_mps: f64,
    /// Slowest speed that makes sense, in m/s.
    pub least_mps: f64,
    /// From the middle of the car to its corner, in m.
    pub reach_m: f64,
}

impl Default for UncertaintyLimits {
    /// Of an XTB.
    fn default() -> Self {
        Self { slow_part: 0.5, stop_part: 1.0, cruise_mps: 0.35, least_mps: 0.10, reach_m: 0.32 }
    }
}

/// What the pose allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UncertaintySpeed {
    /// As fast as planned.
    Full,
    /// Not faster than this.
    Slow {
        /// In m/s.
        mps: f64,
    },
    /// Not at all: somebody has to say where the truck is.
    Stop,
}

impl UncertaintySpeed {
    /// What an estimate allows where the map leaves `clearance_m` beside the body. A clearance that is not
    /// finite or not positive allows nothing, nor does a pose that fixes contradict.
    #[must_use]
    pub fn of(estimate: &Estimate, clearance_m: f64, limits: &UncertaintyLimits) -> Self {
        let used = Self::uncertain_m(estimate, limits.reach_m) / clearance_m;
        let UncertaintyLimits { slow_part, stop_part, cruise_mps, least_mps, .. } = *limits;
        let possible = clearance_m > 0.0 && clearance_m.is_finite() && used <= stop_part;
        if !possible || estimate.contradicted {
            Self::Stop
        } else if used <= slow_part {
            Self::Full
        } else {
            let slower = (used - slow_part) / (stop_part - slow_part);
            Self::Slow { mps: cruise_mps + (least_mps - cruise_mps) * slower }
        }
    }

    /// By how much a corner of the body, `reach_m` from its middle, may be elsewhere than believed, in m.
    #[must_use]
    pub fn uncertain_m(estimate: &Estimate, reach_m: f64) -> f64 {
        2.0 * (estimate.sigma_m + reach_m * estimate.sigma_yaw_rad)
    }
}
