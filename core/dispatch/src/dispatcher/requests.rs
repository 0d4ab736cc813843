//! Questions of people and programs: submissions, and changes that wait for robots to confirm.

use super::handing::end;
use super::{Dispatcher, Ticket};
use crate::admit::{self, Bar, refusal};
use crate::ground::Ground;
use crate::record::{Change, Ending, Record};
use crate::task::Task;
use crate::writer::Then;
use xtb_protocol::messages::{
    DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchRequest, TaskChange, TaskId,
    TaskSpec, TaskState,
};
use xtb_protocol::{Name, Uuid};

/// What shall be done with tasks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verb {
    Cancel,
    Pause,
    Resume,
    Retry,
}

/// A question that waits for its tasks.
#[derive(Debug, Clone)]
pub(super) struct Waiting {
    ticket: Ticket,
    request: Uuid,
    by: Name,
    verb: Verb,
    until_ms: u64,
    tasks: Vec<(TaskId, Option<TaskChange>)>,
}

/// The ledger cannot be written.
pub(super) fn ledger_failed(why: &str) -> DispatchError {
    let message = format!("the ledger cannot be written: {why}");
    refusal(DispatchCode::LedgerFailed, message, "nothing was done; make room for it, then ask again")
}

/// What a verb comes to for a task as it is.
enum Progress {
    Done,
    Wrong(&'static str),
    Write(Change, String),
    Wait,
}

impl Dispatcher {
    /// A question. Its answer is an [`Effect::Reply`](super::Effect::Reply) with this ticket, at once or
    /// when it is in the ledger and robots have confirmed.
    pub fn request(
        &mut self,
        now_ms: u64,
        ticket: Ticket,
        client: &Name,
        request: &DispatchRequest,
        ground: &dyn Ground,
    ) {
        let (verb, tasks) = match &request.body {
            DispatchBody::Submit { tasks } => {
                return self.submit(now_ms, (ticket, request.id), client, tasks, ground);
            }
            DispatchBody::Show { task } => {
                let outcome = self.show(now_ms, *task);
                return self.reply(ticket, request.id, outcome);
            }
            DispatchBody::Activate {} => return self.activate(now_ms, (ticket, request.id), client),
            DispatchBody::Adopt {} => return self.adopt(now_ms, (ticket, request.id), client),
            DispatchBody::Status {} => {
                let status = self.status(now_ms);
                return self.reply(ticket, request.id, DispatchOutcome::Status(status));
            }
            DispatchBody::CancelAll {} => (Verb::Cancel, self.book.open().map(|task| task.id).collect()),
            DispatchBody::Cancel { tasks } => (Verb::Cancel, tasks.clone()),
            DispatchBody::Pause { tasks } => (Verb::Pause, tasks.clone()),
            DispatchBody::Resume { tasks } => (Verb::Resume, tasks.clone()),
            DispatchBody::Retry { tasks } => (Verb::Retry, tasks.clone()),
        };
        if self.waiting.len() >= self.settings.max_waiting {
            let message = format!("{} questions wait for an answer", self.waiting.len());
            let error = refusal(DispatchCode::Overloaded, message, "ask again, less often");
            return self.reply(ticket, request.id, DispatchOutcome::Error(error));
        }
        self.waiting.push_back(Waiting {
            ticket,
            request: request.id,
            by: client.clone(),
            verb,
            until_ms: now_ms + self.settings.confirm_ms,
            tasks: tasks.into_iter().map(|task| (task, None)).collect(),
        });
    }

    fn show(&self, now_ms: u64, id: TaskId) -> DispatchOutcome {
        let Some(mut history) = self.history(id) else { return DispatchOutcome::Error(unknown(id)) };
        if let Some(why) = self.why_queued(now_ms, id) {
            history.task.reason = Some(why);
        }
        DispatchOutcome::Shown(Box::new(history))
    }

    fn submit(
        &mut self,
        now_ms: u64,
        (ticket, key): (Ticket, Uuid),
        by: &Name,
        tasks: &[TaskSpec],
        ground: &dyn Ground,
    ) {
        if let Some(tasks) = self.book.submission(by, key) {
            return self.reply(ticket, key, DispatchOutcome::Submitted(tasks));
        }
        if let Err(error) = self.admit(now_ms, key, tasks, ground) {
            return self.reply(ticket, key, DispatchOutcome::Error(error));
        }
        // A map that was told of comes before the tasks that were taken for it.
        self.write_switches(now_ms);
        let first = self.book.next_task() + self.writer.new_tasks();
        let ids: Vec<TaskId> = (first..).take(tasks.len()).map(TaskId::new).collect();
        let records = tasks.iter().zip(&ids).map(|(spec, task)| {
            let spec = Box::new(spec.clone());
            Record::Submitted { task: *task, by: by.clone(), key, spec }
        });
        let records = records.collect();
        let outcome = DispatchOutcome::Submitted(ids);
        self.writer.push(now_ms, records, Then::Answer { ticket, request: key, outcome });
    }

    fn admit(
        &self,
        now_ms: u64,
        key: Uuid,
        tasks: &[TaskSpec],
        ground: &dyn Ground,
    ) -> Result<(), DispatchError> {
        if let Some(why) = self.writer.failed().filter(|_| !self.writer.may_try(now_ms)) {
            return Err(ledger_failed(why));
        }
        if self.writer.has_submission(key) {
            let message = "this submission is being written";
            return Err(refusal(DispatchCode::Overloaded, message, "ask again with the same id"));
        }
        if self.writer.len() >= self.settings.max_unwritten {
            let message = format!("{} changes wait for the ledger", self.writer.len());
            return Err(refusal(DispatchCode::Overloaded, message, "ask again, less often"));
        }
        let max_open = self.settings.max_open;
        let open = self.book.open_count() + usize::try_from(self.writer.new_tasks()).unwrap_or(usize::MAX);
        let room = max_open.saturating_sub(open);
        let (robots, has_roster) = (&self.robots, self.has_roster);
        admit::check(tasks, Bar { now_ms, room, max_open, robots, has_roster, ground })
    }

