//! A simulated fleet of processes, and a client that hears everything and gives the robots something to do.

#![allow(dead_code)] // measurements each use a part

use fleet_tests::name;
use fleet_tests::processes::{Process, program};
use std::collections::BTreeMap;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use xtb_bus::{Bus, Incoming, SessionRole, Subscription};
use xtb_protocol::keys::{FleetKeys, RobotKeys};
use xtb_protocol::messages::{
    Body, Done, Lease, LinkLoss, Outcome, Request, RobotState, Roster, RosterEntry, Truth, Via,
};
use xtb_protocol::{Name, Uuid};

const FLEET: &str = "lab";
const ASK_WITHIN: Duration = Duration::from_secs(5);
/// Robots that are asked at the same time.
const AT_ONCE: usize = 32;
/// A robot that drives gets another goal after so long.
const ANEW: Duration = Duration::from_secs(10);
/// For what should take a second.
pub(crate) const PATIENCE: Duration = Duration::from_secs(60);
pub(crate) const LOOK_EVERY: Duration = Duration::from_millis(20);

pub(crate) type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

/// What all robots do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Work {
    Wander,
    Drive,
}

/// Starts the simulators, each with its part of the robots; also where the first one's router is.
pub(crate) async fn simulators(robots: usize, parts: usize) -> Result<(Vec<Process>, String)> {
    let (mut processes, mut endpoint) = (Vec::new(), None::<String>);
    for part in 0..parts {
        let (first, next) = (part * robots / parts, (part + 1) * robots / parts);
        let numbers = [next - first, first + 1, robots].map(|number| number.to_string());
        let mut command = cli(&["sim", "--robots", &numbers[0], "--first", &numbers[1]]);
        command.args(["--fleet-size", &numbers[2]]);
        match &endpoint {
            None => command.args(["--listen", "tcp/127.0.0.1:0"]),
            Some(router) => command.args(["--connect", router]),
        };
        let (process, line) = tokio::task::spawn_blocking(move || Process::start_ready(&mut command)).await?;
        let said =
            line.split('"').find(|part| part.starts_with("tcp/")).ok_or("a simulator does not start")?;
        endpoint.get_or_insert(said.to_owned());
        processes.push(process);
    }
    Ok((processes, endpoint.ok_or("no simulator")?))
}

/// The states of one robot within the window.
#[derive(Debug, Default)]
struct Seen {
    count: u64,
    first: Option<Incoming>,
    last: Option<Incoming>,
}

#[derive(Debug, Default)]
struct Heard {
    /// Of each simulator, by the first of its robots.
    truths: BTreeMap<Name, Truth>,
    counts: bool,
    states: BTreeMap<String, Seen>,
}

/// A client that hears everything and gives the robots something to do.
pub(crate) struct Witness {
    bus: Bus,
    keys: FleetKeys,
    me: Name,
    robots: Vec<RosterEntry>,
    heard: Arc<Mutex<Heard>>,
    /// Nobody is sent anywhere any more.
    pub(crate) is_over: AtomicBool,
    _subscriptions: [Subscription; 2],
}

