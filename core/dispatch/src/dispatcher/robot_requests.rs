//! Requests to robots: one at a time each, asked again until answered; and what they answer.

use super::{Dispatcher, Effect};
use crate::task::Task;
use crate::task_progress;
use crate::tracked_robot::RequestPurpose;
use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::messages::{Assignment, Body, Outcome, RejectCode, Reply};
use xtb_robot::operator::CallStep;

/// The state of a robot that has just confirmed a withdrawal needs this long to show it, in ms.
const SHOWS_MS: u64 = 100;

impl Dispatcher {
    /// Keeps leases, asks again, and asks what is to be asked next. No robot waits for another one.
    pub(super) fn send_requests(&mut self, now_ms: u64) {
        let names: Vec<Name> = self.robots.keys().cloned().collect();
        for name in names {
            self.send_request_to(now_ms, &name);
        }
    }

    fn send_request_to(&mut self, now_ms: u64, name: &Name) {
        let Some(ledger) = self.store.ledger() else { return };
        let task = self.store.on(name);
        let settled = !self.writes.has_robot(name) && task.is_none_or(|task| !self.writes.has_task(task.id));
        let Some(robot) = self.robots.get(name) else { return };
        if !robot.is_online(now_ms, &self.settings) {
            return self.drop_request(now_ms, name);
        }
        let ctx = self.ctx(now_ms, ledger);
        let due = robot.pending.is_none() && now_ms >= robot.next_request_ms && settled;
        let purpose = if due { task_progress::next_purpose(ctx, task, robot) } else { None };
        let next = purpose.and_then(|purpose| Some((purpose, body(now_ms, purpose, task, ledger)?)));
        let drives = |task: &&Task| task.wants_to_drive() && ctx.suspension.cause(task).is_none();
        let wanted = task.filter(drives).and_then(|task| Some(task.assignment(ledger)?.assign_seq));
        let leaving = robot.pending_outcome.as_ref().map(|(seq, _)| *seq);
        let wanted = wanted.filter(|seq| leaving != Some(*seq));
        let (id, keep) = (self.new_id(), self.new_id());
        let Some(robot) = self.robots.get_mut(name) else { return };
        // Of a task that is to rest, or leaves the robot, or has left it; what may have arrived is withdrawn.
        robot.pending.take_if(
            |pending| matches!(pending.purpose, RequestPurpose::Assign(of) if Some(of.assign_seq) != wanted),
        );
        if let Some((purpose, body)) = next {
            robot.begin_request(now_ms, id, purpose, body, &self.settings);
        }
        let mut asks = Vec::new();
        if let Some(pending) = &mut robot.pending {
            match pending.call.step(Stamp::from_ms(now_ms)) {
                CallStep::Ask(request) => asks.push(request),
                CallStep::Wait(_) => {}
                CallStep::GiveUp { .. } => {
                    robot.give_up();
                    robot.next_request_ms = now_ms + self.settings.pause_ms;
                }
            }
        }
        if robot.other_holder(&self.identity.me).is_none() {
            asks.extend(robot.retain(now_ms, keep));
        }
        if !asks.is_empty() {
            robot.last_sent_ms = now_ms;
        }
        for request in asks {
            self.effects.push_back(Effect::Ask { robot: name.clone(), request });
        }
    }

    /// Nothing more is said to a robot that does not speak: its lease runs out, and a goal that halts with
    /// it. A pending request is given up.
    fn drop_request(&mut self, now_ms: u64, name: &Name) {
        let Some(robot) = self.robots.get_mut(name) else { return };
        if robot.give_up() {
            robot.next_request_ms = now_ms;
        }
    }

    /// A robot's answer.
    pub fn replied(&mut self, now_ms: u64, name: &Name, reply: &Reply) {
        let Some(robot) = self.robots.get_mut(name) else { return };
        robot.operator.replied(Stamp::from_ms(now_ms), reply);
        robot.unanswered = 0;
        let Some(pending) = robot.pending.take_if(|pending| pending.id == reply.id) else { return };
        match &reply.result {
            Outcome::Ok(_) => self.granted(now_ms, name, pending.purpose),
            Outcome::Error(error) => self.refused(now_ms, name, pending.purpose, error.code, &error.message),
        }
    }

    fn granted(&mut self, now_ms: u64, name: &Name, purpose: RequestPurpose) {
        let Some(robot) = self.robots.get_mut(name) else { return };
        match purpose {
            RequestPurpose::Acquire => {}
            RequestPurpose::Release => robot.operator = Default::default(),
            RequestPurpose::Assign(Assignment { assign_seq, leg, .. }) => {
                let state = robot.observed.as_ref().map_or(0, |observed| observed.seq);
                robot.acked = Some((assign_seq, leg, state));
            }
            RequestPurpose::Withdraw { seq } => {
                robot.withdrawn = Some(robot.withdrawn.map_or(seq, |before| before.max(seq)));
                robot.next_request_ms = now_ms + SHOWS_MS;
            }
        }
    }

    fn refused(
        &mut self,
        now_ms: u64,
        name: &Name,
        purpose: RequestPurpose,
        code: RejectCode,
        message: &str,
    ) {
        let pause_ms = self.settings.pause_ms;
        let Some(robot) = self.robots.get_mut(name) else { return };
        robot.next_request_ms = now_ms + pause_ms;
        match purpose {
            RequestPurpose::Release => robot.operator = Default::default(),
            RequestPurpose::Acquire | RequestPurpose::Withdraw { .. } => {}
            RequestPurpose::Assign(assignment) => self.not_begun(now_ms, name, assignment, code, message),
        }
    }

    fn not_begun(&mut self, now_ms: u64, name: &Name, of: Assignment, code: RejectCode, message: &str) {
        use RejectCode::{Malformed, NoMap, Unsupported, WrongVersion};
        let (Some(task), Some(robot)) = (self.store.on(name), self.robots.get_mut(name)) else { return };
        let present = task.assignment(of.ledger);
        if present.is_some_and(|present| present.assign_seq == of.assign_seq && present.leg < of.leg) {
            // It is asked again when the one before is reached: then the refusal counts.
            robot.next_leg_refused = Some((of.assign_seq, of.leg));
            return;
        }
        let current = task.wants_to_drive() && present == Some(of);
        if !current || self.writes.has_task(task.id) {
            return;
        }
        let id = task.id;
        let ctx = self.ctx(now_ms, of.ledger);
        let Some(robot) = self.robots.get(name) else { return };
        let Some(outcome) = task_progress::refused(ctx, task, robot, code, message) else { return };
        if matches!(code, Malformed | WrongVersion | Unsupported | NoMap)
            && let Some(robot) = self.robots.get_mut(name)
        {
            robot.incapable.insert(id, message.to_owned());
        }
        self.record(now_ms, id, outcome);
    }
}

/// The request for a purpose.
fn body(now_ms: u64, purpose: RequestPurpose, task: Option<&Task>, ledger: u64) -> Option<Body> {
    Some(match purpose {
        RequestPurpose::Acquire => Body::Acquire { take: false },
        RequestPurpose::Release => Body::Release {},
        RequestPurpose::Withdraw { seq } => Body::Withdraw { ledger, assign_seq: seq },
        RequestPurpose::Assign(assignment) => {
            let task = task?;
            Body::Assign {
                assignment,
                errand: task.action(assignment.leg, now_ms),
                on_link_loss: task.spec.on_link_loss,
                finish_s: task.finish_s(),
            }
        }
    })
}
