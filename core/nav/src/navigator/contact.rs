//! Something touched that no beam has seen: the wheels do not turn although the motor is driven.
//!
//! It is taken for an obstacle in the direction driven: marked along the bumper (in a bend also where the
//! sides swing outwards), backed off from, planned around. What cannot be one, is a fault of the drive: a
//! stall before the wheels have turned again since the one before, or one too many on the same stretch.

use super::Navigator;
use super::recovery::{RECOVERED_M, RECOVERY_MPS};
use super::task::{Recovery, Stage, Task};
use super::turn::{HoldReason, Sensed, TurnDecision, stand};
use crate::MapPose;
use crate::path_follower::LONGEST_STEP_S;
use xtb_control::infrared::SPACING_M;
use xtb_control::{Command, Stamp};

/// Things touched without half a metre of progress in between; one more is a fault of the drive. Chosen, not
/// measured.
const MOST_CONTACTS: u32 = 4;
/// Wheels that have turned for less than this since the last stall have not got free, in m: 200 pulses of the
/// default encoder; chosen, not measured.
const FREE_M: f64 = 0.05;
/// What was touched is so far off the body, in m: the pose may be a little off (2.6 cm p95 with fixes,
/// docs/navigation.md), and the place has to lie outside of the body to be kept.
const OFF_M: f64 = 0.05;
/// Beside the outermost strips something may stand so far beyond the side of the body, in mm; chosen, not
/// measured.
const BEYOND_SIDE_MM: f64 = 5.0;
/// Between two points along a side, in m: the usual cell of a map.
const APART_M: f64 = 0.05;
/// From this part of full lock on the sides may be what touches; chosen, not measured.
const SIDE_STEERING: f64 = 0.3;
/// Ways of backing off that are tried, longest first, in m; chosen, not measured.
const BACK_M: [f64; 4] = [RECOVERED_M, 0.3, 0.2, 0.1];
/// It takes no longer than twice its time; chosen, not measured.
const PATIENCE: f64 = 2.0;

/// How the wheels have been driven.
#[derive(Debug, Clone, Default)]
pub(super) struct StallMonitor {
    /// +1 ahead, −1 astern, and the steering with it, as asked last.
    asked: Option<(f64, f64)>,
    /// Turned since the last stall, in m; without one, as much as ever.
    turned_m: Option<f64>,
    before: Option<Stamp>,
    /// Where things were marked at the last stall.
    marked: Vec<[f64; 2]>,
}

impl StallMonitor {
    /// A turn that decided this.
    pub(super) fn turn(&mut self, now: Stamp, speed_mps: f64, decision: &TurnDecision) {
        let dt_s = self.before.map_or(0.0, |before| now.since_s(before)).min(LONGEST_STEP_S);
        self.before = Some(now);
        if let Some(turned_m) = &mut self.turned_m {
            *turned_m += speed_mps.abs() * dt_s;
        }
        if let TurnDecision::Go(Command::Follow { rpm, steering }, _) = decision
            && rpm.get() != 0.0
        {
            self.asked = Some((rpm.get().signum(), steering.get()));
        }
    }

    fn are_free(&self) -> bool {
        self.turned_m.is_none_or(|turned_m| turned_m >= FREE_M)
    }
}

impl Navigator {
    /// The motor was driven and the wheels did not turn. True if something in the way may be the reason: it
    /// is marked, and the robot stands until [`Navigator::release_motor`]. False if that cannot be.
    pub fn stalled(&mut self, now: Stamp, pose: &MapPose) -> bool {
        let Some(mut task) = self.task.take() else { return false };
        let plausible = self.is_contact(&task);
        if plausible {
            self.contact(now, pose, &mut task);
        } else if let Some(obstacles) = self.obstacles.as_mut().filter(|_| !self.stall_monitor.are_free()) {
            obstacles.remove_contact(&self.stall_monitor.marked);
        }
        self.stall_monitor.turned_m = Some(0.0);
        self.task = Some(task);
        plausible
    }

    /// The motor may be driven again.
    pub fn release_motor(&mut self) {
        if let Some(Task { stage: Stage::Contact { released }, .. }) = &mut self.task {
            *released = true;
        }
    }

    /// Whether it stands because of something touched, until the motor is released.
    #[must_use]
    pub fn in_contact(&self) -> bool {
        self.task.as_ref().is_some_and(Task::in_contact)
    }

