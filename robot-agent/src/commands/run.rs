//! No verb, or `record`: the robot runs until it is told to end.

use super::{Failure, identity};
use robot_agent::AgentError;
use robot_agent::clock::Clock;
use robot_agent::config::ConfigFile;
use robot_agent::hardware::Hardware;
use robot_agent::hardware::instruments::Instruments;
use robot_agent::hardware::serial::{PortSettings, SerialHardware};
use robot_agent::logging::{self, LogFormat};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, SystemTime};
use tokio::sync::watch;
use xtb_bus::Enrolled;
use xtb_control::vehicle::Imu;

pub(crate) fn run(
    file: &ConfigFile,
    settings_file: Option<PathBuf>,
    identity: Option<Enrolled>,
    record: Option<&Path>,
    log: LogFormat,
) -> Result<ExitCode, Failure> {
    let mut agent = file.agent()?;
    agent.record = record.map(Path::to_owned);
    agent.settings_file = settings_file;
    logging::start(log, "info,zenoh=error,zenoh_transport=error");
    if let Some(identity) = &identity {
        identity::check(identity, SystemTime::now())?;
    }
    agent.identity = identity;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(|error| Failure::new(error, "out of threads or memory"))?;
    let (hardware, clock) = open(file)?;
    let ended = runtime.block_on(async {
        let (end, shutdown) = watch::channel(false);
        tokio::spawn(async move {
            wait_for_signal().await;
            tracing::info!("shutting down: motor to neutral first");
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
            Err(Failure::new(error, "--record needs a folder with write permission"))
        }
        Err(error) => Err(Failure::new(error, "check the endpoints given with --connect")),
    }
}

/// The lines and the clock that go with the settings. A port that cannot be opened is no failure: it
/// is a fault that the state shows, and it is tried again.
pub(crate) fn open(file: &ConfigFile) -> Result<Lines, Failure> {
    let hardware = &file.hardware;
    match hardware.kind.as_str() {
        "serial" => {
            let board = PortSettings { path: hardware.board.clone(), baud: hardware.board_baud };
            let gyro = (file.vehicle.imu == Imu::ThreeDmG)
                .then(|| PortSettings { path: hardware.gyro.clone(), baud: hardware.gyro_baud });
            let serial =
                SerialHardware::start(board, gyro).map_err(|error| Failure::new(error, "out of threads"))?;
            Ok((Box::new(serial), Clock::real()))
        }
        "simulated" => open_simulated(file, 1.0).map(|(lines, _)| lines),
        _ => Err(Failure::new("no hardware is configured", NO_HARDWARE).code(2)),
    }
}

#[cfg(feature = "sim")]
const NO_HARDWARE: &str = "--hardware serial --board PORT --gyro PORT for a truck (`robot-agent ports` lists \
    the ports), --hardware simulated for one simulated truck in an empty room";
#[cfg(not(feature = "sim"))]
const NO_HARDWARE: &str =
    "--hardware serial --board PORT --gyro PORT for a truck (`robot-agent ports` lists the ports)";

/// One simulated truck at `speed` × real time, and the instruments that a person holds to it.
#[cfg(feature = "sim")]
pub(crate) fn open_simulated(file: &ConfigFile, speed: f64) -> Result<(Lines, Instruments), Failure> {
    use robot_agent::hardware::simulated::LoneTruck;
    let (truck, clock) = LoneTruck::start_at(u64::from(file.hardware.seed), speed, &file.vehicle)
        .map_err(|error| Failure::new(error, "the simulated truck does not fit into its room"))?;
    let instruments = truck.instruments();
    Ok(((Box::new(truck), clock), instruments))
}

/// This program was built without the simulator.
#[cfg(not(feature = "sim"))]
pub(crate) fn open_simulated(_: &ConfigFile, _: f64) -> Result<(Lines, Instruments), Failure> {
    let hint = "--hardware serial for a truck; `fleet-cli sim` simulates trucks with their agents, and with --pty \
        the serial ports of a truck";
    Err(Failure::new("this robot-agent was built without the simulator", hint).code(2))
}

/// Hardware and the clock that it runs on.
pub(crate) type Lines = (Box<dyn Hardware>, Clock);

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
