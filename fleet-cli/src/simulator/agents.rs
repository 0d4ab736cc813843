//! Agents inside the simulator's process: the same `robot_agent::run` as on a real truck.

use crate::error::{Failure, Kind};
use robot_agent::AgentError;
use robot_agent::clock::Clock;
use robot_agent::config::AgentConfig;
use robot_agent::hardware::simulated::SimulatedHardware;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use xtb_control::VehicleConfig;
use xtb_nav::NavSettings;
use xtb_protocol::Name;
use xtb_protocol::messages::RosterEntry;

/// What all agents of a simulation share.
#[derive(Debug, Clone)]
pub(super) struct AgentSettings {
    pub(super) fleet: Name,
    pub(super) connect: Vec<String>,
    pub(super) vehicle: VehicleConfig,
    pub(super) record: Option<PathBuf>,
    pub(super) world_speed: f64,
}

/// One agent.
pub struct RunningAgent {
    end: watch::Sender<bool>,
    task: JoinHandle<()>,
    failure: Arc<Mutex<Option<Failure>>>,
}

impl RunningAgent {
    pub(super) fn start(
        settings: &AgentSettings,
        robot: &RosterEntry,
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
            start_pose: robot.start_pose.unwrap_or_default(),
            vehicle: settings.vehicle.clone(),
            record: settings.record.clone(),
            world_speed: settings.world_speed,
        };
        let (end, shutdown) = watch::channel(false);
        let failure = Arc::<Mutex<Option<Failure>>>::default();
        let slot = failure.clone();
        let task = tokio::spawn(async move {
            if let Err(error) = robot_agent::run(&config, Box::new(hardware), clock, shutdown).await {
                tracing::warn!("{}: {error}", config.robot);
                *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(failed(&config.robot, &error));
            }
        });
        Self { end, task, failure }
    }

    /// Why it ended, if it failed.
    #[must_use]
    pub fn failure(&self) -> Option<Failure> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Ends it cleanly.
    ///
    /// # Errors
    /// Why it had failed.
    pub async fn stop(self) -> Result<(), Failure> {
        self.end.send_replace(true);
        let _ = self.task.await;
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }
}

fn failed(robot: &Name, error: &AgentError) -> Failure {
    Failure::new(Kind::Failed, format!("{robot}: {error}")).hint(match error {
        AgentError::NameTaken(_) => "another simulator or agent uses this router; choose another --fleet",
        _ => "",
    })
}
