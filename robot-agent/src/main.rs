//! `robot-agent`: read the settings, open the lines, run the robot, end cleanly.

use clap::Parser;
use robot_agent::clock::Clock;
use robot_agent::config::{ConfigFile, ConfigProblem, Layers};
use robot_agent::hardware::Hardware;
use robot_agent::hardware::serial::SerialHardware;
use robot_agent::hardware::simulated::LoneTruck;
use std::io::{IsTerminal, Write};
use std::path::PathBuf;
use std::process::ExitCode;
use tokio::sync::watch;
use toml::Value;
use tracing_subscriber::EnvFilter;

const EXIT_CODES: &str = "\
Exit codes: 0 ended as asked · 1 failed · 2 wrong usage or configuration · 4 name taken

Settings come from the compiled-in defaults, then --config, then the environment, then flags.
The log's detail: RUST_LOG=debug.";

/// One robot: the first-level controller of TM 2004-262 beside its Zenoh session.
#[derive(Debug, Parser)]
#[command(version, after_help = EXIT_CODES)]
struct Args {
    /// Settings in TOML; see --print-config
    #[arg(long, value_name = "FILE", env = "XTB_AGENT_CONFIG")]
    config: Option<PathBuf>,
    /// Print the settings in force, commented, and end
    #[arg(long)]
    print_config: bool,
    /// The robot's name [default: xtb-1]
    #[arg(long, env = "XTB_NAME")]
    name: Option<String>,
    /// The fleet's name [default: lab]
    #[arg(long, env = "XTB_FLEET")]
    fleet: Option<String>,
    /// The router [default: tcp/127.0.0.1:7447]; may be given several times
    #[arg(long, value_name = "ENDPOINT", env = "XTB_CONNECT", value_delimiter = ',')]
    connect: Vec<String>,
    /// serial, or simulated: one truck alone in an empty room [default: simulated]
    #[arg(long, value_name = "KIND", env = "XTB_HARDWARE")]
    hardware: Option<String>,
    /// Serial port of the I/O board
    #[arg(long, value_name = "PORT", env = "XTB_BOARD")]
    board: Option<String>,
    /// Serial port of the gyro
    #[arg(long, value_name = "PORT", env = "XTB_GYRO")]
    gyro: Option<String>,
    /// Where the truck stands in the map (ENU: metres, radians) [default: 0,0,1.5708]
    #[arg(long, value_name = "X,Y,YAW", env = "XTB_START_POSE", allow_hyphen_values = true, value_parser = parse_pose)]
    start_pose: Option<[f64; 3]>,
    /// Any other setting, such as vehicle.goto.reference_rpm=10
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,
}

fn parse_pose(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("{part:?} is not a number")))
        .collect::<Result<_, _>>()?;
    parts.try_into().map_err(|_| "give X,Y,YAW: metres east, metres north, radians".to_owned())
}

impl Args {
    fn settings(&self) -> Result<ConfigFile, ConfigProblem> {
        let mut layers = Layers::default();
        if let Some(path) = &self.config {
            let origin = path.display().to_string();
            let text = std::fs::read_to_string(path)
                .map_err(|error| ConfigProblem::Read { path: origin.clone(), reason: error.to_string() })?;
            layers.file(&origin, &text)?;
        }
        for (flag, key, value) in [
            ("--name", "agent.name", &self.name),
            ("--fleet", "agent.fleet", &self.fleet),
            ("--hardware", "hardware.kind", &self.hardware),
            ("--board", "hardware.board", &self.board),
            ("--gyro", "hardware.gyro", &self.gyro),
        ] {
            if let Some(value) = value {
                layers.set(flag, key, Value::String(value.clone()))?;
            }
        }
        if !self.connect.is_empty() {
            let endpoints = self.connect.iter().cloned().map(Value::String).collect();
            layers.set("--connect", "zenoh.connect", Value::Array(endpoints))?;
        }
        if let Some(pose) = self.start_pose {
            for (key, value) in ["start_pose.x_m", "start_pose.y_m", "start_pose.yaw_rad"].iter().zip(pose) {
                layers.set("--start-pose", key, Value::Float(value))?;
            }
        }
        for setting in &self.settings {
            let (key, value) = setting.split_once('=').ok_or_else(|| ConfigProblem::Syntax {
                origin: "--set".into(),
                reason: format!("{setting:?} is not KEY=VALUE"),
            })?;
            // What is not a number, a switch or quoted is text.
            let value = value.parse().unwrap_or_else(|_| Value::String(value.to_owned()));
            layers.set("--set", key.trim(), value)?;
        }
        layers.finish()
    }
}

fn main() -> ExitCode {
    let args = Args::parse();
    let settings = match args.settings().and_then(|file| file.agent().map(|agent| (file, agent))) {
        Ok(settings) => settings,
        Err(problem) => return fail(2, &problem, "robot-agent --print-config shows every setting"),
    };
    let (file, agent) = settings;
    if args.print_config {
        let written = std::io::stdout().write_all(file.to_toml().as_bytes());
        return if written.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let filter = EnvFilter::try_from_default_env()
        .unwrap_or_else(|_| EnvFilter::new("info,zenoh=error,zenoh_transport=error"));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .init();
    let runtime = match tokio::runtime::Builder::new_multi_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return fail(1, &error, "the system is out of threads or memory"),
    };
    let (hardware, clock) = match open(&file) {
        Ok(opened) => opened,
        Err(error) => {
            let hint = "check the cables and the ports' paths, and that no other program holds them";
            return fail(1, &error, hint);
        }
    };
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
    runtime.shutdown_timeout(std::time::Duration::from_millis(500));
    match ended {
        Ok(()) => ExitCode::SUCCESS,
        Err(error @ robot_agent::AgentError::NameTaken(_)) => {
            fail(4, &error, "give this robot another --name, or end the other agent")
        }
        Err(error) => fail(1, &error, "check the endpoints given with --connect"),
    }
}

fn open(file: &ConfigFile) -> Result<(Box<dyn Hardware>, Clock), Box<dyn std::error::Error>> {
    let hardware = &file.hardware;
    if hardware.kind == "serial" {
        let serial =
            SerialHardware::open(&hardware.board, hardware.board_baud, &hardware.gyro, hardware.gyro_baud)?;
        return Ok((Box::new(serial), Clock::real()));
    }
    let (truck, clock) = LoneTruck::start(u64::from(hardware.seed))?;
    Ok((Box::new(truck), clock))
}

async fn wait_for_signal() {
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

fn fail(code: u8, error: &dyn std::fmt::Display, hint: &str) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "error: {error}\nhint: {hint}");
    ExitCode::from(code)
}
