//! A session with the fleet: who is there, who should be, and requests that are asked until answered.

mod admission;
mod no_link;
mod requests;

use crate::error::{Error, ErrorKind, Result};
use crate::settings::Settings;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use tokio::task::JoinSet;
use xtb_bus::{Bus, BusError, Enrolled, Incoming, Opening, SessionRole};
use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::keys::{FleetKeys, Key, RobotKeys};
use xtb_protocol::messages::{
    About, Done, MAX_ROSTER, Message, Outcome, Reply, RobotState, Roster, RosterEntry, SimStats,
};
use xtb_robot::RoundTrip;
use xtb_robot::round_trip::PATIENCE_MOST;

/// A state older than this is stale: it is not shown as if it were the present one.
pub const STALE: Duration = Duration::from_millis(500);
/// Right after a session opens or a link returns, a query can come back at once without a reply
/// (Zenoh issue 2767): an empty answer is asked for once more, this much later.
const SETTLE: Duration = Duration::from_millis(150);
/// A first attempt to open a session that has not failed by `--timeout` is waited for this many times as long:
/// its handshake takes two round trips.
const OPENING_TAKES: u32 = 3;
/// The cause is looked for once an attempt has failed, or has taken so long.
const LOOK_AFTER: Duration = Duration::from_secs(1);
/// An opening handshake that took longer than this says something of the link, not only of this computer.
const SLOW_HANDSHAKE: Duration = Duration::from_millis(300);

/// Answers that are kept of one robot that was asked by name: it gives one, and the fleet's are kept all at once.
const VOICES: usize = 8;

/// A state and when it arrived.
#[derive(Debug, Clone, PartialEq)]
pub struct LastState {
    /// What the robot said.
    pub state: RobotState,
    /// When.
    pub at: Instant,
}

impl LastState {
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
    settings: Settings,
    began: Instant,
    link: Mutex<RoundTrip>,
    asking: Option<admission::Asking>,
}

impl Client {
    /// Opens a session, trying for as long as `--timeout` says. What will not get better by trying again is told at
    /// once.
    ///
    /// # Errors
    /// [`ErrorKind::NoRouter`], [`ErrorKind::NotAdmitted`] or, for an endpoint that is none, [`ErrorKind::Invalid`].
    pub async fn open(settings: &Settings) -> Result<Self> {
        let role = SessionRole::Client { connect: settings.connect.clone() };
        let session = Opening::of(role).tls(settings.identity.as_ref().map(Enrolled::tls));
        let (began, failed) = (Instant::now(), Notify::new());
        let has_failed = AtomicBool::new(false);
        let opening = session.patiently(|error| {
            has_failed.store(true, Ordering::Relaxed);
            failed.notify_one();
            tracing::debug!("{error}");
        });
        let cause = no_link::Cause::default();
        let looking = async {
            // Where TLS meets none, the first attempt may take longer than anybody waits.
            let _ = tokio::time::timeout(LOOK_AFTER, failed.notified()).await;
            cause.lasting(settings).await
        };
        let (mut opening, mut looking) = (pin!(opening), pin!(looking));
        let mut within = settings.timeout;
        let opened = loop {
            tokio::select! {
                biased;
                opened = &mut opening => break opened?,
                error = &mut looking => return Err(error),
                () = tokio::time::sleep_until((began + within).into()) => {
                    if has_failed.load(Ordering::Relaxed) || within > settings.timeout {
                        return Err(cause.error(settings, began.elapsed()));
                    }
                    within *= OPENING_TAKES;
                }
            }
        };
        let took = began.elapsed();
        let client = Self::asking(settings, opened, true);
        if took > SLOW_HANDSHAKE && !has_failed.load(Ordering::Relaxed) {
            client.measured(took / 2);
        }
        Ok(client)
    }

    /// A client on a session that is open already.
    #[must_use]
    pub fn on(settings: &Settings, bus: Bus) -> Self {
        Self::asking(settings, bus, false)
    }

    fn asking(settings: &Settings, bus: Bus, asks: bool) -> Self {
        let keys = FleetKeys::new(settings.fleet.clone());
        let (link, settings, began) = (Mutex::default(), settings.clone(), Instant::now());
        let identity = settings.identity.as_ref().filter(|_| asks).map(|enrolled| enrolled.identity.clone());
        let asking = identity.map(|own| admission::Asking::begin(bus.clone(), keys.clone(), own));
        Self { shared: Arc::new(Shared { bus, keys, settings, began, link, asking }) }
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

    /// What it was opened with.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.shared.settings
    }

    /// The fleet's name.
    #[must_use]
    pub fn fleet(&self) -> &Name {
        &self.shared.settings.fleet
    }

