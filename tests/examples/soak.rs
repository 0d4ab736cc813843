//! A simulated fleet works for an hour in real time, each program a process of its own: does one of them hold more
//! and more?
//! `cargo build --release --workspace && cargo run --release -p fleet-tests --example soak [ROBOTS] [MINUTES] [SEED] [OUT.csv]`
//!
//! Router, simulator, dispatcher, dashboard with a page that reads, a recorder, and one robot-agent in a fleet of its
//! own. A script with a seed submits tasks all along: goto, patrol, wander. Every 10 s each process' memory and file
//! handles go to a CSV file. At the end a table, and exit code 1 if a limit was broken: memory of router, agent,
//! dispatcher and dashboard, file handles of all, contacts by the ground truth.

#![allow(clippy::print_stdout)] // a measurement's table

use fleet_tests::dispatch::Asker;
use fleet_tests::processes::{Process, program};
use fleet_tests::soak::{Growth, Held};
use fleet_tests::{Pilot, name};
use futures_util::{SinkExt, StreamExt};
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tokio::signal::unix::{SignalKind, signal};
use tokio_tungstenite::tungstenite::Message;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use xtb_bus::{Bus, Incoming, SessionRole};
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_protocol::Uuid;
use xtb_protocol::keys::{FleetKeys, Name};
use xtb_protocol::messages::{
    Body, DispatchBody, DispatchOutcome, DispatchRequest, LinkLoss, RobotState, Roster, TaskKind, TaskSpec,
    TaskState, Truth, TruthRobot, Via, Waypoint,
};

const FLEET: &str = "lab";
/// The fleet of the robot-agent that is a process: its room is not the others'.
const ALONE: &str = "alone";
const LOOK_EVERY: Duration = Duration::from_secs(10);
/// A line is printed after so many looks.
const LOOKS_A_LINE: usize = 60;
/// What may grow: memory in MiB in an hour, handles in the whole time.
const MOST_MIB_PER_H: f64 = 1.0;
const MOST_HANDLES: f64 = 1.0;
const ASK_WITHIN: Duration = Duration::from_secs(5);
/// Between two looks of the script at how many tasks are open.
const SUBMIT_EVERY: Duration = Duration::from_millis(100);
/// A task that nobody can do makes room for another one.
const DEADLINE: Duration = Duration::from_secs(300);
/// Points are at most so far outside the start poses.
const AROUND_M: f64 = 1.0;
/// The robot that is alone gets a goal this often, and none farther away than this.
const GOAL_EVERY: Duration = Duration::from_secs(20);
const GOAL_WITHIN_M: f64 = 4.0;
const INTERRUPTED: u8 = 130;
/// So many contacts are told one by one.
const TOUCHES: usize = 100;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error + Send + Sync>>;

