//! What each request does: idempotency, lease, order, latches, goal.
//!
//! | request | lease | while latched | effect |
//! | --- | --- | --- | --- |
//! | `acquire` | – | yes | grants; refused while another holds it, unless `take` |
//! | `retain` | present | yes | heard |
//! | `release` | present | yes | free; ends a goal that halts on link loss |
//! | `goto`, `wander` | present | no | the goal; ends the one before |
//! | `cancel` | present | yes | ends that goal |
//! | `set_pose` | present | yes | the pose, while nothing is under way |
//! | `reset` | present | yes | clears latches whose cause is gone; moves nothing |
//! | `assign` | present | no | as `goto` or `wander`, unless a later assignment came first |
//! | `withdraw` | none | yes | ends the client's own assignment, and fences it |
//! | `stop` | none | yes | ends everything of the network |

use super::{Agent, Arrival, ENDED_GOALS, View};
use crate::authority::assignments::Known;
use crate::authority::goal::{Goal, Target, TimeLimit};
use crate::authority::guard::Guard;
use crate::faults::INPUT_LOST_MS;
use xtb_control::frames::MapPose;
use xtb_control::{Command, Mode, Stamp};
use xtb_nav::navigator::TargetPose;
use xtb_protocol::messages::{
    Assignment, Body, Done, EventKind, Fault, GoalEnd, GoalStatus, InputAges, LinkLoss, RejectCode, Reply,
    Request, StopReason, TaskAction, Via,
};
use xtb_protocol::{Name, Uuid};

