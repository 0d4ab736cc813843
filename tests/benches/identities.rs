//! What TLS and the rules of a fleet with identities cost beside TCP: setpoints from one session to another through
//! a router, and commands with their answers.
//!
//! `cargo bench -p fleet-tests --bench identities [-- SAMPLES]`: all ways in turn, so that the difference does not
//! depend on the machine. The limits: p50 at most 0.3 ms over TCP's, p99 at most 1.5 times TCP's. The registry has
//! 50 robots and 10 people. The last line is the result as JSON; exit code 1 if a limit is missed.

use fleet_tests::identities::{FLEET, Pki};
use fleet_tests::{eventually, name};
use serde_json::{Value, json};
use std::process::ExitCode;
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};
use xtb_bus::{Bus, Service, SessionRole, Subscription};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{Estop, Estopped, Setpoint};
use xtb_protocol::{Name, Uuid};

const SAMPLES: u64 = 2000;
/// Over TCP's median.
const P50_OVER_US: u64 = 300;
/// Times TCP's, in per cent.
const P99_PER_CENT: u64 = 150;
/// Between two samples.
const PAUSE: Duration = Duration::from_millis(3);
const LOST_AFTER: Duration = Duration::from_secs(2);

#[allow(clippy::print_stdout)]
fn main() -> ExitCode {
    let samples = std::env::args().skip(1).find_map(|word| word.parse().ok()).unwrap_or(SAMPLES);
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let took = runtime.block_on(measure(samples));
    println!("                  samples      p50      p99      max");
    for took in &took {
        println!("{}", took.row());
    }
    let mut kept_all = true;
    let mut judged = serde_json::Map::new();
    for (what, tcp, tls) in [("setpoint", &took[0], &took[1]), ("question", &took[2], &took[3])] {
        for (which, us, limit_us) in [
            ("p50", tls.at(0.5), tcp.at(0.5) + P50_OVER_US),
            ("p99", tls.at(0.99), tcp.at(0.99) * P99_PER_CENT / 100),
        ] {
            let kept = us <= limit_us;
            kept_all &= kept;
            println!("{what} {which} {us} µs, limit {limit_us} µs: {}", if kept { "kept" } else { "missed" });
            judged.insert(format!("{what}_{which}"), kept.into());
        }
    }
    let ways: serde_json::Map<String, Value> =
        took.iter().map(|took| (took.what.replace(' ', "_"), took.json())).collect();
    println!("{}", json!({ "us": ways, "kept": judged }));
    if kept_all { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What one way took.
struct Took {
    what: &'static str,
    us: Vec<u64>,
    lost: u64,
}

impl Took {
    fn new(what: &'static str) -> Self {
        Self { what, us: Vec::new(), lost: 0 }
    }

    fn add(&mut self, took: Option<Duration>) {
        match took {
            Some(took) => self.us.push(took.as_micros() as u64),
            None => self.lost += 1,
        }
    }

    fn at(&self, share: f64) -> u64 {
        self.us[((self.us.len() - 1) as f64 * share) as usize]
    }

    fn row(&self) -> String {
        let (what, p50, p99, max) = (self.what, self.at(0.5), self.at(0.99), self.at(1.0));
        format!("{what:16}  {:7}  {p50:5} µs  {p99:5} µs  {max:5} µs, {} lost", self.us.len(), self.lost)
    }

    fn json(&self) -> Value {
        let (p50, p99, max) = (self.at(0.5), self.at(0.99), self.at(1.0));
        json!({ "samples": self.us.len(), "p50": p50, "p99": p99, "max": max, "lost": self.lost })
    }
}

async fn measure(samples: u64) -> [Took; 4] {
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let plain = xtb_bus::open(&role).await.expect("a router");
    let endpoint = plain.locators().await.remove(0);
    let client = || async {
        let role = SessionRole::Client { connect: vec![endpoint.clone()] };
        xtb_bus::open(&role).await.expect("a session")
    };
    let tcp = Way::open(client().await, client().await).await;

    let mut pki = Pki::new(&[("alice", xtb_identity::Role::Operator)]);
    for robot in 1..=50 {
        pki.add(&format!("xtb-{robot}"), xtb_identity::Role::Robot);
    }
    for person in 1..10 {
        pki.add(&format!("person{person}"), xtb_identity::Role::Operator);
    }
    pki.write();
    let guarded = pki.router().await;
    let open = |of| {
        let opening = pki.opening(of, guarded.endpoint());
        async move { opening.once().await.expect("a session") }
    };
    let tls = Way::open(open("alice").await, open("xtb-1").await).await;

    let mut took = ["setpoint tcp", "setpoint tls", "question tcp", "question tls"].map(Took::new);
    for n in 0..samples {
        for (index, way) in [&tcp, &tls].into_iter().enumerate() {
            tokio::time::sleep(PAUSE).await;
            took[index].add(way.setpoint(n).await);
            tokio::time::sleep(PAUSE).await;
            took[2 + index].add(way.question().await);
        }
    }
    guarded.close().await;
    for took in &mut took {
        assert!(!took.us.is_empty(), "nothing arrived");
        took.us.sort_unstable();
    }
    took
}

/// From an operator's session to a robot's.
struct Way {
    bus: Bus,
    client: Name,
    teleop: String,
    estop: String,
    arrived: Receiver<Instant>,
    _subscription: Subscription,
    _service: Service,
    _robot: Bus,
}

impl Way {
    async fn open(bus: Bus, robot: Bus) -> Self {
        let (client, keys) = (name("alice"), FleetKeys::new(name(FLEET)).robot(&name("xtb-1")));
        let (sender, arrived) = mpsc::channel();
        let each = move |_| {
            let _ = sender.send(Instant::now());
        };
        let subscription = robot.subscribe(&keys.teleop(None), each).await.expect("a subscription");
        let (runtime, own_key) = (tokio::runtime::Handle::current(), keys.estop(Some(&client)));
        let answer = move |question: xtb_bus::Question| {
            let own_key = own_key.clone();
            runtime.spawn(async move {
                let said = Estopped { robot: name("xtb-1"), latched: true };
                let _ = question.reply(&own_key, &said, Format::Postcard).await;
            });
        };
        let service = robot.serve(&keys.estop(None), answer).await.expect("a queryable");
        let way = Self {
            bus,
            teleop: keys.teleop(Some(&client)),
            estop: keys.estop(Some(&client)),
            client,
            arrived,
            _subscription: subscription,
            _service: service,
            _robot: robot,
        };
        eventually("the robot's session", || async {
            let heard = way.setpoint(0).await;
            heard.and(way.question().await)
        })
        .await;
        way
    }

    async fn setpoint(&self, seq: u64) -> Option<Duration> {
        while self.arrived.try_recv().is_ok() {}
        let setpoint = Setpoint { lease: None, seq, echo_tick_ms: None, rpm: 0.0, steering: 0.0 };
        let channel = Channel::Teleop(self.client.clone());
        let sent = Instant::now();
        self.bus.put(&self.teleop, &channel, &setpoint, Format::Postcard).await.expect("a put");
        self.arrived.recv_timeout(LOST_AFTER).ok().map(|at| at - sent)
    }

    async fn question(&self) -> Option<Duration> {
        let (channel, estop) = (Channel::Estop(self.client.clone()), Estop { id: Uuid::new_v4() });
        let (sent, mut took) = (Instant::now(), None);
        let each = |_| took = Some(sent.elapsed());
        self.bus.ask_each(&self.estop, &channel, &estop, LOST_AFTER, each).await.expect("a question");
        took
    }
}
