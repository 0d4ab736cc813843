//! A robot under load: stops while messages flow, and a flood.

use crate::identities::{Access, Pki};
use crate::processes::RouterProcess;
use crate::rig::STRANGER;
use crate::{Pilot, Probe, Rig, agent_config, eventually, name};
use robot_agent::clock::{Clock, WorldTime};
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{self, Receiver};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::Bus;
use xtb_control::PwmCount;
use xtb_control::controller::PwmOutputs;
use xtb_protocol::Uuid;
use xtb_protocol::codec::{Format, encode, encoding};
use xtb_protocol::keys::{Channel, FleetKeys, RobotKeys};
use xtb_protocol::messages::{Body, Estop, LinkLoss, Rejected, RobotState, Setpoint};
use xtb_sim::{Simulation, TruckParameters, World};

/// A stop that is not there by then is lost.
const LOST_AFTER: Duration = Duration::from_secs(1);
const TICK: Duration = Duration::from_millis(1);
/// Questions among the messages of a flood, which cost an answer each.
const ASK_EACH: usize = 100;

/// Messages of a stranger on a robot's keys until this is dropped.
pub struct Flood(JoinHandle<()>);

impl Drop for Flood {
    fn drop(&mut self) {
        self.0.abort();
    }
}

impl Flood {
    /// On xtb-1 of the fleet `lab`, with questions, from a session of its own with the router at `endpoint`, which
    /// has no identities.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn from(endpoint: &str, a_ms: usize) -> Self {
        let bus = Access::Open.session(STRANGER, endpoint).await;
        Self::start(&bus, &FleetKeys::new(name("lab")).robot(&name("xtb-1")), a_ms, true)
    }

    /// Setpoints without a lease, every fourth message garbage, `a_ms` of them each millisecond; sent
    /// with the care of requests, so that Zenoh drops none. With `asks`, a question now and then too.
    fn start(bus: &Bus, keys: &RobotKeys, a_ms: usize, asks: bool) -> Self {
        let (bus, keys, client) = (bus.clone(), keys.clone(), name(STRANGER));
        let setpoint = Setpoint { lease: None, seq: 1, echo_tick_ms: Some(1), rpm: 20.0, steering: 0.0 };
        let good = encode(&setpoint, Format::Postcard).unwrap_or_default();
        let kind = encoding::<Setpoint>(Format::Postcard);
        Self(tokio::spawn(async move {
            let (key, channel) = (keys.teleop(Some(&client)), Channel::Cmd(client));
            let mut tick = tokio::time::interval(TICK);
            let mut sent = 0_usize;
            loop {
                tick.tick().await;
                for _ in 0..a_ms {
                    let bytes = if sent.is_multiple_of(4) { vec![0xAA; 40] } else { good.clone() };
                    let _ = bus.put_raw(&key, &channel, &kind, bytes).await;
                    sent += 1;
                    if asks && sent.is_multiple_of(ASK_EACH) {
                        let (bus, state) = (bus.clone(), keys.state());
                        tokio::spawn(async move { bus.get(&state, LOST_AFTER).await.map(drop) });
                    }
                }
            }
        }))
    }
}

/// From the put of an emergency stop to the first neutral frame on the serial line.
pub struct Stops {
    /// Sorted.
    pub took: Vec<Duration>,
    /// Stops that did not arrive within a second.
    pub lost: usize,
    /// Messages of strangers that arrived meanwhile, per second.
    pub others_per_s: f64,
}

/// `count` emergency stops of a driving truck while `per_ms` other messages a millisecond flow; with or without
/// identities.
///
/// # Panics
/// If the robot does not start, or Zenoh fails.
pub async fn stops(count: usize, per_ms: usize, identities: bool) -> Stops {
    let access = Access::of(identities, 1, &["bench", STRANGER]);
    let router = RouterProcess::start(access.pki().map(Pki::folder));
    let (agent, passed) = Lone::start(router.endpoint(), &access);
    let bus = access.session("bench", router.endpoint()).await;
    let other = access.session(STRANGER, router.endpoint()).await;
    let fleet = FleetKeys::new(name("lab"));
    let keys = fleet.robot(&name("xtb-1"));
    let pilot = Pilot::new(&bus, "lab", "xtb-1", "bench").await;
    eventually("the agent", || async {
        pilot.setpoint(0.0, 0.0).await;
        pilot.next_setpoint(0.0, 0.0)
    })
    .await;
    let (flood, began) = (Flood::start(&other, &keys, per_ms, false), Instant::now());
    let before = rejected(&bus, &keys).await;
    let mut stops = Stops { took: Vec::new(), lost: 0, others_per_s: 0.0 };
    for n in 0..count {
        drive(&pilot, &passed, n).await;
        let one = keys.estop(Some(&name("bench")));
        let all = fleet.estop_all(Some(&name("bench")));
        let key = if n.is_multiple_of(2) { one } else { all };
        let sent = Instant::now();
        let estop = Estop { id: Uuid::new_v4() };
        let put = bus.put(&key, &Channel::Estop(name("bench")), &estop, Format::Postcard).await;
        put.unwrap_or_else(|error| panic!("{error}"));
        match neutral(&passed, sent) {
            Some(at) => stops.took.push(at - sent),
            None => stops.lost += 1,
        }
    }
    let after = rejected(&bus, &keys).await;
    let others = (after.fenced + after.malformed) - (before.fenced + before.malformed);
    stops.others_per_s = others as f64 / began.elapsed().as_secs_f64();
    drop(flood);
    agent.end().await;
    stops.took.sort_unstable();
    stops
}

