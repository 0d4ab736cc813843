//! The tasks as the ledger's entries add up to them. The store changes only by entries, in their order.
//!
//! An entry may be a snapshot of the whole store: store and [`record`]s are one idea in two files.

pub mod record;

use crate::replication;
use crate::suspension::{FleetStop, KnownMap};
use crate::task::{Task, TaskMap};
use crate::transition::TaskUpdate;
use record::{LedgerEntry, Record};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, VecDeque};
use std::ops::Bound;
use thiserror::Error;
use uuid::Uuid;
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_TERM, MapHash, TaskId, TaskState};

/// Why entries are no ledger of ours.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ReplayError {
    /// An entry is missing or stands twice.
    #[error("entry {got} found where {expected} was expected: the ledger is damaged")]
    Gap {
        /// The next number.
        expected: u64,
        /// As read.
        got: u64,
    },
    /// The first entry neither opens a ledger nor is a snapshot.
    #[error("the ledger does not start with an opening entry or a snapshot")]
    NoBeginning,
    /// An entry about a task that no entry before it knows, or that cannot follow.
    #[error("entry {n} contradicts earlier entries: {what}")]
    Impossible {
        /// Which.
        n: u64,
        /// What is wrong with it.
        what: String,
    },
}

/// What is in the ledger.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TaskStore {
    ledger: Option<u64>,
    next_n: u64,
    next_task: u64,
    next_seq: u64,
    keep_ended: usize,
    /// The emergency stop of all robots after which nobody has activated the dispatcher.
    #[serde(default)]
    stopped: Option<FleetStop>,
    /// When somebody did so last, in ms since 1970.
    #[serde(default)]
    activated_ms: u64,
    /// The map that the fleet had last.
    #[serde(default)]
    map: Option<KnownMap>,
    /// The copy without which nothing is acknowledged.
    #[serde(default)]
    pair: Option<u64>,
    tasks: BTreeMap<TaskId, Task>,
    /// In the order of their ends.
    ended: VecDeque<TaskId>,
    /// Which task is on a robot. Derived.
    on: BTreeMap<Name, TaskId>,
    /// Tasks of each submission. Derived.
    keys: BTreeMap<Uuid, Vec<TaskId>>,
}

impl TaskStore {
    /// An empty one that remembers so many ended tasks.
    #[must_use]
    pub fn new(keep_ended: usize) -> Self {
        Self { next_n: 1, next_task: 1, next_seq: 1, keep_ended, ..Self::default() }
    }

    /// The entries of a ledger, from its first or from a snapshot on.
    ///
    /// # Errors
    /// The first entry that does not fit: the ledger is not to be written to then.
    pub fn replay(
        keep_ended: usize,
        entries: impl IntoIterator<Item = LedgerEntry>,
    ) -> Result<Self, ReplayError> {
        let mut store = Self::new(keep_ended);
        for entry in entries {
            store.apply(&entry)?;
        }
        store.keep_ended = keep_ended;
        Ok(store)
    }

    /// Number of the ledger; `None` = it has not been opened yet.
    #[must_use]
    pub fn ledger(&self) -> Option<u64> {
        self.ledger
    }

    /// Number of the next entry.
    #[must_use]
    pub fn next_n(&self) -> u64 {
        self.next_n
    }

    /// Number of the next task.
    #[must_use]
    pub fn next_task(&self) -> u64 {
        self.next_task
    }

    /// Number of the next assignment.
    #[must_use]
    pub fn next_seq(&self) -> u64 {
        self.next_seq
    }

    /// The term of the next assignment: how often a stand-by has taken over.
    #[must_use]
    pub fn term(&self) -> u32 {
        replication::term_of(self.next_seq)
    }

    /// The stand-by's copy without which nothing is acknowledged; `None` = the dispatcher is alone.
    #[must_use]
    pub fn pair(&self) -> Option<u64> {
        self.pair
    }

    /// The emergency stop of all robots after which nobody has activated the dispatcher.
    #[must_use]
    pub fn stopped(&self) -> Option<&FleetStop> {
        self.stopped.as_ref()
    }

    /// When somebody activated it last, in ms since 1970; 0 = never.
    #[must_use]
    pub fn activated_ms(&self) -> u64 {
        self.activated_ms
    }

