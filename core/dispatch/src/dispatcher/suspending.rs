//! What suspends tasks and what ends that: emergency stops of all robots, maps, `activate` and `adopt`.
//!
//! What is seen holds at once, and is proposed to the ledger until it is written there; what ends a
//! suspension holds only when that is written.

use super::handing::end;
use super::requests::ledger_failed;
use super::{Dispatcher, Ticket};
use crate::book::Book;
use crate::drive::Eye;
use crate::ground::Ground;
use crate::record::{Ending, Record};
use crate::robot::Robot;
use crate::suspend::{FleetStop, Gate, KnownMap};
use crate::task::Task;
use crate::writer::Then;
use std::collections::BTreeMap;
use xtb_protocol::messages::{
    Adopted, DispatchOutcome, DispatchStatus, MapHash, Suspension, SuspensionCause, TaskId, TaskState,
    TaskView,
};
use xtb_protocol::{Name, Uuid};

/// How far the tasks have been looked up on a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Check {
    /// Whether robots may stand at their points: not yet.
    Points,
    /// Whether a way leads there: of those up to this one, and not before robots had time to be heard.
    Ways { done: Option<TaskId>, from_ms: u64 },
}

/// What holds now.
pub(super) fn gate<'a>(
    unwritten_stop: Option<&'a FleetStop>,
    map: Option<&'a KnownMap>,
    book: &'a Book,
) -> Gate<'a> {
    Gate { stop: unwritten_stop.or(book.stopped()), map: map.or(book.map()) }
}

