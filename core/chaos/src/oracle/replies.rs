//! What a robot answers and what becomes of it: leases, goals, resets, and each request once.

use super::{Broken, Cut, Goal, Held, Invariant, LEASE_GONE, LEASE_SURE, Oracle, SETTLED};
use crate::change::Sender;
use crate::event_log::Answer;
use crate::time::{Turn, ms, turns};
use xtb_protocol::messages::{Body, GoalStatus, Latch, Lease, LinkLoss, Outcome, RejectCode, Reply, Request};
use xtb_robot::agent::Arrival;

/// Replies that a robot remembers for each client.
const REMEMBERED: usize = 64;

impl Oracle {
    /// The robot answered.
    pub(crate) fn answered(
        &mut self,
        now: Turn,
        to: Sender,
        arrival: Arrival,
        request: &Request,
        reply: &Reply,
    ) -> Result<Answer, Broken> {
        let answer = match &reply.result {
            Outcome::Ok(done) => Answer::Done { lease: done.lease, goal: done.goal.map(|id| id.as_u128()) },
            Outcome::Error(error) => Answer::Refused(error.code),
        };
        let id = request.id.as_u128();
        let each_time = matches!(request.body, Body::Retain {} | Body::Stop {});
        if !each_time {
            let known = &mut self.answers[usize::from(to.name)];
            if let Some((_, before)) = known.iter().find(|(known, _)| *known == id) {
                if *before != answer {
                    return Err((Invariant::Requests, format!("answered {before:?} before, now {answer:?}")));
                }
                if let Answer::Done { lease, .. } = answer {
                    self.hears(now, to.name, lease); // it lives, and does not know of its grant yet
                }
                return Ok(answer);
            }
            if known.len() == REMEMBERED {
                known.pop_front();
            }
            known.push_back((id, answer));
        }
        match answer {
            Answer::Done { lease, goal } => self.done(now, to, arrival, request, lease, goal)?,
            Answer::Refused(RejectCode::CausePresent) => {
                if let Body::Reset { latch } = &request.body {
                    self.reset(now, arrival, *latch)?; // of those whose cause is gone
                }
            }
            Answer::Refused(RejectCode::LeaseHeld) => {
                if self.held.is_none_or(|held| self.gone(now, held)) {
                    return Err((
                        Invariant::OneOwner,
                        "a lease that is no longer retained is not \
                        free"
                            .into(),
                    ));
                }
            }
            Answer::Refused(_) => {}
        }
        Ok(answer)
    }

    fn done(
        &mut self,
        now: Turn,
        to: Sender,
        arrival: Arrival,
        request: &Request,
        granted: Option<Lease>,
        goal: Option<u128>,
    ) -> Result<(), Broken> {
        match &request.body {
            Body::Acquire { take } => self.granted(now, to.name, granted, *take),
            Body::Retain {} | Body::Stop {} => Ok(()),
            Body::Release {} => {
                self.owns(now, to, request)?;
                self.held = None;
                Ok(())
            }
            Body::Goto { on_link_loss, finish_s, .. } => {
                self.owns(now, to, request)?;
                self.check_begins(arrival, request, goal)?;
                self.begin(now, to.name, request, *on_link_loss, bound_s(*on_link_loss, *finish_s, None));
                Ok(())
            }
            Body::Wander { for_s, on_link_loss, finish_s } => {
                self.owns(now, to, request)?;
                self.check_begins(arrival, request, goal)?;
                self.begin(now, to.name, request, *on_link_loss, bound_s(*on_link_loss, *finish_s, *for_s));
                Ok(())
            }
            Body::Assign { on_link_loss, finish_s, .. } => {
                self.owns(now, to, request)?;
                self.check_begins(arrival, request, goal)?;
                self.begin(now, to.name, request, *on_link_loss, bound_s(*on_link_loss, *finish_s, None));
                Ok(())
            }
            Body::Withdraw { .. } => Ok(()), // ends a goal at most, which the state shows
            Body::Cancel { .. } => {
                self.owns(now, to, request)?;
                self.cut_goal();
                Ok(())
            }
            Body::SetPose { .. } => self.owns(now, to, request),
            Body::Reset { latch } => {
                self.owns(now, to, request)?;
                self.reset(now, arrival, *latch)
            }
        }
    }

    fn reset(&mut self, now: Turn, arrival: Arrival, latch: Option<Latch>) -> Result<(), Broken> {
        let of_estop = latch.is_none_or(|latch| latch == Latch::Estop);
        if of_estop && self.estopped && arrival < self.estopped_by {
            return Err((Invariant::Latched, "a reset from before the emergency stop ended it".into()));
        }
        if self.estopped || self.published.any {
            self.cut(Cut::Reset);
            self.devices.reset(now, (of_estop && self.estopped) || self.published.holds_transmitter);
        }
        if of_estop {
            self.estops_standing.clear();
        }
        self.estopped &= !of_estop; // what was not latched needs no new start: who drives, drives on
        Ok(())
    }

