//! The control loop on a busy machine, with and without `--realtime`.
//!
//! `cargo bench -p fleet-tests --bench busy [-- SECONDS [ROUNDS]]`: in each round, one agent without and one with
//! it, each for SECONDS (20) beside twice as many threads that compute all the time as there are cores; which
//! goes first alternates. A *late* turn is the robot's own count (more than 5 ms after its time); *p99.9* and
//! *worst* say by how much a turn came more than 5 ms after the one before, measured where it reads its lines.
//! *board lost* counts runs after which that latch was set.
//!
//! The truck is simulated in this process: in every run its thread has a higher priority than the loop with
//! `--realtime`, as a real board does not wait for a busy computer. Without permission for that nothing is measured.
//! The last line is the result as JSON. Exit code 1 if a loop with `--realtime` has lost its board.

#![allow(clippy::print_stdout, clippy::print_stderr)]

use fleet_tests::{agent_config, eventually, name};
use robot_agent::clock::{Clock, WorldTime};
use robot_agent::hardware::Hardware;
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use robot_agent::realtime::{PRIORITY, prioritize_this_thread};
use serde_json::{Value, json};
use std::hint::black_box;
use std::io;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use xtb_bus::{Bus, SessionRole};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{About, Latch, RobotState};
use xtb_sim::{Simulation, TruckParameters, World};

const SECONDS: u64 = 20;
const ROUNDS: u64 = 3;
/// Of the loop.
const TURN: Duration = Duration::from_millis(5);
const ASK_WITHIN: Duration = Duration::from_secs(5);

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).filter_map(|word| word.parse().ok());
    let seconds = Duration::from_secs(numbers.next().unwrap_or(SECONDS));
    let rounds = numbers.next().unwrap_or(ROUNDS);
    let permitted = std::thread::spawn(|| prioritize_this_thread(PRIORITY + 1)).join().expect("no panic");
    if let Err(error) = permitted {
        eprintln!("not measured: the truck's thread may not have a real-time priority: {error}");
        return ExitCode::FAILURE;
    }
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let (before, after) = runtime.block_on(measure(seconds, rounds));
    for total in [&before, &after] {
        println!("{}", total.row("all"));
    }
    println!("{}", json!({ "without": before.json(), "with": after.json() }));
    if after.board_lost == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What one kind of loop did.
#[derive(Default)]
struct Told {
    /// What its factsheet says of the priority.
    realtime: String,
    /// By how much a turn came too late after the one before, in µs.
    late_us: Vec<u64>,
    turns_late: u64,
    frames_lost: u64,
    board_lost: u64,
}

impl Told {
    fn at(&self, share: f64) -> f64 {
        let mut sorted = self.late_us.clone();
        sorted.sort_unstable();
        let index = (sorted.len().saturating_sub(1) as f64 * share) as usize;
        sorted.get(index).map_or(0.0, |us| *us as f64 / 1000.0)
    }

    fn row(&self, round: &str) -> String {
        format!(
            "{round:>5}  {:>7} turns  {:>6} late  p99.9 {:>8.2} ms  worst {:>8.2} ms  {:>5} frames lost  {} board lost  --realtime: {}",
            self.late_us.len(),
            self.turns_late,
            self.at(0.999),
            self.at(1.0),
            self.frames_lost,
            self.board_lost,
            self.realtime
        )
    }

    fn json(&self) -> Value {
        json!({
            "realtime": self.realtime,
            "turns": self.late_us.len(),
            "turns_late": self.turns_late,
            "p99_9_ms": self.at(0.999),
            "worst_ms": self.at(1.0),
            "frames_lost": self.frames_lost,
            "board_lost": self.board_lost,
        })
    }

    fn add(&mut self, other: Self) {
        self.realtime = other.realtime;
        self.late_us.extend(other.late_us);
        self.turns_late += other.turns_late;
        self.frames_lost += other.frames_lost;
        self.board_lost += other.board_lost;
    }
}

async fn measure(seconds: Duration, rounds: u64) -> (Told, Told) {
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.expect("a router");
    let endpoint = router.locators().await.remove(0);
    let bus =
        xtb_bus::open(&SessionRole::Client { connect: vec![endpoint.clone()] }).await.expect("a session");
    let (mut before, mut after) = (Told::default(), Told::default());
    for round in 1..=rounds {
        let first = round % 2 == 0;
        for realtime in [first, !first] {
            let told = run(&bus, &endpoint, realtime, seconds).await;
            println!("{}", told.row(&round.to_string()));
            let total = if realtime { &mut after } else { &mut before };
            total.add(told);
        }
    }
    bus.close().await;
    router.close().await;
    (before, after)
}

