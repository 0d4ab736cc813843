//! Agents inside the simulator's process: the same `robot_agent::run` as on a real truck.

use robot_agent::clock::Clock;
use robot_agent::config::{AgentConfig, Ros2};
use robot_agent::hardware::simulated::SimulatedHardware;
use robot_agent::{AgentError, Host, SharedResources};
use std::path::PathBuf;
use std::time::Duration;
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_bus::Enrolled;
use xtb_client::{Error, ErrorKind};
use xtb_control::VehicleConfig;
use xtb_nav::NavSettings;
use xtb_protocol::Name;
use xtb_protocol::messages::RosterEntry;

/// What all agents of a simulation share.
#[derive(Debug, Clone)]
pub(super) struct AgentSettings {
    pub(super) fleet: Name,
    pub(super) connect: Vec<String>,
    pub(super) identity: Option<Enrolled>,
    pub(super) record: Option<PathBuf>,
    pub(super) ros2: Option<u32>,
    pub(super) world_speed: f64,
    pub(super) link_lease: Duration,
    pub(super) shared: SharedResources,
}

/// How far an agent has come.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Life {
    /// It looks for its name, its router and its truck.
    Starting,
    /// It is present under its name.
    Alive,
    /// It has ended by itself.
    Failed(Error),
}

/// One agent.
pub struct RunningAgent {
    end: watch::Sender<bool>,
    task: JoinHandle<()>,
    life: watch::Receiver<Life>,
}

impl RunningAgent {
    pub(super) fn start(
        settings: &AgentSettings,
        (robot, vehicle): (&RosterEntry, &VehicleConfig),
        hardware: SimulatedHardware,
        clock: Clock,
    ) -> Self {
        let config = AgentConfig {
            navigation: NavSettings::default(),
            map: None,
            fleet: settings.fleet.clone(),
            robot: robot.name.clone(),
            peer: false,
            connect: settings.connect.clone(),
            identity: settings.identity.clone(),
            start_pose: robot.start_pose.unwrap_or_default(),
            vehicle: vehicle.clone(),
            record: settings.record.clone(),
            settings_file: None,
            realtime: false,
            ros2: settings.ros2.map(|domain| Ros2::of(&robot.name, domain)),
            world_speed: settings.world_speed,
        };
        let (link_lease, shared) = (settings.link_lease, settings.shared.clone());
        let (end, shutdown) = watch::channel(false);
        let (told, life) = watch::channel(Life::Starting);
        let task = tokio::spawn(async move {
            let telling = told.clone();
            let alive = Box::new(move || drop(telling.send_replace(Life::Alive)));
            let host = Host { link_lease, alive, shared, is_service: false };
            let hardware = Box::new(hardware);
            if let Err(error) = robot_agent::run_hosted(&config, hardware, clock, shutdown, host).await {
                tracing::warn!("{}: {error}", config.robot);
                told.send_replace(Life::Failed(failed(&config, &error)));
            }
        });
        Self { end, task, life }
    }

    /// How far it has come.
    pub(super) fn life(&self) -> Life {
        self.life.borrow().clone()
    }

    /// Ends it cleanly.
    ///
    /// # Errors
    /// Why it had failed.
    pub async fn stop(self) -> Result<(), Error> {
        self.end.send_replace(true);
        let _ = self.task.await;
        match self.life.borrow().clone() {
            Life::Failed(failure) => Err(failure),
            Life::Starting | Life::Alive => Ok(()),
        }
    }
}

fn failed(config: &AgentConfig, error: &AgentError) -> Error {
    match error {
        AgentError::NameTaken(name) => names_taken(&config.fleet, std::slice::from_ref(name)),
        AgentError::Record(_) => Error::new(ErrorKind::Failed, format!("{}: {error}", config.robot))
            .hint("--record needs a folder with write permission and room on its disk"),
        _ => Error::new(ErrorKind::Failed, format!("{}: {error}", config.robot)),
    }
}

/// Robots of these names are in the fleet already.
pub(super) fn names_taken(fleet: &Name, names: &[Name]) -> Error {
    let are = if names.len() == 1 { "is" } else { "are" };
    let names = names.iter().map(Name::as_str).collect::<Vec<_>>().join(", ");
    Error::new(ErrorKind::NameTaken, format!("name_taken: {names} {are} already in use in fleet {fleet}"))
        .hint("another simulator or agent uses this router; choose another --fleet")
}
