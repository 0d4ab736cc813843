//! One robot: the whole first-level controller beside its Zenoh session, in one process.
//!
//! [`run`] is the agent. Read it top to bottom: lines and loop first, so that the truck is under
//! control before anybody can talk to it; then the session; presence last. It ends in the opposite
//! order: motors first, then queries, then the session.

pub mod clock;
pub mod config;
mod control_loop;
mod counters;
mod downlink;
pub mod enrol;
mod fast_path;
pub mod hardware;
mod inbox;
pub mod logging;
mod loop_pool;
mod mailbox;
mod map_file;
mod map_reader;
mod nav_inputs;
mod neighbours;
mod planner_worker;
pub mod realtime;
mod recorder;
mod recording_server;
pub mod replay;
mod ros2;
mod session;
mod sessions;
pub mod settings_file;
mod shared;
mod snapshot;
mod systemd;
mod uplink;
mod wake;

pub use shared::SharedResources;
pub use xtb_recording::files;

use crate::clock::Clock;
use crate::config::AgentConfig;
use crate::hardware::Hardware;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use thiserror::Error;
use tokio::sync::watch;
use xtb_bus::BusError;
use xtb_nav::navigator::PreparedMap;
use xtb_protocol::{Name, Uuid};
use xtb_robot::{Robot, RobotIdentity};

/// The agent's version, as events and factsheet give it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Why an agent ended.
#[derive(Debug, Error)]
pub enum AgentError {
    /// Another agent of this name is alive.
    #[error("name_taken: {0} is already in use in this fleet")]
    NameTaken(Name),
    /// Zenoh would not.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The map file cannot be used.
    #[error("map {path}: {reason}")]
    Map {
        /// The file.
        path: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The recording cannot be made.
    #[error("cannot record: {0}")]
    Record(std::io::Error),
    /// The system would not.
    #[error("operating system error: {0}")]
    Thread(#[from] std::io::Error),
}

/// Becomes true when everything shall end.
pub type Shutdown = watch::Receiver<bool>;

/// Runs a robot until `shutdown`.
///
/// # Errors
/// [`AgentError`]; the truck has been told to stand before it is returned.
pub fn run(config: &AgentConfig, hardware: Box<dyn Hardware>, clock: Clock, shutdown: Shutdown) -> Run<'_> {
    let (link_lease, shared) = (xtb_bus::LINK_LEASE, SharedResources::default());
    let host = Host { link_lease, alive: Box::new(|| {}), shared, is_service: true };
    run_hosted(config, hardware, clock, shutdown, host)
}

/// A robot's life. Boxed, so that it is compiled here, and not once more in each program that runs it.
pub type Run<'a> = Pin<Box<dyn Future<Output = Result<(), AgentError>> + Send + 'a>>;

/// What an agent has to know of the program that it runs in.
pub struct Host {
    /// The router takes its link for lost after so much silence. Longer where many agents share a program:
    /// a busy one is late with all of them, and links that break make it busier.
    pub link_lease: Duration,
    /// Called when the robot is present under its name, and can be commanded.
    pub alive: Box<dyn FnOnce() + Send>,
    /// What it has together with the others.
    pub shared: SharedResources,
    /// The program is this robot alone: if systemd has started it, systemd is told how it is.
    pub is_service: bool,
}

/// Runs a robot within a program that has others too.
///
/// # Errors
/// As [`run`].
pub fn run_hosted(
    config: &AgentConfig,
    hardware: Box<dyn Hardware>,
    clock: Clock,
    shutdown: Shutdown,
    host: Host,
) -> Run<'_> {
    Box::pin(live(config, hardware, clock, shutdown, host))
}

async fn live(
    config: &AgentConfig,
    hardware: Box<dyn Hardware>,
    clock: Clock,
    shutdown: Shutdown,
    host: Host,
) -> Result<(), AgentError> {
    let identity = RobotIdentity {
        fleet: config.fleet.clone(),
        robot: config.robot.clone(),
        // Random and exact in every language's numbers.
        epoch: (Uuid::new_v4().as_u128() >> 76) as u64,
        start_pose: config.start_pose,
    };
    let mut about = session::about(config, &identity, hardware.kind());
    let mut robot = Robot::new(identity.clone(), config.vehicle.clone(), VERSION);
    robot.agent_mut().set_navigation(&config.vehicle, &config.navigation);
    robot.agent_mut().set_world_speed(config.world_speed);
    if let Some(path) = &config.map {
        robot.agent_mut().set_floor(Arc::new(PreparedMap::of(map_file::read(path)?)));
    }
    let (recorder, recording) = match &config.record {
        Some(folder) => {
            robot.record_steps();
            let started = recorder::start(folder, config, identity.epoch).map_err(AgentError::Record)?;
            (Some(started.0), Some(started.1))
        }
        None => (None, None),
    };
    let (loop_ends, session_ends, notes) = mailbox::mailbox();
    tokio::spawn(mailbox::log(notes));
    let stop = StopOnDrop(Arc::new(AtomicBool::new(false)));
    let parts = (robot, hardware, clock.clone());
    let (control, realtime) =
        host.shared.start_loop(parts, loop_ends, recorder, stop.0.clone(), config.realtime)?;
    realtime.log();
    if host.is_service {
        tokio::spawn(systemd::follow(session_ends.snapshot.clone()));
    }
    about.vehicle.push(realtime.parameter());
    let ended = session::run(config, &clock, session_ends, about, shutdown, || stop.now(), host).await;
    stop.now();
    // A turn lasts 5 ms: joining is short.
    let joined = tokio::task::spawn_blocking(move || {
        let control = control.join();
        // The loop's end of the queue is gone now: the recorder finishes its file.
        control.and(recording.map_or(Ok(()), JoinHandle::join))
    });
    if !matches!(joined.await, Ok(Ok(()))) {
        tracing::error!("the control loop or the recorder panicked");
    }
    ended
}

/// Ends the control loop, also when the agent's future is dropped half way.
struct StopOnDrop(Arc<AtomicBool>);

impl StopOnDrop {
    fn now(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.now();
    }
}
