//! What each request does: boot, idempotency, order, lease, goal.

use super::{Agent, Arrival, View};
use crate::faults::INPUT_LOST_MS;
use crate::goal::{Goal, Target, TimeLimit};
use xtb_control::frames::{MapFromOdom, MapPose};
use xtb_control::{Command, Mode, Stamp, goto};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Body, Done, EventKind, GoalStatus, InputAges, LinkLoss, RejectCode, Reply, Request, StopReason,
};

type Refusal = (RejectCode, String, &'static str);
type Outcome = Result<Done, Refusal>;

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
        if !each_time && let Some(reply) = self.replies.find(client, request.id) {
            return reply.clone();
        }
        if let Some(lease) = request.lease
            && !matches!(request.body, Body::Retain {})
        {
            self.lease.touch(now, client, lease);
        }
        let done =
            self.check_boot(request).and_then(|()| self.carry_out(now, arrival, client, request, view));
        let reply = match done {
            Ok(done) => Reply::done(request.id, done),
            Err((code, message, hint)) => {
                self.refused += 1;
                Reply::refused(request.id, code, message, hint)
            }
        };
        if !each_time {
            self.replies.remember(client, reply.clone());
        }
        reply
    }

    /// A lease of another boot belongs to a command of that boot: nothing of it may move this one.
    fn check_boot(&self, request: &Request) -> Result<(), Refusal> {
        let exempt = matches!(request.body, Body::Stop {} | Body::Acquire { .. });
        match request.lease {
            Some(lease) if lease.epoch != self.identity.epoch && !exempt => Err((
                RejectCode::LeaseLost,
                "the robot has restarted since that lease was granted".into(),
                "acquire it again and send the command anew",
            )),
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
            Body::Acquire { take: _ } => {
                let before = self.lease.holder().cloned();
                let lease = self.lease.acquire(now, client);
                if before.as_ref() != Some(client) {
                    self.emit(now, EventKind::Lease { holder: Some(client.clone()) });
                }
                Ok(Done { lease: Some(lease), goal: None })
            }
            Body::Retain {} => match request.lease {
                Some(lease) if self.lease.touch(now, client, lease) => Ok(Done::default()),
                _ => Err(lease_lost(self.lease.holder())),
            },
            Body::Release {} => match request.lease {
                Some(lease) if self.lease.release(now, client, lease) => {
                    self.emit(now, EventKind::Lease { holder: None });
                    Ok(Done::default())
                }
                _ => Err(lease_lost(self.lease.holder())),
            },
            Body::Goto { x_m, y_m, yaw_rad, on_link_loss, finish_s } => {
                if yaw_rad.is_some() {
                    return Err((
                        RejectCode::Unsupported,
                        "this robot drives to a point and cannot choose its yaw there".into(),
                        "leave yaw_rad out",
                    ));
                }
                let (x_odom, y_odom) = self.map.point_to_odom(*x_m, *y_m);
                let goal = goto::Goal::new(x_odom, y_odom).map_err(|error| {
                    (RejectCode::OutOfRange, error.to_string(), "choose a goal nearer to the robot")
                })?;
                let limit = finish_limit(now, *on_link_loss, *finish_s);
                let target = Target::Point { x_m: *x_m, y_m: *y_m };
                self.check_overtaken(arrival)?;
                let mut new = Goal::accepted(now, client.clone(), request.id, target, *on_link_loss);
                new.limit = limit;
                self.begin(now, new, Command::Goto(goal), view)
            }
            Body::Wander { for_s, on_link_loss, finish_s } => {
                let lasting = for_s.map(|s| TimeLimit { at: after(now, s), then: GoalStatus::Reached });
                let bounded = finish_limit(now, *on_link_loss, *finish_s);
                let limit = [lasting, bounded].into_iter().flatten().min_by_key(|limit| limit.at);
                self.check_overtaken(arrival)?;
                let mut new =
                    Goal::accepted(now, client.clone(), request.id, Target::Anywhere, *on_link_loss);
                new.limit = limit;
                self.begin(now, new, Command::Wander, view)
            }
            Body::Stop {} => {
                self.stop(now, arrival);
                Ok(Done::default())
            }
            Body::Cancel { goal } => match &self.goal {
                Some(present) if present.id == *goal && !present.status.is_final() => {
                    self.commanded_by = self.commanded_by.max(arrival);
                    self.stand(now, StopReason::Cancelled, GoalStatus::Cancelled);
                    Ok(Done::default())
                }
                _ => Err((
                    RejectCode::UnknownGoal,
                    format!("goal {goal} is not the one that runs"),
                    "the state names the present goal",
                )),
            },
            Body::SetPose { x_m, y_m, yaw_rad } => {
                if self.goal_runs() || self.teleop.is_some() {
                    return Err((
                        RejectCode::Busy,
                        "the pose cannot be set while the robot is under way".into(),
                        "stop it first",
                    ));
                }
                let pose = MapPose { x_m: *x_m, y_m: *y_m, yaw_rad: *yaw_rad };
                self.map = MapFromOdom::aligning(&view.outputs.pose, &pose);
                Ok(Done::default())
            }
            Body::Reset { .. } => Ok(Done::default()),
        }
    }

    /// Notes that a command changes who drives, unless a later stop has been carried out already.
    fn check_overtaken(&mut self, arrival: Arrival) -> Result<(), Refusal> {
        if arrival < self.stopped_by {
            return Err((
                RejectCode::Overtaken,
                "a stop came after this command and was carried out first".into(),
                "send it again if it is still wanted",
            ));
        }
        self.commanded_by = self.commanded_by.max(arrival);
        Ok(())
    }

    /// Whether the robot could drive at all.
    fn check_ready(&self, view: View<'_>) -> Result<(), Refusal> {
        if let Some((fault, _)) = self.faults.stopping() {
            return Err((
                RejectCode::NotReady,
                format!("the {} has a fault: {fault}", fault.place()),
                fault.remedy(),
            ));
        }
        if view.outputs.mode == Mode::Manual {
            return Err((
                RejectCode::NotReady,
                "the remote control drives (mode manual)".into(),
                "set its selector to automatic",
            ));
        }
        match unheard(view) {
            None => Ok(()),
            Some(name) => Err((
                RejectCode::NotReady,
                format!("the {name} has not been heard yet"),
                "a robot that has just started needs a moment; `fleet-cli status` shows the ages",
            )),
        }
    }

    fn begin(&mut self, now: Stamp, goal: Goal, command: Command, view: View<'_>) -> Outcome {
        self.check_ready(view)?;
        self.end_goal(now, GoalStatus::Replaced, None);
        self.teleop = None;
        let id = goal.id;
        self.goal = Some(goal);
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

fn lease_lost(holder: Option<&Name>) -> Refusal {
    let message = match holder {
        Some(holder) => format!("the lease is held by {holder}"),
        None => "the lease has run out".to_owned(),
    };
    (RejectCode::LeaseLost, message, "acquire it again")
}

fn after(now: Stamp, seconds: f64) -> Stamp {
    now.plus_ns(Stamp::from_s(seconds).ns())
}

/// A goal that carries on without its client is bounded in time.
fn finish_limit(now: Stamp, policy: LinkLoss, finish_s: f64) -> Option<TimeLimit> {
    (policy == LinkLoss::Finish).then(|| TimeLimit { at: after(now, finish_s), then: GoalStatus::Failed })
}
