//! A session with the fleet: who is there, who should be, and requests that are asked until answered.

use crate::context::Context;
use crate::error::{Failure, Kind, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};
use xtb_authority::operator::{ASK_AGAIN_MS, Operator, Step};
use xtb_bus::{Bus, BusError, Incoming, Role};
use xtb_control::Stamp;
use xtb_protocol::keys::{FleetKeys, Key, RobotKeys};
use xtb_protocol::messages::{
    About, Body, Done, Message, Outcome, RejectCode, Reply, Request, RobotState, Roster, RosterEntry,
    SimStats,
};
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

    /// The fleet's name.
    #[must_use]
    pub fn fleet(&self) -> &Name {
        &self.shared.ctx.fleet
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
        let entries = self.roster_entries(expect).await?;
        Ok(entries.map(|entries| entries.into_iter().map(|entry| entry.name).collect()))
    }

    /// The same with tags and start poses, as far as the config or the simulator gives them.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn roster_entries(&self, expect: &[Name]) -> Result<Option<Vec<RosterEntry>>> {
        let told = self.told_entries(expect);
        if !told.is_empty() {
            return Ok(Some(told));
        }
        self.simulated().await
    }

    /// The robots that the fleet's simulator has; `None` = there is none.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub(crate) async fn simulated(&self) -> Result<Option<Vec<RosterEntry>>> {
        let answers = self.get(&self.keys().sim_roster()).await?;
        let rosters: Vec<Roster> = answers.iter().filter_map(read).collect();
        if rosters.is_empty() {
            return Ok(None);
        }
        Ok(Some(rosters.into_iter().flat_map(|roster| roster.robots).collect()))
    }

    /// How the fleet's simulator runs; `None` = there is none. Asked once: most fleets have none, and
    /// must not wait for it.
    ///
    /// # Errors
    /// [`Kind::Failed`] if the question could not be sent.
    pub async fn sim_stats(&self) -> Result<Option<SimStats>> {
        let answers = self.bus().get(&self.keys().sim_stats(), self.shared.ctx.timeout).await?;
        Ok(answers.iter().find_map(read))
    }

    /// The roster that is known without asking anybody: `expect`, else the config's; empty = none is.
    #[must_use]
    pub fn told_roster(&self, expect: &[Name]) -> BTreeSet<Name> {
        self.told_entries(expect).into_iter().map(|entry| entry.name).collect()
    }

    pub(crate) fn told_entries(&self, expect: &[Name]) -> Vec<RosterEntry> {
        let known = &self.shared.ctx.robots;
        if expect.is_empty() {
            return known.clone();
        }
        let entry = |name: &Name| {
            let bare = || RosterEntry { name: name.clone(), tags: Vec::new(), start_pose: None };
            known.iter().find(|entry| entry.name == *name).cloned().unwrap_or_else(bare)
        };
        expect.iter().map(entry).collect()
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

    /// Everybody's answers on `selector`.
    pub(crate) async fn get(&self, selector: &str) -> std::result::Result<Vec<Incoming>, BusError> {
        get(self.bus(), selector, self.shared.ctx.timeout).await
    }

    /// Asks a robot for something that needs no lease.
    ///
    /// # Errors
    /// [`Kind::Refused`], [`Kind::OutcomeUnknown`], or [`Kind::Usage`] if the request is not valid.
    pub async fn request(&self, robot: &Name, body: Body) -> Result<Done> {
        let reply = self.carry_out(robot, &Operator::default(), Uuid::new_v4(), body).await?;
        accepted(robot, &reply)
    }

    /// Asks, and asks again with the same id while nobody answers or the robot has no room for the
    /// request, until `--timeout` is up.
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
        let mut turned_away = 0;
        loop {
            match call.step(self.now()) {
                Step::Ask(request) => {
                    match self.ask_once(robot, &request).await?.map_or(Answer::Missing, Answer::of) {
                        Answer::Settled(reply) => return Ok(reply),
                        Answer::TurnedAway => turned_away += 1,
                        Answer::Missing => {}
                    }
                    call.unanswered(self.now());
                }
                Step::Wait(until) => {
                    let nap = until.ns().saturating_sub(self.now().ns());
                    tokio::time::sleep(Duration::from_nanos(nap)).await;
                }
                Step::GiveUp { asked } => return Err(self.no_answer(robot, asked, turned_away)),
            }
        }
    }

    async fn ask_once(&self, robot: &Name, request: &Request) -> Result<Option<Reply>> {
        let keys = self.keys().robot(robot);
        let within = Duration::from_millis(ASK_AGAIN_MS).min(self.shared.ctx.timeout);
        match self.bus().ask(&keys, self.name(), request, within).await {
            Ok(reply) => Ok(reply),
            Err(error @ BusError::Operation { .. }) => {
                tracing::debug!("{error}");
                Ok(None)
            }
            Err(error) => Err(error.into()),
        }
    }

    fn no_answer(&self, robot: &Name, asked: u32, turned_away: u32) -> Failure {
        let Context { timeout, fleet, .. } = &self.shared.ctx;
        let seconds = timeout.as_secs_f64();
        let (how, hint) = match turned_away {
            0 => (
                format!("does not answer ({asked} times in {seconds} s)"),
                "`fleet-cli list` shows who is there",
            ),
            _ => (
                format!("is overloaded (it turned away {turned_away} of {asked} requests in {seconds} s)"),
                "too many clients ask it for too much: end some of them, or wait longer with --timeout",
            ),
        };
        let message = format!("{robot} of fleet {fleet} {how}: outcome unknown");
        Failure::new(Kind::OutcomeUnknown, message).hint(hint)
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

/// Everybody's answers on `selector`; asked for once more if there are none at once.
pub(crate) async fn get(
    bus: &Bus,
    selector: &str,
    within: Duration,
) -> std::result::Result<Vec<Incoming>, BusError> {
    let asked = Instant::now();
    let answers = bus.get(selector, within).await?;
    if !answers.is_empty() || asked.elapsed() >= within {
        return Ok(answers);
    }
    tokio::time::sleep(SETTLE).await;
    bus.get(selector, within).await
}

/// What came back for one ask.
#[derive(Debug, PartialEq)]
enum Answer {
    /// The robot's word; asking again would change nothing.
    Settled(Reply),
    /// The robot had no room for the request: it was not looked at.
    TurnedAway,
    /// Nothing.
    Missing,
}

impl Answer {
    fn of(reply: Reply) -> Self {
        match &reply.result {
            Outcome::Error(error) if error.code == RejectCode::Overloaded => Self::TurnedAway,
            _ => Self::Settled(reply),
        }
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

#[cfg(test)]
impl Client {
    /// What it was opened with.
    pub(crate) fn context(&self) -> &Context {
        &self.shared.ctx
    }

    /// A client `me` of fleet `lab` on a session of its own, in which a test plays the robots.
    pub(crate) async fn alone(timeout: Duration) -> Self {
        let own = |text: &str| Name::new(text).unwrap();
        let ctx = Context {
            connect: Vec::new(),
            connect_given: false,
            fleet: own("lab"),
            client: own("me"),
            timeout,
            robots: Vec::new(),
            out: crate::Output { json: true, colors: false },
        };
        let role = Role::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        Self::on(&ctx, xtb_bus::open(&role).await.unwrap())
    }
}

#[cfg(test)]
mod tests;
