//! Out of a place from which there is no path: a little way without one, where that is known to be free.

use super::Navigator;
use super::look_ahead::near_m;
use super::task::{PAUSE_MS, Recovery, Stage, TRIES, Task};
use super::turn::{HoldReason, Sensed, TurnDecision, stand};
use super::visibility::{BODY_STEP_M, GOES_ON_M, IN_THE_WAY_M, blind_points};
use crate::MapPose;
use crate::geometry::{Cell, Path, Piece, distance_m};
use crate::obstacle_layer::ObstacleLayer;
use xtb_control::{Command, Stamp, Steering, WheelRpm};

/// Its wheels' speed, in m/s: a little over the least that the follower asks for in a narrow place (0.10,
/// `follower.tight_mps`).
pub(super) const RECOVERY_MPS: f64 = 0.11;
/// Longest reversing of a recovery, 28 cm at that speed; chosen, not measured (the memorandum's takes 6 s,
/// §4.6).
const RECOVERY_MS: u64 = 2_500;
/// A recovery that has gone so far is done, in m; chosen, not measured.
pub(super) const RECOVERED_M: f64 = 0.4;
/// After it, it stands so long before it plans anew; chosen, not measured.
const AFTER_MS: u64 = PAUSE_MS / 6;
/// What was seen goes on so far where nobody has looked, for a recovery, in m: a quarter of what a path keeps
/// off; chosen, not measured.
const UNSEEN_M: f64 = GOES_ON_M / 4.0;
/// Backing off by this much a range finder's readings are sure again, in m: more than ends the doubt (5 cm,
/// `obstacle.foldback_retreat_m`), and what was nearly touched is then out of the zone of 9.7 cm where they
/// lie.
const LOOKS_AGAIN_M: f64 = 0.12;
/// Recoveries for one goal, so that it ends; chosen, not measured.
const RECOVERIES: u32 = 3;

impl Navigator {
    /// After a plan that failed: again, or astern out of it, or the end.
    pub(super) fn pause(
        &mut self,
        now: Stamp,
        until: Stamp,
        sensed: &Sensed<'_>,
        task: &mut Task,
    ) -> TurnDecision {
        if task.tries > TRIES {
            return TurnDecision::Failed(task.failure());
        }
        if now < until {
            return stand(task.pausing());
        }
        // What passed by, or was seen from too near, stays there until it backs off and looks again.
        let folded = self.obstacles.as_ref().and_then(ObstacleLayer::folded);
        if let Some(side) = folded.filter(|_| task.recoveries < RECOVERIES)
            && let Some(decision) = self.get_out(now, sensed, task, -side * LOOKS_AGAIN_M, [0.0, 1.0, -1.0])
        {
            task.recoveries += 1;
            return decision;
        }
        if task.enclosed && task.recoveries < RECOVERIES {
            task.recoveries += 1;
            let side = if task.recoveries % 2 == 1 { 1.0 } else { -1.0 };
            if let Some(decision) = self.get_out(now, sensed, task, -RECOVERED_M, [side, -side, 0.0]) {
                return decision;
            }
        }
        task.seek();
        stand(HoldReason::Planning)
    }

    /// So much way without a path, with the first of some steerings for which there is room.
    fn get_out(
        &mut self,
        now: Stamp,
        sensed: &Sensed<'_>,
        task: &mut Task,
        way_m: f64,
        steerings: [f64; 3],
    ) -> Option<TurnDecision> {
        let from = sensed.estimate.pose;
        let steering = self.way_out(now, &from, way_m, steerings)?;
        let until = now.plus_ms(RECOVERY_MS);
        task.stage = Stage::Recovering(Recovery { until, steering, from, way_m });
        Some(self.recover(now, sensed, task))
    }

    /// The first of some steerings with which there is room for so much way, negative = astern.
    pub(super) fn way_out(&self, now: Stamp, pose: &MapPose, way_m: f64, steerings: [f64; 3]) -> Option<f64> {
        if !self.car.gears.allow(way_m) {
            return None;
        }
        let things = self.things_around(now, pose);
        let around = [pose.x_m, pose.y_m];
        let obstacles = self.obstacles.as_ref();
        let unobserved =
            obstacles.map_or_else(Vec::new, |all| all.unobserved(now, GOES_ON_M, around, near_m(&self.car)));
        let body = self.car.grown(IN_THE_WAY_M);
        let nears = |pose: &MapPose, point: &[f64; 2]| body.distance_m(pose, *point) <= 0.0;
        // What is that near already does not hold it there.
        let away: Vec<[f64; 2]> = things.into_iter().filter(|point| !nears(pose, point)).collect();
        steerings.into_iter().find(|steering| {
            let back = Piece { length_m: way_m, curvature_per_m: -steering / self.car.radius_m };
            let steps = libm::ceil(way_m.abs() / BODY_STEP_M) as u32;
            (1..=steps).all(|step| {
                let there = back.after(pose, f64::from(step) * BODY_STEP_M * way_m.signum());
                !away.iter().any(|point| nears(&there, point))
            }) && {
                let path = Path { start: *pose, pieces: vec![back] };
                let ways_m = [0.0, way_m.abs()];
                let blind =
                    |all: &ObstacleLayer| blind_points(&path, ways_m, (&self.car, all.sight()), &unobserved);
                obstacles.is_none_or(|all| blind(all).is_empty())
            }
        })
    }

    /// Middles of all cells nearby that are not free, or not known to be.
    fn things_around(&self, now: Stamp, pose: &MapPose) -> Vec<[f64; 2]> {
        let mut things = Vec::new();
        if let Some(obstacles) = &self.obstacles {
            things.extend(obstacles.obstacles(now).map(|obstacle| [obstacle.x_m, obstacle.y_m]));
            things.extend(obstacles.unseen_around(now, UNSEEN_M));
        }
        things.extend(self.others(now).iter().flat_map(|(pose, car)| car.body_points(pose)));
        if let Some(map) = &self.map {
            let grid = map.map.grid();
            let reach = libm::ceil((self.car.reach_m() + RECOVERED_M) / grid.resolution_m()) as i64;
            let (column, row) = grid.place(pose.x_m, pose.y_m);
            let cells = (-reach..=reach).flat_map(|up| (-reach..=reach).map(move |right| (right, up)));
            let cells = cells.map(|(right, up)| (column + right, row + up));
            let taken = cells.filter(|&(column, row)| grid.cell(column, row) != Cell::Free);
            things.extend(taken.map(|(column, row)| grid.centre_m(column, row)));
        }
        things
    }

    /// The memorandum's avoidance (§4.6), astern while turning, or away from what was touched.
    pub(super) fn recover(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> TurnDecision {
        let Stage::Recovering(Recovery { until, steering, from, way_m }) = task.stage else {
            return stand(HoldReason::Planning);
        };
        let gone_m = distance_m(&from, &sensed.estimate.pose);
        if now >= until || gone_m >= way_m.abs() || (sensed.blocked && sensed.speed_mps == 0.0) {
            task.stage = Stage::Pausing { until: now.plus_ms(AFTER_MS) };
            task.enclosed = false;
            return stand(HoldReason::WayBlocked);
        }
        let mps = RECOVERY_MPS.min(self.settings.drive.limit_mps) * way_m.signum();
        let rpm = WheelRpm::try_from(mps / self.vehicle.mps_per_rpm()).unwrap_or(WheelRpm::ZERO);
        let steering = Steering::try_from(steering).unwrap_or(Steering::CENTRED);
        TurnDecision::Go(Command::Follow { rpm, steering }, None)
    }
}
