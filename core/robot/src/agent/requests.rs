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
//! | `assign` | present | no | as `goto` or `wander`, unless a later assignment came first, or the leg before was not reached; the next leg of the one under way waits for it |
//! | `withdraw` | none | yes | ends the client's own assignment, and fences it |
//! | `stop` | none | yes | ends everything of the network |

use super::{Agent, Arrival, TurnView};
use crate::authority::assignments::Known;
use crate::authority::guard::Guard;
use crate::faults::INPUT_LOST_MS;
use xtb_control::frames::MapPose;
use xtb_control::{Mode, Stamp};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Body, Done, EventKind, Fault, GoalStatus, InputAges, Latch, RejectCode, Reply, Request, STOP_SWITCH,
    StopReason, TaskAction,
};

pub(super) type Refusal = (RejectCode, String, &'static str);
pub(super) type Outcome = Result<Done, Refusal>;

impl Agent {
    /// One request; the answer is final, its effect begins at the next turn. The same id again gets
    /// the same answer, but a retain and a stop are done each time.
    pub fn request(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        client: &Name,
        request: &Request,
        view: TurnView<'_>,
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

    fn carry_out(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        client: &Name,
        request: &Request,
        view: TurnView<'_>,
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
                self.check_leg_before(assignment)?;
                let patience = (*on_link_loss, *finish_s);
                let goal = (client, assignment.goal_id());
                let done = match self.next_aim(client, assignment, errand) {
                    Some(aim) => self.take_next_leg(now, arrival, goal, aim, patience, view)?,
                    None => self.set_out(now, arrival, goal, errand, patience, view)?,
                };
                self.assigned.begun(client, assignment);
                Ok(done)
            }
            Body::Withdraw { ledger, assign_seq } => {
                let has_lease = self.has_lease(now, client, request);
                self.withdraw(now, arrival, client, (*ledger, *assign_seq), has_lease);
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

    fn cause_present(&self, latch: Latch) -> Refusal {
        if latch == Latch::Estop {
            let message = format!("{latch} cannot be reset: the {STOP_SWITCH} is pressed");
            return (RejectCode::CausePresent, message, latch.remedy());
        }
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
    pub(super) fn check_overtaken(&mut self, arrival: Arrival) -> Result<(), Refusal> {
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
    pub(super) fn check_ready(&self, view: TurnView<'_>) -> Result<(), Refusal> {
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
}

/// An input without which nothing may move, and that has not been heard lately.
pub(super) fn unheard(view: TurnView<'_>) -> Option<&'static str> {
    let InputAges { gyro, encoder, adc, .. } = view.ages;
    [(encoder, "encoder"), (adc, "converter"), (gyro, "gyro")]
        .into_iter()
        .find_map(|(age, name)| age.is_none_or(|ms| ms > INPUT_LOST_MS).then_some(name))
}
