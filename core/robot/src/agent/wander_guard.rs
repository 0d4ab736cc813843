//! A wandering robot minds the others, where traffic control says where they are.
//!
//! ```text
//!   wandering ── its body would come too near to another one ──► standing ──┐ HOLD_MS
//!       ▲  └◄── nobody is near ahead ─────────────────────────────────┘     │
//!       └──────── BACK_M driven, or no farther ◄── backing off, away from it ◄┘
//! ```
//! The memorandum's wander (§4.6) looks through range finders at bumpers only: at its sides, and where it turns, the
//! truck sees nobody. So its command is set aside while its body, driven on as the wheels stand, would come near to a
//! body that traffic control has told of, and given anew afterwards. The obstacle rule holds all along. Without traffic
//! control wander is the memorandum's alone.

use super::navigate::{STAND, STEP_NS};
use super::{Agent, TurnView};
use crate::authority::arbitration::MotorWriter;
use crate::authority::goal::Target;
use xtb_control::{Command, Stamp, Steering, WheelRpm};
use xtb_nav::geometry::rect::Rect;
use xtb_nav::{Car, MapPose, Piece};
use xtb_protocol::messages::StopReason;

/// Bodies keep so far apart, in m; chosen, not measured.
const APART_M: f64 = 0.12;
/// A body that comes nearer by less than this does not come nearer, in m: rounding.
const NEARER_M: f64 = 0.001;
/// So far ahead beside what it rolls in [`STOPS_S`], in m; chosen, not measured.
const AHEAD_M: f64 = 0.1;
/// It stands within its speed times this, in s, as for traffic control's robots.
const STOPS_S: f64 = xtb_nav::navigator::right_of_way::STOPS_S;
/// The way ahead is looked at in steps of this, in m.
const STEP_M: f64 = 0.05;
/// It stands so long before it does something about it, in ms; chosen, not measured.
const HOLD_MS: u64 = 1_000;
/// Way back, in m, and how fast, in m/s; both chosen, not measured.
const BACK_M: f64 = 0.5;
const BACK_MPS: f64 = 0.12;
/// It backs off for so long at most, in ms: what the way takes, for which there is room.
const BACK_MS: u64 = (1000.0 * BACK_M / BACK_MPS) as u64;

/// What it does about the others.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum WanderGuard {
    /// Nothing: it wanders.
    #[default]
    Free,
    /// It stands.
    Standing { since: Stamp },
    /// It drives away from them: gear, and steering as a fraction of full lock.
    BackingOff { since: Stamp, gear: f64, steering: f64 },
}

