//! From a teleop put to the steering count in a PWM frame on the serial line, beside raw Zenoh.
//!
//! `cargo bench -p fleet-tests --bench latency [-- SAMPLES]`: both through the same router in turn, so that the
//! ratio does not depend on the machine. The limits: p50 at most raw Zenoh's plus one turn (5 ms), p99 at most
//! twice raw Zenoh's plus 7 ms. Setpoints are sent as clients send them, every 50 ms and more, in any phase of
//! the 20 ms frame. The last line is the result as JSON; exit code 1 if a limit is missed.
//!
//! The speed of a setpoint has no limit here: its pulse waits for an encoder window (docs/io-board.md). A tenth as
//! many are measured, each from standing. The board takes new pulses at the end of its own period of 22.2 ms.

use fleet_tests::{Pilot, Probe, agent_config, eventually, name};
use robot_agent::clock::{Clock, WorldTime};
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use serde_json::{Value, json};
use std::process::ExitCode;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::{Bus, SessionRole, Subscription};
use xtb_control::controller::PwmOutputs;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::Setpoint;
use xtb_sim::{Simulation, TruckParameters, World};

const SAMPLES: u64 = 1000;
/// Over raw Zenoh's median: one turn.
const P50_OVER_US: u64 = 5_000;
/// Over twice raw Zenoh's: one turn, and the time of its work on a computer that does other things too.
const P99_OVER_US: u64 = 7_000;
/// Half of the time between two setpoints; the other half follows the raw put.
const HALF: Duration = Duration::from_millis(25);
const LOST_AFTER: Duration = Duration::from_secs(2);
/// Of the setpoints whose speed is measured, in turns per minute, ahead and astern in turns.
const SPEED_RPM: f64 = 30.0;
/// So many setpoints of no speed come before each of them.
const RESTS: u32 = 10;

