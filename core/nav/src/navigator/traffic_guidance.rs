//! Traffic control's paths: what it last said, and when to go by it.

use super::Navigator;
use super::following::Following;
use super::right_of_way::HEARD_MS;
use super::task::{Stage, Task};
use super::turn::Sensed;
use super::visibility::BODY_STEP_M;
use crate::MapPose;
use crate::geometry::{Car, Path, Rect, distance_m};
use crate::path_follower::PathFollower;
use xtb_control::Stamp;

/// What traffic control says to a robot about its present goal.
#[derive(Debug, Clone, PartialEq)]
pub struct TrafficGuidance {
    /// Its paths, counted.
    pub plan: u64,
    /// `None` = stand, there is none yet.
    pub path: Option<Path>,
    /// Released along it, in m.
    pub release_m: f64,
    /// At most this fast.
    pub cruise_mps: f64,
    /// Who has to pass first.
    pub waits_for: Option<String>,
    /// Why there is no way: after [`NO_WAY_MS`] the goal fails with it.
    pub reason: Option<String>,
}

/// Traffic control that has not been heard for this long, 30 of its messages, is gone; chosen, not measured.
pub const TRAFFIC_LOST_MS: u64 = 3_000;
/// And this long after its last word a robot that was guided goes its own way: a service that died is back by
/// then (it was started again after 5 s in the bench of docs/navigation.md).
pub const ALONE_AFTER_MS: u64 = 10_000;
/// A robot that traffic control has told for this long that there is no way gives its goal up: twice the
/// longest time after which that tries again.
pub const NO_WAY_MS: u64 = 20_000;
/// A path that begins farther away than this is not for where it is now, in m: traffic control makes none
/// that begins farther than 10 cm from where the robot said it was, and the pose moves on a little.
pub const START_WITHIN_M: f64 = 0.12;
/// The body may reach so far into something along a path, in m: where a robot stands that near to a wall, traffic
/// control plans with up to 5 cm less than its body.
pub const GRAZE_M: f64 = 0.06;
/// Margins of the body to fixed things with which traffic control plans, in m: the largest with which it is free where
/// the robot stands. With the last ones a truck gets away that stands a little in a wall. Chosen, not measured.
pub const BODY_MARGINS_M: [f64; 5] = [0.05, 0.03, LEAST_MARGIN_M, -0.02, -0.05];
/// The least of them for a robot that stands free.
pub const LEAST_MARGIN_M: f64 = 0.01;
/// A longer path is none of a room's, in m: what is looked at in one turn is bounded. Traffic control believes no
/// robot that says it follows one.
pub const LONGEST_PATH_M: f64 = 500.0;
/// Poses of others are good for this long, six messages of traffic control, in ms; chosen, not measured.
const OTHERS_MS: u64 = 600;
/// What moves is a little farther on by now, in m: 7 cm at 0.35 m/s in the 200 ms between two states.
pub(super) const MOTION_ALLOWANCE_M: f64 = 0.08;

// What moves is forgotten first, then robots, then traffic control; only then does a robot go alone, or give up.
const _: () = assert!(OTHERS_MS < HEARD_MS && HEARD_MS < TRAFFIC_LOST_MS);
const _: () = assert!(TRAFFIC_LOST_MS < ALONE_AFTER_MS && ALONE_AFTER_MS < NO_WAY_MS);

/// What was heard of traffic control.
#[derive(Debug, Clone, Default)]
pub(super) struct GuidanceState {
    heard: Option<Stamp>,
    last: Option<TrafficGuidance>,
    /// Since when it has said that there is no way.
    no_way_since: Option<Stamp>,
    others: Vec<MapPose>,
    /// The number of a path that is not for this robot, since when it is sent, and why.
    refused: Option<(u64, Stamp, String)>,
}

impl GuidanceState {
    /// Whether traffic control lives.
    pub(super) fn is_alive(&self, now: Stamp) -> bool {
        self.heard.is_some_and(|at| now.since_ms(at) < TRAFFIC_LOST_MS)
    }

