//! The client's side of authority: acquire, retain, release, and asking again.
//!
//! Zero replies mean *outcome unknown* (access denied, link lost), so a request keeps its id and is
//! asked again until it is answered or its time is up: the robot does nothing twice.

use crate::authority::lease::{LEASE_FREE_MS, LINK_LOSS_MS};
use xtb_control::Stamp;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{Body, Lease, Outcome, RejectCode, Reply, Request, Setpoint};

/// A lease is retained this often: five are missing before a goal that halts ends.
pub const RETAIN_MS: u64 = 100;
/// An unanswered request is asked again after this long, four times within the usual 2 s; chosen, not
/// measured.
pub const ASK_AGAIN_MS: u64 = 500;
/// An `acquire` sooner, however long its answer takes: the repetition keeps the lease that the first one was
/// granted, until retains take over; four times before it would be free again.
pub const ACQUIRE_AGAIN_MS: u64 = 200;
const _: () = assert!(5 * RETAIN_MS <= LINK_LOSS_MS && 4 * ACQUIRE_AGAIN_MS < LEASE_FREE_MS);

/// One request on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Call {
    request: Request,
    give_up: Stamp,
    next_ask: Stamp,
    again_ms: u64,
    asked: u32,
}

/// What to do about a call now.
#[derive(Debug, Clone, PartialEq)]
pub enum CallStep {
    /// Send this.
    Ask(Request),
    /// Nothing before then.
    Wait(Stamp),
    /// Its time is up: whether the robot did it is unknown.
    GiveUp {
        /// How often it was asked.
        asked: u32,
    },
}

impl Call {
    /// On a slow link asked again only after this long; an `acquire` at its own pace.
    #[must_use]
    pub fn again_after(self, ms: u64) -> Self {
        let acquires = matches!(self.request.body, Body::Acquire { .. });
        Self { again_ms: if acquires { ACQUIRE_AGAIN_MS } else { ms }, ..self }
    }

    /// What to do at `now`.
    pub fn step(&mut self, now: Stamp) -> CallStep {
        if now >= self.give_up {
            return CallStep::GiveUp { asked: self.asked };
        }
        if now < self.next_ask {
            return CallStep::Wait(self.next_ask.min(self.give_up));
        }
        self.asked += 1;
        self.next_ask = now.plus_ms(self.again_ms);
        CallStep::Ask(self.request.clone())
    }

    /// Nothing came back before the transport gave up: ask again as soon as this.
    pub fn unanswered(&mut self, now: Stamp) {
        self.next_ask = self.next_ask.min(now.plus_ms(ASK_AGAIN_MS / 5));
    }
}

/// A client's standing with one robot.
#[derive(Debug, Clone, Default)]
pub struct Operator {
    lease: Option<Lease>,
    next_retain: Stamp,
    /// Why the lease that was held is not any more, in the robot's words.
    lost: Option<String>,
    /// The robot's tick as last seen.
    tick_ms: Option<u64>,
    /// Number of the last setpoint under the present grant.
    seq: u64,
}

impl Operator {
    /// A request with the lease that is held, to be answered before `give_up`.
    #[must_use]
    pub fn call(&self, id: Uuid, body: Body, now: Stamp, give_up: Stamp) -> Call {
        let request = Request { id, lease: self.lease, body };
        Call { request, give_up, next_ask: now, again_ms: ASK_AGAIN_MS, asked: 0 }
    }

    /// The lease that is held.
    #[must_use]
    pub fn lease(&self) -> Option<Lease> {
        self.lease
    }

    /// Whether a lease was held and is not any more.
    #[must_use]
    pub fn has_lost(&self) -> bool {
        self.lost.is_some()
    }

    /// Why it is not, in the robot's words.
    #[must_use]
    pub fn lost_because(&self) -> Option<&str> {
        self.lost.as_deref()
    }

    /// A state of the robot arrived: what setpoints answer to.
    pub fn saw(&mut self, tick_ms: u64) {
        self.tick_ms = Some(tick_ms);
    }

