//! Questions of people and programs: submissions, and changes that wait for robots to confirm.

use super::{Dispatcher, Ticket};
use crate::admission::{self, AdmissionCtx, ledger_failed, refusal};
use crate::task::Task;
use crate::task_store::record::Record;
use crate::tracked_robot::smallest_car;
use crate::transition::{TaskEnding, TaskUpdate};
use crate::travel_cost::TravelCost;
use crate::write_queue::OnWritten;
use xtb_protocol::messages::{
    DispatchBody, DispatchCode, DispatchError, DispatchOutcome, DispatchRequest, MAX_POINTS, TaskChange,
    TaskId, TaskKind, TaskSpec, TaskState, Waypoint,
};
use xtb_protocol::{Name, Uuid};

/// Begins the reason of a task that somebody has cancelled; the name follows.
pub(super) const CANCELLED_BY: &str = "cancelled by ";

/// What shall be done with tasks.
#[derive(Debug, Clone, PartialEq)]
enum TaskCommand {
    Cancel,
    Pause,
    Resume,
    Retry,
    Extend { after: u32, points: Vec<Waypoint> },
}

/// A question that waits for its tasks.
#[derive(Debug, Clone)]
pub(super) struct OpenRequest {
    ticket: Ticket,
    request: Uuid,
    by: Name,
    command: TaskCommand,
    until_ms: u64,
    tasks: Vec<(TaskId, Option<TaskChange>)>,
}

