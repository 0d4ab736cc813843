//! Requests to a robot, asked until they are answered.

use super::{Client, accepted};
use crate::error::{Error, ErrorKind, Result};
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use xtb_bus::{BusError, Incoming};
use xtb_identity::Action;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{Body, Done, Message, Outcome, RejectCode, Reply, Request};
use xtb_protocol::{Name, Uuid};
use xtb_robot::operator::{CallStep, Operator};

/// The same request on its way at most so often; its answers are not waited for one by one.
const IN_FLIGHT: usize = 32;
/// Who else answers in a robot's name is heard this long after the first answer.
const LINGER: Duration = Duration::from_millis(30);

impl Client {
    /// Asks a robot for something that needs no lease.
    ///
    /// # Errors
    /// [`ErrorKind::Refused`], [`ErrorKind::OutcomeUnknown`], [`ErrorKind::Invalid`] if the request is not valid, or
    /// [`ErrorKind::NotAllowed`].
    pub async fn request(&self, robot: &Name, body: Body) -> Result<Done> {
        let reply = self.carry_out(robot, &Operator::default(), Uuid::new_v4(), body).await?;
        accepted(robot, &reply)
    }

    /// Asks, and asks again with the same id while nobody answers or the robot has no room for the
    /// request, until `--timeout` is up, or longer on a slow link. An answer counts however late: it is not
    /// waited for before the request is repeated.
    pub async fn carry_out(&self, robot: &Name, operator: &Operator, id: Uuid, body: Body) -> Result<Reply> {
        let mut replies =
            self.carry_out_heard(robot, operator, id, body, (self.patience(), Duration::ZERO)).await?;
        Ok(replies.swap_remove(0))
    }

    /// The same for `later` longer, with whatever else is answered in the robot's name: one reply, unless there are
    /// two programs.
    pub(crate) async fn carry_out_all(
        &self,
        robot: &Name,
        id: Uuid,
        body: Body,
        later: Duration,
    ) -> Result<Vec<Reply>> {
        let linger = LINGER.max(self.round_trip().bound() / 4);
        let patience = self.patience() + later;
        self.carry_out_heard(robot, &Operator::default(), id, body, (patience, linger)).await
    }

    /// The same of every robot that hears it, each of which answers on its own key; `each` gets their replies as they
    /// come, but none of those who have no room for it.
    pub(crate) async fn carry_out_by_all(
        &self,
        id: Uuid,
        body: Body,
        within: Duration,
        mut each: impl FnMut(Name, Reply),
    ) -> Result<()> {
        self.may(Action::Drive)?;
        let (key_expr, channel) =
            (self.keys().any_robot().cmd(Some(self.name())), Channel::Cmd(self.name().clone()));
        let request = Request { id, lease: None, body };
        let each = |answer: Incoming| {
            let robot = Key::parse(&answer.key).and_then(|key| key.robot);
            if let (Some(robot), Some(reply)) = (robot, super::read::<Reply>(&answer))
                && !is_turned_away(&reply)
            {
                each(robot, reply);
            }
        };
        Ok(self.bus().ask_each(&key_expr, &channel, &request, within, each).await?)
    }

    /// At least one reply.
    async fn carry_out_heard(
        &self,
        robot: &Name,
        operator: &Operator,
        id: Uuid,
        body: Body,
        (patience, linger): (Duration, Duration),
    ) -> Result<Vec<Reply>> {
        self.may(Action::Drive)?;
        Request { id, lease: None, body: body.clone() }
            .validate()
            .map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
        let began = self.now();
        let give_up = began.plus_ns(u64::try_from(patience.as_nanos()).unwrap_or(u64::MAX));
        let again_ms = u64::try_from(self.round_trip().ask_again().as_millis()).unwrap_or(u64::MAX);
        let mut call = operator.call(id, body, began, give_up).again_after(again_ms);
        let (mut turned_away, mut asking) = (0, JoinSet::new());
        loop {
            let until = match call.step(self.now()) {
                CallStep::Ask(request) => {
                    if asking.len() < IN_FLIGHT {
                        let left = Duration::from_nanos(give_up.ns().saturating_sub(self.now().ns()));
                        asking.spawn(self.clone().ask_once(robot.clone(), request, left, linger));
                    }
                    continue;
                }
                CallStep::Wait(until) => until,
                CallStep::GiveUp { asked } => {
                    let error = self.no_answer(robot, patience, asked, turned_away);
                    return Err(self.explained(error).await);
                }
            };
            let nap = Duration::from_nanos(until.ns().saturating_sub(self.now().ns()));
            tokio::select! {
                biased;
                Some(asked) = asking.join_next() => {
                    let replies = asked.map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))??;
                    match Answer::of(replies) {
                        Answer::Settled(replies) => return Ok(replies),
                        Answer::TurnedAway => turned_away += 1,
                        Answer::Missing => {}
                    }
                    call.unanswered(self.now());
                }
                () = tokio::time::sleep(nap) => {}
            }
        }
    }

    async fn ask_once(
        self,
        robot: Name,
        request: Request,
        within: Duration,
        linger: Duration,
    ) -> Result<Vec<Reply>> {
        let (keys, asked) = (self.keys().robot(&robot), Instant::now());
        match self.bus().ask_all(&keys, self.name(), &request, within, linger).await {
            Ok(replies) => {
                if linger.is_zero() && !replies.is_empty() {
                    self.measured(asked.elapsed());
                }
                Ok(replies)
            }
            Err(error @ BusError::Operation { .. }) => {
                tracing::debug!("{error}");
                Ok(Vec::new())
            }
            Err(error) => Err(error.into()),
        }
    }

    fn no_answer(&self, robot: &Name, patience: Duration, asked: u32, turned_away: u32) -> Error {
        let fleet = self.fleet();
        let seconds = (patience.as_secs_f64() * 10.0).round() / 10.0;
        let (how, hint) = match turned_away {
            0 => (
                format!("does not answer ({asked} requests in {seconds} s)"),
                "`fleet-cli list` shows the robots present",
            ),
            _ => (
                format!("is overloaded (it rejected {turned_away} of {asked} requests in {seconds} s)"),
                "too many requests from clients: end some clients, or wait longer with --timeout",
            ),
        };
        let message = format!("{robot} of fleet {fleet} {how}: outcome unknown");
        Error::new(ErrorKind::OutcomeUnknown, message).hint(hint)
    }
}

/// What came back for one ask.
#[derive(Debug, PartialEq)]
pub(super) enum Answer {
    /// The robot's word; asking again would change nothing.
    Settled(Vec<Reply>),
    /// The robot had no room for the request: it was not looked at.
    TurnedAway,
    /// Nothing.
    Missing,
}

impl Answer {
    pub(super) fn of(replies: Vec<Reply>) -> Self {
        match replies.as_slice() {
            [] => Self::Missing,
            all if all.iter().all(is_turned_away) => Self::TurnedAway,
            _ => Self::Settled(replies),
        }
    }
}

fn is_turned_away(reply: &Reply) -> bool {
    matches!(&reply.result, Outcome::Error(error) if error.code == RejectCode::Overloaded)
}
