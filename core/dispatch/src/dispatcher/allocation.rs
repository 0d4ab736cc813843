//! Allocation: which free robot gets which waiting task, and why a task still waits.

use super::Dispatcher;
use crate::assign::{self, Candidate, Demand};
use crate::predicted_free;
use crate::task::Task;
use crate::task_store::record::Record;
use crate::tracked_robot::{TrackedRobot, smallest_car};
use crate::travel_cost::{ANY_CAR, TravelCost};
use crate::write_queue::OnWritten;
use std::collections::BTreeSet;
use xtb_nav::Car;
use xtb_protocol::Name;
use xtb_protocol::messages::{BatteryLevel, TaskId, TaskState, Who};

/// How much farther a robot counts whose battery is getting low, in m.
const LOW_BATTERY_M: f64 = 20.0;
/// And one on which the task has failed before.
const FAILED_M: f64 = 50.0;
/// So many busy robots are looked at, at most: those that are soonest free.
const MAX_PREDICTED: usize = 16;

impl Dispatcher {
    /// Gives waiting tasks to free robots. One that a robot which is nearly done will get to sooner is
    /// reserved for that one, for a while; then, any that is free and left over gets it.
    pub(super) fn allocate(&mut self, now_ms: u64, travel_cost: &dyn TravelCost) {
        self.reserved.clear();
        if self.suspension_state().stop.is_some() || self.are_places_due(now_ms) {
            return;
        }
        let free = self.robots.values().filter(|robot| self.is_free(now_ms, robot));
        let (mut robots, mut candidates): (Vec<&TrackedRobot>, Vec<Candidate>) =
            free.filter_map(|robot| Some((robot, candidate(robot)?))).unzip();
        let waiting: Vec<&Task> =
            self.store.open().filter(|task| self.is_allocatable(now_ms, task)).collect();
        if robots.is_empty() || waiting.is_empty() {
            return;
        }
        travel_cost.begin_round();
        let free = robots.len();
        for (robot, candidate) in self.predicted_free(now_ms, travel_cost) {
            robots.push(robot);
            candidates.push(candidate);
        }
        // As admission measured it, also by who is busy now.
        let least_m = smallest_car(&self.robots, &Who::Any).core_m();
        // Who has not said what car it is may be as wide as any.
        let known = self.robots.values().filter_map(|robot| robot.car);
        let widest = known.max_by(|a, b| a.core_m().total_cmp(&b.core_m())).unwrap_or(ANY_CAR);
        let demands: Vec<Demand> = waiting.iter().map(|task| self.demand(now_ms, task)).collect();
        let assign = |tasks: &[usize], who: &[usize]| -> Vec<(usize, usize)> {
            let some_demands: Vec<Demand> = tasks.iter().map(|&task| demands[task]).collect();
            let some_candidates: Vec<Candidate> = who.iter().map(|&robot| candidates[robot]).collect();
            let penalty_m = |task: usize, robot: usize| {
                let (task, robot) = (waiting[tasks[task]], robots[who[robot]]);
                let car = robot.car.unwrap_or(widest);
                let fits = car.core_m() <= least_m || fits(travel_cost, task, &car);
                let may = robot.stays_for.is_none() || self.leads_home(task);
                (fits && may).then(|| penalty_m(task, robot)).flatten()
            };
            let pairs = assign::assign(&some_demands, &some_candidates, travel_cost, &penalty_m);
            pairs.into_iter().map(|(task, robot)| (tasks[task], who[robot])).collect()
        };
        let all: (Vec<usize>, Vec<usize>) = ((0..waiting.len()).collect(), (0..robots.len()).collect());
        let pairs = assign(&all.0, &all.1);
        let (mut chosen, reserved): (Vec<_>, Vec<_>) =
            pairs.into_iter().partition(|(_, robot)| *robot < free);
        let (late, reserved): (Vec<_>, Vec<_>) =
            reserved.into_iter().partition(|(task, _)| self.reservation_expired(now_ms, waiting[*task]));
        if !late.is_empty() {
            let late: Vec<usize> = late.into_iter().map(|(task, _)| task).collect();
            let taken: BTreeSet<usize> = chosen.iter().map(|(_, robot)| *robot).collect();
            let left: Vec<usize> = (0..free).filter(|robot| !taken.contains(robot)).collect();
            chosen.extend(assign(&late, &left));
        }
        let named = |(task, robot): (usize, usize)| (waiting[task].id, robots[robot].name.clone());
        let chosen: Vec<(TaskId, Name)> = chosen.into_iter().map(named).collect();
        self.reserved = reserved.into_iter().map(named).collect();
        for (task, robot) in chosen {
            let seq = self.store.next_seq() + self.writes.new_seqs();
            self.writes.push(now_ms, vec![Record::Assigned { task, robot, seq }], OnWritten::Nothing);
        }
    }

    /// Whether a task has waited too long to be reserved for anybody.
    fn reservation_expired(&self, now_ms: u64, task: &Task) -> bool {
        now_ms.saturating_sub(task.waiting_since_ms.max(task.not_before_ms)) >= self.settings.reserve_ms
    }

    /// Robots that will be free soon, those first that are soonest.
    fn predicted_free(&self, now_ms: u64, travel_cost: &dyn TravelCost) -> Vec<(&TrackedRobot, Candidate)> {
        let busy = self.store.busy().filter_map(|(name, id)| {
            let (robot, task) = (self.robots.get(name)?, self.store.task(id)?);
            let observed = robot.observed.as_ref()?;
            let is_well = robot.is_online(now_ms, &self.settings)
                && observed.unavailable.is_none()
                && robot.other_holder(&self.identity.me).is_none()
                && robot.blocked_since_ms.is_none();
            let Candidate { extra_m, .. } = candidate(robot)?;
            let later = predicted_free::predict(task, &robot.car(), observed.pose, travel_cost)
                .filter(|_| is_well)?;
            Some((robot, Candidate { extra_m: later.extra_m + extra_m, ..later }))
        });
        let mut busy: Vec<_> = busy.collect();
        busy.sort_by(|(_, a), (_, b)| a.extra_m.total_cmp(&b.extra_m));
        busy.truncate(MAX_PREDICTED);
        busy
    }

