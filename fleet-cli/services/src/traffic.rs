//! Traffic control of a fleet as a service: states in, routes out, joint plans on threads beside.
//!
//! What it decides is [`xtb_traffic::coordinator`]'s; here are its clock, its Zenoh and its threads.

use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, PresenceToken, Publisher};
use xtb_client::cars::Cars;
use xtb_client::client::Client;
use xtb_client::state_feed::StateFeed;
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::Stamp;
use xtb_nav::Map;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{MapHash, RobotState, Route, TrafficState};
use xtb_protocol::{Name, Uuid};
use xtb_traffic::coordinator::{
    Coordinator, GridRoom, Guide, JointJob, JointResult, MOST_JOBS, MOST_TRUCKS, Neighbours, ReportedRobot,
};

/// Robots are guided this often.
const TICK: Duration = Duration::from_millis(100);
/// A robot that has not said what car it is by then is driven around and not led. (The coordinator listens longer
/// before it leads anybody.)
const CAR_WITHIN: Duration = Duration::from_millis(300);
/// A joint plan ends by what it may expand; on a computer that is too slow for that, after so long. What was found by
/// then counts, and who has had no turn is looked at in the next one.
const PLAN_WITHIN: Duration = Duration::from_secs(30);
/// Every so many ticks it says what it does.
const TELL_EVERY: u64 = 5;

/// Traffic control, until it is dropped or stopped.
pub struct TrafficService {
    working: JoinHandle<()>,
    state: watch::Receiver<TrafficState>,
    stop: Arc<AtomicBool>,
    _token: PresenceToken,
}

impl TrafficService {
    /// Starts it for the trucks of a fleet on a map.
    ///
    /// # Errors
    /// [`ErrorKind::Refused`] is never meant here: [`ErrorKind::Failed`] if the fleet has traffic control already, or
    /// Zenoh would not.
    pub async fn start(client: &Client, map: &Map, within: Duration) -> Result<Self> {
        let (bus, keys) = (client.bus().clone(), client.keys().clone());
        if !bus.alive(&keys.traffic_alive(), within).await?.is_empty() {
            return Err(Error::new(ErrorKind::Failed, "this fleet already has traffic control")
                .hint("`fleet-cli traffic status` shows it; use that one"));
        }
        let feed = StateFeed::open(client, &keys.any_robot()).await?;
        let token = bus.declare_alive(&keys.traffic_alive()).await?;
        let publisher =
            bus.publisher(&keys.traffic_state(), &Channel::TrafficState, Format::Postcard).await?;
        let epoch = (Uuid::new_v4().as_u128() >> 76) as u64;
        let room = Arc::new(GridRoom::of(map));
        let coordinator = Coordinator::new(room, epoch);
        let stop = Arc::new(AtomicBool::new(false));
        let (told, state) = watch::channel(said(epoch, 0, map.hash(), &coordinator));
        let work = Work {
            coordinator,
            cars: Cars::new(client),
            epoch,
            seq: 0,
            hash: map.hash(),
            bus,
            keys,
            routes: BTreeMap::new(),
            threads: Arc::new(Semaphore::new(joint_plans())),
            refused: BTreeSet::new(),
            publisher,
            told,
            stop: stop.clone(),
        };
        let began = Instant::now();
        let now = move || Stamp::from_ns(u64::try_from(began.elapsed().as_nanos()).unwrap_or(u64::MAX));
        Ok(Self { working: tokio::spawn(work.run(feed, now)), state, stop, _token: token })
    }

    /// What it says of itself.
    #[must_use]
    pub fn state(&self) -> TrafficState {
        self.state.borrow().clone()
    }
}

impl Drop for TrafficService {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.working.abort();
    }
}

fn said(epoch: u64, seq: u64, hash: MapHash, coordinator: &Coordinator) -> TrafficState {
    let (led, obstacles) = coordinator.names();
    let names = |names: Vec<String>| names.iter().filter_map(|name| Name::new(name).ok()).collect();
    TrafficState {
        epoch,
        seq,
        map_hash: hash.to_string(),
        led: names(led),
        obstacles: names(obstacles),
        plans: coordinator.counters().plans,
    }
}

struct Work {
    coordinator: Coordinator,
    cars: Cars,
    epoch: u64,
    seq: u64,
    hash: MapHash,
    bus: Bus,
    keys: FleetKeys,
    routes: BTreeMap<String, Publisher<Route>>,
    /// For joint plans: each takes one.
    threads: Arc<Semaphore>,
    /// Those that are one too many.
    refused: BTreeSet<String>,
    publisher: Publisher<TrafficState>,
    told: watch::Sender<TrafficState>,
    stop: Arc<AtomicBool>,
}