impl Agent {
    /// What a wandering robot shall do because of the others; `None` = wander on.
    pub(super) fn mind_others(&mut self, now: Stamp, view: TurnView<'_>) -> Option<Command> {
        let wanders = self.writer == MotorWriter::Goal
            && self
                .goal
                .as_ref()
                .is_some_and(|goal| goal.target == Target::Anywhere && !goal.status.is_final());
        if !wanders {
            self.wander_guard = WanderGuard::Free;
            return None;
        }
        let others = self.nav.told_bodies(now);
        if now < self.wander_looked.plus_ns(STEP_NS)
            || (others.is_empty() && self.wander_guard == WanderGuard::Free)
        {
            return None;
        }
        self.wander_looked = now;
        let near = Near { car: *self.nav.car(), pose: self.filter.estimate(now).pose, others };
        let outputs = view.outputs;
        let seen = outputs.obstacle;
        let speed_mps = outputs.rpm * self.mps_per_rpm;
        match self.wander_guard {
            WanderGuard::Free => {
                let gear = if outputs.reference_rpm < 0.0 { -1.0 } else { 1.0 };
                let way_m = AHEAD_M + STOPS_S * speed_mps.abs();
                if outputs.reference_rpm == 0.0 || near.is_clear(gear, outputs.steering, way_m) {
                    return None;
                }
                self.wander_guard = WanderGuard::Standing { since: now };
                Some(STAND)
            }
            WanderGuard::Standing { since } if now.since_ms(since) < HOLD_MS => Some(STAND),
            WanderGuard::Standing { .. } if !seen.front && near.is_clear(1.0, 0.0, BACK_M) => {
                self.wander_guard = WanderGuard::Free;
                Some(Command::Wander)
            }
            WanderGuard::Standing { .. } => {
                let is_open = |gear: f64| if gear < 0.0 { !seen.rear } else { !seen.front };
                self.wander_guard = match near.way_out(is_open, |pose| self.nav.has_room(pose)) {
                    Some((gear, steering)) => WanderGuard::BackingOff { since: now, gear, steering },
                    None => WanderGuard::Standing { since: now },
                };
                Some(STAND)
            }
            WanderGuard::BackingOff { since, gear, steering } => {
                let way_m = AHEAD_M + STOPS_S * speed_mps.abs();
                let is_over = now.since_ms(since) > BACK_MS || outputs.blocked;
                if is_over || !near.is_clear(gear, steering, way_m) {
                    self.wander_guard = WanderGuard::Standing { since: now };
                    return Some(STAND);
                }
                let rpm = WheelRpm::try_from(gear * BACK_MPS / self.mps_per_rpm).unwrap_or(WheelRpm::ZERO);
                let steering = Steering::try_from(steering).unwrap_or(Steering::CENTRED);
                Some(Command::Follow { rpm, steering })
            }
        }
    }

    /// Why a wandering robot stands because of the others.
    pub(super) fn stands_for_others(&self) -> Option<StopReason> {
        matches!(self.wander_guard, WanderGuard::Standing { .. }).then_some(StopReason::GivingWay)
    }
}

/// The others around a robot.
struct Near {
    car: Car,
    pose: MapPose,
    others: Vec<Rect>,
}

impl Near {
    /// The least gap to any of the others at a pose, in m.
    fn gap_m(&self, pose: &MapPose) -> f64 {
        let body = Rect::body(&self.car, pose);
        self.others.iter().map(|other| body.gap_m(other)).fold(f64::MAX, f64::min)
    }

    /// Poses along a way in this gear with this steering.
    fn along(&self, gear: f64, steering: f64, way_m: f64) -> impl Iterator<Item = MapPose> {
        let curvature_per_m = -steering / self.car.radius_m;
        let steps = libm::ceil(way_m / STEP_M) as u32;
        let pose = self.pose;
        (1..=steps).map(move |step| {
            let length_m = gear * way_m * f64::from(step) / f64::from(steps);
            Piece { length_m, curvature_per_m }.end(&pose)
        })
    }

    /// Whether it comes near to nobody on the way, or at least no nearer than it is.
    fn is_clear(&self, gear: f64, steering: f64, way_m: f64) -> bool {
        if self.others.is_empty() {
            return true;
        }
        let least_m = APART_M.min(self.gap_m(&self.pose) - NEARER_M);
        self.along(gear, steering, way_m).all(|pose| self.gap_m(&pose) >= least_m)
    }

    /// Gear and steering that lead farthest away from the others, where there is room for the body.
    fn way_out(
        &self,
        is_open: impl Fn(f64) -> bool,
        has_room: impl Fn(&MapPose) -> bool,
    ) -> Option<(f64, f64)> {
        let gears = [-1.0, 1.0].into_iter().filter(|gear| is_open(*gear));
        let ways = gears.flat_map(|gear| [-1.0, 0.0, 1.0].map(|steering| (gear, steering)));
        let clear = ways.filter(|&(gear, steering)| {
            self.is_clear(gear, steering, BACK_M)
                && self.along(gear, steering, BACK_M).all(|pose| has_room(&pose))
        });
        let gap_m = |&(gear, steering): &(f64, f64)| {
            self.along(gear, steering, BACK_M).last().map_or(0.0, |pose| self.gap_m(&pose))
        };
        clear.max_by(|a, b| gap_m(a).total_cmp(&gap_m(b)))
    }
}