/// Teleoperates, to and fro, until a frame drives.
async fn drive(pilot: &Pilot, passed: &Receiver<(PwmOutputs, Instant)>, n: usize) {
    let rpm = if n.is_multiple_of(2) { 20.0 } else { -20.0 };
    pilot.ask(Body::Reset { latch: None }).await;
    let puts = AtomicU32::new(0);
    eventually("driving", || async {
        // Let go once: a joystick that was held through the stop does not drive on.
        let let_go = puts.fetch_add(1, Ordering::Relaxed).is_multiple_of(50);
        pilot.setpoint(if let_go { 0.0 } else { rpm }, 0.0).await;
        passed.try_iter().any(|(pulses, _)| pulses.motor != PwmCount::NEUTRAL).then_some(())
    })
    .await;
}

fn neutral(passed: &Receiver<(PwmOutputs, Instant)>, sent: Instant) -> Option<Instant> {
    loop {
        let (pulses, at) = passed.recv_timeout(LOST_AFTER.saturating_sub(sent.elapsed())).ok()?;
        if pulses.motor == PwmCount::NEUTRAL && at > sent {
            return Some(at);
        }
    }
}

async fn rejected(bus: &Bus, keys: &RobotKeys) -> Rejected {
    eventually("a state", || async {
        let states = bus.get(&keys.state(), Duration::from_secs(1)).await.ok()?;
        Some(states.first()?.decode::<RobotState>().ok()?.rejected)
    })
    .await
}

/// An agent on real time with a probe on its board's line, in a room of its own.
struct Lone {
    end: watch::Sender<bool>,
    agent: JoinHandle<()>,
    _world: RunningWorld,
}

impl Lone {
    fn start(endpoint: &str, access: &Access) -> (Self, Receiver<(PwmOutputs, Instant)>) {
        let (hardware, lines) = SimulatedHardware::connect();
        let simulation = Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1);
        let simulation = simulation.unwrap_or_else(|error| panic!("{error}"));
        let world = RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, |_| {});
        let (sender, passed) = mpsc::channel();
        let (probe, mut config) = (Probe::new(hardware, sender), agent_config(endpoint, "lab"));
        config.identity = access.pki().map(|pki| pki.enrolled("xtb-1"));
        let (end, shutdown) = watch::channel(false);
        let agent = tokio::spawn(async move {
            let ended = robot_agent::run(&config, Box::new(probe), Clock::real(), shutdown).await;
            ended.unwrap_or_else(|error| panic!("{error}"));
        });
        let world = world.unwrap_or_else(|error| panic!("{error}"));
        (Self { end, agent, _world: world }, passed)
    }

    async fn end(self) {
        self.end.send_replace(true);
        let _ = self.agent.await;
    }
}

/// What a flood did to an agent.
pub struct Flooded {
    /// The worst delay of a turn in each state's 50 ms, in µs, sorted.
    pub late_us: Vec<u64>,
    /// Turns that were due, and those of them that came more than 5 ms late.
    pub turns: (u64, u64),
    /// States that arrived, per second.
    pub states_hz: f64,
    /// Growth of the agent's memory.
    pub growth_kib: i64,
    /// Messages of the flood that the agent has counted, per second.
    pub arrived_per_s: f64,
    /// The first state in which it did not drive, in words.
    pub stood: Option<String>,
}

/// What a flood that `start` starts does to the agent of xtb-1, a process of its own that wanders
/// meanwhile.
///
/// # Panics
/// If Zenoh fails.
pub async fn flood<F>(rig: &Rig, start: impl AsyncFnOnce(&str) -> F, lasting: Duration) -> Flooded {
    let bus = rig.client().await;
    let keys = FleetKeys::new(name("lab")).robot(&name("xtb-1"));
    let pilot = rig.pilot(&bus, 1).await;
    let wander = Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 };
    eventually("wandering", || async {
        let outcome = pilot.ask(wander.clone()).await;
        matches!(outcome, xtb_protocol::messages::Outcome::Ok(_)).then_some(())
    })
    .await;
    let seen = Arc::<Mutex<Vec<RobotState>>>::default();
    let list = seen.clone();
    let hear = move |incoming: xtb_bus::Incoming| {
        if let Ok(state) = incoming.decode::<RobotState>() {
            list.lock().unwrap_or_else(PoisonError::into_inner).push(state);
        }
    };
    let (before, memory_kib) = (rejected(&bus, &keys).await, rig.memory_kib(1));
    let hearing = bus.subscribe(&keys.state(), hear).await.unwrap_or_else(|error| panic!("{error}"));
    let (flood, began) = (start(rig.endpoint()).await, Instant::now());
    tokio::time::sleep(lasting).await;
    let took_s = began.elapsed().as_secs_f64();
    drop((flood, hearing));
    let after = rejected(&bus, &keys).await;
    let seen = std::mem::take(&mut *seen.lock().unwrap_or_else(PoisonError::into_inner));
    let mut late_us: Vec<u64> = seen.iter().map(|state| state.turn_late_us).collect();
    late_us.sort_unstable();
    let arrived = (after.fenced + after.malformed) - (before.fenced + before.malformed);
    Flooded {
        late_us,
        states_hz: seen.len() as f64 / took_s,
        growth_kib: rig.memory_kib(1) as i64 - memory_kib as i64,
        arrived_per_s: arrived as f64 / took_s,
        stood: seen.iter().find(|state| !runs(state)).map(|state| {
            let why = state.goal.as_ref().and_then(|goal| goal.reason.as_deref());
            format!("{:?} {why:?} {:?} {:?}", state.mode, state.stopped_because, state.faults)
        }),
        turns: seen.first().zip(seen.last()).map_or((0, 0), |(first, last)| {
            ((last.tick_ms - first.tick_ms) / 5, last.turns_late - first.turns_late)
        }),
    }
}

fn runs(state: &RobotState) -> bool {
    state.goal.as_ref().is_some_and(|goal| !goal.status.is_final())
}
