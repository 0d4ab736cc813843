//! Lists and answers that fit into a message: what does not is left out, and counted.

use super::Dispatcher;
use crate::task::Task;
use xtb_protocol::codec::json_bytes;
use xtb_protocol::messages::{PAGE_BYTES, TaskChange, TaskId, TaskList};

/// Tasks that have ended, in what is published: who wants to see more of them asks.
const PUBLISHED_ENDED: usize = 100;

/// What a part takes beside itself, in bytes of JSON: the comma.
const BETWEEN: usize = 1;

/// What is left of [`PAGE_BYTES`] of JSON.
struct ByteBudget(usize);

impl ByteBudget {
    fn takes(&mut self, part: &impl serde::Serialize) -> bool {
        let rest = self.0.checked_sub(json_bytes(part) + BETWEEN);
        self.0 = rest.unwrap_or(0);
        rest.is_some()
    }
}

impl Dispatcher {
    /// The tasks that are remembered: those with a robot first, then the others that have not ended, then
    /// those that ended last, until there is no more room.
    #[must_use]
    pub fn list(&self, now_ms: u64) -> TaskList {
        self.with_ended(usize::MAX, now_ms)
    }

    /// The same with no more than the 100 that ended last: what is published every second.
    #[must_use]
    pub fn published(&self, now_ms: u64) -> TaskList {
        self.with_ended(PUBLISHED_ENDED, now_ms)
    }

    fn with_ended(&self, most: usize, now_ms: u64) -> TaskList {
        let store = self.store();
        let with_robot = store.open().filter(|task| task.assigned.is_some());
        let without = store.open().filter(|task| task.assigned.is_none());
        let mut list = self.fill(now_ms, with_robot.chain(without).chain(store.ended().take(most)));
        list.tasks.sort_by_key(|task| task.id);
        list.left_out = (store.tasks().count() - list.tasks.len()) as u64;
        list
    }

    /// The tasks that follow `after`, oldest first, until there is no more room.
    #[must_use]
    pub fn page(&self, now_ms: u64, after: TaskId) -> TaskList {
        let mut page = self.fill(now_ms, self.store().tasks_after(after));
        page.left_out = (self.store().tasks_after(after).count() - page.tasks.len()) as u64;
        page
    }

    fn fill<'a>(&self, now_ms: u64, tasks: impl Iterator<Item = &'a Task>) -> TaskList {
        let mut budget = ByteBudget(PAGE_BYTES);
        TaskList {
            ledger: self.store().ledger().unwrap_or_default(),
            at_ms: now_ms,
            ledger_failed: self.ledger_failed().map(str::to_owned),
            tasks: tasks.map(|task| self.view(task)).take_while(|task| budget.takes(task)).collect(),
            left_out: 0,
            suspended: self.suspensions(),
        }
    }
}

/// Those changes for which there is room, and how many are left out: never one that is not as asked
/// before one that is.
pub(super) fn fitting(mut changes: Vec<TaskChange>) -> (Vec<TaskChange>, u64) {
    let mut budget = ByteBudget(PAGE_BYTES);
    if changes.iter().all(|change| budget.takes(change)) {
        return (changes, 0);
    }
    changes.sort_by_key(|change| change.error.is_none());
    let mut budget = ByteBudget(PAGE_BYTES);
    let fit = changes.iter().take_while(|change| budget.takes(change)).count();
    let left_out = changes.len() - fit;
    changes.truncate(fit);
    (changes, left_out as u64)
}