pub(super) type Refusal = (RejectCode, String, &'static str);
type Outcome = Result<Done, Refusal>;

/// Whether a request needs the present lease.
#[must_use]
fn needs_lease(body: &Body) -> bool {
    match body {
        Body::Acquire { .. } | Body::Stop {} | Body::Withdraw { .. } => false,
        Body::Retain {}
        | Body::Release {}
        | Body::Goto { .. }
        | Body::Wander { .. }
        | Body::Assign { .. }
        | Body::Cancel { .. }
        | Body::SetPose { .. }
        | Body::Reset { .. } => true,
    }
}

impl Agent {
    /// One request; the answer is final, its effect begins at the next turn. The same id again gets
    /// the same answer, but a retain and a stop are done each time.
    pub fn request(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        client: &Name,
        request: &Request,
        view: View<'_>,
    ) -> Reply {
        let each_time = matches!(request.body, Body::Retain {} | Body::Stop {});
        if !each_time
            && self.guards.on(Guard::Idempotency)
            && let Some(reply) = self.replies.find(client, request.id).cloned()
        {
            self.heard_again(now, &reply);
            return reply;
        }
        let done = self
            .check_lease(now, client, request)
            .and_then(|()| self.carry_out(now, arrival, client, request, view));
        let reply = match done {
            Ok(done) => Reply::done(request.id, done),
            Err((code, message, hint)) => {
                self.refused += 1;
                Reply::refused(request.id, code, message, hint)
            }
        };
        if !each_time {
            self.replies.remember(client, reply.clone(), self.lease.holder());
        }
        reply
    }

    /// A request that was granted the present lease came again: its client lives, and does not know of the grant
    /// yet. On a link with a round trip of a second the lease would run out before the first retain.
    fn heard_again(&mut self, now: Stamp, reply: &Reply) {
        if let xtb_protocol::messages::Outcome::Ok(Done { lease: Some(lease), .. }) = &reply.result {
            self.heard(now, *lease);
        }
    }

    /// The present lease, where one is needed. That its holder lives is told by [`Agent::heard`] from the door,
    /// with the time when the message came in, not the time when its turn came.
    fn check_lease(&mut self, now: Stamp, client: &Name, request: &Request) -> Result<(), Refusal> {
        // What waited in the queue until its lease had run out comes too late.
        let alive = self.lease.silent_ms(now).is_some_and(|ms| ms < self.limits.lease_free_ms)
            || !self.guards.on(Guard::LeaseExpiry);
        let present = alive && request.lease.is_some_and(|lease| self.lease.is_present(client, lease));
        if present || !needs_lease(&request.body) {
            return Ok(());
        }
        match request.lease {
            None if self.guards.on(Guard::LeaseRequired) => Err((
                RejectCode::LeaseRequired,
                match self.lease.holder() {
                    Some(holder) => format!("this needs control of the robot, which {holder} has"),
                    None => "this needs control of the robot, but the request has no lease".to_owned(),
                },
                "acquire control first",
            )),
            Some(lease) if self.guards.on(Guard::LeaseFence) => Err(match self.lease.holder() {
                _ if lease.epoch != self.identity.epoch => (
                    RejectCode::LeaseLost,
                    "the robot has restarted since control was granted".to_owned(),
                    "acquire control again and repeat the command",
                ),
                Some(holder) if holder != client => {
                    (RejectCode::LeaseLost, format!("{holder} has control"), "take control, or wait")
                }
                _ => (
                    RejectCode::LeaseLost,
                    match self.lease.granted_after(lease) {
                        Some(other) => format!("control was granted to {other} in the meantime"),
                        None => "the lease has expired".to_owned(),
                    },
                    "acquire control again",
                ),
            }),
            _ => Ok(()),
        }
    }

    fn carry_out(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        client: &Name,
        request: &Request,
        view: View<'_>,
    ) -> Outcome {
        match &request.body {
            Body::Acquire { take } => self.acquire(now, client, *take),
            Body::Retain {} => Ok(Done::default()),
            Body::Release {} => {
                self.lease.free();
                self.control_passes(now, StopReason::LeaseReleased, "control was released");
                self.emit(now, EventKind::Lease { holder: None });
                Ok(Done::default())
            }
            Body::Goto { x_m, y_m, yaw_rad, via, on_link_loss, finish_s } => {
                let errand = TaskAction::Goto { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad, via: *via };
                let patience = (*on_link_loss, *finish_s);
                self.set_out(now, arrival, (client, request.id), &errand, patience, view)
            }
            Body::Wander { for_s, on_link_loss, finish_s } => {
                let patience = (*on_link_loss, *finish_s);
                self.wander(now, arrival, (client, request.id), *for_s, patience, view)
            }
            Body::Assign { assignment, errand, on_link_loss, finish_s } => {
                if self.assigned.check(assignment, self.ends())? == Known::Already {
                    return Ok(Done { lease: None, goal: Some(assignment.goal_id()) });
                }
                let patience = (*on_link_loss, *finish_s);
                let goal = (client, assignment.goal_id());
                let done = self.set_out(now, arrival, goal, errand, patience, view)?;
                self.assigned.begun(client, assignment);
                Ok(done)
            }
            Body::Withdraw { ledger, assign_seq } => {
                self.withdraw(now, arrival, client, (*ledger, *assign_seq));
                Ok(Done::default())
            }
            Body::Stop {} => {
                self.stop(now, arrival);
                Ok(Done::default())
            }
            Body::Cancel { goal } => match &self.goal {
                Some(present) if present.id == *goal && !present.status.is_final() => {
                    self.commanded_by = self.commanded_by.max(arrival);
                    self.stand(now, StopReason::Cancelled, GoalStatus::Cancelled, None);
                    Ok(Done::default())
                }
                _ => Err((
                    RejectCode::UnknownGoal,
                    format!("goal {goal} is not the current goal"),
                    "the state shows the current goal",
                )),
            },
            Body::SetPose { x_m, y_m, yaw_rad } => {
                if self.under_way() {
                    return Err((
                        RejectCode::Busy,
                        "the pose cannot be set while the robot is driving".into(),
                        "stop the robot first",
                    ));
                }
                let pose = MapPose { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad };
                self.filter.set_pose(now, &view.outputs.pose, &pose);
                self.nav.pose_jumped();
                Ok(Done::default())
            }
            Body::Reset { latch } => {
                self.check_overtaken(arrival)?;
                match self.reset(now, *latch, client).first() {
                    None => Ok(Done::default()),
                    Some(latch) => Err(self.cause_present(*latch)),
                }
            }
        }
    }

    /// Begins a goal of this client under this id.
    fn set_out(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        (client, id): (&Name, Uuid),
        errand: &TaskAction,
        (on_link_loss, finish_s): (LinkLoss, f64),
        view: View<'_>,
    ) -> Outcome {
        let (aim, via) = match *errand {
            TaskAction::Goto { x_m, y_m, yaw_rad, via } => (TargetPose { x_m, y_m, yaw_rad }, via),
            TaskAction::Wander { for_s } => {
                return self.wander(now, arrival, (client, id), Some(for_s), (on_link_loss, finish_s), view);
            }
        };
        let via = via.unwrap_or_else(|| self.usual_way());
        let command = match via {
            Via::Direct => self.direct(&aim)?,
            Via::Planned => self.planned_goal(&aim)?,
        };
        let target = Target::Point { x_m: aim.x_m, y_m: aim.y_m, yaw_rad: aim.yaw_rad, via };
        let mut goal = Goal::accepted(now, client.clone(), id, target, on_link_loss);
        goal.limit = finish_limit(now, on_link_loss, finish_s);
        let done = self.begin(now, arrival, goal, command, view)?;
        if via == Via::Planned {
            self.begin_path(aim);
        }
        Ok(done)
    }

    fn wander(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        (client, id): (&Name, Uuid),
        for_s: Option<f64>,
        (on_link_loss, finish_s): (LinkLoss, f64),
        view: View<'_>,
    ) -> Outcome {
        let lasting = for_s.map(|s| TimeLimit { at: after(now, s), then: GoalStatus::Reached });
        let bounded = finish_limit(now, on_link_loss, finish_s);
        let mut goal = Goal::accepted(now, client.clone(), id, Target::Anywhere, on_link_loss);
        goal.limit = [lasting, bounded].into_iter().flatten().min_by_key(|limit| limit.at);
        self.begin(now, arrival, goal, Command::Wander, view)
    }

    /// The present goal and those before it, as the state shows them.
    fn ends(&self) -> impl Iterator<Item = Uuid> {
        let present = self.goal.as_ref().map(|goal| goal.id);
        present.into_iter().chain(self.ended.iter().map(|end| end.id))
    }

    /// Ends an assignment of this client, if it or an earlier one runs, and fences it.
    fn withdraw(&mut self, now: Stamp, arrival: Arrival, client: &Name, (ledger, assign_seq): (u64, u64)) {
        self.assigned.withdraw(client, ledger, assign_seq);
        let runs = self.goal.as_ref().filter(|goal| goal.by == *client && !goal.status.is_final());
        let seq = runs.and_then(|goal| Assignment::of_goal(ledger, goal.id)).map(|(seq, _)| seq);
        if seq.is_some_and(|seq| seq <= assign_seq) {
            self.commanded_by = self.commanded_by.max(arrival);
            self.stand(now, StopReason::Cancelled, GoalStatus::Cancelled, Some("assignment withdrawn"));
        }
    }

    /// Grants the lease under a new root. Whoever held it before is fenced from here on.
    fn acquire(&mut self, now: Stamp, client: &Name, take: bool) -> Outcome {
        let before = self.lease.holder().cloned();
        if let Some(holder) = before.as_ref().filter(|holder| *holder != client)
            && !take
            && self.guards.on(Guard::LeaseExclusive)
        {
            let silent_ms = self.lease.silent_ms(now).unwrap_or_default();
            let message = format!("controlled by {holder} (heard {silent_ms} ms ago)");
            return Err((RejectCode::LeaseHeld, message, "use --take (acquire with take) to take control"));
        }
        let lease = self.lease.grant(now, client);
        self.last_seq = None;
        self.setpoint_seen &= before.as_ref() == Some(client);
        if before.as_ref() == Some(client) {
            // Its own goal goes on under the new grant; its setpoints have to begin anew.
            let goal = self.goal.as_mut().filter(|goal| goal.by == *client);
            goal.into_iter().for_each(|goal| goal.lease = Some(lease));
        } else {
            self.emit(now, EventKind::Lease { holder: Some(client.clone()) });
        }
        self.control_passes(now, StopReason::LeaseTaken, &format!("{client} took control"));
        Ok(Done { lease: Some(lease), goal: None })
    }

    /// What lived by a lease that is not the present one any more ends at once.
    fn control_passes(&mut self, now: Stamp, because: StopReason, words: &str) {
        let present = self.lease.present();
        let fenced = self.guards.on(Guard::LeaseFence);
        let orphan = self.goal.as_ref().is_some_and(|goal| {
            !goal.status.is_final() && goal.on_link_loss == LinkLoss::Halt && goal.lease != present
        });
        if fenced && (self.teleop.is_some() || (orphan && self.guards.on(Guard::LinkLossHalt))) {
            self.stand(now, because, GoalStatus::Cancelled, Some(words));
        }
        self.rearm |= fenced;
    }

    fn cause_present(&self, latch: xtb_protocol::messages::Latch) -> Refusal {
        let cause = self.faults.present().find(|fault| crate::faults::latch_of(*fault) == Some(latch));
        match cause {
            Some(fault) => (
                RejectCode::CausePresent,
                format!("{latch} cannot be reset: {fault} is still present"),
                fault.remedy(),
            ),
            None => (
                RejectCode::CausePresent,
                format!("{latch} cannot be reset: the remote control is active or lost"),
                "set the transmitter's selector to automatic",
            ),
        }
    }

    /// Notes that a command changes who drives, unless a later stop has been carried out already.
    fn check_overtaken(&mut self, arrival: Arrival) -> Result<(), Refusal> {
        if arrival < self.stopped_by && self.guards.on(Guard::Overtaken) {
            return Err((
                RejectCode::Overtaken,
                "a stop that was sent after this command was executed first".into(),
                "repeat the command if it is still wanted",
            ));
        }
        self.commanded_by = self.commanded_by.max(arrival);
        Ok(())
    }

    /// Whether the robot could drive at all.
    fn check_ready(&self, view: View<'_>) -> Result<(), Refusal> {
        if self.is_held() {
            let names: Vec<String> = self.latches.all().map(|latch| latch.to_string()).collect();
            let message = format!("the robot is latched: {}", names.join(", "));
            return Err((
                RejectCode::Latched,
                message,
                "find the cause with `fleet-cli why`, then `fleet-cli reset`",
            ));
        }
        if let Some((fault, _)) = self.faults.stopping() {
            return Err((RejectCode::NotReady, format!("{} fault: {fault}", fault.place()), fault.remedy()));
        }
        if self.faults.present().any(|fault| fault == Fault::OdometryScale) {
            let words = self.odometry_scale.fault().unwrap_or_default();
            let message = format!("odometry fault: {words}");
            return Err((RejectCode::NotReady, message, Fault::OdometryScale.remedy()));
        }
        if self.faults.present().any(|fault| fault == Fault::BatteryLow) {
            let message = "battery too low to start a command".to_owned();
            return Err((RejectCode::BatteryLow, message, Fault::BatteryLow.remedy()));
        }
        if view.outputs.mode == Mode::Manual {
            return Err((
                RejectCode::NotReady,
                "the remote control is active (mode manual)".into(),
                "set the transmitter's selector to automatic",
            ));
        }
        match unheard(view) {
            None => Ok(()),
            Some(name) => Err((
                RejectCode::NotReady,
                format!("no data from the {name} yet"),
                "wait a moment if the robot has just started; `fleet-cli status` shows the ages",
            )),
        }
    }

    fn begin(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        mut goal: Goal,
        command: Command,
        view: View<'_>,
    ) -> Outcome {
        self.check_ready(view)?;
        self.check_overtaken(arrival)?;
        self.end_goal(now, GoalStatus::Replaced, None);
        self.teleop = None;
        let id = goal.id;
        goal.lease = self.lease.present();
        if let Some(before) = self.goal.replace(goal) {
            self.ended.truncate(ENDED_GOALS - 1);
            self.ended.push_front(GoalEnd { id: before.id, status: before.status });
        }
        self.emit(now, EventKind::Goal { id, status: GoalStatus::Accepted, reason: None });
        self.pending = Some(command);
        Ok(Done { lease: None, goal: Some(id) })
    }
}

/// An input without which nothing may move, and that has not been heard lately.
pub(super) fn unheard(view: View<'_>) -> Option<&'static str> {
    let InputAges { gyro, encoder, adc, .. } = view.ages;
    [(encoder, "encoder"), (adc, "converter"), (gyro, "gyro")]
        .into_iter()
        .find_map(|(age, name)| age.is_none_or(|ms| ms > INPUT_LOST_MS).then_some(name))
}

fn after(now: Stamp, seconds: f64) -> Stamp {
    now.plus_ns(Stamp::from_s(seconds).ns())
}

/// A goal that carries on without its client is bounded in time.
fn finish_limit(now: Stamp, policy: LinkLoss, finish_s: f64) -> Option<TimeLimit> {
    (policy == LinkLoss::Finish).then(|| TimeLimit { at: after(now, finish_s), then: GoalStatus::Failed })
}
