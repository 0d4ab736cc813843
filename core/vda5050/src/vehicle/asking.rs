//! What is asked of the dispatcher: it follows from the record and the task, each time anew.

use super::{Answer, Ask, Vehicle};
use crate::action::{ActionState, Wish};
use crate::incoming::Order;
use crate::order::new_points;
use crate::problem::{Problem, ProblemKind};
use crate::record::{Part, submission_id};
use xtb_protocol::messages::{
    DispatchCode, LinkLoss, MAX_POINTS, OnTakeover, TaskKind, TaskSpec, TaskState, Waypoint, Who,
};

/// What was not answered, or refused for the moment, is asked again after this, in ms.
const AGAIN_MS: u64 = 1000;
/// A task whose state is not known is asked for this often, in ms.
const UNKNOWN_MS: u64 = 1000;
/// One that is known as well: a change may have got lost.
const SHOW_EVERY_MS: u64 = 5000;

impl Vehicle {
    /// What is over by now.
    pub(super) fn settle(&mut self) {
        let stands = self.stands();
        let (live, task) = (self.has_live_part(), self.seen.as_ref().map(|seen| seen.state));
        let knows_task = self.record.part.is_none() || task.is_some();
        // An order without points for a task is accepted at once, and so is an update of the horizon alone.
        if self.record.pending.as_ref().is_some_and(|order| new_points(order).is_empty()) {
            self.accept();
        }
        let cancels = self.record.actions.iter().any(|action| action.wish == Some(Wish::Cancel));
        if cancels {
            let is_new =
                self.record.pending.as_ref().is_some_and(|order| order.order_id != self.record.order.id);
            if self.asked.is_none() && !(is_new && self.may_be_taken) {
                self.record.pending = None;
            }
        }
        let ended = self.asked.is_none() && !live && knows_task && stands && self.record.pending.is_none();
        if cancels && ended {
            self.record.order.clear();
            self.record.part = None;
            self.seen = None;
        }
        let (paused, has_part) = (task == Some(TaskState::Paused), self.record.part.is_some());
        for action in &mut self.record.actions {
            let over = match &action.wish {
                Some(Wish::Cancel) => ended,
                Some(Wish::Pause) => stands && knows_task && (!live || !has_part || paused),
                Some(Wish::Unpause) => knows_task && (!live || !paused),
                Some(Wish::State | Wish::Factsheet | Wish::Clear) => true,
                Some(Wish::Pose { .. }) | None => false,
            };
            if over {
                action.end(Ok(()));
            }
        }
    }

    pub(super) fn wishes(&self, wish: &Wish) -> bool {
        self.record.actions.iter().any(|action| action.wish.as_ref() == Some(wish))
    }

    /// The next question; `None` = none.
    pub(super) fn next_ask(&self, now_ms: u64) -> Option<Ask> {
        if self.asked.is_some() || now_ms < self.next_ask_ms {
            return None;
        }
        let live = self.record.part.as_ref().filter(|_| self.has_live_part());
        let state = self.seen.as_ref().map(|seen| seen.state);
        if let Some(part) = live {
            match state {
                None => return Some(Ask::Show(part.task)),
                Some(state) if self.wishes(&Wish::Cancel) && state != TaskState::Cancelled => {
                    return Some(Ask::Cancel(part.task));
                }
                Some(state)
                    if self.record.paused && state != TaskState::Paused && state != TaskState::Cancelling =>
                {
                    return Some(Ask::Pause(part.task));
                }
                Some(TaskState::Paused) if self.wishes(&Wish::Unpause) => {
                    return Some(Ask::Resume(part.task));
                }
                Some(_) => {}
            }
        }
        if let Some(ask) = self.record.pending.as_ref().and_then(|order| self.ask_for(order)) {
            return Some(ask);
        }
        if let Some(part) = live.filter(|_| now_ms >= self.shown_ms + SHOW_EVERY_MS) {
            return Some(Ask::Show(part.task));
        }
        let pose = self.record.actions.iter().find_map(|action| match action.wish {
            Some(Wish::Pose { x_m, y_m, yaw_rad, .. }) => Some(Ask::SetPose { x_m, y_m, yaw_rad }),
            _ => None,
        });
        pose.filter(|_| live.is_none())
    }

    /// How a pending order gets into the ledger. Points that are in it already are not in what is asked.
    fn ask_for(&self, order: &Order) -> Option<Ask> {
        let points = new_points(order);
        let is_update = order.order_id == self.record.order.id;
        if let Some(part) = self.record.part.as_ref().filter(|_| is_update) {
            let fits = part.points as usize + points.len() <= MAX_POINTS;
            if !part.closed && fits {
                return Some(Ask::Extend { task: part.task, after: part.points, points });
            }
            let done = self.seen.as_ref().is_some_and(|seen| seen.state == TaskState::Done);
            if !done || part.traversed < part.points {
                return None; // the rest of the base comes first
            }
        }
        // A robot that is put aside gets nothing new to drive.
        if self.record.paused && !self.may_be_taken {
            return None;
        }
        let part = if is_update { self.record.parts } else { 0 };
        let id = submission_id(&self.serial, order, part);
        let points = points.into_iter().take(MAX_POINTS).collect();
        Some(Ask::Submit { id, spec: Box::new(self.spec(points)) })
    }

