//! A-to-B (§4.10, Tables 2–4, Fig. 16), run by each gyro reading.
//!
//! γ is the bearing of the goal relative to the truck. Table 4 cuts it into eight slices of 45°
//! and drives each ahead or astern so that γ converges to 0 (ahead) or 180° (astern):
//!
//! ```text
//!             0°                    slice  γ            manoeuvre        front servo
//!        8 LF | 1 RF                  1      0..45      right forward    centre − K_P γ
//!     7 RB \  |  / 2 LB               2     45..90      left backward    centre + K_P γ
//!   270° ----truck---- 90°            3     90..135     left forward     centre + K_P γ
//!     6 RF /  |  \ 3 LF               4    135..180     right backward   centre − K_P γ
//!        5 LB | 4 RB                  5–8  180..360     the mirror image, with γ − 360
//!            180°
//! ```
//!
//! Front count below centre = right = yaw grows driving ahead; the rear axle is the mirror image.
//! Ours ([`GotoLaw::Hysteresis`]): a slice is kept until γ is 5° outside it (coasting would carry γ
//! back over the edge: as printed, half of all starts limit-cycle), and in the slices beside 180° the steering
//! goes to zero at 180° instead of jumping between the stops.

use crate::odometry::OdomPose;
use crate::units::{OutOfRange, check, wrap_deg};
use crate::vehicle::{Goto, GotoLaw};
use serde::{Deserialize, Serialize};

/// A goal in the odometry's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GotoGoal {
    x_m: f64,
    y_m: f64,
}

impl GotoGoal {
    /// Farthest coordinate accepted, in m.
    pub const LIMIT_M: f64 = 1.0e4;

    /// # Errors
    /// A coordinate that is not finite or beyond ±[`GotoGoal::LIMIT_M`].
    pub fn new(x_m: f64, y_m: f64) -> Result<Self, OutOfRange> {
        Ok(Self {
            x_m: check("goal x", x_m, -Self::LIMIT_M, Self::LIMIT_M, "m")?,
            y_m: check("goal y", y_m, -Self::LIMIT_M, Self::LIMIT_M, "m")?,
        })
    }
}

impl GotoGoal {
    /// To the right of the start, in m.
    #[must_use]
    pub fn x_m(&self) -> f64 {
        self.x_m
    }

    /// Ahead of the start, in m.
    #[must_use]
    pub fn y_m(&self) -> f64 {
        self.y_m
    }
}

/// Table 4's behaviours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Maneuver {
    /// γ = 0.
    StraightForward,
    /// Slices 1 and 6.
    RightForward,
    /// Slices 2 and 5.
    LeftBackward,
    /// Slices 3 and 8.
    LeftForward,
    /// Slices 4 and 7.
    RightBackward,
}

/// What one gyro reading decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GotoDecision {
    /// Table 2, 1..=4.
    pub quadrant: u8,
    /// Bearing of the goal within its quadrant.
    pub alpha_deg: f64,
    /// Compass bearing of the goal (Table 3).
    pub beta_deg: f64,
    /// Bearing relative to the truck, [0, 360).
    pub gamma_deg: f64,
    /// Table 4.
    pub maneuver: Maneuver,
    /// Both position errors are within the tolerance.
    pub arrived: bool,
    /// Distance to the goal in m.
    pub distance_m: f64,
}

/// Steering and speed that go with a decision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GotoCommand {
    /// Front servo offset from centre in counts, before the limits; the rear is its mirror image.
    pub steering_counts: f64,
    /// +1 ahead, −1 astern.
    pub direction: f64,
}

/// One 45° slice of Table 4.
struct Slice {
    maneuver: Maneuver,
    /// Sign of K_P · correction on the front servo.
    front_sign: f64,
    direction: f64,
}

const fn slice(maneuver: Maneuver, front_sign: f64, direction: f64) -> Slice {
    Slice { maneuver, front_sign, direction }
}

const TABLE_4: [Slice; 8] = [
    slice(Maneuver::RightForward, -1.0, 1.0),
    slice(Maneuver::LeftBackward, 1.0, -1.0),
    slice(Maneuver::LeftForward, 1.0, 1.0),
    slice(Maneuver::RightBackward, -1.0, -1.0),
    slice(Maneuver::LeftBackward, -1.0, -1.0),
    slice(Maneuver::RightForward, 1.0, 1.0),
    slice(Maneuver::RightBackward, 1.0, -1.0),
    slice(Maneuver::LeftForward, -1.0, 1.0),
];

/// A goal being driven to, and the slice that is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GotoStage {
    goal: GotoGoal,
    slice: Option<usize>,
}

impl GotoStage {
    /// A new goal; no slice is kept from the one before.
    #[must_use]
    pub fn new(goal: GotoGoal) -> Self {
        Self { goal, slice: None }
    }

    /// One gyro reading.
    pub fn step(&mut self, config: &Goto, pose: &OdomPose) -> (GotoDecision, GotoCommand) {
        let (dx, dy) = (self.goal.x_m - pose.x_m, self.goal.y_m - pose.y_m);
        let (quadrant, alpha_deg, beta_deg) = bearing(dx, dy);
        let gamma_deg = wrap_deg(beta_deg - pose.yaw.deg());
        let (maneuver, command) = self.table_4(config, gamma_deg);
        let decision = GotoDecision {
            quadrant,
            alpha_deg,
            beta_deg,
            gamma_deg,
            maneuver,
            arrived: dx.abs() <= config.tolerance_m && dy.abs() <= config.tolerance_m,
            distance_m: libm::hypot(dx, dy),
        };
        (decision, command)
    }