impl Dispatcher {
    /// What is suspended now.
    pub(super) fn gate(&self) -> Gate<'_> {
        gate(self.unwritten_stop.as_ref(), self.map.as_ref(), &self.book)
    }

    pub(super) fn eye(&self, now_ms: u64, ledger: u64) -> Eye<'_> {
        let (gate, map_due) = (self.gate(), self.is_map_due(now_ms));
        Eye { now_ms, ledger, me: &self.identity.me, settings: &self.settings, gate, map_due }
    }

    /// Whether a map that the ledger knows may have become another one since: after a start, whoever looks for
    /// maps has a while to say so.
    pub(super) fn is_map_due(&self, now_ms: u64) -> bool {
        self.map.is_none() && self.book.map().is_some() && now_ms < self.started_ms + self.settings.start_ms
    }

    /// Somebody has called for an emergency stop of all robots: nothing is assigned from now on, until
    /// `activate`. Said again, it changes nothing.
    pub fn fleet_stop(&mut self, now_ms: u64, by: Option<&Name>) {
        let is_suspended = self.writer.suspends().unwrap_or(self.book.stopped().is_some());
        if !is_suspended && self.unwritten_stop.is_none() {
            self.unwritten_stop = Some(FleetStop { by: by.cloned(), at_ms: now_ms });
            self.saved.clear();
        }
    }

    /// Which map the fleet has, by its name, and which version of it.
    pub fn map(&mut self, now_ms: u64, name: &str, hash: MapHash) {
        let before = self.map.as_ref().or(self.book.map());
        let same_name = before.filter(|map| map.name == name);
        let since_ms = same_name.map_or(now_ms, |map| map.since_ms);
        let map = Some(KnownMap { name: name.to_owned(), hash, since_ms });
        if self.map != map {
            (self.map, self.check) = (map, Some(Check::Points));
        }
    }

    /// All robots stand latched: a stop of the fleet that was called while nothing was heard here.
    pub(super) fn watch_stops(&mut self, now_ms: u64) {
        let started = now_ms >= self.started_ms + self.settings.start_ms;
        if started
            && self.gate().stop.is_none()
            && let Some(by) = self.stopped_together(now_ms)
        {
            self.fleet_stop(now_ms, Some(&by));
        }
    }

    /// Whether each robot that is heard is latched by an emergency stop that nobody has answered with
    /// `activate`, two of them at least by the same client within a few seconds.
    fn stopped_together(&self, now_ms: u64) -> Option<Name> {
        let there = self.robots.values().filter(|robot| robot.is_there(now_ms, &self.settings));
        let mut stops: BTreeMap<&Name, Vec<u64>> = BTreeMap::new();
        for robot in there {
            let estop = robot.seen.as_ref()?.estop.as_ref()?;
            if estop.since_ms > self.book.activated_ms()
                && let Some(by) = &estop.by
            {
                stops.entry(by).or_default().push(estop.since_ms);
            }
        }
        let together = |times: &mut Vec<u64>| {
            times.sort_unstable();
            times.windows(2).any(|pair| pair[1] - pair[0] <= self.settings.together_ms)
        };
        stops.into_iter().find_map(|(by, mut times)| together(&mut times).then(|| by.clone()))
    }

    /// What was seen and is not in the ledger goes there.
    pub(super) fn write_switches(&mut self, now_ms: u64) {
        if let Some(stop) = self.unwritten_stop.clone().filter(|_| self.writer.suspends() != Some(true)) {
            let record = Record::Suspended { by: stop.by };
            self.writer.push(now_ms, vec![record], Then::Nothing);
        }
        let Some(KnownMap { name, hash, .. }) = self.map.clone() else { return };
        let known = self.book.map().map(|map| (map.name.clone(), map.hash));
        if self.writer.map().cloned().or(known) != Some((name.clone(), hash)) {
            self.writer.push(now_ms, vec![Record::Map { name, hash }], Then::Nothing);
        }
    }

    /// Ends the suspension by an emergency stop of all robots.
    pub(super) fn activate(&mut self, now_ms: u64, (ticket, request): (Ticket, Uuid), by: &Name) {
        let stopped = |suspension: &Suspension| matches!(suspension.cause, SuspensionCause::FleetStop { .. });
        let ended = self.suspensions().into_iter().find(stopped);
        let outcome = DispatchOutcome::Activated(ended.clone());
        if ended.is_none() {
            return self.reply(ticket, request, outcome);
        }
        if let Some(why) = self.not_writable(now_ms) {
            return self.reply(ticket, request, DispatchOutcome::Error(ledger_failed(&why)));
        }
        self.write_switches(now_ms);
        let record = Record::Activated { by: by.clone() };
        self.writer.push(now_ms, vec![record], Then::Answer { ticket, request, outcome });
    }

    /// Takes the tasks of other maps over to the fleet's.
    pub(super) fn adopt(&mut self, now_ms: u64, (ticket, request): (Ticket, Uuid), by: &Name) {
        let gate = self.gate();
        let map = gate.map.map(|map| map.name.clone());
        let others = self.book.open().filter(|task| gate.other_map(task).is_some());
        let tasks: Vec<TaskId> = others.map(|task| task.id).collect();
        let record = map.clone().filter(|_| !tasks.is_empty());
        let outcome = DispatchOutcome::Adopted(Adopted { map, tasks });
        let Some(map) = record else { return self.reply(ticket, request, outcome) };
        if let Some(why) = self.not_writable(now_ms) {
            return self.reply(ticket, request, DispatchOutcome::Error(ledger_failed(&why)));
        }
        self.write_switches(now_ms);
        let record = Record::Adopted { map, by: by.clone() };
        self.writer.push(now_ms, vec![record], Then::Answer { ticket, request, outcome });
    }

    fn not_writable(&self, now_ms: u64) -> Option<String> {
        self.writer.failed().filter(|_| !self.writer.may_try(now_ms)).map(str::to_owned)
    }

    /// What is suspended, and how many tasks wait for its end.
    #[must_use]
    pub fn suspensions(&self) -> Vec<Suspension> {
        let gate = self.gate();
        let mut of_maps: BTreeMap<Option<&str>, (SuspensionCause, u64)> = BTreeMap::new();
        for task in self.book.open() {
            if let Some(cause) = gate.other_map(task) {
                of_maps.entry(task.map.name()).or_insert((cause, 0)).1 += 1;
            }
        }
        let by_stop = gate.stop.map(|stop| Suspension {
            cause: SuspensionCause::FleetStop { by: stop.by.clone() },
            since_ms: stop.at_ms,
            tasks: self.book.open_count() as u64,
        });
        let since_ms = gate.map.map_or(0, |map| map.since_ms);
        let of_maps = of_maps.into_values().map(|(cause, tasks)| Suspension { cause, since_ms, tasks });
        by_stop.into_iter().chain(of_maps).collect()
    }

    /// How it stands, without its tasks.
    #[must_use]
    pub fn status(&self, now_ms: u64) -> DispatchStatus {
        let there = |robot: &&Robot| robot.is_there(now_ms, &self.settings);
        DispatchStatus {
            ledger: self.book.ledger().unwrap_or_default(),
            ledger_failed: self.writer.failed().map(str::to_owned),
            map: self.gate().map.map(|map| map.name.clone()),
            tasks: self.book.tasks().count() as u64,
            open: self.book.open_count() as u64,
            assigned: self.book.busy().count() as u64,
            robots: self.robots.values().filter(there).count() as u64,
        }
    }

    /// A task as lists show it; one that is suspended says why it waits.
    pub(crate) fn view(&self, task: &Task) -> TaskView {
        let mut view = task.view();
        if task.state == TaskState::Queued
            && let Some(cause) = self.gate().cause(task)
        {
            view.reason = Some(cause.text());
        }
        view
    }

    /// Tasks that the map makes impossible fail: at once those with points at which no robot may stand, then
    /// those with points to which no way leads from any robot that may do them.
    pub(super) fn check_points(&mut self, now_ms: u64, ground: &dyn Ground) {
        match self.check {
            Some(Check::Points) => self.check_standing(now_ms, ground),
            Some(Check::Ways { done, from_ms }) if now_ms >= from_ms => self.check_ways(now_ms, done, ground),
            _ => {}
        }
    }

    /// Whether a task is one that the map decides about.
    fn is_of_this_map(&self, task: &Task) -> bool {
        task.state != TaskState::Cancelling && self.gate().other_map(task).is_none()
    }

    fn check_standing(&mut self, now_ms: u64, ground: &dyn Ground) {
        let (mut lost, mut again) = (Vec::new(), false);
        for task in self.book.open().filter(|task| self.is_of_this_map(task)) {
            if self.writer.has_task(task.id) {
                again = true;
                continue;
            }
            let refused = task.points_left().iter().find_map(|point| ground.admits(point).err());
            if let Some((_, what)) = refused {
                lost.push((task.id, what));
            }
        }
        self.fail_on_map(now_ms, lost);
        // One that waits for the ledger is looked at when that has answered.
        if !again {
            let from_ms = now_ms + self.settings.start_ms;
            self.check = Some(Check::Ways { done: None, from_ms });
        }
    }

    fn check_ways(&mut self, now_ms: u64, after: Option<TaskId>, ground: &dyn Ground) {
        ground.begin_round();
        let (mut lost, mut is_through, mut done) = (Vec::new(), true, after);
        for task in self.book.open().filter(|task| after.is_none_or(|after| task.id > after)) {
            if self.is_of_this_map(task) && !self.writer.has_task(task.id) {
                match self.cut_off(now_ms, task, ground) {
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
        self.check = if is_through { None } else { Some(Check::Ways { done, from_ms: now_ms }) };
    }

    /// The first of a task's points to which no way leads, in words. `None` = this round has measured enough.
    /// Where a robot that may do it is not heard, nobody can say: its planner will.
    fn cut_off(&self, now_ms: u64, task: &Task, ground: &dyn Ground) -> Option<Option<String>> {
        let may = || self.robots.values().filter(|robot| robot.is_one_of(&task.spec.who));
        let unknown = |robot: &Robot| !robot.is_there(now_ms, &self.settings);
        if may().any(unknown) || may().next().is_none() {
            return Some(None);
        }
        for point in task.points_left() {
            let mut reached = false;
            for robot in may() {
                let Some(seen) = &robot.seen else { continue };
                reached = ground.leads(&seen.pose, point)?;
                if reached {
                    break;
                }
            }
            if !reached {
                let what = format!(
                    "no way leads to ({:.2}, {:.2}) from any robot that may do it",
                    point.x_m, point.y_m
                );
                return Some(Some(what));
            }
        }
        Some(None)
    }

    fn fail_on_map(&mut self, now_ms: u64, lost: Vec<(TaskId, String)>) {
        let map = self.gate().map.map(|map| map.name.clone()).unwrap_or_default();
        for (id, what) in lost {
            let Some(task) = self.book.task(id) else { continue };
            let (change, why) = (end(task, Ending::Failed), format!("{what}, as map {map} is now"));
            self.writer.push(
                now_ms,
                vec![Record::Became { task: id, change, why: Some(why) }],
                Then::Nothing,
            );
        }
    }
}
