//! From a teleop put to the steering count in a PWM frame on the serial line, beside raw Zenoh.
//!
//! `cargo bench -p fleet-tests --bench latency`: both through the same router in the same run, one
//! after the other, so that the ratio does not depend on the machine. The bound of the design: p99
//! at most twice raw Zenoh's, plus one turn (5 ms) and one frame (20 ms).

use fleet_tests::{Pilot, Probe, agent_config, eventually, name};
use robot_agent::clock::{Clock, WorldTime};
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use xtb_bus::{Bus, Role};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::Setpoint;
use xtb_sim::{Simulation, TruckParameters, World};

const SAMPLES: usize = 1000;
const TURN_AND_FRAME_US: u64 = 25_000;
const LOST_AFTER: Duration = Duration::from_secs(2);

#[allow(clippy::print_stdout)]
fn main() {
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let (raw, teleop) = runtime.block_on(measure());
    println!("                        samples      p50      p99      max");
    let row = |what: &str, us: &[u64]| {
        let (p50, p99, max) = (percentile(us, 0.5), percentile(us, 0.99), percentile(us, 1.0));
        println!("{what}  {:7}  {p50:5} µs  {p99:5} µs  {max:5} µs", us.len());
        p99
    };
    let raw_p99 = row("raw put → callback    ", &raw);
    let teleop_p99 = row("teleop put → PWM frame", &teleop);
    let bound = 2 * raw_p99 + TURN_AND_FRAME_US;
    let verdict = if teleop_p99 <= bound { "kept" } else { "MISSED" };
    println!("bound: 2 × {raw_p99} + {TURN_AND_FRAME_US} = {bound} µs: {verdict}");
}

fn percentile(sorted: &[u64], share: f64) -> u64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

async fn client(endpoint: &str) -> Bus {
    xtb_bus::open(&Role::Client { connect: vec![endpoint.to_owned()] }).await.expect("a session")
}

async fn measure() -> (Vec<u64>, Vec<u64>) {
    let role = Role::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.expect("a router");
    let endpoint = router.locators().await.remove(0);
    let bus = client(&endpoint).await;
    let raw = raw(&bus, &client(&endpoint).await).await;
    let teleop = teleop(&bus, &endpoint).await;
    (raw, teleop)
}

fn setpoint(seq: u64, steering: f64) -> Setpoint {
    Setpoint { lease: None, seq, echo_tick_ms: None, rpm: 0.0, steering }
}

/// Puts of the same message with the same quality of service, to a callback that does nothing.
async fn raw(bus: &Bus, other: &Bus) -> Vec<u64> {
    let (client, keys) = (name("bench"), FleetKeys::new(name("lab")).robot(&name("raw")));
    let (sender, arrived) = mpsc::channel();
    let key = keys.teleop(Some(&client));
    let each = move |_| {
        let _ = sender.send(Instant::now());
    };
    let _subscription = other.subscribe(&key, each).await.expect("a subscription");
    let channel = Channel::Teleop(client);
    eventually("the subscription", || async {
        bus.put(&key, &channel, &setpoint(0, 0.0), Format::Postcard).await.expect("a put");
        arrived.recv_timeout(Duration::from_millis(100)).ok()
    })
    .await;
    while arrived.recv_timeout(Duration::from_millis(100)).is_ok() {}
    let mut took = Vec::new();
    for seq in 0..SAMPLES as u64 {
        pause(seq).await;
        let sent = Instant::now();
        bus.put(&key, &channel, &setpoint(seq, 0.0), Format::Postcard).await.expect("a put");
        if let Ok(at) = arrived.recv_timeout(LOST_AFTER) {
            took.push((at - sent).as_micros() as u64);
        }
    }
    took.sort_unstable();
    took
}

/// Any phase of the 20 ms frame, one after the other.
async fn pause(seq: u64) {
    tokio::time::sleep(Duration::from_micros(500 + seq * 7919 % 20_000)).await;
}

async fn teleop(bus: &Bus, endpoint: &str) -> Vec<u64> {
    let (hardware, lines) = SimulatedHardware::connect();
    let simulation =
        Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1).expect("there is room");
    // Nobody waits for anybody: robot and world each on real time, as with a real truck.
    let _world =
        RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, |_| {}).expect("a thread");
    let (passed_sender, passed) = mpsc::channel();
    let probe = Probe::new(hardware, passed_sender);
    let config = agent_config(endpoint, "lab");
    let (end, shutdown) = watch::channel(false);
    let agent =
        tokio::spawn(
            async move { robot_agent::run(&config, Box::new(probe), Clock::real(), shutdown).await },
        );
    let (client, keys) = (name("bench"), FleetKeys::new(name("lab")).robot(&name("xtb-1")));
    eventually("the agent", || async {
        let alive = bus.alive(&keys.alive(), Duration::from_secs(1)).await.expect("an answer");
        (!alive.is_empty()).then_some(())
    })
    .await;

    let pilot = Pilot::new(bus, "lab", "xtb-1", client.as_str()).await;
    eventually("the lease and a state", || async {
        pilot.setpoint(0.0, 0.0).await;
        pilot.next_setpoint(0.0, 0.0)
    })
    .await;
    let mut took = Vec::new();
    for seq in 0..SAMPLES as u64 {
        pause(seq).await;
        while passed.try_recv().is_ok() {}
        // 900 different counts, so that no frame can be taken for another's.
        let offset = 10 + (seq % 900) as u16;
        let steering = -f64::from(offset) / 975.0;
        let sent = Instant::now();
        pilot.setpoint(0.0, steering).await;
        while let Ok((pulses, at)) = passed.recv_timeout(LOST_AFTER) {
            if pulses.steer_front.get() == 3710 + offset {
                took.push((at - sent).as_micros() as u64);
                break;
            }
        }
    }
    end.send_replace(true);
    let _ = agent.await;
    took.sort_unstable();
    took
}
