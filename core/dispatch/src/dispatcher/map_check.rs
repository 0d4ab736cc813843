//! Tasks that a map makes impossible: noticed when the fleet gets one, or another version of it.

use super::Dispatcher;
use crate::task::Task;
use crate::task_store::record::Record;
use crate::tracked_robot::{TrackedRobot, smallest_car};
use crate::transition::TaskEnding;
use crate::travel_cost::TravelCost;
use crate::write_queue::OnWritten;
use xtb_protocol::messages::{TaskId, TaskState};

/// How far the tasks have been looked up on a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MapCheck {
    /// Whether robots may stand at their points: not yet.
    Points,
    /// Whether a way leads there: of those up to this one, and not before robots had time to be heard.
    Ways { done: Option<TaskId>, from_ms: u64 },
}

impl Dispatcher {
    /// Tasks that the map makes impossible fail: at once those with points at which no robot may stand, then
    /// those with points to which no way leads from any robot that may do them.
    pub(super) fn check_points(&mut self, now_ms: u64, travel_cost: &dyn TravelCost) {
        match self.check {
            Some(MapCheck::Points) => self.check_standing(now_ms, travel_cost),
            Some(MapCheck::Ways { done, from_ms }) if now_ms >= from_ms => {
                self.check_ways(now_ms, done, travel_cost)
            }
            _ => {}
        }
    }

    /// Whether a task is one that the map decides about.
    fn is_of_this_map(&self, task: &Task) -> bool {
        task.state != TaskState::Cancelling && self.suspension_state().other_map(task).is_none()
    }

    fn check_standing(&mut self, now_ms: u64, travel_cost: &dyn TravelCost) {
        let (mut lost, mut again) = (Vec::new(), false);
        for task in self.store.open().filter(|task| self.is_of_this_map(task)) {
            if self.writes.has_task(task.id) {
                again = true;
                continue;
            }
            let car = smallest_car(&self.robots, &task.spec.who);
            let refused = task.points_left().iter().find_map(|point| travel_cost.admits(&car, point).err());
            if let Some((_, what)) = refused {
                lost.push((task.id, what));
            }
        }
        self.fail_on_map(now_ms, lost);
        // One that waits for the ledger is looked at when that has answered.
        if !again {
            let from_ms = now_ms + self.settings.start_ms;
            self.check = Some(MapCheck::Ways { done: None, from_ms });
        }
    }

    fn check_ways(&mut self, now_ms: u64, after: Option<TaskId>, travel_cost: &dyn TravelCost) {
        travel_cost.begin_round();
        let (mut lost, mut is_through, mut done) = (Vec::new(), true, after);
        for task in self.store.open().filter(|task| after.is_none_or(|after| task.id > after)) {
            if self.is_of_this_map(task) && !self.writes.has_task(task.id) {
                match self.cut_off(now_ms, task, travel_cost) {
                    Some(Some(what)) => lost.push((task.id, what)),
                    Some(None) => {}
                    None => {
                        is_through = false;
                        break;
                    }
                }
            }
            done = Some(task.id);
        }
        self.fail_on_map(now_ms, lost);
        self.check = if is_through { None } else { Some(MapCheck::Ways { done, from_ms: now_ms }) };
    }

    /// The first of a task's points to which no way leads, in words. `None` = this round has measured enough.
    /// Where a robot that may do it is not heard, nobody can say: its planner will.
    fn cut_off(&self, now_ms: u64, task: &Task, travel_cost: &dyn TravelCost) -> Option<Option<String>> {
        let may = || self.robots.values().filter(|robot| robot.is_eligible(&task.spec.who));
        let unknown = |robot: &TrackedRobot| !robot.is_online(now_ms, &self.settings);
        if may().any(unknown) || may().next().is_none() {
            return Some(None);
        }
        for point in task.points_left() {
            let mut reached = false;
            for robot in may() {
                let Some(observed) = &robot.observed else { continue };
                reached = travel_cost.is_reachable(&robot.car(), &observed.pose, point)?;
                if reached {
                    break;
                }
            }
            if !reached {
                let what = format!("no path to ({:.2}, {:.2}) from any suitable robot", point.x_m, point.y_m);
                return Some(Some(what));
            }
        }
        Some(None)
    }

    fn fail_on_map(&mut self, now_ms: u64, lost: Vec<(TaskId, String)>) {
        let map = self.suspension_state().map.map(|map| map.name.clone()).unwrap_or_default();
        for (id, what) in lost {
            let Some(task) = self.store.task(id) else { continue };
            let (change, why) = (task.end(TaskEnding::Failed), format!("{what} (current map: {map})"));
            self.writes.push(
                now_ms,
                vec![Record::Became { task: id, change, why: Some(why) }],
                OnWritten::Nothing,
            );
        }
    }
}