/// One agent beside the busy threads.
async fn run(bus: &Bus, endpoint: &str, realtime: bool, seconds: Duration) -> Told {
    let (hardware, lines) = SimulatedHardware::connect();
    let simulation =
        Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1).expect("there is room");
    let mut prioritized = false;
    let each_step = move |_: &Simulation| {
        if !std::mem::replace(&mut prioritized, true) {
            prioritize_this_thread(PRIORITY + 1).expect("permission, as in the beginning");
        }
    };
    let world =
        RunningWorld::start(simulation, vec![lines], WorldTime::new(), 1.0, each_step).expect("a thread");
    let busy = Arc::new(AtomicBool::new(false));
    let (timed, turns) = Timed::new(hardware, busy.clone());
    let mut config = agent_config(endpoint, "lab");
    config.realtime = realtime;
    let (end, shutdown) = watch::channel(false);
    let agent = tokio::spawn(async move {
        let ended = robot_agent::run(&config, Box::new(timed), Clock::real(), shutdown).await;
        ended.expect("an agent");
    });
    let about = about(bus).await;
    let before = state(bus, |state| state.input_age_ms.gyro.is_some() && state.latches.is_empty()).await;
    let threads = start_busy_threads(&busy);
    tokio::time::sleep(seconds).await;
    busy.store(false, Ordering::Relaxed);
    threads.into_iter().for_each(|thread| thread.join().expect("no panic"));
    let after = state(bus, |state| state.epoch == about.epoch && state.seq > before.seq).await;
    end.send_replace(true);
    agent.await.expect("no panic");
    drop(world);
    // The next agent of this process starts as the first one did.
    #[cfg(target_os = "linux")]
    rustix::mm::munlockall().expect("unlocked memory");
    Told {
        realtime: about.realtime().unwrap_or_default().to_owned(),
        late_us: turns.recv().expect("the loop's turns"),
        turns_late: after.turns_late - before.turns_late,
        frames_lost: after.rejected.board_lost - before.rejected.board_lost,
        board_lost: u64::from(after.latches.iter().any(|set| set.latch == Latch::BoardLost)),
    }
}

async fn about(bus: &Bus) -> About {
    let keys = FleetKeys::new(name("lab")).robot(&name("xtb-1"));
    eventually("the factsheet", || async {
        bus.get(&keys.about(), ASK_WITHIN).await.ok()?.first()?.decode::<About>().ok()
    })
    .await
}

async fn state(bus: &Bus, is: impl Fn(&RobotState) -> bool) -> RobotState {
    let keys = FleetKeys::new(name("lab")).robot(&name("xtb-1"));
    eventually("a state", || async {
        let state = bus.get(&keys.state(), ASK_WITHIN).await.ok()?.first()?.decode::<RobotState>().ok()?;
        is(&state).then_some(state)
    })
    .await
}

/// Two for each core, which compute as long as `busy`.
fn start_busy_threads(busy: &Arc<AtomicBool>) -> Vec<JoinHandle<()>> {
    busy.store(true, Ordering::Relaxed);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let start = |_| {
        let busy = busy.clone();
        std::thread::spawn(move || compute(&busy))
    };
    (0..2 * cores).map(start).collect()
}

fn compute(busy: &AtomicBool) {
    let mut number = 1_u64;
    while busy.load(Ordering::Relaxed) {
        number = black_box(number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1));
    }
}

/// A truck's lines that note when a turn reads them.
struct Timed {
    inner: SimulatedHardware,
    /// Only what is read meanwhile counts.
    busy: Arc<AtomicBool>,
    last: Option<Instant>,
    late_us: Vec<u64>,
    done: Sender<Vec<u64>>,
}

impl Timed {
    /// The lines, and what they have noted when they are gone.
    fn new(inner: SimulatedHardware, busy: Arc<AtomicBool>) -> (Self, Receiver<Vec<u64>>) {
        let (done, turns) = mpsc::channel();
        (Self { inner, busy, last: None, late_us: Vec::new(), done }, turns)
    }
}

impl Drop for Timed {
    fn drop(&mut self) {
        let _ = self.done.send(std::mem::take(&mut self.late_us));
    }
}

impl Hardware for Timed {
    fn kind(&self) -> &'static str {
        self.inner.kind()
    }

    /// A turn begins with this.
    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let now = Instant::now();
        let last = self.last.replace(now);
        if let Some(last) = last.filter(|_| self.busy.load(Ordering::Relaxed)) {
            self.late_us.push((now - last).saturating_sub(TURN).as_micros() as u64);
        }
        self.inner.read_board(buffer)
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read_gyro(buffer)
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_board(bytes)
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_gyro(bytes)
    }
}
