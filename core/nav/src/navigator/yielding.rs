//! Among other robots without traffic control: where the rule of [`right_of_way`](super::right_of_way) holds
//! a robot on its path, and what it does about one that stands there.
//!
//! | in the way | |
//! | --- | --- |
//! | the way of one that goes first | it stands before it |
//! | a body that moves | it waits |
//! | one that stands | a path around it |
//! | one that stands, no path around it, and I go first | it drives up to it, and says so |
//! | the same, and the other one goes first | back, to where the other one can pass |
//! | one that is parked, and no path around it | another try later, or `blocked by` it |

use super::Navigator;
use super::following::PathPurpose;
use super::replan::{Blocker, PlanFailure, Planned};
use super::right_of_way::{Hold, InTheWay, LOST_TURN_MS, NearRole, Neighbour, NeighbourNow, hold};
use super::task::{PAUSE_MS, Stage, TRIES, Task, Yielding};
use super::traffic_guidance::MOTION_ALLOWANCE_M;
use super::turn::{HoldReason, TurnDecision, stand};
use crate::MapPose;
use crate::geometry::{Car, Path, Rect, distance_m};
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_protocol::messages::Route;

/// A body that has stood for so long is something to plan around: five states; chosen, not measured.
const STILL_MS: u64 = 1_000;
/// Shorter than this one has only stopped for a moment; chosen, not measured.
const STANDS_MS: u64 = 1_500;
/// One that waits for me has told me to make room after so long; chosen, not measured.
const ASKED_MS: u64 = 2_000;
/// Nobody waits longer than this for another robot, so that every goal ends; chosen, not measured.
const MOST_MS: u64 = 60_000;
/// Ways back for one goal, so that it ends; chosen, not measured.
const MOST_RETREATS: u32 = 4;
/// Others that are looked at, the nearest ones: as many as traffic control tells a robot of.
const MOST_NEAR: usize = Route::MOST_OTHERS;

