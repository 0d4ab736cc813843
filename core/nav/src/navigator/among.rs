//! Among other robots without traffic control: where the rule of [`giveway`](super::giveway) holds a robot
//! on its path, and what it does about one that stands there.
//!
//! | in the way | |
//! | --- | --- |
//! | the way of one that goes first | it stands before it |
//! | a body that moves | it waits |
//! | one that stands | a path around it |
//! | one that stands, no path around it, and I go first | it drives up to it, and says so |
//! | the same, and the other one goes first | back, to where the other one can pass |
//! | one that is parked, and no path around it | another try later, or `blocked by` it |

use super::giveway::{Hold, InTheWay, LOST_TURN_MS, Neighbour, Other, Role, hold};
use super::job::{Blamed, PlanFailure, Planned};
use super::{Decision, Navigator, PAUSE_MS, Stage, Standing, TRIES, Task};
use crate::car::Car;
use crate::rect::Rect;
use crate::{MapPose, Path};
use xtb_control::Stamp;

/// A body that has stood for so long is something to plan around.
const STILL_MS: u64 = 1_000;
/// Shorter than this one has only stopped for a moment.
const STANDS_MS: u64 = 1_500;
/// One that waits for me has told me to make room after so long.
const ASKED_MS: u64 = 2_000;
/// Nobody waits longer than this for another robot.
const MOST_MS: u64 = 60_000;
/// Ways back for one goal.
const MOST_RETREATS: u32 = 4;
/// After a way back it lets the others begin.
const AFTER_RETREAT_MS: u64 = 3_000;
/// Others that are looked at, the nearest ones.
const MOST_NEAR: usize = 16;
/// What moves is a little farther on by now, in m.
const GROWN_M: f64 = 0.08;

/// What a goal has to do with other robots.
#[derive(Debug, Clone, Default)]
pub(super) struct Among {
    /// For whom it stands at present.
    pub(super) waits_for: Option<String>,
    /// For whom it makes room: it looks for a way back, or has driven it.
    makes_room: Option<String>,
    /// It stands where the other one can pass.
    has_made_room: bool,
    retreats: u32,
    /// Who was in the way last.
    blamed: Option<String>,
}

/// What a path is driven for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Errand {
    /// The goal, or a place to look from.
    #[default]
    Goal,
    /// The goal, through somebody who has to go away first.
    Through,
    /// Out of somebody's way.
    Retreat,
}

/// Where a path is held by others.
#[derive(Debug, Clone, Default)]
pub(super) struct Held {
    pub(super) errand: Errand,
    pub(super) hold: Option<Hold>,
    since: Option<Stamp>,
}

impl Held {
    /// As the rule says now.
    pub(super) fn is(&mut self, now: Stamp, hold: Option<Hold>, stands: bool) {
        let goes_on = hold.is_some() && stands;
        self.since = goes_on.then(|| self.since.unwrap_or(now));
        self.hold = hold;
    }
}

impl Task {
    /// Who is to blame, once it gives up.
    pub(super) fn blamed(&self) -> Option<String> {
        self.among.blamed.as_ref().map(|name| format!("blocked by {name}"))
    }

    /// Why it stands between two tries.
    pub(super) fn pausing(&mut self) -> Standing {
        self.among.waits_for = self.among.makes_room.clone().or_else(|| self.among.blamed.clone());
        if self.among.has_made_room { Standing::GivingWay } else { Standing::WayBlocked }
    }

    /// At the end of a way back.
    pub(super) fn has_made_room(&mut self, now: Stamp) {
        self.among.has_made_room = true;
        self.stage = Stage::Pausing { until: now.plus_ms(AFTER_RETREAT_MS) };
    }

    /// No way past this robot, for now.
    fn blame(&mut self, now: Stamp, name: String) {
        let words = format!("blocked by {name}");
        self.no_way(now, PlanFailure { words, at: None, for_good: false, enclosed: false });
        self.among.blamed = Some(name);
    }
}