#[allow(clippy::print_stdout)]
fn main() -> ExitCode {
    let samples = std::env::args().skip(1).find_map(|word| word.parse().ok()).unwrap_or(SAMPLES);
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let [raw, teleop, speed] = runtime.block_on(measure(samples));
    println!("                        samples      p50      p99      max");
    println!("{}", raw.row("raw put → callback    "));
    println!("{}", teleop.row("teleop put → PWM frame"));
    println!("{}", speed.row("its speed → PWM frame "));
    let limits = [
        ("p50", teleop.at(0.5), raw.at(0.5) + P50_OVER_US),
        ("p99", teleop.at(0.99), 2 * raw.at(0.99) + P99_OVER_US),
    ];
    for (what, us, limit_us) in limits {
        println!("{what} {us} µs, limit {limit_us} µs: {}", if us <= limit_us { "kept" } else { "missed" });
    }
    let kept = limits.map(|(_, us, limit_us)| us <= limit_us);
    let kept_by_name = json!({ "p50": kept[0], "p99": kept[1] });
    let (raw, teleop, speed) = (raw.json(), teleop.json(), speed.json());
    println!("{}", json!({ "raw_us": raw, "teleop_us": teleop, "speed_us": speed, "kept": kept_by_name }));
    if kept == [true; 2] { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What one way took.
#[derive(Default)]
struct Took {
    us: Vec<u64>,
    lost: u64,
}

impl Took {
    fn add(&mut self, took: Option<Duration>) {
        match took {
            Some(took) => self.us.push(took.as_micros() as u64),
            None => self.lost += 1,
        }
    }

    fn sorted(mut self) -> Self {
        assert!(!self.us.is_empty(), "nothing arrived");
        self.us.sort_unstable();
        self
    }

    fn at(&self, share: f64) -> u64 {
        self.us[((self.us.len() - 1) as f64 * share) as usize]
    }

    fn row(&self, what: &str) -> String {
        let (p50, p99, max) = (self.at(0.5), self.at(0.99), self.at(1.0));
        format!("{what}  {:7}  {p50:5} µs  {p99:5} µs  {max:5} µs, {} lost", self.us.len(), self.lost)
    }

    fn json(&self) -> Value {
        let (p50, p99, max) = (self.at(0.5), self.at(0.99), self.at(1.0));
        json!({ "samples": self.us.len(), "p50": p50, "p99": p99, "max": max, "lost": self.lost })
    }
}

async fn client(endpoint: &str) -> Bus {
    xtb_bus::open(&SessionRole::Client { connect: vec![endpoint.to_owned()] }).await.expect("a session")
}

async fn measure(samples: u64) -> [Took; 3] {
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.expect("a router");
    let endpoint = router.locators().await.remove(0);
    let bus = client(&endpoint).await;
    let raw_way = RawWay::open(&bus, client(&endpoint).await).await;
    let robot = Robot::start(&bus, &endpoint).await;
    let (mut raw, mut teleop, mut speed) = (Took::default(), Took::default(), Took::default());
    for n in 0..samples {
        tokio::time::sleep(HALF).await;
        raw.add(raw_way.took(n).await);
        // Any phase of the 20 ms frame, one after the other.
        tokio::time::sleep(HALF + Duration::from_micros(n * 7919 % 20_000)).await;
        teleop.add(robot.took(n).await);
    }
    for n in 0..samples.div_ceil(10) {
        speed.add(robot.took_to_move(n).await);
    }
    robot.end().await;
    [raw, teleop, speed].map(Took::sorted)
}

/// Puts of the same message with the same quality of service, to a callback that does nothing.
struct RawWay {
    bus: Bus,
    key: String,
    channel: Channel,
    arrived: Receiver<Instant>,
    _subscription: Subscription,
    _other: Bus,
}

impl RawWay {
    async fn open(bus: &Bus, other: Bus) -> Self {
        let (client, keys) = (name("bench"), FleetKeys::new(name("lab")).robot(&name("raw")));
        let (sender, arrived) = mpsc::channel();
        let key = keys.teleop(Some(&client));
        let each = move |_| {
            let _ = sender.send(Instant::now());
        };
        let subscription = other.subscribe(&key, each).await.expect("a subscription");
        let (bus, channel) = (bus.clone(), Channel::Teleop(client));
        let way = Self { bus, key, channel, arrived, _subscription: subscription, _other: other };
        eventually("the subscription", || async {
            way.put(0).await;
            way.arrived.recv_timeout(Duration::from_millis(100)).ok()
        })
        .await;
        way
    }

    async fn put(&self, seq: u64) {
        let setpoint = Setpoint { lease: None, seq, echo_tick_ms: None, rpm: 0.0, steering: 0.0 };
        self.bus.put(&self.key, &self.channel, &setpoint, Format::Postcard).await.expect("a put");
    }

    async fn took(&self, seq: u64) -> Option<Duration> {
        while self.arrived.try_recv().is_ok() {}
        let sent = Instant::now();
        self.put(seq).await;
        self.arrived.recv_timeout(LOST_AFTER).ok().map(|at| at - sent)
    }
}

/// An agent on real time, with a probe on its board's line and a client that drives it.
struct Robot {
    pilot: Pilot,
    passed: Receiver<(PwmOutputs, Instant)>,
    end: watch::Sender<bool>,
    agent: JoinHandle<()>,
    _world: RunningWorld,
}

impl Robot {
    async fn start(bus: &Bus, endpoint: &str) -> Self {
        let (hardware, lines) = SimulatedHardware::connect();
        let simulation = Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1)
            .expect("there is room");
        // Nobody waits for anybody: robot and world each on real time, as with a real truck.
        let world =
            RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, |_| {}).expect("a thread");
        let (sender, passed) = mpsc::channel();
        let (probe, config) = (Probe::new(hardware, sender), agent_config(endpoint, "lab"));
        let (end, shutdown) = watch::channel(false);
        let agent = tokio::spawn(async move {
            let ended = robot_agent::run(&config, Box::new(probe), Clock::real(), shutdown).await;
            ended.expect("an agent");
        });
        let keys = FleetKeys::new(name("lab")).robot(&name("xtb-1"));
        eventually("the agent", || async {
            let alive = bus.alive(&keys.alive(), Duration::from_secs(1)).await.expect("an answer");
            (!alive.is_empty()).then_some(())
        })
        .await;
        let pilot = Pilot::new(bus, "lab", "xtb-1", "bench").await;
        eventually("the lease and a state", || async {
            pilot.setpoint(0.0, 0.0).await;
            pilot.next_setpoint(0.0, 0.0)
        })
        .await;
        Self { pilot, passed, end, agent, _world: world }
    }

    async fn took(&self, n: u64) -> Option<Duration> {
        while self.passed.try_recv().is_ok() {}
        // 900 different counts, so that no frame can be taken for another's.
        let offset = 10 + (n % 900) as u16;
        let sent = Instant::now();
        self.pilot.setpoint(0.0, -f64::from(offset) / 975.0).await;
        self.first_after(sent, |pulses| pulses.steer_front.get() == 3710 + offset)
    }

    async fn took_to_move(&self, n: u64) -> Option<Duration> {
        for _ in 0..RESTS {
            self.pilot.setpoint(0.0, 0.0).await;
            tokio::time::sleep(2 * HALF).await;
        }
        // Any phase of the encoder's window of 53 ms.
        tokio::time::sleep(Duration::from_micros(n * 7919 % 53_000)).await;
        let standing = self.passed.try_iter().last()?.0.motor;
        let sent = Instant::now();
        self.pilot.setpoint(if n.is_multiple_of(2) { SPEED_RPM } else { -SPEED_RPM }, 0.0).await;
        self.first_after(sent, |pulses| pulses.motor != standing)
    }

    /// How long after `sent` the first such frame passed.
    fn first_after(&self, sent: Instant, is_it: impl Fn(&PwmOutputs) -> bool) -> Option<Duration> {
        loop {
            let (pulses, at) = self.passed.recv_timeout(LOST_AFTER.saturating_sub(sent.elapsed())).ok()?;
            if is_it(&pulses) {
                return Some(at - sent);
            }
        }
    }

    async fn end(self) {
        self.end.send_replace(true);
        let _ = self.agent.await;
    }
}