    pub(super) fn is_free(&self, now_ms: u64, robot: &TrackedRobot) -> bool {
        self.store.on(&robot.name).is_none()
            && !self.writes.has_robot(&robot.name)
            && robot.pending.is_none()
            && now_ms >= robot.next_request_ms
            && self.membership(robot).is_ok()
            && robot.availability(now_ms, &self.settings, &self.identity.me).is_ok()
    }

    /// Why it is no robot of the fleet, as far as that is known: states alone anything may send.
    pub(super) fn membership(&self, robot: &TrackedRobot) -> Result<(), String> {
        if self.has_presence && !robot.alive {
            return Err("not present".to_owned());
        }
        if self.has_roster && !robot.in_roster {
            return Err("not on the roster".to_owned());
        }
        Ok(())
    }

    /// Whether a task may be given to a robot now. After a start, one that was on a robot before waits
    /// for that robot to be heard: it may come back with the drive done.
    pub(super) fn is_allocatable(&self, now_ms: u64, task: &Task) -> bool {
        let heard = now_ms >= self.started_ms + self.settings.start_ms
            || task.last.as_ref().is_none_or(|last| {
                self.robots.get(&last.robot).is_some_and(|robot| robot.is_online(now_ms, &self.settings))
            });
        task.state == TaskState::Queued
            && now_ms >= task.not_before_ms
            && heard
            && !self.is_map_due(now_ms)
            && self.suspension_state().cause(task).is_none()
            && !self.writes.has_task(task.id)
    }

    fn demand(&self, now_ms: u64, task: &Task) -> Demand {
        let waited_ms = now_ms.saturating_sub(task.waiting_since_ms);
        let level = u64::from(task.spec.priority) + waited_ms / self.settings.priority_step_ms.max(1);
        Demand { id: task.id, level, first: task.point(task.legs_done).copied() }
    }

    /// Why a task waits, in words: what keeps the robots that may do it.
    #[must_use]
    pub fn why_queued(&self, now_ms: u64, id: TaskId) -> Option<String> {
        const NAMED: usize = 3;
        let task = self.store.task(id).filter(|task| task.state == TaskState::Queued)?;
        if let Some(cause) = self.suspension_state().cause(task) {
            return Some(format!("{}; {}", cause.text(), cause.remedy()));
        }
        if now_ms < task.not_before_ms {
            return Some(format!("next try in {} s", (task.not_before_ms - now_ms) / 1000 + 1));
        }
        if let Some(robot) = self.reserved.get(&id) {
            return Some(format!("reserved for {robot}, which finishes soon and will arrive first"));
        }
        let mut may = self.robots.values().filter(|robot| robot.is_eligible(&task.spec.who)).peekable();
        if may.peek().is_none() {
            return Some("no suitable robot present".to_owned());
        }
        let measured = self.robots.values().any(|robot| robot.car.is_some());
        let reasons = may.filter_map(|robot| {
            let busy = self.store.on(&robot.name).map(|other| format!("busy with {}", other.id));
            let unavailable = || robot.availability(now_ms, &self.settings, &self.identity.me).err();
            let no_member = || self.membership(robot).err();
            let incapable = robot.incapable.get(&id).cloned();
            let unmeasured = || unmeasured(robot).filter(|_| measured).map(str::to_owned);
            let at_home = || robot.stays_for.clone().filter(|_| !self.leads_home(task));
            let reason = busy
                .or(incapable)
                .or_else(unavailable)
                .or_else(at_home)
                .or_else(no_member)
                .or_else(unmeasured)?;
            Some(format!("{}: {reason}", robot.name))
        });
        let mut reasons: Vec<String> = reasons.collect();
        let more = reasons.len().saturating_sub(NAMED);
        reasons.truncate(NAMED);
        if more > 0 {
            reasons.push(format!("and {more} more"));
        }
        (!reasons.is_empty()).then(|| reasons.join("; "))
    }
}

fn candidate(robot: &TrackedRobot) -> Option<Candidate> {
    let observed = robot.observed.as_ref()?;
    let extra_m = if observed.battery_level == BatteryLevel::Warn { LOW_BATTERY_M } else { 0.0 };
    Some(Candidate { pose: observed.pose, car: robot.car(), extra_m })
}

/// Whether a car may stand at each of a task's points: one that is wider than others cannot do all of theirs.
fn fits(travel_cost: &dyn TravelCost, task: &Task, car: &Car) -> bool {
    task.points_left().iter().all(|point| travel_cost.admits(car, point).is_ok())
}

/// Why it gets no task for which another robot is too wide, if so.
fn unmeasured(robot: &TrackedRobot) -> Option<&'static str> {
    match (robot.car, &robot.capabilities) {
        (Some(_), _) => None,
        (None, None) => Some("factsheet not read yet"),
        (None, Some(_)) => Some("its factsheet does not say what vehicle it is"),
    }
}

/// How much more than the way it costs, in m; `None` = it may not be.
fn penalty_m(task: &Task, robot: &TrackedRobot) -> Option<f64> {
    let may = robot.is_eligible(&task.spec.who) && !robot.incapable.contains_key(&task.id);
    let failed_here = task.failures > 0 && task.last.as_ref().is_some_and(|last| last.robot == robot.name);
    may.then_some(if failed_here { FAILED_M } else { 0.0 })
}
