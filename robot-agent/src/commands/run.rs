//! No verb, or `record`: the robot runs until it is told to end.

use super::Failure;
use robot_agent::AgentError;
use robot_agent::clock::Clock;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::Hardware;
use robot_agent::hardware::serial::{PortSettings, SerialHardware};
use robot_agent::hardware::simulated::LoneTruck;
use robot_agent::logging::{self, LogFormat};
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;
use tokio::sync::watch;

pub(crate) fn run(file: &ConfigFile, record: Option<&Path>, log: LogFormat) -> Result<ExitCode, Failure> {
    let mut agent = file.agent()?;
    agent.record = record.map(Path::to_owned);
    logging::start(log, "info,zenoh=error,zenoh_transport=error");
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Failure::new(error, "the system is out of threads or memory"))?;
    let (hardware, clock) = open(file)?;
    let ended = runtime.block_on(async {
        let (end, shutdown) = watch::channel(false);
        tokio::spawn(async move {
            wait_for_signal().await;
            tracing::info!("ending: motor neutral first");
            end.send_replace(true);
            // The sender lives on, or the receivers would see it as gone.
            std::future::pending::<()>().await;
        });
        robot_agent::run(&agent, hardware, clock, shutdown).await
    });
    runtime.shutdown_timeout(Duration::from_millis(500));
    match ended {
        Ok(()) => Ok(ExitCode::SUCCESS),
        Err(error @ AgentError::NameTaken(_)) => {
            Err(Failure::new(error, "give this robot another --name, or end the other agent").code(4))
        }
        Err(error @ AgentError::Record(_)) => {
            Err(Failure::new(error, "--record takes a folder that you may write to"))
        }
        Err(error) => Err(Failure::new(error, "check the endpoints given with --connect")),
    }
}

/// The lines and the clock that go with the settings. A port that cannot be opened is no failure: it
/// is a fault that the state shows, and it is tried again.
pub(crate) fn open(file: &ConfigFile) -> Result<(Box<dyn Hardware>, Clock), Failure> {
    let hardware = &file.hardware;
    if hardware.kind == "serial" {
        let board = PortSettings { path: hardware.board.clone(), baud: hardware.board_baud };
        let gyro = PortSettings { path: hardware.gyro.clone(), baud: hardware.gyro_baud };
        let serial = SerialHardware::start(board, gyro)
            .map_err(|error| Failure::new(error, "the system is out of threads"))?;
        return Ok((Box::new(serial), Clock::real()));
    }
    let (truck, clock) = LoneTruck::start(u64::from(hardware.seed))
        .map_err(|error| Failure::new(error, "the simulated truck cannot be put into its room"))?;
    Ok((Box::new(truck), clock))
}

/// Returns at Ctrl-C or SIGTERM.
pub(crate) async fn wait_for_signal() {
    use tokio::signal::unix::{SignalKind, signal};
    let terminate = signal(SignalKind::terminate());
    match terminate {
        Ok(mut terminate) => {
            tokio::select! {
                _ = tokio::signal::ctrl_c() => {}
                _ = terminate.recv() => {}
            }
        }
        Err(_) => drop(tokio::signal::ctrl_c().await),
    }
}
