//! A message that is far too long takes no memory, and the link that it came over stays.

#![allow(clippy::print_stderr)] // measured figures, for whoever runs it with --nocapture

use fleet_tests::processes::{Process, RouterProcess, program};
use fleet_tests::{eventually, name};
use std::process::Command;
use std::time::Duration;
use xtb_bus::{Bus, SessionRole};
use xtb_protocol::keys::{Channel, FleetKeys, RobotKeys};
use xtb_protocol::messages::RobotState;

/// Far more than anybody here takes in. Its sender closes the link if it is not all on its way within 5 s of waiting
/// (Zenoh's `wait_before_close`), which 300 MB were not on a busy computer.
const HUGE: usize = 64_000_000;
/// A program may grow by so much while that comes in, in KiB.
const MAY_GROW_KIB: u64 = 32 << 10;

fn robot() -> RobotKeys {
    FleetKeys::new(name("lab")).robot(&name("xtb-1"))
}

async fn open(role: SessionRole) -> Bus {
    xtb_bus::open(&role).await.unwrap()
}

async fn state(bus: &Bus) -> Option<RobotState> {
    let answers = bus.get(&robot().state(), Duration::from_secs(1)).await.unwrap();
    answers.first().and_then(|answer| answer.decode().ok())
}

/// Throws it at the robot, and then something short that is counted, so that all has come by then.
async fn throw(bus: &Bus, programs: &[(&str, &Process)]) {
    eventually("the robot", || state(bus)).await;
    let stranger = name("stranger");
    let (key, channel) = (robot().teleop(Some(&stranger)), Channel::Cmd(stranger));
    let before: Vec<u64> = programs.iter().map(|(_, process)| process.memory_kib()).collect();
    for bytes in [vec![0; HUGE], vec![0; 4]] {
        let (bus, key, channel) = (bus.clone(), key.clone(), channel.clone());
        // It blocks while the link is full.
        let put = tokio::spawn(async move { bus.put_raw(&key, &channel, "application/json", bytes).await });
        put.await.unwrap().unwrap();
    }
    let counted = || async { state(bus).await.filter(|state| state.rejected.malformed > 0) };
    let state = eventually("the short one is counted", counted).await;
    for ((what, process), before) in programs.iter().zip(before) {
        let peak = process.peak_memory_kib();
        eprintln!("{HUGE} bytes at {what}: {} MiB before, {} MiB at most", before >> 10, peak >> 10);
        assert!(peak < before + MAY_GROW_KIB, "{what}: {before} KiB before, {peak} KiB at most");
    }
    assert_eq!(state.rejected.oversized, 0, "it never came in");
    assert!(bus.is_linked().await);
}

#[tokio::test(flavor = "multi_thread")]
async fn at_a_simulator_it_takes_no_memory_and_the_link_stays() {
    let mut sim = Command::new(program("fleet-cli"));
    sim.args(["--json", "sim", "--robots", "1", "--listen", "tcp/127.0.0.1:0"]);
    let (sim, line) = Process::start_ready(&mut sim);
    let endpoint = line.split('"').find(|part| part.starts_with("tcp/")).unwrap().to_owned();
    let bus = open(SessionRole::Client { connect: vec![endpoint] }).await;
    throw(&bus, &[("the simulator", &sim)]).await;
    bus.close().await;
}

fn agent(endpoint: &str) -> Process {
    let mut agent = Command::new(program("robot-agent"));
    agent.args(["--hardware", "simulated", "--name", "xtb-1", "--fleet", "lab", "--connect", endpoint]);
    Process::start(&mut agent)
}

#[tokio::test(flavor = "multi_thread")]
async fn at_a_router_it_takes_no_memory_and_the_link_stays() {
    let router = RouterProcess::start(None);
    let agent = agent(router.endpoint());
    let bus = open(SessionRole::Client { connect: vec![router.endpoint().to_owned()] }).await;
    throw(&bus, &[("the router", router.process()), ("the agent behind it", &agent)]).await;
    bus.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn from_a_false_router_it_takes_no_memory_of_an_agent_and_the_link_stays() {
    let bus = open(SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() }).await;
    let endpoint = bus.locators().await.remove(0);
    let agent = agent(&endpoint);
    throw(&bus, &[("an agent", &agent)]).await;
    bus.close().await;
}
