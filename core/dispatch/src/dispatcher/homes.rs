//! Drives to docks and parking places: which robot is sent where, and which task of its waits meanwhile.
//!
//! Each round decides anew from ledger, states and places, so that nothing has to be remembered over a restart but
//! whether a dock charges. A place that one robot stands at or goes to is no other robot's.

mod round;
mod view;

use super::Dispatcher;
use crate::home::{HomeRules, is_dock_of};
use crate::task::Task;
use crate::task_store::record::Record;
use crate::transition::{TaskEnding, TaskOutcome, TaskUpdate};
use crate::travel_cost::TravelCost;
use crate::write_queue::OnWritten;
use round::{Decision, Round};
use std::sync::Arc;
use xtb_control::vehicle::BatteryLevels;
use xtb_protocol::Name;
use xtb_protocol::messages::{LinkLoss, MAX_PRIORITY, MapPlace, TaskId, TaskKind, TaskSpec, Who};

/// A drive home may take so long without us, in s for each m of the straight way: at 0.1 m/s, and twice as far.
const FINISH_S_PER_M: f64 = 20.0;
/// But no less and no more than this, in s: so long a robot that is not heard keeps its dock from others.
const FINISH_S: [f64; 2] = [120.0, 3600.0];

impl Dispatcher {
    /// Robots go to docks and parking places by these rules from now on; `None` = not by themselves.
    pub fn set_home_rules(&mut self, rules: Option<HomeRules>) {
        self.home_rules = rules.map(Arc::new);
        if self.home_rules.is_none() {
            self.robots.values_mut().for_each(|robot| robot.stays_for = None);
        }
    }

    /// The places of the fleet's map.
    pub fn set_places(&mut self, places: &[MapPlace]) {
        self.places = Some(places.to_vec());
    }

    /// When a robot's battery is low, as its factsheet says.
    pub fn set_battery_levels(&mut self, now_ms: u64, name: &Name, levels: BatteryLevels) {
        self.robot(now_ms, name).charge.levels = levels;
    }

    /// Whether a task is one of the dispatcher's own drives.
    pub(super) fn is_own(&self, task: &Task) -> bool {
        task.by == self.identity.me
    }

    /// Whether a robot that is to stay where it is, or to go home, goes all the same for this task.
    pub(super) fn leads_home(&self, task: &Task) -> bool {
        self.is_own(task) || self.home_order(task).is_some()
    }

    /// Whether the places are not known yet: after a start, whoever looks for them has a while. Until then a robot
    /// that is being charged could be taken for a free one.
    pub(super) fn are_places_due(&self, now_ms: u64) -> bool {
        self.home_rules.is_some()
            && self.places.is_none()
            && now_ms < self.started_ms + self.settings.start_ms
    }

    /// Decides who goes where.
    pub(super) fn check_homes(&mut self, now_ms: u64, travel_cost: &dyn TravelCost) {
        let Some(rules) = self.home_rules.clone() else { return };
        self.look_at_batteries(now_ms, &rules);
        let (decisions, mut stays) = Round::new(self, now_ms, &rules, travel_cost).decide();
        for (name, robot) in &mut self.robots {
            robot.stays_for = stays.remove(name);
        }
        // What has been decided is in the ledger before anything else is.
        let is_due = self.are_places_due(now_ms) || self.is_map_due(now_ms);
        let is_stopped = self.suspension_state().stop.is_some();
        if is_due || is_stopped || self.writes.has_submission_by(&self.identity.me) {
            return;
        }
        for decision in decisions {
            self.carry_out_home(now_ms, decision);
        }
    }

    fn look_at_batteries(&mut self, now_ms: u64, rules: &HomeRules) {
        let places = self.places.as_deref().unwrap_or_default();
        for robot in self.robots.values_mut() {
            let Some(observed) =
                robot.observed.as_ref().filter(|_| robot.last_heard_ms + self.settings.silent_ms > now_ms)
            else {
                continue;
            };
            let stands = observed.running().is_none();
            let at = places.iter().filter(|place| stands && is_dock_of(rules, place, &robot.name));
            let dock = round::nearest_at(at, &observed.pose).map(|place| &place.name);
            let battery = (observed.battery_v, observed.battery_level);
            robot.charge.moved(now_ms, &observed.pose);
            robot.charge.look(now_ms, rules, battery, dock);
        }
    }

    fn carry_out_home(&mut self, now_ms: u64, decision: Decision) {
        match decision {
            Decision::Send { robot, place, charges, why } => {
                if self.store.open_count() >= self.settings.max_open {
                    return;
                }
                let task = TaskId::new(self.store.next_task() + self.writes.new_tasks());
                // A robot that gets home without us is better off than one that stands with a low battery.
                let pose =
                    self.robots.get(&robot).and_then(|robot| robot.observed.as_ref()).map(|seen| seen.pose);
                let way_m = pose.map_or(f64::MAX, |at| libm::hypot(at.x_m - place.x_m, at.y_m - place.y_m));
                let finish_s = (way_m * FINISH_S_PER_M).clamp(FINISH_S[0], FINISH_S[1]);
                let (priority, on_link_loss) =
                    if charges { (MAX_PRIORITY, LinkLoss::Finish) } else { (0, LinkLoss::Halt) };
                let kind = TaskKind::Goto { to: place };
                let spec = TaskSpec {
                    priority,
                    who: Who::Robot(robot),
                    on_link_loss,
                    finish_s,
                    ..TaskSpec::new(kind)
                };
                let (by, key) = (self.identity.me.clone(), self.new_id());
                let change = TaskUpdate::Queued { not_before_ms: 0, failed: false };
                let records = vec![
                    Record::Submitted { task, by, key, spec: Box::new(spec) },
                    Record::Became { task, change, why: Some(why) },
                ];
                self.writes.push(now_ms, records, OnWritten::Nothing);
            }
            Decision::Release { task, why } => {
                // No fault of the robot, nor of the task.
                let change = TaskUpdate::Queued { not_before_ms: 0, failed: false };
                self.record(now_ms, task, TaskOutcome::Changed(change, Some(why)));
            }
            Decision::Cancel { task, why, avoid } => {
                if let Some((name, place)) = avoid
                    && let Some(robot) = self.robots.get_mut(&name)
                {
                    robot.charge.avoid(now_ms, &place);
                }
                let Some(change) = self.store.task(task).map(|task| task.end(TaskEnding::Cancelled)) else {
                    return;
                };
                let record = Record::Became { task, change, why: Some(why) };
                self.writes.push(now_ms, vec![record], OnWritten::Nothing);
            }
        }
    }
}
