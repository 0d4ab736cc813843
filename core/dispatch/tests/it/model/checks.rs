//! What must hold in the model, at every step and at the end.

use super::weather::Off;
use super::{LEDGER, START_MS, World};
use std::collections::{BTreeMap, BTreeSet};
use xtb_dispatch::task_store::record::Record;
use xtb_dispatch::transition::TaskUpdate;
use xtb_dispatch::{Dispatcher, LedgerEntry};
use xtb_protocol::messages::{Assignment, Body, Request, SuspensionCause, TaskId, TaskState};
use xtb_protocol::{Name, Uuid};

impl World {
    /// What the ledger has, and under which request.
    pub(super) fn submitted(&self) -> BTreeMap<TaskId, Uuid> {
        let of = |entry: &LedgerEntry| match &entry.record {
            Record::Submitted { task, key, .. } => Some((*task, *key)),
            _ => None,
        };
        self.ledger.iter().filter_map(of).collect()
    }

    /// Which task an assignment of the ledger is of.
    fn tasks_of_seq(&self) -> BTreeMap<u64, TaskId> {
        let of = |entry: &LedgerEntry| match &entry.record {
            Record::Assigned { task, seq, .. } => Some((*seq, *task)),
            _ => None,
        };
        self.ledger.iter().filter_map(of).collect()
    }

    pub(super) fn check(&self) -> Result<(), String> {
        let running = self.robots.iter().filter_map(|robot| Some((robot, robot.running()?)));
        let ours = running.filter_map(|(robot, goal)| Some((robot, Assignment::of_goal(LEDGER, goal.id)?)));
        let ours: Vec<_> = ours.collect();
        if ours.is_empty() {
            return Ok(());
        }
        let tasks = self.tasks_of_seq();
        let mut drivers: BTreeMap<TaskId, &Name> = BTreeMap::new();
        for (robot, (seq, _)) in ours {
            let name = &robot.name;
            let Some(task) = tasks.get(&seq) else {
                return Err(format!("{name} drives for assignment {seq}, which is not in the ledger"));
            };
            if let Some(other) = drivers.insert(*task, name) {
                return Err(format!("{other} and {name} drive for {task} at {}", self.now_ms - START_MS));
            }
            if self.confirmed.contains(task) {
                return Err(format!("{name} drives for {task}, whose cancellation was confirmed"));
            }
        }
        Ok(())
    }

    /// Nothing is begun while the dispatcher is suspended.
    pub(super) fn check_ask(&self, request: &Request) -> Result<(), String> {
        let suspended = self.dispatcher.iter().flat_map(Dispatcher::suspensions);
        let stopped = suspended.map(|it| it.cause).find(|it| matches!(it, SuspensionCause::FleetStop { .. }));
        match (&request.body, stopped) {
            (Body::Assign { assignment, .. }, Some(cause)) => {
                Err(format!("{} is asked for although {}", assignment.task, cause.text()))
            }
            _ => Ok(()),
        }
    }

    /// No assignment in the ledger is of a task that was suspended there: what the ledger says, read anew.
    fn check_suspensions(&self) -> Result<(), String> {
        let (mut stopped, mut map) = (false, None::<&str>);
        let mut of: BTreeMap<TaskId, Option<&str>> = BTreeMap::new();
        let mut ended: BTreeSet<TaskId> = BTreeSet::new();
        for entry in &self.ledger {
            match &entry.record {
                Record::Suspended { .. } => stopped = true,
                Record::Activated { .. } => stopped = false,
                Record::Map { name, .. } => {
                    let none = of.values_mut().filter(|task| task.is_none());
                    none.for_each(|task| *task = Some(name));
                    map = Some(name);
                }
                // What has ended stays of its map, also when it is retried.
                Record::Adopted { map, .. } => {
                    let open = of.iter_mut().filter(|(task, _)| !ended.contains(task));
                    open.for_each(|(_, of)| *of = Some(map));
                }
                Record::Became { task, change: TaskUpdate::Ended { .. }, .. } => drop(ended.insert(*task)),
                Record::Became { task, change: TaskUpdate::Queued { .. }, .. } => drop(ended.remove(task)),
                Record::Submitted { task, .. } => drop(of.insert(*task, map)),
                Record::Assigned { task, .. } => {
                    let own = of.get(task).copied().flatten();
                    if stopped || own != map {
                        let (n, what) =
                            (entry.n, if stopped { "after a stop of the fleet" } else { "elsewhere" });
                        return Err(format!(
                            "entry {n} assigns {task} of {own:?} {what}, the map is {map:?}"
                        ));
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    pub(super) fn check_end(&self) -> Result<(), String> {
        self.check_suspensions()?;
        let submitted = self.submitted();
        for submission in &self.submissions {
            let task = submission.task.ok_or("a submission without an answer")?;
            if self.weather.off != Off::SameId && submitted.get(&task) != Some(&submission.key) {
                return Err(format!("{task} is another submission's"));
            }
        }
        if submitted.len() != self.submissions.len() {
            return Err(format!("{} tasks of {} submissions", submitted.len(), self.submissions.len()));
        }
        let dispatcher = self.dispatcher.as_ref().ok_or("no dispatcher")?;
        let tasks = self.tasks_of_seq();
        for task in dispatcher.store().tasks() {
            if task.state == TaskState::Failed && task.reason.is_none() {
                return Err(format!("{} failed without a reason", task.id));
            }
            for leg in 0..task.legs_done {
                self.check_leg(&tasks, task.id, leg)?;
            }
            if task.state == TaskState::Done && task.legs().is_some_and(|legs| task.legs_done != legs) {
                return Err(format!("{} is called done after {} drives", task.id, task.legs_done));
            }
        }
        Ok(())
    }

    /// How many points the ledger knows of a route.
    pub(super) fn points_in_ledger(&self, id: TaskId) -> usize {
        let points = self.ledger.iter().map(|entry| match &entry.record {
            Record::Submitted { task, spec, .. } if *task == id => spec.kind.points().len(),
            Record::Extended { task, points, .. } if *task == id => points.len(),
            _ => 0,
        });
        points.sum()
    }

    /// A drive that counts as done was driven: once, but for those that nobody could know of.
    fn check_leg(&self, tasks: &BTreeMap<u64, TaskId>, task: TaskId, leg: u32) -> Result<(), String> {
        let finishes = self
            .robots
            .iter()
            .enumerate()
            .flat_map(|(i, robot)| robot.finished.iter().map(move |finished| (i, *finished)));
        let mut of_leg: Vec<(u64, usize)> = finishes
            .filter(|(_, finished)| {
                let of = Assignment::of_goal(LEDGER, finished.goal);
                of.is_some_and(|(seq, at)| tasks.get(&seq) == Some(&task) && at == leg)
            })
            .map(|(i, finished)| (finished.at_ms, i))
            .collect();
        of_leg.sort_unstable();
        if of_leg.is_empty() {
            return Err(format!("{task} leg {leg} counts as done and was never driven"));
        }
        for pair in of_leg.windows(2) {
            let ((first_ms, robot), (second_ms, _)) = (pair[0], pair[1]);
            let excused = self.outages[robot]
                .iter()
                .any(|(from_ms, until_ms)| *from_ms < second_ms && *until_ms + 3000 > first_ms);
            if !excused {
                return Err(format!("{task} leg {leg} was driven twice: {of_leg:?}"));
            }
        }
        Ok(())
    }
}