    fn spec(&self, points: Vec<Waypoint>) -> TaskSpec {
        TaskSpec {
            who: Who::Robot(self.serial.robot.clone()),
            on_link_loss: LinkLoss::Finish,
            on_takeover: OnTakeover::Resume,
            ..TaskSpec::new(TaskKind::Route { points, loops: 1, dwell_s: 0.0 })
        }
    }

    /// What came of the last question.
    pub fn answered(&mut self, now_ms: u64, answer: Answer) {
        let Some(ask) = self.asked.take() else { return };
        self.unreachable = None;
        self.may_be_taken |= matches!(ask, Ask::Submit { .. });
        match (ask, answer) {
            (_, Answer::Unreachable(why)) => {
                self.unreachable = Some(why);
                self.next_ask_ms = now_ms + AGAIN_MS;
            }
            (_, Answer::Refused(code, why)) if is_passing(code) => {
                if code != DispatchCode::Unconfirmed {
                    self.unreachable = Some(why);
                }
                self.next_ask_ms = now_ms + AGAIN_MS;
            }
            (Ask::Submit { spec, .. }, Answer::Submitted(task)) => {
                let points = u32::try_from(spec.kind.points().len()).unwrap_or(u32::MAX);
                let is_update =
                    self.record.pending.as_ref().is_some_and(|order| order.order_id == self.record.order.id);
                let number = if is_update { self.record.parts } else { 0 };
                self.accept();
                self.record.parts = number + 1;
                self.record.part =
                    Some(Part { number, task, ledger: None, points, traversed: 0, closed: false });
                self.seen = None;
            }
            (Ask::Extend { points, .. }, Answer::Done) => {
                if let Some(part) = &mut self.record.part {
                    part.points += u32::try_from(points.len()).unwrap_or(u32::MAX);
                }
                self.accept();
            }
            (Ask::Extend { .. }, Answer::Refused(DispatchCode::WrongState | DispatchCode::Stale, _)) => {
                if let Some(part) = &mut self.record.part {
                    part.closed = true; // a part of its own follows
                }
            }
            (Ask::Submit { .. } | Ask::Extend { .. }, Answer::Refused(code, why)) => {
                self.not_taken(code, why)
            }
            (Ask::Show(_), Answer::Done) => {
                // How it stands was told before.
                self.next_ask_ms = now_ms + if self.seen.is_some() { 0 } else { UNKNOWN_MS };
            }
            (
                Ask::Show(task) | Ask::Cancel(task) | Ask::Pause(task) | Ask::Resume(task),
                Answer::Refused(code, _),
            ) => {
                match code {
                    DispatchCode::UnknownTask => self.task_is_lost(task),
                    _ => self.seen = None, // it was not as it was thought to be
                }
                self.next_ask_ms = now_ms + AGAIN_MS;
            }
            (Ask::Cancel(_) | Ask::Pause(_) | Ask::Resume(_), _) => {
                // The task itself says when it is so.
                self.seen = None;
                self.next_ask_ms = now_ms;
            }
            (Ask::SetPose { .. }, answer) => self.pose_is_set(answer),
            (Ask::Submit { .. } | Ask::Extend { .. } | Ask::Show(_), _) => {
                self.next_ask_ms = now_ms + AGAIN_MS
            }
        }
    }

    /// The pending order is in the ledger, or needs nothing there.
    fn accept(&mut self) {
        let Some(order) = self.record.pending.take() else { return };
        if order.order_id != self.record.order.id {
            (self.record.part, self.record.parts, self.seen) = (None, 0, None);
        }
        self.record.order.take(order);
        self.problems.clear();
    }

    fn not_taken(&mut self, code: DispatchCode, why: String) {
        let Some(order) = self.record.pending.take() else { return };
        let kind = match code {
            DispatchCode::UnknownRobot => ProblemKind::NotAvailable,
            DispatchCode::OutOfRange | DispatchCode::Malformed => ProblemKind::Malformed,
            _ => ProblemKind::NoRoute,
        };
        let problem = Problem::new(kind, why).with("orderId", &order.order_id);
        self.refuse(problem.with("orderUpdateId", order.order_update_id).with("topic", "order"));
    }

    fn pose_is_set(&mut self, answer: Answer) {
        let is_pose = |action: &&mut ActionState| matches!(action.wish, Some(Wish::Pose { .. }));
        let Some(action) = self.record.actions.iter_mut().find(is_pose) else { return };
        let result = match answer {
            Answer::Done => Ok(()),
            Answer::Failed(why) | Answer::Refused(_, why) => Err(why),
            Answer::Submitted(_) | Answer::Unreachable(_) => Err("no answer".to_owned()),
        };
        if let (Ok(()), Some(Wish::Pose { last_node_id, .. })) = (&result, &action.wish) {
            self.record.order.last_node = (last_node_id.clone().unwrap_or_default(), 0);
        }
        let failed = result.clone().err().map(|why| (why, action.id.clone()));
        action.end(result);
        if let Some((why, id)) = failed {
            self.refuse(Problem::new(ProblemKind::InvalidInstantAction, why).with("actionId", id));
        }
    }
}

/// Whether the same may be taken a moment later.
fn is_passing(code: DispatchCode) -> bool {
    use DispatchCode::{LedgerFailed, Overloaded, QueueFull, Unconfirmed};
    matches!(code, LedgerFailed | Overloaded | QueueFull | Unconfirmed)
}