    fn is_contact(&self, task: &Task) -> bool {
        matches!(task.stage, Stage::Following(_) | Stage::Recovering(_))
            && self.obstacles.is_some()
            && self.stall_monitor.asked.is_some()
            && self.stall_monitor.are_free()
            && task.contacts < MOST_CONTACTS
    }

    fn contact(&mut self, now: Stamp, pose: &MapPose, task: &mut Task) {
        let (Some(obstacles), Some((gear, steering))) = (&mut self.obstacles, self.stall_monitor.asked)
        else {
            return;
        };
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let in_map = |[ahead, left]: [f64; 2]| {
            [pose.x_m + ahead * cos - left * sin, pose.y_m + ahead * sin + left * cos]
        };
        let end_m = if gear > 0.0 { self.car.front_m } else { self.car.rear_m } + OFF_M;
        self.stall_monitor.marked =
            outline(end_m, self.car.half_width_m, gear, steering).map(in_map).collect();
        obstacles.add_contact(now, &self.stall_monitor.marked);
        if let Stage::Following(following) = &task.stage {
            task.lost_start = (following.plan > 0).then_some(following.path.start);
        }
        task.contacts += 1;
        task.blocked_at = Some(in_map([gear * end_m, 0.0]));
        "contact with an unmapped obstacle".clone_into(&mut task.last_failure);
        task.stage = Stage::Contact { released: false };
    }

    /// Back the way it came, or otherwise away from what it touched, as far as that is known to be free.
    pub(super) fn back_off(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> TurnDecision {
        let from = sensed.estimate.pose;
        let (gear, steering) = self.stall_monitor.asked.unwrap_or((1.0, 0.0));
        let found = BACK_M.into_iter().find_map(|back_m| {
            let way_m = -gear * back_m;
            self.way_out(now, &from, way_m, [steering, 0.0, -steering]).map(|steering| (way_m, steering))
        });
        let Some((way_m, steering)) = found else {
            task.seek();
            return stand(HoldReason::Planning);
        };
        let until = now.plus_ms((PATIENCE * 1000.0 * way_m.abs() / RECOVERY_MPS) as u64);
        task.stage = Stage::Recovering(Recovery { until, steering, from, way_m });
        self.recover(now, sensed, task)
    }
}

/// Points just off the body where something may stand that stops it, ahead and to the left of its middle: the
/// bumper, in a bend also the front of the inner side and the rear of the outer one.
fn outline(end_m: f64, half_width_m: f64, gear: f64, steering: f64) -> impl Iterator<Item = [f64; 2]> {
    let beside_m = half_width_m + OFF_M;
    let steps = |to_m: f64| (0..=(to_m / APART_M) as i32).map(|step| f64::from(step) * APART_M);
    let bumper = strips_m(half_width_m).map(move |left_m| [gear * end_m, left_m]);
    // + is to the right.
    let inner = -steering.signum();
    let sides = steps(end_m).filter(move |_| steering.abs() > SIDE_STEERING);
    let sides = sides.flat_map(move |m| [[gear * m, inner * beside_m], [-gear * m, -inner * beside_m]]);
    bumper.chain(sides)
}

/// To the left of the middle, in m: the strips between the beams, where something may stand that no beam saw,
/// and those beside the outermost ones.
fn strips_m(half_width_m: f64) -> impl Iterator<Item = f64> {
    // In millimetres, so that an XTB's 0.205 m is that to the bit.
    let side_m = (half_width_m * 1000.0 + BEYOND_SIDE_MM) / 1000.0;
    let within = libm::floor(half_width_m / SPACING_M) as i32;
    let between = (-within..=within).map(|strip| f64::from(strip) * SPACING_M);
    [-side_m].into_iter().chain(between).chain([side_m])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Car;
    use xtb_control::VehicleConfig;

    #[test]
    fn the_strips_are_as_far_out_as_the_body_is_wide() {
        let strips: Vec<f64> = strips_m(Car::of(&VehicleConfig::default()).half_width_m).collect();
        assert_eq!(strips, [-0.205, -0.14, -0.07, 0.0, 0.07, 0.14, 0.205]);
        let mut wide = VehicleConfig::default();
        wide.geometry.body_width_m = 0.6;
        assert_eq!(strips_m(Car::of(&wide).half_width_m).count(), 11, "two more on each side");
    }
}
