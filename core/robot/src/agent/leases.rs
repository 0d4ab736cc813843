//! The lease: who may command now, who takes it, and what ends with it.

use super::Agent;
use super::requests::{Outcome, Refusal};
use crate::authority::admission::Admission;
use crate::authority::guard::Guard;
use crate::authority::lease::LeaseBook;
use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Body, Done, EventKind, GoalStatus, Lease, LinkLoss, RejectCode, Reply, Request, StopReason,
};

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
    /// Whether a request bears the present lease.
    pub(super) fn has_lease(&self, now: Stamp, client: &Name, request: &Request) -> bool {
        // What waited in the queue until its lease had run out comes too late.
        let alive = self.lease.silent_ms(now).is_some_and(|ms| ms < self.limits.lease_free_ms)
            || !self.guards.on(Guard::LeaseExpiry);
        alive && request.lease.is_some_and(|lease| self.lease.is_present(client, lease))
    }

    /// The present lease, where one is needed. That its holder lives is told by [`Agent::heard`] from the door,
    /// with the time when the message came in, not the time when its turn came.
    pub(super) fn check_lease(
        &mut self,
        now: Stamp,
        client: &Name,
        request: &Request,
    ) -> Result<(), Refusal> {
        let present = self.has_lease(now, client, request);
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

    /// Grants the lease under a new root. Whoever held it before is fenced from here on.
    pub(super) fn acquire(&mut self, now: Stamp, client: &Name, take: bool) -> Outcome {
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
    pub(super) fn control_passes(&mut self, now: Stamp, because: StopReason, words: &str) {
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

    /// The holder was heard at the door, whatever becomes of its message.
    pub fn heard(&mut self, at: Stamp, lease: Lease) {
        let alive = self.lease.silent_ms(at).is_some_and(|ms| ms < self.limits.lease_free_ms)
            || !self.guards.on(Guard::LeaseExpiry);
        if alive && self.lease.present() == Some(lease) {
            self.lease.heard(at);
        }
    }

    /// A request that was granted the present lease came again: its client lives, and does not know of the grant
    /// yet. On a link with a round trip of a second the lease would run out before the first retain.
    pub(super) fn heard_again(&mut self, now: Stamp, reply: &Reply) {
        if let xtb_protocol::messages::Outcome::Ok(Done { lease: Some(lease), .. }) = &reply.result {
            self.heard(now, *lease);
        }
    }

    /// A lease that nobody retains becomes free.
    pub(super) fn watch_lease(&mut self, now: Stamp) {
        let silent = self.lease.silent_ms(now).is_some_and(|ms| ms >= self.limits.lease_free_ms);
        if silent && self.guards.on(Guard::LeaseExpiry) && self.lease.free() {
            self.emit(now, EventKind::Lease { holder: None });
        }
    }

    /// The lease's book.
    #[must_use]
    pub fn lease(&self) -> &LeaseBook {
        &self.lease
    }

    /// Whose messages may come in now.
    #[must_use]
    pub fn admission(&self) -> Admission {
        if !self.guards.on(Guard::LeaseFence) || !self.guards.on(Guard::LeaseRequired) {
            return Admission::Anyone;
        }
        match (self.lease.holder(), self.lease.present()) {
            (Some(holder), Some(lease)) => Admission::Holder(holder.clone(), lease),
            _ => Admission::Nobody,
        }
    }
}
