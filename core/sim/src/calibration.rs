//! What is there to be calibrated on a simulated truck (Annex A), and what a person measures of it.
//!
//! The true lines are individual and known to nobody inside the simulated world: a calibration
//! measures through [`Truck::measured`](crate::Truck::measured) and the board's piston readings, a
//! test compares with [`Truck::calibration_truth`](crate::Truck::calibration_truth).

use xtb_control::vehicle::Line;

/// A truck's true lines, quantity over PWM count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationTruth {
    /// Wheel angle of front and rear axle in degrees, + = to the right; the middle of the play.
    pub steering: [Line; 2],
    /// Angle of front and rear bumper in degrees, + = up.
    pub bumpers: [Line; 2],
    /// Speed of the pistons FL, FR, RL, RR in m/s, + = up: the derivative just beyond the dead band
    /// (mean of lifting and lowering), through the pulse of zero movement.
    pub pistons: [Line; 4],
}
