//! Points that are passed: on to the next goal without standing at the one before.
//!
//! ```text
//!   ──── path to the goal ────┬─ PASS_M ──► its end ──── path beyond ────► the next goal
//!                             └ reached, the next goal begins; the path beyond is looked for
//! ```
//! A goal that is to be passed counts as reached [`PASS_M`] before the end of a path that leads to it and that is
//! free and released altogether. The robot drives on to that end, over the goal itself. Meanwhile the path from there
//! to the next goal is planned, by itself or by traffic control, and is driven on without a stop. If none comes in
//! time, the robot stands at the end of the first path until one does.

use super::following::{Beyond, Following, PathPurpose};
use super::replan::{PlanFailure, Planned};
use super::task::{Stage, Task};
use super::turn::TargetPose;
use super::{Navigator, PLAN_WITHIN_MS};
use crate::path_follower::PathFollower;
use xtb_control::Stamp;

/// A goal that is passed counts as reached so far before its end, in m: at 0.35 m/s 1.4 s, in which a plan of
/// typically 5 to 300 ms, or one of traffic control's rounds, comes back before the robot slows down.
pub const PASS_M: f64 = 0.5;
/// What is released to so near the end of a path is released altogether, in m: rounding.
const RELEASED_M: f64 = 0.001;

impl Navigator {
    /// Whether the present goal may count as reached, and another one begin with [`Navigator::pass`].
    #[must_use]
    pub fn may_pass(&self, now: Stamp) -> bool {
        let Some(Task { stage: Stage::Following(following), target, .. }) = &self.task else { return false };
        let follower = &following.follower;
        let left_m = follower.length_m() - follower.way_m();
        let (end, tolerance) = (following.path.end(), self.settings.tolerance(false));
        let leads_there = !following.to_vantage
            && following.held.purpose == PathPurpose::Goal
            && libm::hypot(end.x_m - target.x_m, end.y_m - target.y_m) <= tolerance.position_m;
        let is_released = match following.plan {
            0 => !self.guidance.may_return(now),
            _ => following.release_m >= follower.length_m() - RELEASED_M,
        };
        let is_free = following.obstructed.is_none()
            && following.held.hold.is_none()
            && following.blocked_since.is_none();
        following.beyond.is_none() && leads_there && is_released && is_free && left_m <= PASS_M
    }

    /// The present goal counts as reached, and this one begins: the path under way is driven to its end, and on
    /// from there.
    pub fn pass(&mut self, target: TargetPose) {
        let stage = self.task.take().map(|task| (task.stage, task.hold_reason));
        self.begin(target);
        if let (Some((Stage::Following(mut following), hold_reason)), Some(task)) = (stage, &mut self.task) {
            following.beyond = Some(Beyond::Unknown);
            (task.stage, task.hold_reason) = (Stage::Following(following), hold_reason);
        }
    }

    /// Asks for the path beyond the end of the present one, unless traffic control makes it.
    pub(super) fn look_beyond(&mut self, now: Stamp, task: &mut Task) {
        let Stage::Following(following) = &mut task.stage else { return };
        let asks = match following.beyond {
            Some(Beyond::Unknown) => true,
            Some(Beyond::Asked { at, .. }) => now.since_ms(at) >= PLAN_WITHIN_MS,
            _ => false,
        };
        if asks && following.plan == 0 && !self.guidance.may_return(now) {
            self.jobs += 1;
            following.beyond = Some(Beyond::Asked { job: self.jobs, at: now });
            let start = following.path.end();
            self.outbox = self.plan_job(now, task, start);
        }
    }

    /// The path beyond the end of the present one, or why there is none: then it is looked for from there.
    pub(super) fn go_beyond(&self, task: &mut Task, result: Result<Planned, PlanFailure>) {
        let exact = task.target.yaw_rad.is_some();
        let Stage::Following(following) = &mut task.stage else { return };
        following.beyond = Some(Beyond::None);
        let Ok(Planned { path, to_vantage: false, expects_thin }) = result else { return };
        let path = following.path.tail(following.follower.way_m()).and(&path);
        let tolerance = self.settings.tolerance(exact);
        if let Ok(follower) = PathFollower::new(&path, &self.car, self.follower.clone(), tolerance) {
            let expects_thin = expects_thin && following.expects_thin;
            let cruise_mps = following.cruise_mps;
            **following = Following { expects_thin, cruise_mps, ..Following::own(path, follower, false) };
            task.plans += 1;
        }
    }
}

/// Whether this job was for the path beyond the present one.
pub(super) fn is_for(task: &Task, number: u64) -> bool {
    let Stage::Following(following) = &task.stage else { return false };
    matches!(following.beyond, Some(Beyond::Asked { job, .. }) if job == number)
}