    /// A reply arrived: a lease in it is now held, a lost one is dropped.
    pub fn replied(&mut self, now: Stamp, reply: &Reply) {
        match &reply.result {
            Outcome::Ok(done) => {
                if let Some(lease) = done.lease {
                    (self.lease, self.lost, self.seq) = (Some(lease), None, 0);
                    self.next_retain = now.plus_ms(RETAIN_MS);
                }
            }
            Outcome::Error(error) if error.code == RejectCode::LeaseLost => {
                if self.lease.take().is_some() {
                    self.lost = Some(error.message.clone());
                }
            }
            Outcome::Error(_) => {}
        }
    }

    /// The body of a request that is due now to keep the lease.
    pub fn retain(&mut self, now: Stamp) -> Option<Body> {
        (self.lease.is_some() && now >= self.next_retain).then(|| {
            self.next_retain = now.plus_ms(RETAIN_MS);
            Body::Retain {}
        })
    }

    /// The next setpoint; `None` without a lease, or before a state of the robot was seen.
    pub fn setpoint(&mut self, rpm: f64, steering: f64) -> Option<Setpoint> {
        let (Some(lease), Some(tick_ms)) = (self.lease, self.tick_ms) else { return None };
        self.seq += 1;
        Some(Setpoint { lease: Some(lease), seq: self.seq, echo_tick_ms: Some(tick_ms), rpm, steering })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::Done;

    #[test]
    fn a_call_is_asked_again_with_the_same_id_until_its_time_is_up() {
        let id = Uuid::from_u128(7);
        let mut call = Operator::default().call(id, Body::Stop {}, Stamp::ZERO, Stamp::from_ms(1200));
        let mut asks = 0;
        for ms in 0..1200 {
            if let CallStep::Ask(request) = call.step(Stamp::from_ms(ms)) {
                assert_eq!(request.id, id);
                asks += 1;
            }
        }
        assert_eq!(asks, 3);
        assert_eq!(call.step(Stamp::from_ms(1200)), CallStep::GiveUp { asked: 3 });
    }

    #[test]
    fn on_a_slow_link_it_is_asked_less_often_but_an_acquire_keeps_its_pace() {
        let asks = |body: Body| {
            let end = Stamp::from_ms(1200);
            let mut call = Operator::default().call(Uuid::nil(), body, Stamp::ZERO, end).again_after(1000);
            (0..1200).filter(|ms| matches!(call.step(Stamp::from_ms(*ms)), CallStep::Ask(_))).count()
        };
        assert_eq!(asks(Body::Stop {}), 2);
        assert_eq!(asks(Body::Acquire { take: false }), 6);
    }

    fn granted() -> Reply {
        Reply::done(Uuid::nil(), Done { lease: Some(Lease { epoch: 1, root: 2 }), goal: None })
    }

    #[test]
    fn a_lease_is_retained_every_100_ms_until_it_is_lost() {
        let mut operator = Operator::default();
        assert_eq!(operator.retain(Stamp::from_ms(500)), None);
        operator.replied(Stamp::from_ms(1000), &granted());
        let retains: Vec<u64> =
            (1000..1350).filter(|ms| operator.retain(Stamp::from_ms(*ms)).is_some()).collect();
        assert_eq!(retains, [1100, 1200, 1300]);
        let refused = Reply::refused(Uuid::nil(), RejectCode::LeaseLost, "held by cli-7", "");
        operator.replied(Stamp::from_ms(1350), &refused);
        assert_eq!((operator.has_lost(), operator.lost_because()), (true, Some("held by cli-7")));
        assert_eq!(operator.retain(Stamp::from_ms(9000)), None);
    }

    #[test]
    fn setpoints_bear_the_lease_count_from_one_in_each_grant_and_answer_the_last_state() {
        let mut operator = Operator::default();
        operator.replied(Stamp::ZERO, &granted());
        assert_eq!(operator.setpoint(1.0, 0.0), None, "no state was seen");
        operator.saw(77);
        let seqs: Vec<_> = (0..3).filter_map(|_| operator.setpoint(1.0, 0.0)).map(|s| s.seq).collect();
        assert_eq!(seqs, [1, 2, 3]);
        operator.replied(Stamp::ZERO, &granted());
        let next = operator.setpoint(1.0, 0.5).unwrap();
        assert_eq!((next.seq, next.echo_tick_ms, next.lease.unwrap().root), (1, Some(77), 2));
    }
}
