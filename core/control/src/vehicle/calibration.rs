//! Annex A's fits as the stages use them.

use super::Calibration;

/// A fit of Annex A: quantity = slope · PWM count + intercept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// Quantity per count.
    pub slope: f64,
    /// Quantity at count 0.
    pub intercept: f64,
}

impl Line {
    /// The quantity at a count.
    #[must_use]
    pub fn at(self, count: f64) -> f64 {
        self.slope * count + self.intercept
    }

    /// The count that gives a quantity: A · quantity + B of §4.8.3.
    #[must_use]
    pub fn count(self, quantity: f64) -> f64 {
        (quantity - self.intercept) / self.slope
    }
}

impl Calibration {
    /// Wheel angle in degrees of front and rear axle.
    #[must_use]
    pub fn steering(&self) -> [Line; 2] {
        [
            Line { slope: self.steering_front_slope, intercept: self.steering_front_intercept },
            Line { slope: self.steering_rear_slope, intercept: self.steering_rear_intercept },
        ]
    }

    /// Angle in degrees of front and rear bumper.
    #[must_use]
    pub fn bumpers(&self) -> [Line; 2] {
        [
            Line { slope: self.bumper_front_slope, intercept: self.bumper_front_intercept },
            Line { slope: self.bumper_rear_slope, intercept: self.bumper_rear_intercept },
        ]
    }

    /// Speeds in m/s of the pistons FL, FR, RL, RR.
    #[must_use]
    pub fn pistons(&self) -> [Line; 4] {
        [
            Line { slope: self.piston_fl_slope, intercept: self.piston_fl_intercept },
            Line { slope: self.piston_fr_slope, intercept: self.piston_fr_intercept },
            Line { slope: self.piston_rl_slope, intercept: self.piston_rl_intercept },
            Line { slope: self.piston_rr_slope, intercept: self.piston_rr_intercept },
        ]
    }
}