    /// Whether it lives, or was there a moment ago and may come back.
    pub(super) fn may_return(&self, now: Stamp) -> bool {
        self.heard.is_some_and(|at| now.since_ms(at) < ALONE_AFTER_MS)
    }

    /// The path belongs to a goal that is over.
    pub(super) fn forget_path(&mut self) {
        (self.last, self.no_way_since, self.refused) = (None, None, None);
    }

    /// Why there is no way, once traffic control has said so for long.
    pub(super) fn no_way(&self, now: Stamp) -> Option<&str> {
        self.no_way_since.filter(|since| self.is_alive(now) && now.since_ms(*since) >= NO_WAY_MS)?;
        self.last.as_ref()?.reason.as_deref()
    }

    /// Where the others are, as far as that is known.
    pub(super) fn others(&self, now: Stamp, car: &Car) -> Vec<(MapPose, Car)> {
        let car = car.grown(MOTION_ALLOWANCE_M);
        self.poses(now).iter().map(|pose| (*pose, car)).collect()
    }

    /// Where the middles of the others are, as far as that is known.
    pub(super) fn poses(&self, now: Stamp) -> &[MapPose] {
        let fresh = self.heard.is_some_and(|at| now.since_ms(at) < OTHERS_MS);
        if fresh { &self.others } else { &[] }
    }

    pub(super) fn last(&self) -> Option<&TrafficGuidance> {
        self.last.as_ref()
    }
}

impl Navigator {
    /// Traffic control was heard; `guidance` is about the goal that runs now, or none.
    pub fn guide(&mut self, now: Stamp, guidance: Option<TrafficGuidance>, others: &[MapPose]) {
        // What was seen while nobody said where the others are may have been one of them.
        let was_gone = self.guidance.heard.is_some_and(|at| now.since_ms(at) >= TRAFFIC_LOST_MS);
        if let Some(obstacles) = self.obstacles.as_mut().filter(|_| was_gone) {
            obstacles.clear();
        }
        self.guidance.heard = Some(now);
        self.guidance.others = others.to_vec();
        if self.task.is_some() {
            let says_no = guidance.as_ref().is_some_and(|guidance| guidance.reason.is_some());
            self.guidance.no_way_since =
                says_no.then(|| self.guidance.no_way_since.filter(|_| !was_gone).unwrap_or(now));
            self.guidance.last = guidance;
        }
    }

    /// Bodies of the others near by, as far as traffic control has told where they are.
    #[must_use]
    pub fn told_bodies(&self, now: Stamp) -> Vec<Rect> {
        let others = self.guidance.others(now, &self.car);
        others.iter().map(|(pose, car)| Rect::body(car, pose)).collect()
    }

    /// Whether its body has room at a pose, with so much more on each side, in m, as far as the map says; without a map
    /// it has.
    #[must_use]
    pub fn has_room(&self, pose: &MapPose, margin_m: f64) -> bool {
        let body = self.car.grown(margin_m);
        self.map.as_ref().is_none_or(|map| map.hit_by(&body, pose).is_none())
    }

    /// Whether traffic control has been heard lately.
    #[must_use]
    pub fn is_guided(&self, now: Stamp) -> bool {
        self.guidance.is_alive(now)
    }