    fn table_4(&mut self, config: &Goto, gamma: f64) -> (Maneuver, GotoCommand) {
        let published = config.law == GotoLaw::Published;
        let index = match self.slice {
            Some(kept) if !published && degrees_outside(kept, gamma) <= config.hysteresis_deg => kept,
            _ if gamma == 0.0 => 0,
            _ => (libm::ceil(gamma / 45.0) as usize).clamp(1, 8) - 1,
        };
        self.slice = Some(index);
        let slice = &TABLE_4[index];
        if gamma == 0.0 && slice.direction > 0.0 {
            return (Maneuver::StraightForward, GotoCommand { steering_counts: 0.0, direction: 1.0 });
        }
        let steering_counts = if !published && (index == 3 || index == 4) {
            config.kp * (gamma - 180.0)
        } else {
            // γ up to 180°, γ − 360 beyond; a kept slice that reaches over 0 follows by itself.
            let turn = if gamma > 180.0 { gamma - 360.0 } else { gamma };
            slice.front_sign * config.kp * turn
        };
        (slice.maneuver, GotoCommand { steering_counts, direction: slice.direction })
    }
}

/// Quadrant (Table 2), α, and β (Table 3) of a position error.
fn bearing(dx: f64, dy: f64) -> (u8, f64, f64) {
    let alpha = if dy == 0.0 { 90.0 } else { libm::atan((dx / dy).abs()).to_degrees() };
    match (dx >= 0.0, dy >= 0.0) {
        (true, true) => (1, alpha, alpha),
        (false, true) => (2, alpha, 360.0 - alpha),
        (false, false) => (3, alpha, 180.0 + alpha),
        (true, false) => (4, alpha, 180.0 - alpha),
    }
}

/// How far γ lies outside the slice, in degrees; 0 inside.
fn degrees_outside(slice: usize, gamma: f64) -> f64 {
    let from_middle = wrap_deg(gamma - (slice as f64 * 45.0 + 22.5) + 180.0) - 180.0;
    (from_middle.abs() - 22.5).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Heading;

    fn at(yaw_deg: f64) -> OdomPose {
        OdomPose { x_m: 0.0, y_m: 0.0, yaw: Heading::from_deg(yaw_deg) }
    }

    /// Bearing γ of a goal straight "north" seen from a truck with yaw −γ.
    fn decide(stage: &mut GotoStage, config: &Goto, gamma: f64) -> (GotoDecision, GotoCommand) {
        stage.step(config, &at(-gamma))
    }

    fn north() -> GotoStage {
        GotoStage::new(GotoGoal::new(0.0, 2.0).unwrap())
    }

    #[test]
    fn table_4_as_printed() {
        use Maneuver::*;
        let config = Goto { law: GotoLaw::Published, ..Goto::default() };
        let rows = [
            (10.0, RightForward, -1950.0, 1.0),
            (60.0, LeftBackward, 195.0 * 60.0, -1.0),
            (100.0, LeftForward, 195.0 * 100.0, 1.0),
            (170.0, RightBackward, -195.0 * 170.0, -1.0),
            (190.0, LeftBackward, 195.0 * 170.0, -1.0),
            (250.0, RightForward, -195.0 * 110.0, 1.0),
            (300.0, RightBackward, -195.0 * 60.0, -1.0),
            (350.0, LeftForward, 1950.0, 1.0),
        ];
        for (gamma, maneuver, counts, direction) in rows {
            let (decision, command) = decide(&mut north(), &config, gamma);
            assert_eq!(decision.maneuver, maneuver, "{gamma}");
            assert!((command.steering_counts - counts).abs() < 1e-6, "{gamma}: {command:?}");
            assert_eq!(command.direction, direction, "{gamma}");
        }
        assert_eq!(decide(&mut north(), &config, 0.0).0.maneuver, StraightForward);
    }

    #[test]
    fn a_slice_is_kept_until_the_bearing_is_five_degrees_outside() {
        let (config, mut stage) = (Goto::default(), north());
        assert_eq!(decide(&mut stage, &config, 44.0).0.maneuver, Maneuver::RightForward);
        assert_eq!(decide(&mut stage, &config, 49.9).0.maneuver, Maneuver::RightForward);
        assert_eq!(decide(&mut stage, &config, 50.1).0.maneuver, Maneuver::LeftBackward);
        assert_eq!(decide(&mut stage, &config, 41.0).0.maneuver, Maneuver::LeftBackward);
    }

    #[test]
    fn steering_is_continuous_through_zero_while_a_slice_is_kept() {
        let (config, mut stage) = (Goto::default(), north());
        decide(&mut stage, &config, 2.0);
        let (_, command) = decide(&mut stage, &config, 358.0);
        assert!((command.steering_counts - 390.0).abs() < 1e-9, "{command:?}");
        let mut stage = north();
        decide(&mut stage, &config, 358.0);
        let (_, command) = decide(&mut stage, &config, 2.0);
        assert!((command.steering_counts + 390.0).abs() < 1e-9, "{command:?}");
    }

    #[test]
    fn steering_goes_to_zero_at_180_degrees() {
        let config = Goto::default();
        for gamma in [178.0, 182.0] {
            let (_, command) = decide(&mut north(), &config, gamma);
            assert!((command.steering_counts - 195.0 * (gamma - 180.0)).abs() < 1e-9);
            assert_eq!(command.direction, -1.0);
        }
    }

    #[test]
    fn arrived_inside_the_box_only() {
        let config = Goto::default();
        let decide = |x, y| GotoStage::new(GotoGoal::new(x, y).unwrap()).step(&config, &at(0.0)).0.arrived;
        assert!(decide(0.2, -0.2));
        assert!(!decide(0.201, 0.0));
    }
}