    /// The map that the fleet had last.
    #[must_use]
    pub fn map(&self) -> Option<&KnownMap> {
        self.map.as_ref()
    }

    /// A task.
    #[must_use]
    pub fn task(&self, id: TaskId) -> Option<&Task> {
        self.tasks.get(&id)
    }

    /// All tasks that are remembered, oldest first.
    pub fn tasks(&self) -> impl Iterator<Item = &Task> {
        self.tasks.values()
    }

    /// Those that follow another one, oldest first.
    pub fn tasks_after(&self, after: TaskId) -> impl Iterator<Item = &Task> {
        self.tasks.range((Bound::Excluded(after), Bound::Unbounded)).map(|(_, task)| task)
    }

    /// Those that have ended and are remembered, the last one first.
    pub fn ended(&self) -> impl Iterator<Item = &Task> {
        self.ended.iter().rev().filter_map(|id| self.tasks.get(id))
    }

    /// Those that have not ended, oldest first.
    pub fn open(&self) -> impl Iterator<Item = &Task> {
        self.tasks.values().filter(|task| !task.state.is_final())
    }

    /// How many have not ended.
    #[must_use]
    pub fn open_count(&self) -> usize {
        self.tasks.len() - self.ended.len()
    }

    /// The task that is on a robot.
    #[must_use]
    pub fn on(&self, robot: &Name) -> Option<&Task> {
        self.on.get(robot).and_then(|id| self.tasks.get(id))
    }

    /// Robots with a task.
    pub fn busy(&self) -> impl Iterator<Item = (&Name, TaskId)> {
        self.on.iter().map(|(robot, id)| (robot, *id))
    }

    /// The tasks of a submission that was taken before.
    #[must_use]
    pub fn submission(&self, by: &Name, key: Uuid) -> Option<Vec<TaskId>> {
        let ids = self.keys.get(&key)?;
        ids.iter().all(|id| self.tasks.get(id).is_some_and(|task| task.by == *by)).then(|| ids.clone())
    }

    /// An entry has been written: the store changes.
    ///
    /// # Errors
    /// See [`ReplayError`]; nothing changes then.
    pub fn apply(&mut self, entry: &LedgerEntry) -> Result<(), ReplayError> {
        if let Record::Snapshot(store) = &entry.record {
            *self = Self { next_n: entry.n.saturating_add(1), ..(**store).clone() };
            return Ok(());
        }
        if entry.n != self.next_n {
            return Err(ReplayError::Gap { expected: self.next_n, got: entry.n });
        }
        if self.ledger.is_none() && !matches!(entry.record, Record::Opened { .. }) {
            return Err(ReplayError::NoBeginning);
        }
        self.take(entry).map_err(|what| ReplayError::Impossible { n: entry.n, what })?;
        self.next_n += 1;
        Ok(())
    }

