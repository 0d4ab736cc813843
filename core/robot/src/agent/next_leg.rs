//! The next leg of an assignment, known while the one before is under way: the point between is passed.
//!
//! An assignment that is the next leg of the one under way, both along planned paths, does not replace it. It waits, at
//! most one, and begins when the present goal is passed ([`Navigator::pass`](xtb_nav::navigator::Navigator::pass)) or
//! reached. Whatever else ends the present goal ends the next one with it, before it has begun: its number is used up
//! then.

use super::goals::finish_limit;
use super::requests::{Outcome, Refusal};
use super::{Agent, Arrival, TurnView};
use crate::authority::assignments::ASSIGN_AGAIN;
use crate::authority::goal::{Goal, Target};
use xtb_control::Stamp;
use xtb_nav::navigator::TargetPose;
use xtb_protocol::messages::{
    Assignment, Done, EventKind, GoalStatus, LinkLoss, RejectCode, TaskAction, Via,
};
use xtb_protocol::{Name, Uuid};

/// A planned goal that has been accepted and waits for the one before.
#[derive(Debug, Clone)]
pub(super) struct NextLeg {
    pub(super) goal: Goal,
    aim: TargetPose,
    /// How long it may take from its beginning on, with [`LinkLoss::Finish`].
    finish_s: f64,
}

impl Agent {
    /// Refuses a leg if the one before has ended and was not reached: the request for it was held up.
    pub(super) fn check_leg_before(&self, assignment: &Assignment) -> Result<(), Refusal> {
        let Some(leg) = assignment.leg.checked_sub(1) else { return Ok(()) };
        let before = Assignment { leg, ..*assignment }.goal_id();
        let present = self.goal.iter().map(|goal| (goal.id, goal.status));
        let mut goals = present.chain(self.ended.iter().map(|end| (end.id, end.status)));
        let missed = |(id, status): (Uuid, GoalStatus)| {
            id == before && status.is_final() && status != GoalStatus::Reached
        };
        if goals.any(missed) {
            let message = format!("leg {leg} of assignment {} was not reached", assignment.assign_seq);
            return Err((RejectCode::UnknownGoal, message, ASSIGN_AGAIN));
        }
        Ok(())
    }

    /// Where the next leg of the assignment of this client that is under way leads, if this is that: both along
    /// planned paths.
    pub(super) fn next_aim(
        &self,
        client: &Name,
        assignment: &Assignment,
        errand: &TaskAction,
    ) -> Option<TargetPose> {
        let TaskAction::Goto { x_m, y_m, yaw_rad, via } = *errand else { return None };
        let before = Assignment { leg: assignment.leg.checked_sub(1)?, ..*assignment };
        let present = self.goal.as_ref().filter(|goal| !goal.status.is_final() && goal.by == *client)?;
        let is_planned = present.is_planned() && via.unwrap_or_else(|| self.usual_way()) == Via::Planned;
        (is_planned && present.id == before.goal_id()).then_some(TargetPose { x_m, y_m, yaw_rad })
    }

    /// Accepts the next leg of the assignment under way.
    pub(super) fn take_next_leg(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        (client, id): (&Name, Uuid),
        aim: TargetPose,
        (on_link_loss, finish_s): (LinkLoss, f64),
        view: TurnView<'_>,
    ) -> Outcome {
        self.planned_goal(now, &aim)?;
        self.check_ready(view)?;
        self.check_overtaken(arrival)?;
        let target = Target::Point { x_m: aim.x_m, y_m: aim.y_m, yaw_rad: aim.yaw_rad, via: Via::Planned };
        let goal = Goal::accepted(now, client.clone(), id, target, on_link_loss);
        self.next_leg = Some(NextLeg { goal, aim, finish_s });
        Ok(Done { lease: None, goal: Some(id) })
    }

    /// Passes the present goal, if another one waits and the navigator is near enough.
    pub(super) fn pass_goal(&mut self, now: Stamp) {
        if self.next_leg.is_none() || !self.nav.may_pass(now) {
            return;
        }
        let (Some(next), Some(present)) = (self.next_leg.take(), &mut self.goal) else { return };
        present.becomes(now, GoalStatus::Reached, None);
        let event = EventKind::Goal { id: present.id, status: GoalStatus::Reached, reason: None };
        self.emit(now, event);
        let aim = self.follow_on(now, next);
        self.nav.pass(aim);
        self.goal_is(now, None);
    }

    /// The present goal has ended, so: the next one begins where the robot stands, or never.
    pub(super) fn begin_next_leg(&mut self, now: Stamp, status: GoalStatus) {
        if let Some(next) = self.next_leg.take().filter(|_| status == GoalStatus::Reached) {
            let aim = self.follow_on(now, next);
            self.nav.begin(aim);
        }
    }

    fn follow_on(&mut self, now: Stamp, NextLeg { mut goal, aim, finish_s }: NextLeg) -> TargetPose {
        (goal.since, goal.lease) = (now, self.lease.present());
        goal.limit = finish_limit(now, goal.on_link_loss, finish_s);
        self.replace_goal(now, goal);
        aim
    }
}
