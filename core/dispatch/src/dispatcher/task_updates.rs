//! What becomes of tasks: what their robots show, and what the clock says.

use super::Dispatcher;
use crate::settings::DispatcherSettings;
use crate::task::Task;
use crate::task_progress;
use crate::task_store::record::{LedgerEntry, Record};
use crate::transition::{TaskEnding, TaskOutcome, TaskUpdate};
use crate::write_queue::OnWritten;
use xtb_protocol::messages::{Assignment, GoalStatus, TaskId, TaskKind, TaskState};

impl Dispatcher {
    /// What became of a task is proposed to the ledger.
    pub(super) fn record(&mut self, now_ms: u64, id: TaskId, outcome: TaskOutcome) {
        let Some(task) = self.store.task(id) else { return };
        let Some(assigned) = task.assigned.as_ref().or(task.last.as_ref()) else { return };
        let (seq, name) = (assigned.seq, assigned.robot.clone());
        let Some(ledger) = self.store.ledger() else { return };
        let ctx = self.ctx(now_ms, ledger);
        let outcome = match ctx.suspension.cause(task) {
            Some(cause) if outcome == TaskOutcome::Renew => TaskOutcome::suspended(&cause),
            _ => outcome,
        };
        let robot = self.robots.get(&name);
        if robot.is_some_and(|robot| task_progress::has_to_confirm(ctx, task, robot, &outcome)) {
            if let Some(robot) = self.robots.get_mut(&name) {
                robot.pending_outcome = Some((seq, outcome));
            }
            return;
        }
        let records = match outcome {
            TaskOutcome::Changed(change, why) => vec![Record::Became { task: id, change, why }],
            TaskOutcome::Renew => {
                let seq = self.store.next_seq() + self.writes.new_seqs();
                vec![Record::Assigned { task: id, robot: name, seq }]
            }
            TaskOutcome::Reached => {
                let leg = task.legs_done;
                let mut records = vec![Record::Reached { task: id, seq, leg }];
                if task.is_all(leg + 1, now_ms) {
                    let change = TaskUpdate::Ended { ending: TaskEnding::Done };
                    records.push(Record::Became { task: id, change, why: None });
                }
                records
            }
        };
        // An answer may come before the next step: an assignment stands behind the map that it is for.
        self.write_suspension(now_ms);
        self.writes.push(now_ms, records, OnWritten::Nothing);
    }

    /// Deadlines, and patrols whose time is over.
    pub(super) fn check_deadlines(&mut self, now_ms: u64) {
        let mut over = Vec::new();
        for task in self.store.open().filter(|task| !self.writes.has_task(task.id)) {
            if task.state == TaskState::Cancelling {
                continue;
            }
            let late = task.spec.deadline_ms.is_some_and(|deadline_ms| now_ms >= deadline_ms);
            let lasted = matches!(task.spec.kind, TaskKind::Patrol { for_s: Some(_), .. })
                && task.began_ms.is_some()
                && task.is_all(task.legs_done, now_ms);
            let (ending, why) = match (late, lasted) {
                (_, true) => (TaskEnding::Done, None),
                (true, _) => (TaskEnding::Failed, Some("deadline passed".to_owned())),
                _ => continue,
            };
            over.push((task.id, task.end(ending), why));
        }
        for (task, change, why) in over {
            self.writes.push(now_ms, vec![Record::Became { task, change, why }], OnWritten::Nothing);
        }
    }

    /// What robots show of their tasks, and of those that they had before.
    pub(super) fn check_robots(&mut self, now_ms: u64) {
        let Some(ledger) = self.store.ledger() else { return };
        let ctx = self.ctx(now_ms, ledger);
        let mut outcomes = Vec::new();
        for (name, id) in self.store.busy() {
            let (Some(task), Some(robot)) = (self.store.task(id), self.robots.get(name)) else { continue };
            if !self.writes.has_task(id)
                && let Some(outcome) = task_progress::outcome(ctx, task, robot)
            {
                outcomes.push((id, outcome));
            }
        }
        // Also of one that was paused as it arrived: whoever resumes it would have it driven again.
        let left = |task: &&Task| task.assigned.is_none() && task.last.is_some();
        let waits = |task: &&Task| matches!(task.state, TaskState::Queued | TaskState::Paused);
        let left = self.store.open().filter(|task| left(task) && waits(task));
        for task in left.filter(|task| !self.writes.has_task(task.id)) {
            if self.was_reached(now_ms, ledger, task) {
                outcomes.push((task.id, TaskOutcome::Reached));
            }
        }
        for (id, outcome) in outcomes {
            self.record(now_ms, id, outcome);
        }
    }

    /// A robot that had the task is back, and shows that it had done the drive.
    fn was_reached(&self, now_ms: u64, ledger: u64, task: &Task) -> bool {
        let Some(last) = &task.last else { return false };
        let Some(robot) = self.robots.get(&last.robot) else { return false };
        let leg = task.legs_done;
        let goal = Assignment { ledger, task: task.id, assign_seq: last.seq, leg }.goal_id();
        let status = robot.observed.as_ref().and_then(|observed| observed.goal(goal)).map(|goal| goal.status);
        robot.is_online(now_ms, &self.settings) && status == Some(GoalStatus::Reached)
    }

    /// What a durable entry means for what is known of the robots.
    pub(super) fn update_robots(&mut self, entry: &LedgerEntry, task: TaskId) {
        let Some(task) = self.store.task(task) else { return };
        let last = task.last.as_ref().map(|last| last.robot.clone());
        match &entry.record {
            Record::Became { change: TaskUpdate::Queued { not_before_ms, failed }, why, .. } => {
                let why = why.clone().unwrap_or_default();
                let DispatcherSettings { refused_ms, unanswered_ms, most_unanswered, .. } = self.settings;
                if let Some(robot) = last.and_then(|last| self.robots.get_mut(&last)) {
                    let is_silent = robot.unanswered >= most_unanswered;
                    let for_ms = if is_silent { unanswered_ms } else { refused_ms };
                    if is_silent {
                        // The next task is another try.
                        robot.unanswered = 0;
                    }
                    robot.idle_since_ms = entry.at_ms;
                    if !failed && *not_before_ms > 0 {
                        robot.avoid(entry.at_ms, for_ms, why);
                    }
                }
            }
            Record::Became { change: TaskUpdate::Ended { .. }, .. } => {
                let id = task.id;
                self.robots.values_mut().for_each(|robot| {
                    robot.incapable.remove(&id);
                });
                if let Some(robot) = last.and_then(|last| self.robots.get_mut(&last)) {
                    robot.idle_since_ms = entry.at_ms;
                }
            }
            _ => {}
        }
    }
}