    fn take(&mut self, entry: &LedgerEntry) -> Result<(), String> {
        let at_ms = entry.at_ms;
        match &entry.record {
            Record::Opened { ledger } => {
                if self.ledger.is_some() {
                    return Err("the ledger is already open".to_owned());
                }
                self.ledger = Some(*ledger);
            }
            Record::Submitted { task, by, key, spec } => {
                if task.number() != self.next_task {
                    return Err(format!("{task} is not the next task, t{}", self.next_task));
                }
                self.next_task += 1;
                self.keys.entry(*key).or_default().push(*task);
                let map = self.map_of(entry.v);
                self.tasks.insert(*task, Task::new(*task, by.clone(), *key, (**spec).clone(), map, at_ms));
            }
            Record::Assigned { task: id, robot, seq } => {
                if *seq < self.next_seq {
                    return Err(format!("assignment {seq} is not new"));
                }
                if let Some(other) = self.on.get(robot).filter(|other| *other != id) {
                    return Err(format!("{robot} already has {other}"));
                }
                let task = Self::open_task(&mut self.tasks, *id)?;
                if task.assigned.as_ref().is_some_and(|before| before.robot != *robot) {
                    return Err(format!("{id} is already on another robot"));
                }
                task.assign(at_ms, robot.clone(), *seq);
                self.next_seq = seq.saturating_add(1);
                self.on.insert(robot.clone(), *id);
            }
            Record::Reached { task: id, leg, .. } => {
                let task = Self::open_task(&mut self.tasks, *id)?;
                if *leg != task.legs_done {
                    return Err(format!("{id} has completed {} drives, not {leg}", task.legs_done));
                }
                task.reach(at_ms, *leg);
            }
            Record::Extended { task: id, after, points, by } => {
                let task = Self::open_task(&mut self.tasks, *id)?;
                if !task.extend(at_ms, *after, points, by) {
                    return Err(format!("{id} cannot have more points after {after}"));
                }
            }
            Record::Became { task: id, change, why } => self.change(at_ms, *id, change, why.as_deref())?,
            Record::Suspended { by } => self.stopped = Some(FleetStop { by: by.clone(), at_ms }),
            Record::Activated { .. } => (self.stopped, self.activated_ms) = (None, at_ms),
            Record::Map { name, hash } => self.take_map(at_ms, name, *hash),
            Record::Adopted { map, by } => {
                let open = self.tasks.values_mut().filter(|task| !task.state.is_final());
                open.for_each(|task| task.adopt(at_ms, map, by));
            }
            Record::Term { term } => {
                if *term <= self.term() || *term > MAX_TERM {
                    return Err(format!("term {term} does not follow term {}", self.term()));
                }
                (self.next_seq, self.pair) = (replication::first_seq(*term), None);
            }
            Record::Pair { copy } => self.pair = *copy,
            Record::Snapshot(_) => {}
        }
        Ok(())
    }

    /// The map of a task that is submitted now, by an entry of this version.
    fn map_of(&self, version: u32) -> TaskMap {
        match &self.map {
            _ if version < 2 => TaskMap::Unknown,
            Some(map) => TaskMap::Named(map.name.clone()),
            None => TaskMap::NoMap,
        }
    }

    fn take_map(&mut self, at_ms: u64, name: &str, hash: MapHash) {
        let is_first = self.map.is_none();
        let same = self.map.take().filter(|map| map.name == name);
        let since_ms = same.map_or(at_ms, |map| map.since_ms);
        self.map = Some(KnownMap { name: name.to_owned(), hash, since_ms });
        for task in self.tasks.values_mut().filter(|task| is_first && task.map == TaskMap::NoMap) {
            task.map = TaskMap::Named(name.to_owned());
        }
    }

    fn change(
        &mut self,
        at_ms: u64,
        id: TaskId,
        change: &TaskUpdate,
        why: Option<&str>,
    ) -> Result<(), String> {
        let task = self.tasks.get_mut(&id).ok_or_else(|| format!("no task {id}"))?;
        let was_final = task.state.is_final();
        let retried =
            was_final && task.state != TaskState::Done && matches!(change, TaskUpdate::Queued { .. });
        if was_final && !retried {
            return Err(format!("{id} has already ended"));
        }
        let robot = task.assigned.as_ref().map(|assigned| assigned.robot.clone());
        task.apply(at_ms, change, why);
        let is_final = task.state.is_final();
        if let Some(robot) = robot.filter(|_| task.assigned.is_none()) {
            self.on.remove(&robot);
        }
        if retried {
            self.ended.retain(|ended| *ended != id);
        }
        if is_final {
            task.steps.shrink_to_fit(); // thousands are remembered
            self.ended.push_back(id);
            self.forget();
        }
        Ok(())
    }

    /// The oldest ended tasks are forgotten.
    fn forget(&mut self) {
        while self.ended.len() > self.keep_ended
            && let Some(id) = self.ended.pop_front()
        {
            let Some(task) = self.tasks.remove(&id) else { continue };
            if let Some(ids) = self.keys.get_mut(&task.key) {
                ids.retain(|other| *other != id);
                if ids.is_empty() {
                    self.keys.remove(&task.key);
                }
            }
        }
    }

    fn open_task(tasks: &mut BTreeMap<TaskId, Task>, id: TaskId) -> Result<&mut Task, String> {
        let task = tasks.get_mut(&id).ok_or_else(|| format!("no task {id}"))?;
        if task.state.is_final() { Err(format!("{id} has already ended")) } else { Ok(task) }
    }
}