    /// Takes over a new path once it stands, and each release at once. Without traffic control for
    /// [`ALONE_AFTER_MS`] a robot that stands at the end of what was released looks for itself.
    ///
    /// # Errors
    /// The path is not for a car like this one, in words.
    pub(super) fn follow_guidance(
        &mut self,
        now: Stamp,
        sensed: &Sensed<'_>,
        task: &mut Task,
    ) -> Result<(), String> {
        let stands = sensed.stands();
        if task.in_contact() {
            return Ok(());
        }
        if !self.guidance.is_alive(now) {
            if self.guidance.may_return(now) {
                return Ok(());
            }
            if let Stage::Following(following) = &task.stage
                && following.plan > 0
                && stands
            {
                task.seek();
            }
            return Ok(());
        }
        let Some(guidance) = self.guidance.last() else {
            return Ok(());
        };
        if let Stage::Following(following) = &mut task.stage
            && following.plan == guidance.plan
        {
            following.release_m = following.release_m.max(guidance.release_m);
            following.cruise_mps = guidance.cruise_mps;
            return Ok(());
        }
        let Some(path) = guidance.path.as_ref().filter(|path| task.lost_start != Some(path.start)) else {
            return Ok(());
        };
        let tolerance = self.settings.tolerance(task.target.yaw_rad.is_some());
        // A plan that continues the one before is driven on; any other waits until it stands.
        if let Stage::Following(following) = &mut task.stage
            && following.plan > 0
            && following.path.start == path.start
        {
            if let Err(why) = self.fits(path, following.follower.way_m()) {
                return self.refuse(now, why);
            }
            following.follower.go_on(path, &self.car).map_err(|error| wrong_vehicle(&error))?;
            (following.path, following.plan, following.beyond) = (path.clone(), guidance.plan, None);
            following.follower.arrive(tolerance);
            following.release_m = following.release_m.max(guidance.release_m);
            following.cruise_mps = guidance.cruise_mps;
            task.blocked_at = None;
            return Ok(());
        }
        let (start, here) = (&path.start, &sensed.estimate.pose);
        if !stands || distance_m(start, here) > START_WITHIN_M {
            return Ok(());
        }
        let follower = PathFollower::new(path, &self.car, self.follower.clone(), tolerance)
            .map_err(|error| wrong_vehicle(&error))?;
        if let Err(why) = self.fits(path, 0.0) {
            return self.refuse(now, why);
        }
        task.plans += 1;
        task.blocked_at = None;
        let mut following = Following::guided(path.clone(), follower, guidance.plan);
        (following.release_m, following.cruise_mps) = (guidance.release_m, guidance.cruise_mps);
        task.stage = Stage::Following(Box::new(following));
        Ok(())
    }

    /// It stands instead of driving that path. Traffic control may just have another version of the map: the goal
    /// fails once the same path has been sent for [`NO_WAY_MS`].
    fn refuse(&mut self, now: Stamp, why: String) -> Result<(), String> {
        let plan = self.guidance.last().map_or(0, |guidance| guidance.plan);
        let refused = &mut self.guidance.refused;
        match refused {
            Some((refused, since, why)) if *refused == plan => {
                if now.since_ms(*since) >= NO_WAY_MS {
                    Err(why.clone())
                } else {
                    Ok(())
                }
            }
            _ => {
                *refused = Some((plan, now, why));
                Ok(())
            }
        }
    }

    /// Whether this robot's own body, a little smaller for what two poses differ by, stays clear of its own map
    /// on the rest of traffic control's path. A path that was refused is not looked at again.
    fn fits(&self, path: &Path, from_m: f64) -> Result<(), String> {
        let plan = self.guidance.last().map_or(0, |guidance| guidance.plan);
        if let Some((_, _, why)) = self.guidance.refused.as_ref().filter(|(refused, ..)| *refused == plan) {
            return Err(why.clone());
        }
        let gears = self.car.gears;
        if let Some(unseen) = gears.unseen()
            && path.tail(from_m).pieces.iter().any(|piece| !gears.allow(piece.length_m))
        {
            return Err(wrong_vehicle(&format!("it leads where {unseen}")));
        }
        let Some(map) = &self.map else { return Ok(()) };
        if path.length_m() > LONGEST_PATH_M {
            return Err(wrong_vehicle(&format!("it is longer than {LONGEST_PATH_M} m")));
        }
        let body = self.car.grown(-GRAZE_M.min(self.car.core_m() / 2.0));
        let (mut begin, mut way_m) = (path.start, 0.0);
        for piece in &path.pieces {
            let steps = libm::ceil(piece.length_m.abs() / BODY_STEP_M).max(1.0) as u32;
            for step in 0..=steps {
                let part = f64::from(step) / f64::from(steps);
                if way_m + part * piece.length_m.abs() < from_m {
                    continue;
                }
                if let Some([x_m, y_m]) = map.hit_by(&body, &piece.after(&begin, part * piece.length_m)) {
                    let (long_m, wide_m) = (self.car.front_m + self.car.rear_m, 2.0 * self.car.half_width_m);
                    return Err(wrong_vehicle(&format!(
                        "it hits an obstacle on the map at ({x_m:.2}, {y_m:.2}) with a body of {long_m:.2} × {wide_m:.2} m"
                    )));
                }
            }
            way_m += piece.length_m.abs();
            begin = piece.end(&begin);
        }
        Ok(())
    }
}

