//! What suspends tasks and what ends that: emergency stops of all robots, maps, `activate` and `adopt`.
//!
//! What is seen holds at once, and is proposed to the ledger until it is written there; what ends a
//! suspension holds only when that is written.

use super::map_check::MapCheck;
use super::{Dispatcher, Ticket};
use crate::admission::ledger_failed;
use crate::suspension::{FleetStop, KnownMap, SuspensionState};
use crate::task::Task;
use crate::task_progress::Ctx;
use crate::task_store::record::Record;
use crate::tracked_robot::TrackedRobot;
use crate::write_queue::OnWritten;
use std::collections::BTreeMap;
use xtb_protocol::messages::{
    Adopted, DispatchOutcome, DispatchStatus, MapHash, Suspension, SuspensionCause, TaskId, TaskState,
    TaskView,
};
use xtb_protocol::{Name, Uuid};

impl Dispatcher {
    /// What is suspended now.
    pub(super) fn suspension_state(&self) -> SuspensionState<'_> {
        SuspensionState {
            stop: self.unwritten_stop.as_ref().or(self.store.stopped()),
            map: self.map.as_ref().or(self.store.map()),
        }
    }

    pub(super) fn ctx(&self, now_ms: u64, ledger: u64) -> Ctx<'_> {
        Ctx {
            now_ms,
            ledger,
            me: &self.identity.me,
            settings: &self.settings,
            suspension: self.suspension_state(),
            map_due: self.is_map_due(now_ms),
        }
    }

    /// Whether a map that the ledger knows may have become another one since: after a start, whoever looks for
    /// maps has a while to say so.
    pub(super) fn is_map_due(&self, now_ms: u64) -> bool {
        self.map.is_none() && self.store.map().is_some() && now_ms < self.started_ms + self.settings.start_ms
    }

    /// Somebody has called for an emergency stop of all robots: nothing is assigned from now on, until
    /// `activate`. Said again, it changes nothing.
    pub fn fleet_stop(&mut self, now_ms: u64, by: Option<&Name>) {
        let is_suspended = self.writes.suspends().unwrap_or(self.store.stopped().is_some());
        if !is_suspended && self.unwritten_stop.is_none() {
            self.unwritten_stop = Some(FleetStop { by: by.cloned(), at_ms: now_ms });
            self.reserved.clear();
        }
    }

    /// Which map the fleet has, by its name, and which version of it.
    pub fn map(&mut self, now_ms: u64, name: &str, hash: MapHash) {
        let before = self.map.as_ref().or(self.store.map());
        let same_name = before.filter(|map| map.name == name);
        let since_ms = same_name.map_or(now_ms, |map| map.since_ms);
        let map = Some(KnownMap { name: name.to_owned(), hash, since_ms });
        if self.map != map {
            (self.map, self.check) = (map, Some(MapCheck::Points));
        }
    }

    /// All robots stand latched: a stop of the fleet that was called while nothing was heard here.
    pub(super) fn check_fleet_stop(&mut self, now_ms: u64) {
        let started = now_ms >= self.started_ms + self.settings.start_ms;
        if started
            && self.suspension_state().stop.is_none()
            && let Some(by) = self.stopped_together(now_ms)
        {
            self.fleet_stop(now_ms, Some(&by));
        }
    }

    /// Whether each robot that is heard is latched by an emergency stop that nobody has answered with
    /// `activate`, two of them at least by the same client within a few seconds.
    fn stopped_together(&self, now_ms: u64) -> Option<Name> {
        let there = self.robots.values().filter(|robot| robot.is_online(now_ms, &self.settings));
        let mut stops: BTreeMap<&Name, Vec<u64>> = BTreeMap::new();
        for robot in there {
            let estop = robot.observed.as_ref()?.estop.as_ref()?;
            if estop.since_ms > self.store.activated_ms()
                && let Some(by) = &estop.by
            {
                stops.entry(by).or_default().push(estop.since_ms);
            }
        }
        let together = |times: &mut Vec<u64>| {
            times.sort_unstable();
            times.windows(2).any(|pair| pair[1] - pair[0] <= self.settings.fleet_stop_window_ms)
        };
        stops.into_iter().find_map(|(by, mut times)| together(&mut times).then(|| by.clone()))
    }

    /// What was seen and is not in the ledger goes there.
    pub(super) fn write_suspension(&mut self, now_ms: u64) {
        if let Some(stop) = self.unwritten_stop.clone().filter(|_| self.writes.suspends() != Some(true)) {
            let record = Record::Suspended { by: stop.by };
            self.writes.push(now_ms, vec![record], OnWritten::Nothing);
        }
        let Some(KnownMap { name, hash, .. }) = self.map.clone() else { return };
        let known = self.store.map().map(|map| (map.name.clone(), map.hash));
        if self.writes.map().cloned().or(known) != Some((name.clone(), hash)) {
            self.writes.push(now_ms, vec![Record::Map { name, hash }], OnWritten::Nothing);
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
        self.write_suspension(now_ms);
        let record = Record::Activated { by: by.clone() };
        self.writes.push(now_ms, vec![record], OnWritten::Answer { ticket, request, outcome });
    }

    /// Takes the tasks of other maps over to the fleet's.
    pub(super) fn adopt(&mut self, now_ms: u64, (ticket, request): (Ticket, Uuid), by: &Name) {
        let state = self.suspension_state();
        let map = state.map.map(|map| map.name.clone());
        let others = self.store.open().filter(|task| state.other_map(task).is_some());
        let tasks: Vec<TaskId> = others.map(|task| task.id).collect();
        let record = map.clone().filter(|_| !tasks.is_empty());
        let outcome = DispatchOutcome::Adopted(Adopted { map, tasks });
        let Some(map) = record else { return self.reply(ticket, request, outcome) };
        if let Some(why) = self.not_writable(now_ms) {
            return self.reply(ticket, request, DispatchOutcome::Error(ledger_failed(&why)));
        }
        self.write_suspension(now_ms);
        let record = Record::Adopted { map, by: by.clone() };
        self.writes.push(now_ms, vec![record], OnWritten::Answer { ticket, request, outcome });
    }

    fn not_writable(&self, now_ms: u64) -> Option<String> {
        self.writes.failed().filter(|_| !self.writes.may_try(now_ms)).map(str::to_owned)
    }

    /// What is suspended, and how many tasks wait for its end.
    #[must_use]
    pub fn suspensions(&self) -> Vec<Suspension> {
        let state = self.suspension_state();
        let mut of_maps: BTreeMap<Option<&str>, (SuspensionCause, u64)> = BTreeMap::new();
        for task in self.store.open() {
            if let Some(cause) = state.other_map(task) {
                of_maps.entry(task.map.name()).or_insert((cause, 0)).1 += 1;
            }
        }
        let by_stop = state.stop.map(|stop| Suspension {
            cause: SuspensionCause::FleetStop { by: stop.by.clone() },
            since_ms: stop.at_ms,
            tasks: self.store.open_count() as u64,
        });
        let since_ms = state.map.map_or(0, |map| map.since_ms);
        let of_maps = of_maps.into_values().map(|(cause, tasks)| Suspension { cause, since_ms, tasks });
        by_stop.into_iter().chain(of_maps).collect()
    }

    /// How it stands, without its tasks.
    #[must_use]
    pub fn status(&self, now_ms: u64) -> DispatchStatus {
        let there = |robot: &&TrackedRobot| robot.is_online(now_ms, &self.settings);
        DispatchStatus {
            ledger: self.store.ledger().unwrap_or_default(),
            ledger_failed: self.writes.failed().map(str::to_owned),
            map: self.suspension_state().map.map(|map| map.name.clone()),
            tasks: self.store.tasks().count() as u64,
            open: self.store.open_count() as u64,
            assigned: self.store.busy().count() as u64,
            robots: self.robots.values().filter(there).count() as u64,
        }
    }

    /// A task as lists show it; one that is suspended says why it waits.
    pub(crate) fn view(&self, task: &Task) -> TaskView {
        let mut view = task.view();
        if task.state == TaskState::Queued
            && let Some(cause) = self.suspension_state().cause(task)
        {
            view.reason = Some(cause.text());
        }
        if view.reason.is_none() && self.is_own(task) {
            view.reason = task.steps.iter().find_map(|step| step.reason.clone());
        }
        view
    }
}