impl Navigator {
    /// The robot's own name: of two that meet the smaller one goes first.
    pub fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.neighbours.me);
    }

    /// Another robot said this, `at`.
    pub fn neighbour(&mut self, at: Stamp, said: impl Into<Arc<Neighbour>>) {
        self.neighbours.hear(at, said.into());
    }

    /// Whether it has a goal and nobody coordinates.
    #[must_use]
    pub fn goes_alone(&self, now: Stamp) -> bool {
        self.task.is_some() && !self.guidance.is_alive(now)
    }

    /// For whom it stands, where nobody coordinates.
    #[must_use]
    pub fn waits_for(&self) -> Option<&str> {
        self.task.as_ref()?.yielding.waits_for.as_deref()
    }

    /// Where the others are: what the range finders see of them is not unknown.
    pub(super) fn others(&self, now: Stamp) -> Vec<(MapPose, Car)> {
        if self.guidance.is_alive(now) {
            return self.guidance.others(now, &self.car);
        }
        let car = self.car.grown(MOTION_ALLOWANCE_M);
        self.neighbours.others(now).map(|other| (other.pose, car)).collect()
    }

    /// The nearest of the others that are meant, nearest first.
    fn nearest(
        &self,
        now: Stamp,
        from: &MapPose,
        meant: impl Fn(&NeighbourNow<'_>) -> bool,
    ) -> Vec<NeighbourNow<'_>> {
        let far_m = |pose: &MapPose| distance_m(pose, from);
        let mut others: Vec<NeighbourNow<'_>> = self.neighbours.others(now).filter(meant).collect();
        others.sort_by(|a, b| far_m(&a.pose).total_cmp(&far_m(&b.pose)));
        others.truncate(MOST_NEAR);
        others
    }

    /// Bodies to plan around.
    pub(super) fn standing_robots(&self, now: Stamp, from: &MapPose) -> Vec<(String, MapPose)> {
        let still =
            |other: &NeighbourNow<'_>| other.said.role == NearRole::Parked || other.still_ms >= STILL_MS;
        let still = self.nearest(now, from, still);
        still.into_iter().map(|other| (other.said.name.clone(), other.pose)).collect()
    }

    /// What has to become free, if a way back is looked for.
    pub(super) fn retreat_from(&self, now: Stamp, task: &Task) -> Option<Vec<Rect>> {
        let name = task.yielding.makes_room.as_ref().filter(|_| !task.yielding.has_made_room)?;
        let sweep = self.neighbours.find(now, name).map(|other| other.sweep(&self.car));
        Some(sweep.unwrap_or_default())
    }

    /// How far the rule lets it drive.
    pub(super) fn hold(&self, now: Stamp, path: &Path, from_m: f64) -> Option<Hold> {
        let others = self.nearest(now, &path.at(from_m).0, |_| true);
        hold(&self.neighbours.me, &self.car, path, from_m, &others)
    }

    /// Stands on its path because of another robot: why, or what to do instead.
    pub(super) fn wait_for_other(&mut self, now: Stamp, task: &mut Task) -> Result<HoldReason, TurnDecision> {
        let Stage::Following(following) = &task.stage else { return Err(stand(HoldReason::Planning)) };
        let held = following.held.clone();
        let Some(Hold { name, what, .. }) = held.hold else { return Ok(HoldReason::GivingWay) };
        let held_ms = held.since.map_or(0, |since| now.since_ms(since));
        let other = self.neighbours.find(now, &name);
        let before = other.is_some_and(|other| other.goes_before(&self.neighbours.me));
        let stood_ms = other.map_or(0, |other| other.stood_ms);
        task.yielding.waits_for = Some(name.clone());
        let through = held.purpose == PathPurpose::Through;
        let is_asked = other.is_some_and(|other| self.waits_for_me(&other));
        let patience_ms = match before {
            true if is_asked => ASKED_MS,
            true => LOST_TURN_MS,
            false if through => PAUSE_MS,
            false => STANDS_MS,
        };
        if held_ms < MOST_MS
            && (what == InTheWay::Path || stood_ms < patience_ms || through && held_ms < PAUSE_MS)
        {
            let standing = before || stood_ms < STANDS_MS;
            return Ok(if standing { HoldReason::GivingWay } else { HoldReason::WayBlocked });
        }
        task.yielding.blocked_by = Some(name);
        task.tries += u32::from(through);
        if held_ms >= MOST_MS || task.tries > TRIES {
            return Err(TurnDecision::Failed(task.failure()));
        }
        Err(self.lose_the_path(task, "another robot"))
    }

    fn waits_for_me(&self, other: &NeighbourNow<'_>) -> bool {
        other.said.waits_for.as_ref() == Some(&self.neighbours.me)
    }

    /// What a plan that has come back means among others: a path and what it is driven for, or `None` where
    /// there is none for now.
    pub(super) fn accept_plan(
        &self,
        now: Stamp,
        task: &mut Task,
        result: Result<Planned, PlanFailure>,
        by: Option<Blocker>,
    ) -> Option<(Planned, PathPurpose)> {
        let makes_room = task.yielding.makes_room.take_if(|_| !task.yielding.has_made_room);
        match (result, by, makes_room) {
            (Ok(planned), _, Some(name)) => {
                task.yielding.retreats += 1;
                task.yielding.makes_room = Some(name);
                Some((planned, PathPurpose::Retreat))
            }
            (Err(_), _, Some(name)) => {
                task.no_way_past(now, name);
                None
            }
            (Ok(planned), ..) => {
                task.yielding = Yielding { retreats: task.yielding.retreats, ..Yielding::default() };
                Some((planned, PathPurpose::Goal))
            }
            (Err(_), Some(Blocker { name, planned }), None) => self.plan_past(now, task, name, planned),
            (Err(failure), None, None) => {
                task.yielding = Yielding { retreats: task.yielding.retreats, ..Yielding::default() };
                task.no_way(now, failure);
                None
            }
        }
    }

    /// Without this robot there would be a path.
    fn plan_past(
        &self,
        now: Stamp,
        task: &mut Task,
        name: String,
        planned: Planned,
    ) -> Option<(Planned, PathPurpose)> {
        let other = self.neighbours.find(now, &name).filter(|other| other.said.role == NearRole::Alone);
        let Some(other) = other else {
            task.no_way_past(now, name);
            return None;
        };
        let is_asked = self.waits_for_me(&other) && other.stood_ms >= ASKED_MS;
        let back = other.goes_before(&self.neighbours.me)
            && (is_asked || other.stood_ms >= LOST_TURN_MS)
            && task.yielding.retreats < MOST_RETREATS;
        if back {
            (task.yielding.makes_room, task.yielding.has_made_room) = (Some(name), false);
            task.seek();
            return None;
        }
        task.yielding.blocked_by = Some(name);
        Some((planned, PathPurpose::Through))
    }
}