fn wrong_vehicle(why: &dyn std::fmt::Display) -> String {
    format!("wrong_vehicle: traffic control's path does not fit this robot: {why}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Cell, Grid, Piece};
    use crate::localization::FilterTuning;
    use crate::map::Map;
    use crate::navigator::{HoldReason, PreparedMap, TargetPose, TurnDecision};
    use crate::{NavSettings, PoseFilter};
    use std::sync::Arc;
    use xtb_control::VehicleConfig;
    use xtb_control::odometry::OdomPose;

    const NOW: Stamp = Stamp::from_ms(1000);
    const START: MapPose = MapPose { x_m: 1.0, y_m: 0.5, yaw_rad: 0.0 };

    /// A lane of 4 m by 1 m, walls along both sides.
    fn lane() -> Map {
        let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 20).unwrap();
        for column in 0..80 {
            grid.set(column, 0, Cell::Occupied);
            grid.set(column, 19, Cell::Occupied);
        }
        Map::new("lane", grid, Vec::new()).unwrap()
    }

    /// What a robot with a body this wide decides at once, and after it has been sent along this piece for long.
    fn sent_along(width_m: f64, piece: Piece) -> [TurnDecision; 2] {
        let mut vehicle = VehicleConfig::default();
        vehicle.geometry.body_width_m = width_m;
        let mut navigator = Navigator::new(&vehicle, &NavSettings::default());
        navigator.set_map(Arc::new(PreparedMap::of(lane())));
        navigator.begin(TargetPose { x_m: 3.0, y_m: 0.5, yaw_rad: None });
        let mut path = Path::standing(START);
        path.push(piece);
        let guidance = TrafficGuidance {
            plan: 1,
            path: Some(path),
            release_m: 1.0,
            cruise_mps: 0.3,
            waits_for: None,
            reason: None,
        };
        let estimate = PoseFilter::new(&vehicle, FilterTuning::default(), NOW, &OdomPose::default(), &START);
        let (ir_front_cm, ir_rear_cm) = (&[None; 8], &[None; 8]);
        [NOW, NOW.plus_ms(NO_WAY_MS)].map(|now| {
            navigator.guide(now, Some(guidance.clone()), &[]);
            let estimate = &estimate.estimate(now);
            let speed_mps = 0.0;
            let (blocked, scanned) = (false, false);
            let sensed = Sensed { estimate, speed_mps, blocked, ir_front_cm, ir_rear_cm, scanned };
            navigator.turn(now, &sensed).unwrap()
        })
    }

    #[test]
    fn a_path_that_is_not_for_this_vehicle_is_refused_with_the_reason() {
        let straight = Piece { length_m: 1.5, curvature_per_m: 0.0 };
        let refused = |decision: &TurnDecision, word: &str| match decision {
            TurnDecision::Failed(why) => {
                assert!(why.starts_with("wrong_vehicle: ") && why.contains(word), "{why}")
            }
            other => panic!("{other:?}"),
        };
        let taken = &sent_along(0.4, straight)[0];
        assert!(matches!(taken, TurnDecision::Go(_, None | Some(HoldReason::AtCusp))), "{taken:?}");
        let [first, later] = sent_along(1.1, straight);
        assert!(!matches!(first, TurnDecision::Failed(_)), "another plan may be on its way: {first:?}");
        refused(&later, "0.50 × 1.10 m");
        refused(&sent_along(0.4, Piece { curvature_per_m: 5.0, ..straight })[0], "radius of 0.200 m");
        refused(&sent_along(0.4, Piece { length_m: 900.0, ..straight })[1], "longer than 500 m");
    }
}