impl Navigator {
    /// The robot's own name: of two that meet the smaller one goes first.
    pub fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.neighbours.me);
    }

    /// Another robot said this, `at`.
    pub fn neighbour(&mut self, at: Stamp, said: Neighbour) {
        self.neighbours.hear(at, said);
    }

    /// Whether it has a goal and nobody coordinates.
    #[must_use]
    pub fn goes_alone(&self, now: Stamp) -> bool {
        self.task.is_some() && !self.led.leads(now)
    }

    /// For whom it stands, where nobody coordinates.
    #[must_use]
    pub fn waits_for(&self) -> Option<&str> {
        self.task.as_ref()?.among.waits_for.as_deref()
    }

    /// Where the others are: what the range finders see of them is not unknown.
    pub(super) fn others(&self, now: Stamp) -> Vec<(MapPose, Car)> {
        if self.led.leads(now) {
            return self.led.others(now, &self.car);
        }
        let car = self.car.grown(GROWN_M);
        self.neighbours.others(now).map(|other| (other.pose, car)).collect()
    }

    /// The nearest of the others that are meant, nearest first.
    fn nearest(&self, now: Stamp, from: &MapPose, meant: impl Fn(&Other<'_>) -> bool) -> Vec<Other<'_>> {
        let far_m = |pose: &MapPose| libm::hypot(pose.x_m - from.x_m, pose.y_m - from.y_m);
        let mut others: Vec<Other<'_>> = self.neighbours.others(now).filter(meant).collect();
        others.sort_by(|a, b| far_m(&a.pose).total_cmp(&far_m(&b.pose)));
        others.truncate(MOST_NEAR);
        others
    }

    /// Bodies to plan around.
    pub(super) fn in_the_search(&self, now: Stamp, from: &MapPose) -> Vec<(String, MapPose)> {
        let still = |other: &Other<'_>| other.said.role == Role::Parked || other.still_ms >= STILL_MS;
        let still = self.nearest(now, from, still);
        still.into_iter().map(|other| (other.said.name.clone(), other.pose)).collect()
    }

    /// What has to become free, if a way back is looked for.
    pub(super) fn retreat_from(&self, now: Stamp, task: &Task) -> Option<Vec<Rect>> {
        let name = task.among.makes_room.as_ref().filter(|_| !task.among.has_made_room)?;
        let sweep = self.neighbours.find(now, name).map(|other| other.sweep(&self.car));
        Some(sweep.unwrap_or_default())
    }

    /// How far the rule lets it drive.
    pub(super) fn hold(&self, now: Stamp, path: &Path, from_m: f64) -> Option<Hold> {
        let others = self.nearest(now, &path.at(from_m).0, |_| true);
        hold(&self.neighbours.me, &self.car, path, from_m, &others)
    }

    /// Stands on its path because of another robot: why, or what to do instead.
    pub(super) fn wait_for_other(&mut self, now: Stamp, task: &mut Task) -> Result<Standing, Decision> {
        let Stage::Following(following) = &task.stage else { return Err(super::stand(Standing::Planning)) };
        let held = following.held.clone();
        let Some(Hold { name, what, .. }) = held.hold else { return Ok(Standing::GivingWay) };
        let held_ms = held.since.map_or(0, |since| now.since_ms(since));
        let other = self.neighbours.find(now, &name);
        let before = other.is_some_and(|other| other.goes_before(&self.neighbours.me));
        let stood_ms = other.map_or(0, |other| other.stood_ms);
        task.among.waits_for = Some(name.clone());
        let through = held.errand == Errand::Through;
        let is_asked = other.is_some_and(|other| self.waits_for_me(&other));
        let patience_ms = match before {
            true if is_asked => ASKED_MS,
            true => LOST_TURN_MS,
            false if through => PAUSE_MS,
            false => STANDS_MS,
        };
        if held_ms < MOST_MS
            && (what == InTheWay::Way || stood_ms < patience_ms || through && held_ms < PAUSE_MS)
        {
            let standing = before || stood_ms < STANDS_MS;
            return Ok(if standing { Standing::GivingWay } else { Standing::WayBlocked });
        }
        task.among.blamed = Some(name);
        task.tries += u32::from(through);
        if held_ms >= MOST_MS || task.tries > TRIES {
            return Err(Decision::Failed(task.failure()));
        }
        Err(self.lose_the_path(task, "another robot"))
    }

    fn waits_for_me(&self, other: &Other<'_>) -> bool {
        other.said.waits_for.as_ref() == Some(&self.neighbours.me)
    }

    /// What a plan that has come back means among others: a path and what it is driven for, or `None` where
    /// there is none for now.
    pub(super) fn among(
        &self,
        now: Stamp,
        task: &mut Task,
        result: Result<Planned, PlanFailure>,
        by: Option<Blamed>,
    ) -> Option<(Planned, Errand)> {
        let makes_room = task.among.makes_room.take_if(|_| !task.among.has_made_room);
        match (result, by, makes_room) {
            (Ok(planned), _, Some(name)) => {
                task.among.retreats += 1;
                task.among.makes_room = Some(name);
                Some((planned, Errand::Retreat))
            }
            (Err(_), _, Some(name)) => {
                task.blame(now, name);
                None
            }
            (Ok(planned), ..) => {
                task.among = Among { retreats: task.among.retreats, ..Among::default() };
                Some((planned, Errand::Goal))
            }
            (Err(_), Some(Blamed { name, planned }), None) => self.blocked_by(now, task, name, planned),
            (Err(failure), None, None) => {
                task.among = Among { retreats: task.among.retreats, ..Among::default() };
                task.no_way(now, failure);
                None
            }
        }
    }

    /// Without this robot there would be a path.
    fn blocked_by(
        &self,
        now: Stamp,
        task: &mut Task,
        name: String,
        planned: Planned,
    ) -> Option<(Planned, Errand)> {
        let other = self.neighbours.find(now, &name).filter(|other| other.said.role == Role::Alone);
        let Some(other) = other else {
            task.blame(now, name);
            return None;
        };
        let is_asked = self.waits_for_me(&other) && other.stood_ms >= ASKED_MS;
        let back = other.goes_before(&self.neighbours.me)
            && (is_asked || other.stood_ms >= LOST_TURN_MS)
            && task.among.retreats < MOST_RETREATS;
        if back {
            (task.among.makes_room, task.among.has_made_room) = (Some(name), false);
            task.seek();
            return None;
        }
        task.among.blamed = Some(name);
        Some((planned, Errand::Through))
    }
}