    /// This client's name.
    #[must_use]
    pub fn name(&self) -> &Name {
        &self.shared.settings.client
    }

    /// Time since this client began.
    #[must_use]
    pub fn now(&self) -> Stamp {
        Stamp::from_ns(u64::try_from(self.shared.began.elapsed().as_nanos()).unwrap_or(u64::MAX))
    }

    fn link(&self) -> MutexGuard<'_, RoundTrip> {
        self.shared.link.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The link to the robots, as far as it was measured.
    #[must_use]
    pub fn round_trip(&self) -> RoundTrip {
        *self.link()
    }

    /// An answer took this long.
    pub fn measured(&self, took: Duration) {
        self.link().measured(took);
    }

    /// How long to wait for an answer: `--timeout`, longer on a slow link.
    #[must_use]
    pub fn patience(&self) -> Duration {
        self.link().patience(self.shared.settings.timeout)
    }

    /// Closes the session.
    pub async fn close(self) {
        self.shared.bus.clone().close().await;
    }

    /// Which robots should be there: `expect`, else the config's, else the simulator's own roster.
    /// `None` = nobody knows.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn roster(&self, expect: &[Name]) -> Result<Option<BTreeSet<Name>>> {
        let entries = self.roster_entries(expect).await?;
        Ok(entries.map(|entries| entries.into_iter().map(|entry| entry.name).collect()))
    }

    /// The same with tags and start poses, as far as the config or the simulator gives them.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn roster_entries(&self, expect: &[Name]) -> Result<Option<Vec<RosterEntry>>> {
        let told = self.told_entries(expect);
        if !told.is_empty() {
            return Ok(Some(told));
        }
        self.simulated().await
    }

    /// The robots that the fleet's simulator has; `None` = there is none, or there are too many to be true.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn simulated(&self) -> Result<Option<Vec<RosterEntry>>> {
        let answers = self.get(&self.keys().sim_roster()).await?;
        let rosters: Vec<Roster> = answers.iter().filter_map(read).collect();
        if rosters.is_empty() {
            return Ok(None);
        }
        // Two simulators may each have some; what both name is one robot.
        let mut names = BTreeSet::new();
        let entries = rosters.into_iter().flat_map(|roster| roster.robots);
        let entries: Vec<RosterEntry> =
            entries.filter(|entry| names.insert(entry.name.clone())).take(MAX_ROSTER + 1).collect();
        if entries.len() > MAX_ROSTER {
            tracing::warn!("the rosters of this fleet name more than {MAX_ROSTER} robots: none is taken");
            return Ok(None);
        }
        Ok(Some(entries))
    }

    /// How the fleet's simulator runs, of several the slowest; `None` = there is none. Asked once: most fleets have
    /// none, and must not wait for it.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn sim_stats(&self) -> Result<Option<SimStats>> {
        let answers = self.bus().get(&self.keys().sim_stats(), self.shared.settings.timeout).await?;
        Ok(SimStats::slowest(answers.iter().filter_map(read)))
    }

    /// The roster that is known without asking anybody: `expect`, else the config's; empty = none is.
    #[must_use]
    pub fn told_roster(&self, expect: &[Name]) -> BTreeSet<Name> {
        self.told_entries(expect).into_iter().map(|entry| entry.name).collect()
    }

    /// The same with tags and start poses.
    #[must_use]
    pub fn told_entries(&self, expect: &[Name]) -> Vec<RosterEntry> {
        let known = &self.shared.settings.robots;
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
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn alive(&self) -> Result<BTreeSet<Name>> {
        let key_expr = self.keys().any_robot().alive();
        let keys = self.bus().alive(&key_expr, self.patience()).await?;
        Ok(keys.iter().filter_map(|key| Key::parse(key)?.robot).collect())
    }

    /// Whether this robot is there now.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if nobody can say so.
    pub async fn is_alive(&self, robot: &Name) -> Result<bool> {
        Ok(self.bus().is_alive(&self.keys().robot(robot).alive(), self.patience()).await?)
    }

    /// The states of the robots behind `keys`.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn states(&self, keys: &RobotKeys) -> Result<BTreeMap<Name, LastState>> {
        Ok(seen(&get_timed(self.bus(), &keys.state(), self.patience()).await?))
    }

    /// A robot's factsheet, if it answers.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn about(&self, robot: &Name) -> Result<Option<About>> {
        Ok(self.get(&self.keys().robot(robot).about()).await?.iter().find_map(read))
    }

    /// Everybody's answers on `selector`.
    pub async fn get(&self, selector: &str) -> std::result::Result<Vec<Incoming>, BusError> {
        get(self.bus(), selector, self.patience()).await
    }

    /// The answers of robots on one of their keys: everybody is asked at once, then by name those of `there` who
    /// have not answered.
    pub async fn get_each(
        &self,
        key: fn(&RobotKeys) -> String,
        there: &BTreeSet<Name>,
    ) -> std::result::Result<Vec<Incoming>, BusError> {
        let answers = get_timed(self.bus(), &key(&self.keys().any_robot()), self.patience()).await?;
        Ok(untimed(self.ask_the_silent(key, answers, there).await?))
    }

    /// Asks by name those of `there` who have not answered a question to all. (A wildcard reaches only those whom
    /// the routers on the way know to match it.)
    async fn ask_the_silent(
        &self,
        key: fn(&RobotKeys) -> String,
        mut answers: Vec<Timed>,
        there: &BTreeSet<Name>,
    ) -> std::result::Result<Vec<Timed>, BusError> {
        let answered: BTreeSet<Name> =
            answers.iter().filter_map(|(_, answer)| Key::parse(&answer.key)?.robot).collect();
        let mut asking = JoinSet::new();
        for robot in there.difference(&answered) {
            let (client, key) = (self.clone(), key(&self.keys().robot(robot)));
            asking.spawn(async move {
                let found = get_timed(client.bus(), &key, client.patience()).await?;
                Ok::<_, BusError>(found.into_iter().take(VOICES).collect::<Vec<_>>())
            });
        }
        while let Some(asked) = asking.join_next().await {
            match asked {
                Ok(found) => answers.extend(found?),
                Err(error) => tracing::error!("cannot query a robot by name: {error}"),
            }
        }
        Ok(answers)
    }

    /// Who is there, and the states of all, each with when it came; who does not answer a question to all is asked
    /// by name.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`] if the question could not be sent.
    pub async fn heard(&self) -> Result<(BTreeSet<Name>, BTreeMap<Name, LastState>)> {
        let any = self.keys().any_robot().state();
        let ask = || get_timed(self.bus(), &any, self.patience());
        let (alive, answers) = tokio::join!(self.alive(), ask());
        let alive = alive?;
        let asked = Instant::now();
        let mut answers = self.ask_the_silent(RobotKeys::state, answers?, &alive).await?;
        if asked.elapsed() > STALE / 2 {
            // Somebody took his time: the others' states have become old.
            answers.extend(ask().await?);
        }
        Ok((alive, seen(&answers)))
    }

    /// What to say when nobody is there.
    #[must_use]
    pub fn nobody(&self) -> Error {
        let Settings { connect, fleet, .. } = &self.shared.settings;
        let message =
            format!("No robot found: the router at {} knows no robot of fleet {fleet}", connect.join(", "));
        Error::new(ErrorKind::NoRobot, message).hint(
            "start `fleet-cli sim` or, on a robot, `robot-agent`; \
             --fleet selects another fleet, --connect another router",
        )
    }
}

