//! A wandering robot minds the others, where traffic control says where they are, and the walls of its map.
//!
//! ```text
//!   wandering ── its body would come too near to another one, or to a wall ──► standing ──┐ HOLD_MS
//!       ▲  └◄── nothing is near ahead ──────────────────────────────────────────────┘     │
//!       └──────────────────────── BACK_M driven, or no farther ◄── driving away from it ◄─┘
//! ```
//! The memorandum's wander (§4.6) looks through range finders at bumpers only: at its sides, and where it turns, the
//! truck sees nothing; nor does it see a wall that it nearly drives along. So its command is set aside while its body,
//! driven on as the wheels stand, would come near to a body that traffic control has told of, or to a wall, and given
//! anew afterwards. The obstacle rule holds all along. Without traffic control and without a map, or where its pose is
//! not known well, wander is the memorandum's alone.

use super::navigate::{STAND, STEP_NS};
use super::{Agent, TurnView};
use crate::authority::arbitration::MotorWriter;
use crate::authority::goal::Target;
use xtb_control::{Command, Stamp, Steering, WheelRpm};
use xtb_nav::geometry::rect::Rect;
use xtb_nav::navigator::{MARGIN_M, Navigator};
use xtb_nav::{MapPose, Piece};
use xtb_protocol::messages::StopReason;

/// Bodies keep so far apart, in m; chosen, not measured.
const APART_M: f64 = 0.12;
/// It keeps the first of these from what its map shows, in m, or where it has come nearer, the next that it still has.
/// The first is that of planned paths.
const WALL_M: [f64; 3] = [MARGIN_M, MARGIN_M / 2.0, 0.0];
/// Away from a wall it drives with as much, in m: a corner may swing out a little.
const AWAY_M: f64 = WALL_M[1];
/// A pose that is less certain than this, in m, stops nobody who wanders before a wall; chosen, not measured.
const KNOWN_M: f64 = 0.1;
/// Free floor ahead counts up to here when it looks for a way out, in m, in steps of [`AHEAD_M`].
const OPEN_M: f64 = 2.0;
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

/// What it does about others and walls.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) enum WanderGuard {
    /// Nothing: it wanders.
    #[default]
    Free,
    /// It stands.
    Standing { since: Stamp, because: StopReason },
    /// It drives away: gear, and steering as a fraction of full lock.
    BackingOff { since: Stamp, gear: f64, steering: f64 },
}

impl Agent {
    /// What a wandering robot shall do because of others or walls; `None` = wander on.
    pub(super) fn guard_wander(&mut self, now: Stamp, view: TurnView<'_>) -> Option<Command> {
        let wanders = self.writer == MotorWriter::Goal
            && self
                .goal
                .as_ref()
                .is_some_and(|goal| goal.target == Target::Anywhere && !goal.status.is_final());
        if !wanders {
            self.wander_guard = WanderGuard::Free;
            return None;
        }
        if now < self.wander_looked.plus_ns(STEP_NS) {
            return None;
        }
        self.wander_looked = now;
        let estimate = self.filter.estimate(now);
        let near = Near::of(&self.nav, estimate.pose, now);
        let outputs = view.outputs;
        let seen = outputs.obstacle;
        let way_m = AHEAD_M + STOPS_S * (outputs.rpm * self.mps_per_rpm).abs();
        match self.wander_guard {
            WanderGuard::Free => {
                if outputs.reference_rpm == 0.0 {
                    return None;
                }
                let near = if estimate.sigma_m < KNOWN_M { near } else { Near { wall_m: None, ..near } };
                let because = near.stop_reason(outputs.reference_rpm.signum(), outputs.steering, way_m)?;
                self.wander_guard = WanderGuard::Standing { since: now, because };
                Some(STAND)
            }
            WanderGuard::Standing { since, .. } if now.since_ms(since) < HOLD_MS => Some(STAND),
            WanderGuard::Standing { .. } if !seen.front && near.stop_reason(1.0, 0.0, BACK_M).is_none() => {
                self.wander_guard = WanderGuard::Free;
                Some(Command::Wander)
            }
            WanderGuard::Standing { because, .. } => {
                let is_open = |gear: f64| if gear < 0.0 { !seen.rear } else { !seen.front };
                self.wander_guard = match near.way_out(is_open) {
                    Some((gear, steering)) => WanderGuard::BackingOff { since: now, gear, steering },
                    None => WanderGuard::Standing { since: now, because },
                };
                Some(STAND)
            }
            WanderGuard::BackingOff { since, gear, steering } => {
                let stop_reason = near.away(AWAY_M).stop_reason(gear, steering, way_m);
                let is_over = now.since_ms(since) > BACK_MS || outputs.blocked;
                if is_over || stop_reason.is_some() {
                    let because = stop_reason.unwrap_or(obstacle(gear));
                    self.wander_guard = WanderGuard::Standing { since: now, because };
                    return Some(STAND);
                }
                let rpm = WheelRpm::try_from(gear * BACK_MPS / self.mps_per_rpm).unwrap_or(WheelRpm::ZERO);
                let steering = Steering::try_from(steering).unwrap_or(Steering::CENTRED);
                Some(Command::Follow { rpm, steering })
            }
        }
    }