    fn cut_goal(&mut self) {
        (self.goal, self.cut) = (None, Cut::GoalEnded);
    }

    /// Whether a lease is free by now; a loop that was held up needs a moment to see it.
    pub(super) fn gone(&self, now: Turn, held: Held) -> bool {
        let settled = now <= self.last_turn + 1 && now - self.turning_since > SETTLED;
        settled && now - held.heard > LEASE_GONE
    }

    fn owns(&self, now: Turn, to: Sender, request: &Request) -> Result<(), Broken> {
        let present = self.held.is_some_and(|held| {
            held.name == to.name && Some(held.lease) == request.lease && !self.gone(now, held)
        });
        match present {
            true => Ok(()),
            false => Err((
                Invariant::OneOwner,
                format!("{:?} of {to} was done without the present lease ({:?})", request.body, self.held),
            )),
        }
    }

    fn granted(&mut self, now: Turn, name: u8, lease: Option<Lease>, take: bool) -> Result<(), Broken> {
        let Some(lease) = lease else {
            return Err((Invariant::OneOwner, "an acquire was done and gave no lease".into()));
        };
        if let Some((_, other)) = self.granted.iter().find(|(known, owner)| *known == lease && *owner != name)
        {
            return Err((Invariant::OneOwner, format!("person-{name} got the lease of person-{other}")));
        }
        let other = self.held.filter(|held| held.name != name);
        if let Some(held) = other
            && !take
            && now - held.heard < LEASE_SURE
        {
            return Err((
                Invariant::OneOwner,
                format!("person-{name} got what person-{} holds, without taking it", held.name),
            ));
        }
        if self.held.is_none() {
            self.last_setpoint = None; // the first one of a client that comes anew counts as pushed anew
        }
        if other.is_some() {
            // Its setpoints are fenced at once; its goal ends when it is silent, or at once.
            (self.setpoint, self.last_setpoint, self.armed) = (None, None, false);
            if self.goal.is_none() {
                self.cut = Cut::LeaseTaken;
            }
        }
        if let Some(goal) = &mut self.goal
            && self.held.is_some_and(|held| held.name == name && goal.lease == Some(held.lease))
        {
            (goal.lease, goal.heard) = (Some(lease), now); // its own goal goes on under the new grant
        }
        if !self.granted.contains(&(lease, name)) {
            self.granted.push((lease, name));
        }
        self.held = Some(Held { name, lease, heard: now, granted: now });
        Ok(())
    }

    /// Whether a goal may have been accepted.
    fn check_begins(&self, arrival: Arrival, request: &Request, goal: Option<u128>) -> Result<(), Broken> {
        if goal != Some(request.id.as_u128()) {
            return Err((Invariant::Requests, format!("a goal was accepted as {goal:?}")));
        }
        if self.estopped {
            return Err((Invariant::Latched, "a goal was accepted through an emergency stop".into()));
        }
        if arrival < self.stopped_by {
            return Err((Invariant::Latched, "a goal from before a stop was accepted after it".into()));
        }
        Ok(())
    }

    fn begin(&mut self, now: Turn, by: u8, request: &Request, policy: LinkLoss, longest_s: Option<f64>) {
        let (id, lease) = (request.id.as_u128(), request.lease);
        let until = longest_s.map_or(Turn::MAX, |s| now + turns(s) + ms(50));
        self.goal = Some(Goal { id, by, lease, policy, heard: now, until });
        self.acknowledged = Some(id);
    }

    /// The robot told of a goal.
    pub(crate) fn goal_event(&mut self, id: u128, status: GoalStatus) -> Result<(), Broken> {
        let known = self.begun.iter_mut().find(|(known, _)| *known == id);
        match (known, status) {
            (Some(_), GoalStatus::Accepted) => {
                return Err((Invariant::Requests, "a goal began twice".into()));
            }
            (None, GoalStatus::Accepted) => self.begun.push((id, None)),
            (None, _) => return Err((Invariant::Requests, format!("an unknown goal is {status:?}"))),
            (Some((_, Some(end))), _) => {
                return Err((Invariant::Requests, format!("a goal that was {end:?} is {status:?}")));
            }
            (Some((_, end)), _) if status.is_final() => *end = Some(status),
            (Some(_), _) => {}
        }
        if status.is_final() && self.goal.is_some_and(|goal| goal.id == id) {
            self.cut_goal();
        }
        Ok(())
    }
}

/// How long a goal may last, if that is bounded.
fn bound_s(policy: LinkLoss, finish_s: f64, for_s: Option<f64>) -> Option<f64> {
    let bound = match policy {
        LinkLoss::Finish => Some(finish_s),
        LinkLoss::Halt => None,
    };
    [bound, for_s].into_iter().flatten().reduce(f64::min)
}
