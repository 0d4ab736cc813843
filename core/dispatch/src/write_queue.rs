//! What waits for the ledger: one write at a time, and what follows from it only when it is durable.
//!
//! A write that fails takes with it all that waits behind it: nothing of it has happened, nobody was
//! told, and what still is so will be seen and asked for again.

use crate::task_store::TaskStore;
use crate::task_store::record::{LedgerEntry, Record};
use std::collections::{BTreeSet, VecDeque};
use xtb_protocol::Name;
use xtb_protocol::messages::{DispatchOutcome, MapHash, TaskId};

/// Entries of one write at most, but for a submission that alone has more.
const MAX_ENTRIES: usize = 1024;

/// Entries that have to become durable together or not at all.
#[derive(Debug, Clone, PartialEq)]
pub struct Write {
    /// Says which in [`written`](crate::Dispatcher::written).
    pub id: u64,
    /// In their order, numbered on from the last ones.
    pub entries: Vec<LedgerEntry>,
}

/// Who waits for a change.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum OnWritten {
    /// Nobody.
    Nothing,
    /// Whoever asked for it.
    Answer {
        /// The question.
        ticket: u64,
        /// Its id.
        request: uuid::Uuid,
        /// What to say when it is written.
        outcome: DispatchOutcome,
    },
}

/// Records that belong together.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WriteJob {
    pub(crate) at_ms: u64,
    pub(crate) records: Vec<Record>,
    pub(crate) on_written: OnWritten,
}

/// The queue before the ledger.
#[derive(Debug, Clone, Default)]
pub(crate) struct WriteQueue {
    waiting: VecDeque<WriteJob>,
    /// The write that is out, and its jobs.
    in_flight: Option<(Write, Vec<WriteJob>)>,
    next_id: u64,
    /// Tasks that an unwritten change is about: nothing else is decided about them.
    tasks: BTreeSet<TaskId>,
    /// Robots that an unwritten assignment is about.
    robots: BTreeSet<Name>,
    new_tasks: u64,
    new_seqs: u64,
    /// Whether the last unwritten switch of the dispatcher suspends it.
    suspends: Option<bool>,
    /// The last unwritten map.
    map: Option<(String, MapHash)>,
    /// The last unwritten stand-by, or that there is none any more.
    pair: Option<Option<u64>>,
    /// Why the last write failed, and when the next may be tried.
    failed: Option<(String, u64)>,
    /// Why nothing may be written at all.
    held: Option<String>,
}

impl WriteQueue {
    /// A change that shall be written.
    pub(crate) fn push(&mut self, at_ms: u64, records: Vec<Record>, on_written: OnWritten) {
        for record in &records {
            match record {
                Record::Submitted { .. } => self.new_tasks += 1,
                Record::Assigned { task, robot, .. } => {
                    self.new_seqs += 1;
                    self.tasks.insert(*task);
                    self.robots.insert(robot.clone());
                }
                Record::Reached { task, .. }
                | Record::Extended { task, .. }
                | Record::Became { task, .. } => {
                    self.tasks.insert(*task);
                }
                Record::Suspended { .. } => self.suspends = Some(true),
                Record::Activated { .. } => self.suspends = Some(false),
                Record::Map { name, hash } => self.map = Some((name.clone(), *hash)),
                Record::Pair { copy } => self.pair = Some(*copy),
                Record::Opened { .. }
                | Record::Adopted { .. }
                | Record::Term { .. }
                | Record::Snapshot(_) => {}
            }
        }
        self.waiting.push_back(WriteJob { at_ms, records, on_written });
    }

    /// Whether something about this task is not written yet.
    pub(crate) fn has_task(&self, task: TaskId) -> bool {
        self.tasks.contains(&task)
    }

    /// Whether an assignment of this robot is not written yet.
    pub(crate) fn has_robot(&self, robot: &Name) -> bool {
        self.robots.contains(robot)
    }

    /// Whether a submission with this id is not written yet.
    pub(crate) fn has_submission(&self, key: uuid::Uuid) -> bool {
        let in_flight = self.in_flight.iter().flat_map(|(_, jobs)| jobs);
        let mut ends = self.waiting.iter().chain(in_flight).map(|job| &job.on_written);
        let submitted = |outcome: &DispatchOutcome| matches!(outcome, DispatchOutcome::Submitted(_));
        ends.any(|end| matches!(end, OnWritten::Answer { request, outcome, .. } if *request == key && submitted(outcome)))
    }

