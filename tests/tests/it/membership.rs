//! Robots that come, go, restart, and share a name; routers that are late or restart.

use fleet_tests::{Fleet, PATIENCE, Setup, agent_config, eventually, name};
use robot_agent::AgentError;
use robot_agent::clock::WorldTime;
use robot_agent::hardware::simulated::{RunningWorld, SimulatedHardware};
use std::sync::Arc;
use std::sync::atomic::{AtomicU16, Ordering};
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::{Bus, SessionRole};
use xtb_control::Mode;
use xtb_protocol::Uuid;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{Body, GoalStatus, Lease, Outcome, Request, Setpoint, StopReason};
use xtb_sim::{Simulation, TruckParameters, World};

#[tokio::test(flavor = "multi_thread")]
async fn robots_leave_and_join_while_others_drive() {
    let mut fleet = Fleet::start(Setup { robots: 2, ..Setup::default() }).await;
    let goal = fleet.goto(1, 0.0, 2.5).await;
    fleet.simulator.stop_agent(1).await;
    eventually("the leaving", || async { (fleet.alive().await.len() == 1).then_some(()) }).await;
    fleet.simulator.restart_agent(1);
    eventually("the joining", || async { (fleet.alive().await.len() == 2).then_some(()) }).await;
    assert_eq!(fleet.outcome(1, goal).await, GoalStatus::Reached);
    let start = fleet.truth(2);
    let second = fleet.goto(2, start.x_m, start.y_m + 1.0).await;
    assert_eq!(fleet.outcome(2, second).await, GoalStatus::Reached);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_that_restarts_in_mid_goal_does_not_move_by_itself() {
    let mut fleet = Fleet::start(Setup::default()).await;
    fleet.goto(1, 0.0, 4.0).await;
    fleet.until(1, "driving", |state| state.speed_mps.is_some_and(|mps| mps > 0.05)).await;
    let epoch = fleet.state(1).await.epoch;
    fleet.simulator.stop_agent(0).await;
    fleet.simulator.restart_agent(0);
    let state = fleet.until(1, "the new boot", |state| state.epoch != epoch).await;
    assert_eq!((state.mode, state.goal), (Mode::Idle, None));
    eventually("standing", || async { (fleet.truth(1).speed_mps == 0.0).then_some(()) }).await;
    let before = fleet.truth(1);
    // Somebody who has not noticed goes on: his lease is of the boot before.
    let lease = Some(Lease { epoch, root: 1 });
    let old = Setpoint { lease, seq: 7, echo_tick_ms: None, rpm: 20.0, steering: 0.0 };
    let driver = name("driver");
    let (key, channel) = (fleet.robot(1).teleop(Some(&driver)), Channel::Teleop(driver));
    let until_s = fleet.time_s() + 3.0;
    eventually("three seconds of old setpoints", || async {
        fleet.bus.put(&key, &channel, &old, Format::Postcard).await.unwrap();
        (fleet.time_s() > until_s).then_some(())
    })
    .await;
    fleet.until(1, "old setpoints counted", |state| state.rejected.fenced > 0).await;
    let after = fleet.truth(1);
    assert_eq!((before.x_m, before.y_m), (after.x_m, after.y_m));
    assert!(after.neutral_since_s.is_some());
    assert_eq!(fleet.state(1).await.stopped_because, vec![StopReason::NoCommand]);
    fleet.end().await;
}

/// An agent with a truck of its own, outside any fleet's simulator.
pub(crate) struct LoneAgent {
    end: watch::Sender<bool>,
    task: JoinHandle<Result<(), AgentError>>,
    /// What the board gives the motor.
    pub(crate) motor: Arc<AtomicU16>,
    _world: RunningWorld,
}

pub(crate) fn lone_agent(endpoint: &str, fleet: &str) -> LoneAgent {
    let simulation = Simulation::new(World::default(), &TruckParameters::default(), &["truck"], 1).unwrap();
    let (hardware, lines) = SimulatedHardware::connect();
    let time = WorldTime::new();
    let clock = time.join();
    let motor = Arc::new(AtomicU16::new(0));
    let seen = motor.clone();
    let world = RunningWorld::start(simulation, vec![lines], time, 1.0, move |simulation| {
        let truth = simulation.trucks().first().map(|truck| truck.truth());
        seen.store(truth.map_or(0, |truth| truth.motor_counts), Ordering::Relaxed);
    })
    .unwrap();
    let config = agent_config(endpoint, fleet);
    let (end, shutdown) = watch::channel(false);
    let task =
        tokio::spawn(async move { robot_agent::run(&config, Box::new(hardware), clock, shutdown).await });
    LoneAgent { end, task, motor, _world: world }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_second_agent_of_a_name_refuses_to_start() {
    let fleet = Fleet::start(Setup::default()).await;
    let second = lone_agent(fleet.simulator.endpoint(), "lab");
    let ended = tokio::time::timeout(PATIENCE, second.task).await.unwrap().unwrap();
    assert!(matches!(ended, Err(AgentError::NameTaken(taken)) if taken == name("xtb-1")));
    assert_eq!(fleet.alive().await.len(), 1);
    fleet.end().await;
}

pub(crate) async fn router(endpoint: &str) -> Bus {
    let role = SessionRole::Router { listen: vec![endpoint.to_owned()], connect: Vec::new() };
    eventually("the port", || async { xtb_bus::open(&role).await.ok() }).await
}

/// No other test's robot can be taken for this fleet's, should their routers exchange ports.
const LATE: &str = "late";

/// A client that is new each time sees the robot and gets an answer from it.
async fn works(endpoint: &str) {
    let keys = FleetKeys::new(name(LATE)).robot(&name("xtb-1"));
    let role = SessionRole::Client { connect: vec![endpoint.to_owned()] };
    eventually("a robot that answers", || async {
        let bus = xtb_bus::open(&role).await.ok()?;
        let within = Duration::from_secs(1);
        let alive = bus.alive(&keys.alive(), within).await.ok()?;
        let request = Request { id: Uuid::new_v4(), lease: None, body: Body::Stop {} };
        let reply = bus.ask(&keys, &name("test"), &request, within).await.ok().flatten();
        bus.close().await;
        (alive.len() == 1 && matches!(reply?.result, Outcome::Ok(_))).then_some(())
    })
    .await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_before_its_router_and_one_whose_router_restarts_work_as_soon_as_it_is_there() {
    // A port that is free now; nobody else is told of it.
    let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let endpoint = format!("tcp/127.0.0.1:{port}");
    let agent = lone_agent(&endpoint, LATE);
    let first = router(&endpoint).await;
    works(&endpoint).await;
    first.close().await;
    let second = router(&endpoint).await;
    works(&endpoint).await;
    agent.end.send_replace(true);
    assert!(tokio::time::timeout(PATIENCE, agent.task).await.unwrap().unwrap().is_ok());
    second.close().await;
}