/// Everybody's answers on `selector`; asked for once more if there are none at once. Silence for `within` ends
/// it: on a slow link the states of a fleet come one by one.
pub async fn get(
    bus: &Bus,
    selector: &str,
    within: Duration,
) -> std::result::Result<Vec<Incoming>, BusError> {
    Ok(untimed(get_timed(bus, selector, within).await?))
}

/// An answer, and when it came.
type Timed = (Instant, Incoming);

/// The same, each with when it came.
async fn get_timed(bus: &Bus, selector: &str, within: Duration) -> std::result::Result<Vec<Timed>, BusError> {
    let asked = Instant::now();
    let most = within.max(PATIENCE_MOST);
    let answers = bus.gather_timed(selector, within, most).await?;
    if !answers.is_empty() || asked.elapsed() >= within {
        return Ok(answers);
    }
    tokio::time::sleep(SETTLE).await;
    bus.gather_timed(selector, within, most).await
}

fn untimed(answers: Vec<Timed>) -> Vec<Incoming> {
    answers.into_iter().map(|(_, answer)| answer).collect()
}

/// The states among answers; of two of one robot the later one.
fn seen(answers: &[Timed]) -> BTreeMap<Name, LastState> {
    let states = answers.iter().filter_map(|(at, answer)| Some((*at, read::<RobotState>(answer)?)));
    states.map(|(at, state)| (state.robot.clone(), LastState { state, at })).collect()
}

/// What a reply gave.
pub fn accepted(robot: &Name, reply: &Reply) -> Result<Done> {
    match &reply.result {
        Outcome::Ok(done) => Ok(*done),
        Outcome::Error(error) => Err(Error::refused(robot, error)),
    }
}

/// An answer that can be read; one that cannot is logged and counts as none.
fn read<M: Message>(answer: &Incoming) -> Option<M> {
    answer.decode().inspect_err(|error| tracing::warn!("on {}: {error}", answer.key)).ok()
}

#[cfg(test)]
mod tests;
