//! How fast a truck may drive that is not sure where it is.
//!
//! A body's corner may be off by u = 2 (σ + r σ_yaw), r its distance from the middle: 95 % of all times it
//! is nearer. Against the clearance c that the map leaves beside the body:
//!
//! ```text
//!   u ≤ c / 2       full speed
//!   c / 2 < u ≤ c   slower in proportion, from cruise down to creep
//!   u > c           stop, and ask for a fix or a pose
//! ```

use super::Estimate;

/// From the middle of the truck to its corner, in m (0.50 × 0.40 m).
const REACH_M: f64 = 0.32;
/// Fastest planned speed, in m/s.
const CRUISE_MPS: f64 = 0.35;
/// Slowest speed that makes sense, in m/s.
const CREEP_MPS: f64 = 0.10;

/// What the pose allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trust {
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

impl Trust {
    /// What an estimate allows where the map leaves `clearance_m` beside the body. A clearance that is not
    /// finite or not positive allows nothing.
    #[must_use]
    pub fn of(estimate: &Estimate, clearance_m: f64) -> Self {
        let used = Self::uncertain_m(estimate) / clearance_m;
        if !(clearance_m > 0.0 && clearance_m.is_finite() && used <= 1.0) {
            Self::Stop
        } else if used <= 0.5 {
            Self::Full
        } else {
            Self::Slow { mps: CRUISE_MPS + (CREEP_MPS - CRUISE_MPS) * (used - 0.5) * 2.0 }
        }
    }

    /// By how much a corner of the body may be elsewhere than believed, in m.
    #[must_use]
    pub fn uncertain_m(estimate: &Estimate) -> f64 {
        2.0 * (estimate.sigma_m + REACH_M * estimate.sigma_yaw_rad)
    }
}