fn lock(heard: &Mutex<Heard>) -> MutexGuard<'_, Heard> {
    heard.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Witness {
    pub(crate) async fn open(endpoint: &str, parts: usize) -> Result<Self> {
        let keys = FleetKeys::new(name(FLEET));
        let bus = xtb_bus::open(&SessionRole::Client { connect: vec![endpoint.to_owned()] }).await?;
        let heard = Arc::<Mutex<Heard>>::default();
        let (truths, states) = (heard.clone(), heard.clone());
        let truth = move |incoming: Incoming| {
            let Ok(truth) = incoming.decode::<Truth>() else { return };
            let Some((first, _)) = truth.robots.first_key_value() else { return };
            lock(&truths).truths.insert(first.clone(), truth);
        };
        // Decoded afterwards: this machine is busy enough.
        let state = move |incoming: Incoming| {
            let mut heard = lock(&states);
            if !heard.counts {
                return;
            }
            let seen = heard.states.entry(incoming.key.clone()).or_default();
            seen.count += 1;
            if seen.first.is_none() {
                seen.first = Some(incoming);
            } else {
                seen.last = Some(incoming);
            }
        };
        let subscriptions = [
            bus.subscribe(&keys.sim_truth(), truth).await?,
            bus.subscribe(&keys.any_robot().state(), state).await?,
        ];
        let rosters = bus.get(&keys.sim_roster(), ASK_WITHIN).await?;
        if rosters.len() != parts {
            return Err(format!("{} rosters of {parts} simulators", rosters.len()).into());
        }
        let mut robots = Vec::new();
        for roster in &rosters {
            robots.extend(roster.decode::<Roster>()?.robots);
        }
        Ok(Self {
            bus,
            keys,
            me: name("thousand"),
            robots,
            heard,
            is_over: AtomicBool::new(false),
            _subscriptions: subscriptions,
        })
    }

    /// Gives all robots something to do, and those that have done it something new, until it is over.
    pub(crate) async fn employ(self: Arc<Self>, work: Work) {
        for round in 0.. {
            let mut asking = JoinSet::new();
            for index in 0..self.robots.len() {
                if asking.len() >= AT_ONCE {
                    let _ = asking.join_next().await;
                }
                let fleet = self.clone();
                asking.spawn(async move { fleet.send(index, work, round).await });
            }
            while asking.join_next().await.is_some() {}
            let rested = Instant::now() + ANEW;
            while work == Work::Wander || Instant::now() < rested {
                if self.is_over.load(Ordering::Relaxed) {
                    return;
                }
                tokio::time::sleep(LOOK_EVERY).await;
            }
        }
    }

    /// Sends a robot on its way.
    async fn send(&self, index: usize, work: Work, round: usize) {
        if self.is_over.load(Ordering::Relaxed) {
            return;
        }
        let (on_link_loss, finish_s) = (LinkLoss::Finish, 3600.0);
        let robots = &self.robots;
        // In pairs; one that has no neighbour goes home.
        let other = if index ^ 1 < robots.len() { index ^ 1 } else { index };
        let place =
            robots[if round.is_multiple_of(2) { other } else { index }].start_pose.unwrap_or_default();
        let body = match work {
            Work::Wander => Body::Wander { for_s: None, on_link_loss, finish_s },
            Work::Drive => Body::Goto {
                x_m: place.x_m,
                y_m: place.y_m,
                yaw_rad: None,
                via: Some(Via::Planned),
                on_link_loss,
                finish_s,
            },
        };
        let robot = self.keys.robot(&robots[index].name);
        if let Some(Outcome::Ok(Done { lease, .. })) =
            self.ask(&robot, None, Body::Acquire { take: true }).await
        {
            // One that is busy with another robot in its way is asked again in the next round.
            let _ = self.ask(&robot, lease, body).await;
        }
    }

    async fn ask(&self, robot: &RobotKeys, lease: Option<Lease>, body: Body) -> Option<Outcome> {
        let request = Request { id: Uuid::new_v4(), lease, body };
        let answered = self.bus.ask(robot, &self.me, &request, ASK_WITHIN).await;
        answered.ok().flatten().map(|reply| reply.result)
    }

    pub(crate) fn count_states(&self, counts: bool) {
        lock(&self.heard).counts = counts;
    }

    /// States that came within the window, and how many the robots numbered meanwhile.
    pub(crate) fn counted(&self) -> (u64, u64) {
        let heard = lock(&self.heard);
        let seq = |incoming: &Option<Incoming>| {
            let state = incoming.as_ref()?.decode::<RobotState>();
            state.ok().map(|state| state.seq)
        };
        let sent = |seen: &Seen| match (seq(&seen.first), seq(&seen.last)) {
            (Some(first), Some(last)) => last.saturating_sub(first) + 1,
            _ => seen.count,
        };
        (heard.states.values().map(|seen| seen.count).sum(), heard.states.values().map(sent).sum())
    }

    pub(crate) fn time_s(&self) -> f64 {
        // Of the slowest one.
        lock(&self.heard).truths.values().map(|truth| truth.t_s).reduce(f64::min).unwrap_or_default()
    }

    pub(crate) fn moving(&self) -> usize {
        let heard = lock(&self.heard);
        let robots = heard.truths.values().flat_map(|truth| truth.robots.values());
        robots.filter(|robot| robot.neutral_since_s.is_none()).count()
    }

    pub(crate) fn is_neutral(&self) -> bool {
        self.moving() == 0
    }

    pub(crate) fn contacts(&self) -> u64 {
        let heard = lock(&self.heard);
        heard.truths.values().flat_map(|truth| truth.robots.values()).map(|robot| robot.contacts).sum()
    }
}

/// Waits until it is so.
pub(crate) async fn until(what: &str, is: impl Fn() -> bool) -> Result<()> {
    let give_up = Instant::now() + PATIENCE;
    while !is() {
        if Instant::now() > give_up {
            return Err(format!("not within {PATIENCE:?}: {what}").into());
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
    Ok(())
}

pub(crate) fn cli(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.arg("--json").args(arguments);
    command
}