impl Work {
    async fn run(mut self, feed: StateFeed, now: impl Fn() -> Stamp) {
        let (sender, mut results) = mpsc::channel::<JointResult>(MOST_JOBS);
        let mut tick = tokio::time::interval(TICK);
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            tick.tick().await;
            while let Ok(result) = results.try_recv() {
                self.coordinator.planned(now(), result);
            }
            let views: Vec<ReportedRobot> =
                feed.shared_states().values().filter_map(|seen| self.view(&seen.state, seen.age())).collect();
            for view in &views {
                self.coordinator.robot(now(), view.clone());
            }
            self.guide(now(), &views).await;
            while let Ok(permit) = self.threads.clone().try_acquire_owned()
                && let Some(job) = self.coordinator.job(now())
            {
                self.plan(job, sender.clone(), permit);
            }
            if self.seq.is_multiple_of(TELL_EVERY) {
                self.tell().await;
            }
        }
    }

    /// A robot as the coordinator sees it; `None` = it has come a moment ago and will say what car it is.
    fn view(&mut self, state: &RobotState, age: Duration) -> Option<ReportedRobot> {
        let car = match self.cars.of(&state.robot, state.epoch) {
            Ok(car) => Some(car),
            Err(silent) if silent < CAR_WITHIN => return None,
            Err(_) => None,
        };
        Some(ReportedRobot::of(state, car, millis(age)))
    }

    /// Each robot is told how to go on.
    async fn guide(&mut self, now: Stamp, views: &[ReportedRobot]) {
        self.seq += 1;
        let guides = self.coordinator.tick(now);
        let refused = self.coordinator.refused();
        self.warn_of(&refused);
        let near = Neighbours::of(views);
        let known: BTreeSet<&str> = views.iter().map(|view| view.name.as_str()).collect();
        self.routes.retain(|name, _| known.contains(name.as_str()) || guides.contains_key(name));
        for (name, guide) in guides.into_iter().chain(refused) {
            let route = guide.route(self.epoch, self.seq, near.near(&name));
            let sent = match self.publisher_of(&name).await {
                Ok(publisher) => publisher.put(&route).await.map_err(Error::from),
                Err(failure) => Err(failure),
            };
            if let Err(failure) = sent {
                tracing::debug!("cannot send to {name}: {}", failure.message);
            }
        }
    }

    /// Says once of each robot that it is one too many.
    fn warn_of(&mut self, refused: &BTreeMap<String, Guide>) {
        for name in refused.keys().filter(|name| !self.refused.contains(*name)) {
            tracing::warn!(
                "{name} is not coordinated: there are {MOST_TRUCKS} robots already, {} more than that",
                refused.len()
            );
        }
        self.refused = refused.keys().cloned().collect();
    }

    async fn publisher_of(&mut self, name: &str) -> Result<&Publisher<Route>> {
        if !self.routes.contains_key(name) {
            let robot = Name::new(name).map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
            let key = self.keys.robot(&robot).route();
            let publisher = self.bus.publisher::<Route>(&key, &Channel::Route, Format::Postcard).await?;
            self.routes.insert(name.to_owned(), publisher);
        }
        Ok(&self.routes[name])
    }

    /// A joint plan, on a thread of its own.
    fn plan(&self, job: JointJob, done: mpsc::Sender<JointResult>, permit: OwnedSemaphorePermit) {
        let stop = self.stop.clone();
        tokio::task::spawn_blocking(move || {
            let began = Instant::now();
            let mut keep_going = || !stop.load(Ordering::Relaxed) && began.elapsed() < PLAN_WITHIN;
            // Its robots shall not wait for ever; what went wrong is on standard error.
            let solved = catch_unwind(AssertUnwindSafe(|| job.solve(&mut keep_going)));
            drop(permit);
            let _ = done.blocking_send(solved.unwrap_or_else(|_| job.given_up()));
        });
    }

    async fn tell(&self) {
        let state = said(self.epoch, self.seq, self.hash, &self.coordinator);
        if let Err(error) = self.publisher.put(&state).await {
            tracing::debug!("{error}");
        }
        self.told.send_replace(state);
    }
}

/// So many joint plans are made at a time: one core is left for all the rest.
fn joint_plans() -> usize {
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    cores.saturating_sub(1).clamp(1, MOST_JOBS)
}

fn millis(age: Duration) -> u64 {
    u64::try_from(age.as_millis()).unwrap_or(u64::MAX)
}
