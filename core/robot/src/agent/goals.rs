//! The goal's life: how it begins, what is seen of it as it runs, and how it ends.

use super::navigate::BY_HAND;
use super::requests::Outcome;
use super::{Agent, Arrival, ENDED_GOALS, TurnView};
use crate::authority::goal::{Goal, Target, TimeLimit};
use crate::authority::guard::Guard;
use xtb_control::{Command, Outputs, Stamp};
use xtb_nav::navigator::TargetPose;
use xtb_protocol::messages::texts::{WITHDRAWN, client_timeout};
use xtb_protocol::messages::{
    Assignment, Done, EventKind, GoalEnd, GoalStatus, LinkLoss, StopReason, TaskAction, Via,
};
use xtb_protocol::{Name, Uuid};

impl Agent {
    /// Begins a goal of this client under this id.
    pub(super) fn set_out(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        (client, id): (&Name, Uuid),
        errand: &TaskAction,
        (on_link_loss, finish_s): (LinkLoss, f64),
        view: TurnView<'_>,
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
            Via::Planned => self.planned_goal(now, &aim)?,
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

    pub(super) fn wander(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        (client, id): (&Name, Uuid),
        for_s: Option<f64>,
        (on_link_loss, finish_s): (LinkLoss, f64),
        view: TurnView<'_>,
    ) -> Outcome {
        self.sees_both_ways("wandering", BY_HAND)?;
        let lasting = for_s.map(|s| TimeLimit { at: after(now, s), then: GoalStatus::Reached });
        let bounded = finish_limit(now, on_link_loss, finish_s);
        let mut goal = Goal::accepted(now, client.clone(), id, Target::Anywhere, on_link_loss);
        goal.limit = [lasting, bounded].into_iter().flatten().min_by_key(|limit| limit.at);
        self.begin(now, arrival, goal, Command::Wander, view)
    }

    fn begin(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        mut goal: Goal,
        command: Command,
        view: TurnView<'_>,
    ) -> Outcome {
        self.check_ready(view)?;
        self.check_overtaken(arrival)?;
        self.end_goal(now, GoalStatus::Replaced, None);
        self.teleop = None;
        let id = goal.id;
        goal.lease = self.lease.present();
        self.replace_goal(now, goal);
        self.pending = Some(command);
        Ok(Done { lease: None, goal: Some(id) })
    }

    /// The present goal has ended, and this one follows.
    pub(super) fn replace_goal(&mut self, now: Stamp, goal: Goal) {
        let id = goal.id;
        if let Some(before) = self.goal.replace(goal) {
            self.ended.truncate(ENDED_GOALS - 1);
            self.ended.push_front(GoalEnd { id: before.id, status: before.status });
        }
        self.emit(now, EventKind::Goal { id, status: GoalStatus::Accepted, reason: None });
    }

    pub(super) fn watch_goal(&mut self, now: Stamp, outputs: &Outputs) {
        let heard = self.lease.silent_ms(now).is_some_and(|ms| ms < self.limits.link_loss_ms);
        let present = self.lease.present();
        let halts = self.guards.on(Guard::LinkLossHalt);
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        if halts && goal.on_link_loss == LinkLoss::Halt && !(heard && goal.lease == present) {
            let words = client_timeout(&goal.by);
            return self.stand(now, StopReason::LeaseExpired, GoalStatus::Failed, Some(&words));
        }
        if goal.status == GoalStatus::Accepted {
            return;
        }
        if let Some(limit) = goal.limit
            && now >= limit.at
        {
            let words = (limit.then == GoalStatus::Failed).then_some("time limit reached");
            return self.stand(now, StopReason::TimeUp, limit.then, words);
        }
        if goal.is_planned() {
            return;
        }
        if let (Target::Point { .. }, Some(decision)) = (goal.target, &outputs.goto) {
            goal.distance_m = Some(decision.distance_m);
            if decision.arrived {
                self.idle_because = StopReason::GoalReached;
                return self.end_goal(now, GoalStatus::Reached, None);
            }
        }
        self.goal_is(now, outputs.blocked.then_some("an obstacle in the driving direction"));
    }

    /// The goal runs, or is blocked by this.
    pub(super) fn goal_is(&mut self, now: Stamp, blocked: Option<&str>) {
        let status = if blocked.is_some() { GoalStatus::Blocked } else { GoalStatus::Running };
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        if goal.status != status || goal.reason.as_deref() != blocked {
            let news = goal.status != status;
            goal.becomes(now, status, blocked);
            let (id, reason) = (goal.id, blocked.map(str::to_owned));
            if news {
                self.emit(now, EventKind::Goal { id, status, reason });
            }
        }
    }

    pub(super) fn end_goal(&mut self, now: Stamp, status: GoalStatus, reason: Option<&str>) {
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        goal.becomes(now, status, reason);
        let event = EventKind::Goal { id: goal.id, status, reason: reason.map(str::to_owned) };
        self.nav.end();
        self.emit(now, event);
        self.begin_next_leg(now, status);
    }

    /// Ends an assignment of this client, if it or an earlier one runs, and fences it.
    pub(super) fn withdraw(
        &mut self,
        now: Stamp,
        arrival: Arrival,
        client: &Name,
        (ledger, assign_seq): (u64, u64),
        has_lease: bool,
    ) {
        if has_lease {
            self.assigned.withdraw(client, ledger, assign_seq);
        } else {
            self.assigned.withdraw_without_lease(client, ledger, assign_seq);
        }
        let runs = self.goal.as_ref().filter(|goal| goal.by == *client && !goal.status.is_final());
        let seq = runs.and_then(|goal| Assignment::of_goal(ledger, goal.id)).map(|(seq, _)| seq);
        if seq.is_some_and(|seq| seq <= assign_seq) {
            self.commanded_by = self.commanded_by.max(arrival);
            self.stand(now, StopReason::Cancelled, GoalStatus::Cancelled, Some(WITHDRAWN));
        }
    }

    pub(super) fn goal_runs(&self) -> bool {
        self.goal.as_ref().is_some_and(|goal| !goal.status.is_final())
    }

    /// The present goal, the one that waits for it, and those before it, as the state shows them.
    pub(super) fn ends(&self) -> impl Iterator<Item = Uuid> {
        let present = self.goal.as_ref().map(|goal| goal.id);
        let next = self.next_leg.as_ref().map(|leg| leg.goal.id);
        present.into_iter().chain(next).chain(self.ended.iter().map(|end| end.id))
    }

    /// The present or last goal.
    #[must_use]
    pub fn goal(&self) -> Option<&Goal> {
        self.goal.as_ref()
    }

    /// How the goals before the present one ended, newest first.
    pub fn ended_goals(&self) -> impl Iterator<Item = GoalEnd> {
        self.ended.iter().copied()
    }
}

fn after(now: Stamp, seconds: f64) -> Stamp {
    now.plus_ns(Stamp::from_s(seconds).ns())
}

/// A goal that carries on without its client is bounded in time.
pub(super) fn finish_limit(now: Stamp, policy: LinkLoss, finish_s: f64) -> Option<TimeLimit> {
    (policy == LinkLoss::Finish).then(|| TimeLimit { at: after(now, finish_s), then: GoalStatus::Failed })
}
