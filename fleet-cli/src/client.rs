//! A session with the fleet: who is there, who should be, and requests that are asked until answered.

use crate::context::Context;
use crate::error::{Failure, Kind, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_authority::operator::{ASK_AGAIN_MS, Call, Operator, Step};
use xtb_bus::{Bus, BusError, Incoming, Role};
use xtb_control::Stamp;
use xtb_protocol::keys::{FleetKeys, Key, RobotKeys};
use xtb_protocol::messages::{About, Body, Done, Message, Outcome, Reply, Request, RobotState, Roster};
use xtb_protocol::{Name, Uuid};

/// A state older than this is stale: it is not shown as if it were the present one.
pub const STALE: Duration = Duration::from_millis(500);
/// Right after a session opens or a link returns, a query can come back at once without a reply
/// (Zenoh issue 2767): an empty answer is asked for once more, this much later.
const SETTLE: Duration = Duration::from_millis(150);

/// A state and when it arrived.
#[derive(Debug, Clone, PartialEq)]
pub struct Seen {
    /// What the robot said.
    pub state: RobotState,
    /// When.
    pub at: Instant,
}

impl Seen {
    /// How long ago it arrived.
    #[must_use]
    pub fn age(&self) -> Duration {
        self.at.elapsed()
    }

    /// The state, unless it is stale.
    #[must_use]
    pub fn fresh(&self) -> Option<&RobotState> {
        (self.age() <= STALE).then_some(&self.state)
    }
}

/// An open session. Clones share it.
#[derive(Debug, Clone)]
pub struct Client {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    bus: Bus,
    keys: FleetKeys,
    ctx: Context,
    began: Instant,
}

impl Client {
    /// Opens a session, trying for as long as `--timeout` says.
    ///
    /// # Errors
    /// [`Kind::NoRouter`] or, for an endpoint that is none, [`Kind::Usage`].
    pub async fn open(ctx: &Context) -> Result<Self> {
        let role = Role::Client { connect: ctx.connect.clone() };
        let opening = xtb_bus::open_patiently(&role, |error| tracing::debug!("{error}"));
        match tokio::time::timeout(ctx.timeout, opening).await {
            Ok(opened) => Ok(Self::on(ctx, opened?)),
            Err(_) => {
                let tried = ctx.connect.join(", ");
                let seconds = ctx.timeout.as_secs_f64();
                Err(Failure::new(
                    Kind::NoRouter,
                    format!("No router answers at {tried} (tried for {seconds} s)"),
                )
                .hint(
                    "start `fleet-cli sim` or `fleet-cli router`, \
                         or name a router with --connect or XTB_CONNECT",
                ))
            }
        }
    }

    /// A client on a session that is open already.
    #[must_use]
    pub fn on(ctx: &Context, bus: Bus) -> Self {
        let keys = FleetKeys::new(ctx.fleet.clone());
        Self { shared: Arc::new(Shared { bus, keys, ctx: ctx.clone(), began: Instant::now() }) }
    }

    /// The session.
    #[must_use]
    pub fn bus(&self) -> &Bus {
        &self.shared.bus
    }

    /// The fleet's keys.
    #[must_use]
    pub fn keys(&self) -> &FleetKeys {
        &self.shared.keys
    }

    /// This client's name.
    #[must_use]
    pub fn name(&self) -> &Name {
        &self.shared.ctx.client
    }

    /// Time since this client began.
    #[must_use]
    pub fn now(&self) -> Stamp {
        Stamp::from_ns(u64::try_from(self.shared.began.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    /// Closes the session.
    pub async fn close(self) {
        self.shared.bus.clone().close().await;
    }

    /// Which robots should be there: `expect`, else the config's, else the simulator's own roster.
    /// `None` = nobody knows.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn roster(&self, expect: &[Name]) -> Result<Option<BTreeSet<Name>>> {
        if !expect.is_empty() {
            return Ok(Some(expect.iter().cloned().collect()));
        }
        let configured = &self.shared.ctx.robots;
        if !configured.is_empty() {
            return Ok(Some(configured.iter().map(|entry| entry.name.clone()).collect()));
        }
        let answers = self.get(&self.keys().sim_roster()).await?;
        let rosters: Vec<Roster> = answers.iter().filter_map(read).collect();
        if rosters.is_empty() {
            return Ok(None);
        }
        Ok(Some(rosters.into_iter().flat_map(|roster| roster.robots).map(|entry| entry.name).collect()))
    }

    /// The robots that are there now.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn alive(&self) -> Result<BTreeSet<Name>> {
        let key_expr = self.keys().any_robot().alive();
        let keys = self.bus().alive(&key_expr, self.shared.ctx.timeout).await?;
        Ok(keys.iter().filter_map(|key| Key::parse(key)?.robot).collect())
    }

    /// The states of the robots behind `keys`.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn states(&self, keys: &RobotKeys) -> Result<BTreeMap<Name, Seen>> {
        let answers = self.get(&keys.state()).await?;
        let at = Instant::now();
        let states = answers.iter().filter_map(read::<RobotState>);
        Ok(states.map(|state| (state.robot.clone(), Seen { state, at })).collect())
    }

    /// A robot's factsheet, if it answers.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn about(&self, robot: &Name) -> Result<Option<About>> {
        Ok(self.get(&self.keys().robot(robot).about()).await?.iter().find_map(read))
    }

    async fn get(&self, selector: &str) -> Result<Vec<Incoming>> {
        let within = self.shared.ctx.timeout;
        let asked = Instant::now();
        let answers = self.bus().get(selector, within).await?;
        if !answers.is_empty() || asked.elapsed() >= within {
            return Ok(answers);
        }
        tokio::time::sleep(SETTLE).await;
        Ok(self.bus().get(selector, within).await?)
    }

    /// Asks a robot for something that needs no lease.
    ///
    /// # Errors
    /// [`Kind::Refused`], [`Kind::OutcomeUnknown`], or [`Kind::Usage`] if the request is not valid.
    pub async fn request(&self, robot: &Name, body: Body) -> Result<Done> {
        let reply = self.carry_out(robot, &Operator::default(), Uuid::new_v4(), body).await?;
        accepted(robot, &reply)
    }

    /// Asks, and asks again with the same id while nobody answers, until `--timeout` is up.
    pub(crate) async fn carry_out(
        &self,
        robot: &Name,
        operator: &Operator,
        id: Uuid,
        body: Body,
    ) -> Result<Reply> {
        Request { id, lease: None, body: body.clone() }
            .validate()
            .map_err(|error| Failure::new(Kind::Usage, error.to_string()))?;
        let began = self.now();
        let give_up = began.plus_ns(u64::try_from(self.shared.ctx.timeout.as_nanos()).unwrap_or(u64::MAX));
        let mut call = operator.call(id, body, began, give_up);
        loop {
            match call.step(self.now()) {
                Step::Ask(request) => {
                    if let Some(reply) = self.ask_once(robot, &request, &mut call).await? {
                        return Ok(reply);
                    }
                }
                Step::Wait(until) => {
                    let nap = until.ns().saturating_sub(self.now().ns());
                    tokio::time::sleep(Duration::from_nanos(nap)).await;
                }
                Step::GiveUp { asked } => return Err(self.no_answer(robot, asked)),
            }
        }
    }

    async fn ask_once(&self, robot: &Name, request: &Request, call: &mut Call) -> Result<Option<Reply>> {
        let keys = self.keys().robot(robot);
        let within = Duration::from_millis(ASK_AGAIN_MS).min(self.shared.ctx.timeout);
        match self.bus().ask(&keys, self.name(), request, within).await {
            Ok(Some(reply)) => return Ok(Some(reply)),
            Ok(None) => {}
            Err(error @ BusError::Operation { .. }) => tracing::debug!("{error}"),
            Err(error) => return Err(error.into()),
        }
        call.unanswered(self.now());
        Ok(None)
    }

    fn no_answer(&self, robot: &Name, asked: u32) -> Failure {
        let Context { timeout, fleet, .. } = &self.shared.ctx;
        let seconds = timeout.as_secs_f64();
        let message = format!(
            "{robot} of fleet {fleet} does not answer ({asked} times in {seconds} s): outcome unknown"
        );
        Failure::new(Kind::OutcomeUnknown, message).hint("`fleet-cli list` shows who is there")
    }

    /// What to say when nobody is there.
    #[must_use]
    pub fn nobody(&self) -> Failure {
        let Context { connect, fleet, .. } = &self.shared.ctx;
        let message =
            format!("No robot answers: the router at {} knows no robot of fleet {fleet}", connect.join(", "));
        Failure::new(Kind::NoRobot, message).hint(
            "start `fleet-cli sim` or, on a robot, `robot-agent`; \
             another fleet is named with --fleet, another router with --connect",
        )
    }
}

/// What a reply gave.
pub(crate) fn accepted(robot: &Name, reply: &Reply) -> Result<Done> {
    match &reply.result {
        Outcome::Ok(done) => Ok(*done),
        Outcome::Error(error) => Err(Failure::refused(robot, error)),
    }
}

/// An answer that can be read; one that cannot is logged and counts as none.
fn read<M: Message>(answer: &Incoming) -> Option<M> {
    answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
}