    /// Goes on with the questions that wait, and answers those that need not any more.
    pub(super) fn answer(&mut self, now_ms: u64) {
        for _ in 0..self.waiting.len() {
            let Some(mut waiting) = self.waiting.pop_front() else { return };
            self.go_on(now_ms, &mut waiting);
            if waiting.tasks.iter().all(|(_, change)| change.is_some()) {
                let changes = waiting.tasks.into_iter().filter_map(|(_, change)| change).collect();
                self.reply(waiting.ticket, waiting.request, DispatchOutcome::Changed(changes));
            } else {
                self.waiting.push_back(waiting);
            }
        }
    }

    /// Whether the robot of a held task has not confirmed yet that it will not drive for it.
    fn still_has(&self, task: &Task) -> bool {
        let assigned = task.assigned.as_ref().filter(|_| task.state == TaskState::Held);
        assigned.is_some_and(|assigned| {
            !self.robots.get(&assigned.robot).is_some_and(|robot| robot.has_let_go(assigned.seq))
        })
    }

    fn go_on(&mut self, now_ms: u64, waiting: &mut Waiting) {
        let Waiting { by, verb, until_ms, tasks, .. } = waiting;
        for (id, change) in tasks.iter_mut().filter(|(_, change)| change.is_none()) {
            let Some(task) = self.book.task(*id) else {
                *change = Some(TaskChange { id: *id, state: None, error: Some(unknown(*id)) });
                continue;
            };
            let state = Some(task.state);
            let done = |error| Some(TaskChange { id: *id, state, error });
            let wait = self.writer.has_task(*id) || (*verb == Verb::Resume && self.still_has(task));
            match if wait { Progress::Wait } else { progress(now_ms, *verb, task, by) } {
                Progress::Done => *change = done(None),
                Progress::Wrong(what) => {
                    let message = format!("{id} {what}");
                    let hint = format!("`fleet-cli task {id}` shows how it came to be so");
                    *change = done(Some(refusal(DispatchCode::WrongState, message, &hint)));
                }
                Progress::Write(what, why) if self.writer.may_try(now_ms) => {
                    let record = Record::Became { task: *id, change: what, why: Some(why) };
                    self.writer.push(now_ms, vec![record], Then::Nothing);
                }
                Progress::Write(..) => {
                    *change = done(Some(ledger_failed(self.writer.failed().unwrap_or_default())));
                }
                Progress::Wait if now_ms >= *until_ms => *change = done(Some(unconfirmed(task))),
                Progress::Wait => {}
            }
        }
    }
}

fn progress(now_ms: u64, verb: Verb, task: &Task, by: &Name) -> Progress {
    use TaskState::{Cancelled, Cancelling, Done, Failed, Held, Paused};
    let again = Change::Queued { not_before_ms: 0, failed: false };
    let free = task.assigned.is_none();
    match (verb, task.state) {
        (Verb::Cancel, Cancelled) => Progress::Done,
        (Verb::Cancel, Done | Failed) => Progress::Wrong("has ended already"),
        (Verb::Cancel, Cancelling) if task.ending == Some(Ending::Cancelled) => Progress::Wait,
        (Verb::Cancel, _) => Progress::Write(end(task, Ending::Cancelled), format!("cancelled by {by}")),
        (Verb::Pause, Paused) if free => Progress::Done,
        (Verb::Pause | Verb::Resume, Paused) if !free => Progress::Wait,
        (Verb::Pause, Cancelled | Cancelling | Done | Failed) => Progress::Wrong("has ended, or is about to"),
        (Verb::Pause, _) => Progress::Write(Change::Paused, format!("paused by {by}")),
        (Verb::Resume, Paused | Held) => Progress::Write(again, format!("resumed by {by}")),
        (Verb::Resume, Cancelled | Cancelling | Done | Failed) => {
            Progress::Wrong("has ended; retry begins it again")
        }
        (Verb::Retry, Cancelled | Failed) if task.spec.deadline_ms.is_some_and(|at_ms| at_ms <= now_ms) => {
            Progress::Wrong("has a deadline that is over; submit it anew")
        }
        (Verb::Retry, Cancelled | Failed) => Progress::Write(again, format!("retried by {by}")),
        (Verb::Retry, Done) => Progress::Wrong("is done; submit it anew"),
        (Verb::Resume | Verb::Retry, _) => Progress::Done,
    }
}

fn unknown(id: TaskId) -> DispatchError {
    let message = format!("there is no task {id}, or it ended long ago");
    refusal(DispatchCode::UnknownTask, message, "`fleet-cli tasks` lists them")
}

fn unconfirmed(task: &Task) -> DispatchError {
    let message = match &task.assigned {
        Some(assigned) => {
            format!("{} has not confirmed yet that it has let go of {}", assigned.robot, task.id)
        }
        None => format!("the change of {} is not in the ledger yet", task.id),
    };
    let hint = "it goes on trying; `fleet-cli stop` and `estop` stop a robot whatever it does";
    refusal(DispatchCode::Unconfirmed, message, hint)
}