    /// Why a wandering robot stands because of others or walls.
    pub(super) fn wander_stop_reason(&self) -> Option<StopReason> {
        match self.wander_guard {
            WanderGuard::Standing { because, .. } => Some(because),
            _ => None,
        }
    }
}

/// A wall in this gear.
fn obstacle(gear: f64) -> StopReason {
    if gear < 0.0 { StopReason::ObstacleRear } else { StopReason::ObstacleFront }
}

/// What is around a robot.
struct Near<'a> {
    nav: &'a Navigator,
    pose: MapPose,
    others: Vec<Rect>,
    /// It comes no nearer to another body than this, in m.
    apart_m: f64,
    /// Nor to a wall, in m; `None` = it knows of none, or its body is in one.
    wall_m: Option<f64>,
}

impl<'a> Near<'a> {
    fn of(nav: &'a Navigator, pose: MapPose, now: Stamp) -> Self {
        let has_map = nav.map().is_some();
        let wall_m = WALL_M.into_iter().find(|margin_m| has_map && nav.has_room(&pose, *margin_m));
        let mut near = Self { nav, pose, others: nav.told_bodies(now), apart_m: APART_M, wall_m };
        near.apart_m = APART_M.min(near.gap_m(&pose) - NEARER_M);
        near
    }

    /// The same, but so near to walls at least.
    fn away(mut self, wall_m: f64) -> Self {
        self.wall_m = self.wall_m.map(|now_m| now_m.min(wall_m));
        self
    }

    /// The least gap to any of the others at a pose, in m.
    fn gap_m(&self, pose: &MapPose) -> f64 {
        let body = Rect::body(self.nav.car(), pose);
        self.others.iter().map(|other| body.gap_m(other)).fold(f64::MAX, f64::min)
    }

    /// How far it could drive straight ahead from a pose before it met a wall of the map, in m, up to [`OPEN_M`].
    fn open_m(&self, from: &MapPose) -> f64 {
        let Some(wall_m) = self.wall_m else { return OPEN_M };
        let steps = (1..=(OPEN_M / AHEAD_M) as u32).map(|step| AHEAD_M * f64::from(step));
        let ahead = |length_m: f64| Piece { length_m, curvature_per_m: 0.0 }.end(from);
        steps.take_while(|length_m| self.nav.has_room(&ahead(*length_m), wall_m)).last().unwrap_or(0.0)
    }

    /// Poses along a way in this gear with this steering.
    fn along(&self, gear: f64, steering: f64, way_m: f64) -> impl Iterator<Item = MapPose> {
        let curvature_per_m = -steering / self.nav.car().radius_m;
        let steps = libm::ceil(way_m / STEP_M) as u32;
        let pose = self.pose;
        (1..=steps).map(move |step| {
            let length_m = gear * way_m * f64::from(step) / f64::from(steps);
            Piece { length_m, curvature_per_m }.end(&pose)
        })
    }

    /// What it comes too near to on the way.
    fn stop_reason(&self, gear: f64, steering: f64, way_m: f64) -> Option<StopReason> {
        if self.others.is_empty() && self.wall_m.is_none() {
            return None;
        }
        self.along(gear, steering, way_m).find_map(|pose| {
            if self.gap_m(&pose) < self.apart_m {
                return Some(StopReason::GivingWay);
            }
            let is_wall = self.wall_m.is_some_and(|wall_m| !self.nav.has_room(&pose, wall_m));
            is_wall.then(|| obstacle(gear))
        })
    }

    /// Gear and steering that lead to where the others are farthest and most floor ahead is free.
    fn way_out(self, is_open: impl Fn(f64) -> bool) -> Option<(f64, f64)> {
        let near = self.away(AWAY_M);
        let gears =
            [-1.0, 1.0].into_iter().filter(|gear| is_open(*gear) && near.nav.car().gears.allow(*gear));
        let ways = gears.flat_map(|gear| [-1.0, 0.0, 1.0].map(|steering| (gear, steering)));
        let clear = ways.filter(|&(gear, steering)| near.stop_reason(gear, steering, BACK_M).is_none());
        let free_m = |&(gear, steering): &(f64, f64)| {
            let end = near.along(gear, steering, BACK_M).last();
            end.map_or(0.0, |pose| near.gap_m(&pose).min(near.open_m(&pose)))
        };
        clear.max_by(|a, b| free_m(a).total_cmp(&free_m(b)))
    }
}
