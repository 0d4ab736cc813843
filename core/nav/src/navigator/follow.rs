//! A turn along a path, and what ends it.

use super::Navigator;
use super::following::{Beyond, Following, PathPurpose};
use super::look_ahead::LOOK_MS;
use super::task::{Stage, TRIES, Task};
use super::turn::{HoldReason, Sensed, TurnDecision, stand};
use crate::MapPose;
use crate::localization::UncertaintySpeed;
use crate::path_follower::{DriveLimits, FollowerStatus, Stuck};
use xtb_control::Stamp;

/// The first level holds it this long before it looks for another way; chosen, not measured.
const BLOCKED_MS: u64 = 1_500;
/// What holds it stands so far ahead of the bumper, in m, within the obstacle rule's 25 cm, or as far within a longer
/// one (`navigation.drive.obstacle_cm`), …
const HELD_AHEAD_M: f64 = 0.2;
/// … or where something is known as near as this to there; chosen, not measured.
const HELD_NEAR_M: f64 = 0.4;
/// Paths for one goal before it gives up, so that every goal ends; chosen, not measured.
const MOST_PLANS: u32 = 40;
/// Way along a path that counts as progress, in m; chosen, not measured.
const PROGRESS_M: f64 = 0.5;

impl Navigator {
    /// A turn along the path.
    pub(super) fn follow(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> TurnDecision {
        self.look_beyond(now, task);
        let Stage::Following(following) = &mut task.stage else { return stand(HoldReason::Planning) };
        self.look_ahead(now, sensed, following);
        if following.met_thin && !following.expects_thin && following.plan == 0 {
            task.seek();
            return stand(HoldReason::Planning);
        }
        let pose = sensed.estimate.pose;
        let uncertainty = self.settings.uncertainty_limits(&self.car);
        let allowed = UncertaintySpeed::of(sensed.estimate, following.clearance_m, &uncertainty);
        let limits = self.drive_limits(now, following, allowed);
        let drive = following.follower.step(now, &pose, sensed.speed_mps, &limits);
        following.off_m = drive.cross_m;
        if drive.way_m > following.counted_m + PROGRESS_M {
            following.counted_m = drive.way_m;
            (task.tries, task.lost_paths, task.contacts, task.blocked_at) = (0, 0, 0, None);
        }
        let held = sensed.blocked || drive.status == FollowerStatus::Stuck(Stuck::NoMotion);
        following.blocked_since = held.then(|| following.blocked_since.unwrap_or(now));
        let command = drive.command(&self.vehicle);
        let go = |why| TurnDecision::Go(command, why);
        if allowed == UncertaintySpeed::Stop {
            return go(Some(HoldReason::PoseUncertain));
        }
        match drive.status {
            FollowerStatus::Reached | FollowerStatus::Stuck(Stuck::Missed) if following.to_vantage => {
                task.seek();
                stand(HoldReason::Planning)
            }
            FollowerStatus::Reached | FollowerStatus::Stuck(Stuck::Missed)
                if following.held.purpose == PathPurpose::Retreat =>
            {
                task.has_made_room(now);
                stand(task.pausing())
            }
            FollowerStatus::Reached | FollowerStatus::Stuck(Stuck::Missed) if following.beyond.is_some() => {
                match following.beyond {
                    Some(Beyond::None) => {
                        task.seek();
                        stand(HoldReason::Planning)
                    }
                    _ if following.plan > 0 => go(Some(HoldReason::WaitingForTraffic)),
                    _ => go(Some(HoldReason::Planning)),
                }
            }
            FollowerStatus::Reached => TurnDecision::Reached,
            FollowerStatus::Deviated { .. }
            | FollowerStatus::Stuck(Stuck::Missed | Stuck::NoProgress | Stuck::NotANumber) => {
                self.lose_the_path(task, "the robot left its path")
            }
            FollowerStatus::AtReleaseEnd if following.held.hold.is_some() && sensed.stands() => {
                match self.wait_for_other(now, task) {
                    Ok(standing) => go(Some(standing)),
                    Err(decision) => decision,
                }
            }
            _ if following.blocked_since.is_some_and(|since| now.since_ms(since) >= BLOCKED_MS) => {
                let at = self.held_by(now, &pose, drive.speed_mps);
                self.find_blocked(now, task, at)
            }
            _ if following.obstructed_since.is_some_and(|since| now.since_ms(since) >= LOOK_MS)
                && sensed.stands() =>
            {
                let at = following.obstructed.map_or([pose.x_m, pose.y_m], |(_, at)| at);
                self.find_blocked(now, task, at)
            }
            FollowerStatus::AtReleaseEnd if following.obstructed.is_some() => {
                go(Some(HoldReason::WayBlocked))
            }
            FollowerStatus::AtReleaseEnd => go(Some(HoldReason::WaitingForTraffic)),
            _ if following.plan > 0 && following.cruise_mps == 0.0 && sensed.stands() => {
                go(Some(HoldReason::WaitingForTraffic))
            }
            FollowerStatus::AtCusp => go(Some(HoldReason::AtCusp)),
            FollowerStatus::Following | FollowerStatus::Stuck(Stuck::NoMotion) => go(None),
        }
    }

    /// As far and as fast as path, obstacles, other robots and the pose let it.
    fn drive_limits(&self, now: Stamp, following: &Following, allowed: UncertaintySpeed) -> DriveLimits {
        let allowed_mps = match allowed {
            UncertaintySpeed::Full => self.settings.cruise_mps(),
            UncertaintySpeed::Slow { mps } => mps.min(self.settings.drive.limit_mps),
            UncertaintySpeed::Stop => 0.0,
        };
        let held_m = following.held.hold.as_ref().map_or(f64::MAX, |hold| hold.way_m);
        let free_m = following.obstructed.map_or(held_m, |(way_m, _)| way_m.min(held_m));
        // Its own path ends where traffic control takes over again.
        let release_m = match following.plan {
            0 if self.guidance.is_alive(now) => 0.0,
            _ => following.release_m,
        };
        // Both may have become lower since the path was taken up.
        let own_mps = if following.plan == 0 { self.settings.meeting_mps() } else { f64::MAX };
        let cruise_mps = following.cruise_mps.min(own_mps);
        DriveLimits {
            way_m: release_m.min(free_m),
            cruise_mps: cruise_mps.min(allowed_mps).min(following.bend_mps(self.car.radius_m)),
            clearance_m: following.clearance_m,
            swing_rad: following.swing_rad(self.car.front_m),
        }
    }

    /// Where the thing most likely is because of which the first level holds the motor.
    fn held_by(&self, now: Stamp, pose: &MapPose, speed_mps: f64) -> [f64; 2] {
        let held_m = HELD_AHEAD_M.max(self.settings.drive.obstacle_cm / 100.0 - 0.05);
        let ahead_m = speed_mps.signum() * (self.car.front_m + held_m);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let at = [pose.x_m + ahead_m * cos, pose.y_m + ahead_m * sin];
        let obstacle = self.obstacles.as_ref().and_then(|obstacles| obstacles.nearest(now, at));
        let obstacle = obstacle.filter(|obstacle| obstacle.distance_m(at) < HELD_NEAR_M);
        obstacle.map_or(at, |obstacle| [obstacle.x_m, obstacle.y_m])
    }

    /// Something unknown is in the way: another path, or, on traffic control's, a report to it.
    fn find_blocked(&mut self, now: Stamp, task: &mut Task, at: [f64; 2]) -> TurnDecision {
        task.blocked_at = Some(at);
        let Stage::Following(following) = &task.stage else { return stand(HoldReason::WayBlocked) };
        if following.plan > 0 && self.guidance.is_alive(now) {
            return stand(HoldReason::WayBlocked);
        }
        self.lose_the_path(task, "unmapped obstacle")
    }

    /// Another path from here, unless that was tried often enough.
    pub(super) fn lose_the_path(&mut self, task: &mut Task, why: &str) -> TurnDecision {
        task.lost_paths += 1;
        why.clone_into(&mut task.last_failure);
        if task.lost_paths > TRIES || task.plans >= MOST_PLANS {
            return TurnDecision::Failed(task.failure());
        }
        if let Stage::Following(following) = &task.stage {
            task.lost_start = (following.plan > 0).then_some(following.path.start);
        }
        task.seek();
        stand(HoldReason::Planning)
    }
}