    /// Whether a submission by this client is not written yet.
    pub(crate) fn has_submission_by(&self, client: &Name) -> bool {
        let in_flight = self.in_flight.iter().flat_map(|(_, jobs)| jobs);
        let mut records = self.waiting.iter().chain(in_flight).flat_map(|job| &job.records);
        records.any(|record| matches!(record, Record::Submitted { by, .. } if by == client))
    }

    /// Whether the dispatcher will be suspended when everything is written; `None` = as it is.
    pub(crate) fn suspends(&self) -> Option<bool> {
        self.suspends
    }

    /// The map that will be the fleet's when everything is written; `None` = the one that is.
    pub(crate) fn map(&self) -> Option<&(String, MapHash)> {
        self.map.as_ref()
    }

    /// The stand-by when everything is written; `None` = as it is.
    pub(crate) fn pair(&self) -> Option<Option<u64>> {
        self.pair
    }

    /// Nothing is written any more, for this reason; `None` = again.
    pub(crate) fn hold(&mut self, why: Option<String>) {
        self.held = why;
    }

    /// Whether nothing may be written.
    pub(crate) fn is_held(&self) -> bool {
        self.held.is_some()
    }

    /// Tasks that were not written yet.
    pub(crate) fn new_tasks(&self) -> u64 {
        self.new_tasks
    }

    /// Assignments that were not written yet.
    pub(crate) fn new_seqs(&self) -> u64 {
        self.new_seqs
    }

    /// Changes that wait.
    pub(crate) fn len(&self) -> usize {
        self.waiting.len() + self.in_flight.as_ref().map_or(0, |(_, jobs)| jobs.len())
    }

    /// Why the ledger cannot be written, if it could not the last time.
    pub(crate) fn failed(&self) -> Option<&str> {
        self.held.as_deref().or_else(|| self.failed.as_ref().map(|(why, _)| why.as_str()))
    }

    /// Whether to try to write at all now.
    pub(crate) fn may_try(&self, now_ms: u64) -> bool {
        self.held.is_none() && self.failed.as_ref().is_none_or(|(_, again_ms)| now_ms >= *again_ms)
    }

    /// The next write, if none is out.
    pub(crate) fn next(&mut self, store: &TaskStore) -> Option<Write> {
        if self.in_flight.is_some() || self.waiting.is_empty() {
            return None;
        }
        let (mut entries, mut jobs) = (Vec::new(), Vec::new());
        while let Some(job) = self.waiting.front()
            && (jobs.is_empty() || entries.len() + job.records.len() <= MAX_ENTRIES)
            && let Some(job) = self.waiting.pop_front()
        {
            for record in &job.records {
                let n = store.next_n() + entries.len() as u64;
                let v = record.version();
                entries.push(LedgerEntry { v, n, at_ms: job.at_ms, record: record.clone() });
            }
            jobs.push(job);
        }
        self.next_id += 1;
        let write = Write { id: self.next_id, entries };
        self.in_flight = Some((write.clone(), jobs));
        Some(write)
    }

    /// The write is durable.
    pub(crate) fn written(&mut self, id: u64) -> Option<(Vec<LedgerEntry>, Vec<WriteJob>)> {
        if self.in_flight.as_ref().is_none_or(|(write, _)| write.id != id) {
            return None;
        }
        let (write, jobs) = self.in_flight.take()?;
        self.failed = None;
        self.count();
        Some((write.entries, jobs))
    }

    /// The write has failed: it and all behind it never were.
    pub(crate) fn lost(&mut self, id: u64, why: String, again_ms: u64) -> Option<Vec<WriteJob>> {
        if self.in_flight.as_ref().is_none_or(|(write, _)| write.id != id) {
            return None;
        }
        let (_, mut jobs) = self.in_flight.take()?;
        jobs.extend(self.waiting.drain(..));
        self.failed = Some((why, again_ms));
        self.count();
        Some(jobs)
    }

    /// What is still unwritten, counted anew.
    fn count(&mut self) {
        let waiting = std::mem::take(&mut self.waiting);
        (self.new_tasks, self.new_seqs) = (0, 0);
        (self.suspends, self.map, self.pair) = (None, None, None);
        self.tasks.clear();
        self.robots.clear();
        for job in waiting {
            self.push(job.at_ms, job.records, job.on_written);
        }
    }
}