/// What a command comes to for a task as it is.
enum Progress {
    Done,
    Wrong(DispatchCode, String),
    Write(Record),
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
        travel_cost: &dyn TravelCost,
    ) {
        let (command, tasks) = match &request.body {
            DispatchBody::Submit { tasks } => {
                return self.submit(now_ms, (ticket, request.id), client, tasks, travel_cost);
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
            DispatchBody::CancelAll {} => {
                (TaskCommand::Cancel, self.store.open().map(|task| task.id).collect())
            }
            DispatchBody::Cancel { tasks } => (TaskCommand::Cancel, tasks.clone()),
            DispatchBody::Pause { tasks } => (TaskCommand::Pause, tasks.clone()),
            DispatchBody::Resume { tasks } => (TaskCommand::Resume, tasks.clone()),
            DispatchBody::Retry { tasks } => (TaskCommand::Retry, tasks.clone()),
            DispatchBody::Extend { task, after, points } => {
                if let Err(error) = self.admit_points(*task, *after, points, travel_cost) {
                    return self.reply(ticket, request.id, DispatchOutcome::Error(error));
                }
                (TaskCommand::Extend { after: *after, points: points.clone() }, vec![*task])
            }
        };
        if self.open_requests.len() >= self.settings.max_waiting {
            let message = format!("{} requests are already waiting", self.open_requests.len());
            let error =
                refusal(DispatchCode::Overloaded, message, "try again, with fewer requests per second");
            return self.reply(ticket, request.id, DispatchOutcome::Error(error));
        }
        self.open_requests.push_back(OpenRequest {
            ticket,
            request: request.id,
            by: client.clone(),
            command,
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
        travel_cost: &dyn TravelCost,
    ) {
        if let Some(tasks) = self.store.submission(by, key) {
            return self.reply(ticket, key, DispatchOutcome::Submitted(tasks));
        }
        if let Err(error) = self.admit(now_ms, key, tasks, travel_cost) {
            return self.reply(ticket, key, DispatchOutcome::Error(error));
        }
        // A map that was told of comes before the tasks that were taken for it.
        self.write_suspension(now_ms);
        let first = self.store.next_task() + self.writes.new_tasks();
        let ids: Vec<TaskId> = (first..).take(tasks.len()).map(TaskId::new).collect();
        let records = tasks.iter().zip(&ids).map(|(spec, task)| {
            let spec = Box::new(spec.clone());
            Record::Submitted { task: *task, by: by.clone(), key, spec }
        });
        let records = records.collect();
        let outcome = DispatchOutcome::Submitted(ids);
        self.writes.push(now_ms, records, OnWritten::Answer { ticket, request: key, outcome });
    }

    fn admit(
        &self,
        now_ms: u64,
        key: Uuid,
        tasks: &[TaskSpec],
        travel_cost: &dyn TravelCost,
    ) -> Result<(), DispatchError> {
        if let Some(why) = self.writes.failed().filter(|_| !self.writes.may_try(now_ms)) {
            return Err(ledger_failed(why));
        }
        if self.writes.has_submission(key) {
            let message = "this submission is being saved";
            return Err(refusal(DispatchCode::Overloaded, message, "try again with the same id"));
        }
        if self.writes.len() >= self.settings.max_unwritten {
            let message = format!("{} changes are waiting for the ledger", self.writes.len());
            return Err(refusal(
                DispatchCode::Overloaded,
                message,
                "try again, with fewer requests per second",
            ));
        }
        let max_open = self.settings.max_open;
        let open = self.store.open_count() + usize::try_from(self.writes.new_tasks()).unwrap_or(usize::MAX);
        let room = max_open.saturating_sub(open);
        let (robots, has_roster) = (&self.robots, self.has_roster);
        admission::check(tasks, AdmissionCtx { now_ms, room, max_open, robots, has_roster, travel_cost })
    }

    /// Whether there is room for a robot at points that a task is to have; what it has already is not asked again.
    fn admit_points(
        &self,
        id: TaskId,
        after: u32,
        points: &[Waypoint],
        travel_cost: &dyn TravelCost,
    ) -> Result<(), DispatchError> {
        let Some(task) = self.store.task(id).filter(|task| !has_points(task, after, points)) else {
            return Ok(());
        };
        let car = smallest_car(&self.robots, &task.spec.who);
        points.iter().try_for_each(|point| admission::admits_point(travel_cost, &car, point))
    }

    /// Goes on with the questions that wait, and answers those that need not any more.
    pub(super) fn answer(&mut self, now_ms: u64) {
        for _ in 0..self.open_requests.len() {
            let Some(mut open) = self.open_requests.pop_front() else { return };
            self.go_on(now_ms, &mut open);
            if open.tasks.iter().all(|(_, change)| change.is_some()) {
                let changes = open.tasks.into_iter().filter_map(|(_, change)| change).collect();
                self.reply(open.ticket, open.request, DispatchOutcome::Changed(changes));
            } else {
                self.open_requests.push_back(open);
            }
        }
    }

    /// Whether the robot of a held task has not confirmed yet that it will not drive for it.
    fn still_has(&self, task: &Task) -> bool {
        let assigned = task.assigned.as_ref().filter(|_| task.state == TaskState::Held);
        assigned.is_some_and(|assigned| {
            !self.robots.get(&assigned.robot).is_some_and(|robot| robot.has_released(assigned.seq))
        })
    }

    fn go_on(&mut self, now_ms: u64, open: &mut OpenRequest) {
        let OpenRequest { by, command, until_ms, tasks, .. } = open;
        for (id, change) in tasks.iter_mut().filter(|(_, change)| change.is_none()) {
            let Some(task) = self.store.task(*id) else {
                *change = Some(TaskChange { id: *id, state: None, error: Some(unknown(*id)) });
                continue;
            };
            let state = Some(task.state);
            let done = |error| Some(TaskChange { id: *id, state, error });
            let wait = self.writes.has_task(*id) || (*command == TaskCommand::Resume && self.still_has(task));
            match if wait { Progress::Wait } else { progress(now_ms, command, task, by) } {
                Progress::Done => *change = done(None),
                Progress::Wrong(code, what) => {
                    let message = format!("{id} {what}");
                    let hint = format!("`fleet-cli task {id}` shows its history");
                    *change = done(Some(refusal(code, message, &hint)));
                }
                Progress::Write(record) if self.writes.may_try(now_ms) => {
                    self.writes.push(now_ms, vec![record], OnWritten::Nothing);
                }
                Progress::Write(..) => {
                    *change = done(Some(ledger_failed(self.writes.failed().unwrap_or_default())));
                }
                Progress::Wait if now_ms >= *until_ms => *change = done(Some(unconfirmed(task))),
                Progress::Wait => {}
            }
        }
    }
}

fn progress(now_ms: u64, command: &TaskCommand, task: &Task, by: &Name) -> Progress {
    use TaskState::{Cancelled, Cancelling, Done, Failed, Held, Paused};
    let again = TaskUpdate::Queued { not_before_ms: 0, failed: false };
    let free = task.assigned.is_none();
    let write = |change, why| Progress::Write(Record::Became { task: task.id, change, why: Some(why) });
    let wrong = |what: &str| Progress::Wrong(DispatchCode::WrongState, what.to_owned());
    match (command, task.state) {
        (TaskCommand::Cancel, Cancelled) => Progress::Done,
        (TaskCommand::Cancel, Done | Failed) => wrong("has already ended"),
        (TaskCommand::Cancel, Cancelling) if task.ending == Some(TaskEnding::Cancelled) => Progress::Wait,
        (TaskCommand::Cancel, _) => write(task.end(TaskEnding::Cancelled), format!("{CANCELLED_BY}{by}")),
        (TaskCommand::Pause, Paused) if free => Progress::Done,
        (TaskCommand::Pause | TaskCommand::Resume, Paused) if !free => Progress::Wait,
        (TaskCommand::Pause, Cancelled | Cancelling | Done | Failed) => wrong("has ended or is ending"),
        (TaskCommand::Pause, _) => write(TaskUpdate::Paused, format!("paused by {by}")),
        (TaskCommand::Resume, Paused | Held) => write(again, format!("resumed by {by}")),
        (TaskCommand::Resume, Cancelled | Cancelling | Done | Failed) => {
            wrong("has ended; start it again with retry")
        }
        (TaskCommand::Retry, Cancelled | Failed)
            if task.spec.deadline_ms.is_some_and(|at_ms| at_ms <= now_ms) =>
        {
            wrong("has passed its deadline; submit it as a new task")
        }
        (TaskCommand::Retry, Cancelled | Failed) => write(again, format!("retried by {by}")),
        (TaskCommand::Retry, Done) => wrong("is done; submit it as a new task"),
        (TaskCommand::Resume | TaskCommand::Retry, _) => Progress::Done,
        (TaskCommand::Extend { after, points }, _) => extension(task, *after, points, by),
    }
}

/// A point that was driven to once is not added again: only what the client believes there is may be extended.
fn extension(task: &Task, after: u32, more: &[Waypoint], by: &Name) -> Progress {
    let wrong = |what: &str| Progress::Wrong(DispatchCode::WrongState, what.to_owned());
    let TaskKind::Route { points, loops: 1, .. } = &task.spec.kind else {
        return wrong("is no route that is driven once");
    };
    let stale = |what: String| Progress::Wrong(DispatchCode::Stale, what);
    if has_points(task, after, more) {
        Progress::Done
    } else if task.state.is_final() || task.state == TaskState::Cancelling {
        wrong("has ended or is ending")
    } else if points.len() != after as usize {
        stale(format!("has {} points, not {after}", points.len()))
    } else if points.len() + more.len() > MAX_POINTS {
        stale(format!("would have more than {MAX_POINTS} points"))
    } else {
        Progress::Write(Record::Extended { task: task.id, after, points: more.to_vec(), by: by.clone() })
    }
}

/// Whether a task already has these points in that place.
fn has_points(task: &Task, after: u32, more: &[Waypoint]) -> bool {
    task.spec.kind.points().get(after as usize..).is_some_and(|points| points.starts_with(more))
}

fn unknown(id: TaskId) -> DispatchError {
    let message = format!("task {id} does not exist, or ended too long ago");
    refusal(DispatchCode::UnknownTask, message, "`fleet-cli tasks` lists the tasks")
}

fn unconfirmed(task: &Task) -> DispatchError {
    let message = match &task.assigned {
        Some(assigned) => {
            format!("{} has not confirmed yet that it has ended {}", assigned.robot, task.id)
        }
        None => format!("the change of {} is not saved in the ledger yet", task.id),
    };
    let hint = "the dispatcher keeps trying; `fleet-cli stop` and `estop` stop the robot in any case";
    refusal(DispatchCode::Unconfirmed, message, hint)
}