#[tokio::main]
async fn main() -> Result<ExitCode> {
    // From now on Ctrl-C ends what was started.
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |n: usize, default: u64| arguments.get(n).map_or(Ok(default), |text| text.parse());
    let (robots, minutes, seed) = (number(0, 50)?, number(1, 60)?, number(2, 1)?);
    let out = arguments.get(3).map_or("soak.csv", String::as_str);
    let mut csv = File::create(out)?;
    writeln!(csv, "seconds,process,memory_kib,handles,cpu_s")?;
    let folder = tempfile::tempdir()?;
    let Started { mut watched, endpoint, page } = start(folder.path(), robots, seed)?;
    println!("{robots} robots, {minutes} min, seed {seed}; load {} before; looks go to {out}", load());

    let bus = xtb_bus::open(&SessionRole::Client { connect: vec![endpoint] }).await?;
    let keys = FleetKeys::new(name(FLEET));
    let seen = Arc::<Mutex<Seen>>::default();
    let truths = seen.clone();
    let hear = move |incoming: Incoming| {
        if let Ok(truth) = incoming.decode::<Truth>() {
            lock(&truths).take(&truth);
        }
    };
    let _truth = bus.subscribe(&keys.sim_truth(), hear).await?;
    let states = seen.clone();
    let hear = move |incoming: Incoming| {
        if let Ok(state) = incoming.decode::<RobotState>() {
            let does = format!("{:?} {:?}", state.mode, state.stopped_because);
            lock(&states).does.insert(state.robot, does);
        }
    };
    let _states = bus.subscribe(&keys.any_robot().state(), hear).await?;
    let script = Script { asker: Asker::new(&bus, "soak"), area_m: area_m(&bus, &keys).await?, robots };
    let end = tokio::select! {
        biased;
        _ = interrupt.recv() => End::Interrupted,
        _ = terminate.recv() => End::Interrupted,
        end = look_on(&mut watched, &mut csv, Duration::from_secs(60 * minutes)) => end?,
        end = read_page(&page, &seen) => end?,
        () = script.submit(Pcg32::new(seed, 0x50a4), &seen) => End::Broken("the script has ended".into()),
        () = drive_alone(&bus, Pcg32::new(seed, 0xa10e)) => End::Broken("nobody drives the agent".into()),
    };
    let mut broken = table(&watched);
    if matches!(end, End::Interrupted) {
        return Ok(ExitCode::from(INTERRUPTED));
    }
    broken.extend(script.told().await);
    broken.extend(lock(&seen).told());
    if let End::Broken(why) = end {
        broken.push(why);
    }
    for why in &broken {
        println!("limit broken: {why}");
    }
    Ok(if broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Why it is over.
enum End {
    Time,
    Interrupted,
    Broken(String),
}

/// A process and what it held.
struct Watched {
    name: &'static str,
    /// Whether its memory has a limit.
    limited: bool,
    process: Process,
    looks: Vec<Held>,
}

/// All of them; where the router is, and where the page.
struct Started {
    watched: Vec<Watched>,
    endpoint: String,
    page: String,
}

fn start(folder: &Path, robots: u64, seed: u64) -> Result<Started> {
    let (router, line) = ready("router", &mut cli(&["router", "--listen", "tcp/127.0.0.1:0"]))?;
    let endpoint = line.split('"').find(|part| part.starts_with("tcp/")).ok_or("no endpoint")?.to_owned();
    let (robots, seed) = (robots.to_string(), seed.to_string());
    let at = |arguments: &[&str]| {
        let mut command = cli(&["--connect", &endpoint]);
        command.args(arguments);
        command
    };
    let (simulator, _) = ready("simulator", &mut at(&["sim", "--robots", &robots, "--seed", &seed]))?;
    let mut dispatcher = at(&["dispatch", "serve", "--ledger"]);
    let (dispatcher, _) = ready("dispatcher", dispatcher.arg(folder.join("lab.ledger")))?;
    let (dashboard, line) = ready("dashboard", &mut at(&["dashboard", "--listen", "127.0.0.1:0"]))?;
    let page = serde_json::from_str::<Value>(&line)?["address"].as_str().ok_or("no address")?.to_owned();
    let (recorder, _) = ready("recorder", at(&["record", "--out"]).arg(folder.join("lab.mcap")))?;
    let mut agent = Command::new(program("robot-agent"));
    agent.args(["--hardware", "simulated", "--name", "xtb-1", "--fleet", ALONE, "--connect", &endpoint]);
    let agent = Process::start(agent.stdout(Stdio::null()));
    let watched = [
        ("router", true, router),
        ("agent", true, agent),
        ("dispatcher", true, dispatcher),
        ("dashboard", true, dashboard),
        ("simulator", false, simulator),
        ("recorder", false, recorder),
    ];
    let watched =
        watched.map(|(name, limited, process)| Watched { name, limited, process, looks: Vec::new() });
    Ok(Started { watched: watched.into(), endpoint, page })
}

fn cli(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.arg("--json").args(arguments);
    command
}

/// Starts it and waits for its line.
fn ready(what: &str, command: &mut Command) -> Result<(Process, String)> {
    let (process, line) = Process::start_ready(command);
    if !line.starts_with("{\"ready\":true") {
        return Err(format!("the {what} says {line:?}").into());
    }
    Ok((process, line))
}

/// Looks at all processes again and again, until the time is over or one of them has ended.
async fn look_on(watched: &mut [Watched], csv: &mut File, length: Duration) -> Result<End> {
    let began = Instant::now();
    let mut look = tokio::time::interval(LOOK_EVERY);
    loop {
        look.tick().await;
        let at_s = began.elapsed().as_secs_f64();
        for Watched { name, process, looks, .. } in watched.iter_mut() {
            if !process.runs() {
                return Ok(End::Broken(format!("{name}: has ended after {at_s:.0} s")));
            }
            let held = Held::look(process.0.id(), at_s)?;
            writeln!(csv, "{at_s:.1},{name},{},{},{:.2}", held.memory_kib, held.handles, held.cpu_s)?;
            looks.push(held);
        }
        if watched.first().is_some_and(|first| first.looks.len().is_multiple_of(LOOKS_A_LINE)) {
            let now =
                watched.iter().filter_map(|it| Some(format!("{} {:.1}", it.name, mib(it.looks.last()?))));
            println!("{at_s:.0} s: {} MiB", now.collect::<Vec<_>>().join(", "));
        }
        if began.elapsed() >= length {
            return Ok(End::Time);
        }
    }
}

fn mib(held: &Held) -> f64 {
    held.memory_kib as f64 / 1024.0
}

/// Prints it, and returns the limits that were broken.
fn table(watched: &[Watched]) -> Vec<String> {
    let mut broken = Vec::new();
    println!(
        "\n| process | memory, MiB: first | last | growth, MiB/h | in the last quarter | handles: first | last | growth | CPU, cores |"
    );
    println!("|{}", " ---: |".repeat(9));
    for Watched { name, limited, looks, .. } in watched {
        let (Some(first), Some(last), Some(growth)) = (looks.first(), looks.last(), Growth::of(looks)) else {
            broken.push(format!("{name}: too few looks"));
            continue;
        };
        println!(
            "| {name} | {:.1} | {:.1} | {:+.2} | {:+.2} | {} | {} | {:+.2} | {:.3} |",
            mib(first),
            mib(last),
            growth.memory_mib_per_h,
            growth.late_mib_per_h,
            first.handles,
            last.handles,
            growth.handles,
            growth.cores
        );
        if *limited && growth.memory_mib_per_h > MOST_MIB_PER_H {
            let grown = growth.memory_mib_per_h;
            broken.push(format!("{name}: memory grows by {grown:.2} MiB/h, at most {MOST_MIB_PER_H} may be"));
        }
        if growth.handles.abs() >= MOST_HANDLES {
            broken.push(format!("{name}: the number of file handles changed by {:+.1}", growth.handles));
        }
    }
    broken
}

/// What the client has seen.
#[derive(Debug, Default)]
struct Seen {
    /// The world's time in s, and when: first and last.
    times: Option<[(Instant, f64); 2]>,
    robots: BTreeMap<Name, TruthRobot>,
    /// What each says that it does.
    does: BTreeMap<Name, String>,
    /// Who had the first ones, and who was near.
    touches: Vec<String>,
    frames: u64,
    submitted: u64,
    refused: u64,
    unanswered: u64,
}

fn lock(seen: &Mutex<Seen>) -> MutexGuard<'_, Seen> {
    seen.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Seen {
    fn take(&mut self, truth: &Truth) {
        let now = (Instant::now(), truth.t_s);
        self.times = Some([self.times.map_or(now, |[first, _]| first), now]);
        for (name, robot) in &truth.robots {
            let before = self.robots.insert(name.clone(), *robot);
            if let Some(before) = before.filter(|before| robot.contacts > before.contacts)
                && self.touches.len() < TOUCHES
            {
                self.touches.push(touch(truth, name, &before, &self.does));
            }
        }
    }

    /// Prints it, and returns the limits that were broken.
    fn told(&self) -> Vec<String> {
        let real_time = self.times.map_or(f64::NAN, |[(began, first_s), (now, last_s)]| {
            (last_s - first_s) / now.duration_since(began).as_secs_f64()
        });
        let Self { touches, frames, submitted, refused, unanswered, .. } = self;
        let contacts: u64 = self.robots.values().map(|robot| robot.contacts).sum();
        println!("{submitted} tasks submitted, {refused} refused, {unanswered} without an answer");
        println!("{contacts} contacts, {frames} frames of the page, {real_time:.2} × real time");
        touches.iter().for_each(|touch| println!("contact: {touch}"));
        if contacts == 0 { Vec::new() } else { vec![format!("{contacts} contacts")] }
    }
}

/// One contact: who drove, and the nearest other truck as that one sees it.
fn touch(truth: &Truth, name: &Name, robot: &TruthRobot, does: &BTreeMap<Name, String>) -> String {
    let others = truth.robots.iter().filter(|(other, _)| *other != name);
    let away_m = |other: &TruthRobot| (other.x_m - robot.x_m).hypot(other.y_m - robot.y_m);
    let nearest = others.min_by(|(_, a), (_, b)| away_m(a).total_cmp(&away_m(b)));
    let at = format!("{:.1} s, {name} at {:.2} {:.2}", truth.t_s, robot.x_m, robot.y_m);
    let Some((other, its)) = nearest else { return at };
    let degrees = |rad: f64| wrap_rad(rad).to_degrees();
    let bearing = degrees((its.y_m - robot.y_m).atan2(its.x_m - robot.x_m) - robot.yaw_rad);
    let heading = degrees(its.yaw_rad - robot.yaw_rad);
    let [mine, others] = [name, other].map(|name| does.get(name).map_or("?", String::as_str));
    format!(
        "{at} with {:.2} m/s, {mine}: {other} is {:.2} m away at {bearing:.0}°, heads {heading:.0}°, drives {:.2} m/s, {others}",
        robot.speed_mps,
        away_m(its),
        its.speed_mps
    )
}

/// Whoever submits tasks.
struct Script {
    asker: Asker,
    /// Where points are: along x, along y.
    area_m: [(f64, f64); 2],
    robots: u64,
}

impl Script {
    /// Keeps as many tasks open as there are robots; does not end.
    async fn submit(&self, mut dice: Pcg32, seen: &Mutex<Seen>) {
        loop {
            tokio::time::sleep(SUBMIT_EVERY).await;
            let status = self.ask(DispatchBody::Status {}).await;
            if !matches!(status, Some(DispatchOutcome::Status(status)) if status.open < self.robots) {
                continue;
            }
            let outcome = self.ask(DispatchBody::Submit { tasks: vec![self.task(&mut dice)] }).await;
            let mut seen = lock(seen);
            match outcome {
                Some(DispatchOutcome::Submitted(_)) => seen.submitted += 1,
                Some(_) => seen.refused += 1,
                None => seen.unanswered += 1,
            }
        }
    }

    async fn ask(&self, body: DispatchBody) -> Option<DispatchOutcome> {
        let request = DispatchRequest { id: Uuid::new_v4(), body };
        self.asker.ask_once(&request).await.map(|reply| reply.result)
    }

    fn task(&self, dice: &mut Pcg32) -> TaskSpec {
        let kind = match dice.next_u32() % 4 {
            0 => TaskKind::Patrol {
                points: (0..3).map(|_| self.point(dice)).collect(),
                dwell_s: 2.0,
                for_s: Some(60.0 + 120.0 * share(dice)),
            },
            1 => TaskKind::Wander { for_s: 20.0 + 40.0 * share(dice) },
            _ => TaskKind::Goto { to: self.point(dice) },
        };
        let deadline = (SystemTime::now() + DEADLINE).duration_since(UNIX_EPOCH).ok();
        let deadline_ms = deadline.and_then(|since| u64::try_from(since.as_millis()).ok());
        TaskSpec { deadline_ms, ..TaskSpec::new(kind) }
    }

    fn point(&self, dice: &mut Pcg32) -> Waypoint {
        let [x_m, y_m] = self.area_m.map(|(from_m, to_m)| from_m + (to_m - from_m) * share(dice));
        Waypoint { x_m, y_m, yaw_rad: None }
    }

    /// Prints how the tasks stand, and returns whether they stand as they must not.
    async fn told(&self) -> Option<String> {
        let list = self.asker.list().await;
        let mut states = BTreeMap::<TaskState, usize>::new();
        for task in list.iter().flat_map(|list| &list.tasks) {
            *states.entry(task.state).or_default() += 1;
        }
        println!("\nremembered tasks: {states:?}");
        (!states.contains_key(&TaskState::Done)).then(|| "no task was done".to_owned())
    }
}

/// From 0 to 1.
fn share(dice: &mut Pcg32) -> f64 {
    f64::from(dice.next_u32()) / f64::from(u32::MAX)
}

/// Where the robots started, and a little around that.
async fn area_m(bus: &Bus, keys: &FleetKeys) -> Result<[(f64, f64); 2]> {
    let rosters = bus.get(&keys.sim_roster(), ASK_WITHIN).await?;
    let roster = rosters.first().ok_or("no roster")?.decode::<Roster>()?;
    let starts: Vec<MapPose> = roster.robots.iter().filter_map(|robot| robot.start_pose).collect();
    let span = |value: fn(&MapPose) -> f64| {
        let least = starts.iter().map(value).fold(f64::INFINITY, f64::min);
        let most = starts.iter().map(value).fold(f64::NEG_INFINITY, f64::max);
        (least - AROUND_M, most + AROUND_M)
    };
    Ok([span(|pose| pose.x_m), span(|pose| pose.y_m)])
}

/// Gives the robot of its own fleet goals; does not end.
async fn drive_alone(bus: &Bus, mut dice: Pcg32) {
    let pilot = Pilot::new(bus, ALONE, "xtb-1", "soak").await;
    let (on_link_loss, finish_s) = (LinkLoss::Finish, 300.0);
    loop {
        let [x_m, y_m] = [(); 2].map(|()| GOAL_WITHIN_M * (2.0 * share(&mut dice) - 1.0));
        let body = match dice.next_u32() % 2 {
            0 => Body::Wander { for_s: None, on_link_loss, finish_s },
            _ => Body::Goto { x_m, y_m, yaw_rad: None, via: Some(Via::Direct), on_link_loss, finish_s },
        };
        pilot.ask(body).await;
        tokio::time::sleep(GOAL_EVERY).await;
    }
}

/// Reads what the dashboard sends and answers it as its page does, until it is closed.
async fn read_page(address: &str, seen: &Mutex<Seen>) -> Result<End> {
    let mut request = format!("ws://{address}/ws").into_client_request()?;
    request.headers_mut().insert("origin", format!("http://{address}").parse()?);
    let (mut socket, _) = tokio_tungstenite::connect_async(request).await?;
    socket.send(Message::Text(json!({ "watch": "xtb-1" }).to_string().into())).await?;
    while let Some(message) = socket.next().await {
        let Message::Text(text) = message? else { continue };
        let message: Value = serde_json::from_str(&text)?;
        if let Some(n) = message["frame"]["n"].as_u64() {
            lock(seen).frames += 1;
            socket.send(Message::Text(json!({ "seen": n }).to_string().into())).await?;
        }
    }
    Ok(End::Broken("dashboard: it has closed the page".into()))
}

/// Of the last minute, five minutes and quarter of an hour.
fn load() -> String {
    let text = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split_whitespace().take(3).collect::<Vec<_>>().join(" ")
}
