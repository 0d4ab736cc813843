//! The whole list of tasks, however many: page after page, put together.

use super::{ANSWERS_WITHIN, DispatcherClient, not_ours};
use crate::client::get;
use crate::error::{Error, ErrorKind, Result};
use std::time::Duration;
use xtb_protocol::messages::{TaskId, TaskList};

/// Bytes of all pages together at most: a dispatcher remembers some 22,000 tasks, of 100 points at most.
const MAX_BYTES: usize = 256 << 20;

impl DispatcherClient<'_> {
    /// All tasks that the dispatcher remembers, each as it was when its page was made.
    ///
    /// # Errors
    /// [`ErrorKind::NoDispatcher`], [`ErrorKind::OutcomeUnknown`] if it does not answer, or [`ErrorKind::Failed`] if its pages
    /// do not fit together.
    pub async fn list(&self) -> Result<TaskList> {
        let key = self.client.keys().dispatch_tasks();
        let (first, _) = self.page(&key).await?;
        if first.left_out == 0 {
            return Ok(first);
        }
        let (mut whole, mut bytes) = self.page(&after(&key, TaskId::new(0))).await?;
        while whole.left_out > 0 {
            let last = whole.tasks.last().map(|task| task.id);
            let last = last.ok_or_else(|| not_ours("an empty page announces further tasks"))?;
            let (next, more) = self.page(&after(&key, last)).await?;
            bytes += more;
            if next.ledger != whole.ledger {
                let message = "the dispatcher started a new ledger while its tasks were read";
                return Err(Error::new(ErrorKind::Failed, message).hint("try again"));
            }
            if bytes > MAX_BYTES {
                return Err(not_ours(&format!("more than {} MiB of tasks", MAX_BYTES >> 20)));
            }
            join(&mut whole, next)?;
        }
        Ok(whole)
    }

    /// One page, and how long it is in bytes.
    async fn page(&self, selector: &str) -> Result<(TaskList, usize)> {
        let answers = get(self.client.bus(), selector, self.within(ANSWERS_WITHIN)).await?;
        match answers.first() {
            Some(answer) => {
                let page = answer.decode().map_err(|error| not_ours(&error.to_string()))?;
                Ok((page, answer.payload.len()))
            }
            None => {
                let error = self.silent(Duration::ZERO, "no request was sent", self.is_there().await);
                Err(self.client.explained(error).await)
            }
        }
    }
}

fn after(key: &str, task: TaskId) -> String {
    format!("{key}?after={task}")
}

/// Puts the next page behind what was read so far.
fn join(whole: &mut TaskList, next: TaskList) -> Result<()> {
    let last = whole.tasks.last().map(|task| task.id);
    let follows = next.tasks.first().is_none_or(|first| Some(first.id) > last);
    if !follows || !next.tasks.is_sorted_by(|one, other| one.id < other.id) {
        return Err(not_ours("the pages of tasks are not in order"));
    }
    if next.tasks.is_empty() && next.left_out > 0 {
        return Err(not_ours("an empty page announces further tasks"));
    }
    whole.tasks.extend(next.tasks);
    (whole.left_out, whole.ledger_failed) = (next.left_out, next.ledger_failed);
    Ok(())
}
