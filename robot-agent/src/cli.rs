//! The command line: flags that set what a robot is, and the verbs beside running it.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Parser, Subcommand};
use robot_agent::config::{ConfigFile, ConfigProblem, SettingLayers};
use robot_agent::files;
use robot_agent::logging::LogFormat;
use std::path::{Path, PathBuf};
use toml::Value;
use xtb_control::calibration::Actuator;

const EXIT_CODES: &str = "\
Exit codes: 0 success · 1 failed, or a check found a problem · 2 wrong usage or configuration · 4 name taken

Without a command the robot runs until Ctrl-C. Settings come from the compiled-in defaults, then
--config, then the environment, then flags. For a detailed log: XTB_LOG=debug.";

/// Runs one robot: the first-level controller of TM 2004-262 and its Zenoh session.
#[derive(Debug, Parser)]
#[command(version, after_help = EXIT_CODES, subcommand_negates_reqs = true)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) settings: Settings,
    /// Print the settings in effect, with comments, and exit
    #[arg(long)]
    pub(crate) print_config: bool,
    /// Record every sample, command and decision into a file in this folder
    #[arg(long, value_name = "DIR", env = "XTB_RECORD")]
    pub(crate) record: Option<PathBuf>,
    /// Format of the log on standard error
    #[arg(long, value_name = "FORMAT", env = "XTB_LOG_FORMAT", value_enum, default_value_t, global = true)]
    pub(crate) log_format: LogFormat,
    /// Print JSON, with a command that prints results
    #[arg(long, global = true)]
    pub(crate) json: bool,
    #[command(subcommand)]
    pub(crate) command: Option<Verb>,
}

/// What else the program can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Run the robot and record every sample, command and decision (the same as --record DIR)
    Record(RecordArgs),
    /// Feed a trace or a recording through the controller again
    Replay(ReplayArgs),
    /// Read every sensor once and report problems
    CheckHardware(CheckArgs),
    /// Sweep a servo, measure, fit the line of Annex A and write it to the configuration
    Calibrate(CalibrateArgs),
    /// Lead through a new truck step by step: every sensor, servo, the motor, the emergency stop, calibration
    BringUp(BringUpArgs),
    /// Enrol this robot with its identity file, from `fleet-cli pki add-robot`
    Enrol(EnrolArgs),
    /// List this computer's serial ports
    Ports(PortsArgs),
    /// Write the manual pages into a folder
    Man {
        /// Folder, created if missing, such as ~/.local/share/man/man1
        #[arg(value_name = "DIR")]
        folder: PathBuf,
    },
    /// Print a completion script for a shell
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
}

/// `record`.
#[derive(Debug, clap::Args)]
pub(crate) struct RecordArgs {
    /// Folder for the recording, created if missing
    #[arg(value_name = "DIR", default_value = "recordings")]
    pub(crate) folder: PathBuf,
}

/// `replay`.
#[derive(Debug, clap::Args)]
#[command(
    long_about = "Feed a trace or a recording through the controller again.\n\n\
        --trace IN.jsonl prints the controller's decisions, one JSON object per line (docs/trace.md).\n\
        FILE.mcap compares with the recorded decisions: identical, or the first difference with its \
        time, stage and both values (exit code 1). With --set or --config it shows instead which \
        decisions would have been different.",
    group(clap::ArgGroup::new("input").required(true).args(["recording", "trace"]))
)]
pub(crate) struct ReplayArgs {
    /// Recording made with --record
    #[arg(value_name = "FILE.mcap")]
    pub(crate) recording: Option<PathBuf>,
    /// Trace of samples, one JSON object per line; - reads standard input
    #[arg(long, value_name = "IN.jsonl")]
    pub(crate) trace: Option<PathBuf>,
    /// Write the recording's samples as a trace instead of replaying it; - is standard output
    #[arg(long, value_name = "OUT.jsonl", requires = "recording", conflicts_with_all = ["trace", "json"])]
    pub(crate) export: Option<PathBuf>,
    /// Print JSON
    #[arg(long, conflicts_with = "trace")]
    pub(crate) json: bool,
}

/// `check-hardware`.
#[derive(Debug, clap::Args)]
pub(crate) struct CheckArgs {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Longest time to wait for a sensor
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0)]
    pub(crate) timeout: f64,
}

/// `calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Put the truck on a stand first: all wheels off the ground. Pistons are measured by \
    their own sensors; the angles of steering and bumpers are read and typed in by hand; a simulated truck \
    measures itself. A fit with R < 0.98 is rejected (exit code 1). docs/calibration.md has the procedure.")]
pub(crate) struct CalibrateArgs {
    /// Actuator to calibrate
    #[arg(value_name = "WHAT", value_parser = actuators())]
    pub(crate) what: Actuator,
    /// Do not ask: move the actuator and write the result
    #[arg(long)]
    pub(crate) yes: bool,
    /// Use these readings instead of moving the actuator: lines "count angle" (pistons: "count speed" in
    /// m/s), in the order in which they were taken
    #[arg(long, value_name = "FILE", conflicts_with_all = ["from", "to", "points"])]
    pub(crate) readings: Option<PathBuf>,
    /// File to write the result to, created if missing [default: the --config file]
    #[arg(long, value_name = "FILE")]
    pub(crate) write: Option<PathBuf>,
    /// Never write the result
    #[arg(long, conflicts_with = "write")]
    pub(crate) dry_run: bool,
    /// File for the plot [default: calibration-WHAT.svg next to the configuration]
    #[arg(long, value_name = "FILE")]
    pub(crate) plot: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Shortest pulse of the sweep, in counts of 0.4 µs [default: from the configuration]
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(2331..=5272))]
    pub(crate) from: Option<u16>,
    /// Longest pulse of the sweep
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u16).range(2331..=5272))]
    pub(crate) to: Option<u16>,
    /// Number of pulses, one way [default: 13, pistons 20]
    #[arg(long, value_name = "N")]
    pub(crate) points: Option<usize>,
}

impl CalibrateArgs {
    /// For somebody who has asked already; the result is written.
    pub(crate) fn confirmed(what: Actuator) -> Self {
        Self {
            what,
            yes: true,
            readings: None,
            write: None,
            dry_run: false,
            plot: None,
            json: false,
            from: None,
            to: None,
            points: None,
        }
    }
}

/// `bring-up`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "It needs --config FILE, says at each step what to do, and writes what it has found to \
    FILE.bring-up.json and .txt (without FILE's ending) after each one: a report that can be sent to others. Broken \
    off, it goes on with the first step that is open. At a terminal, skip, failed and quit are heard at any time; \
    answers may also come from a script on standard input. A simulated truck has a simulated person beside it. \
    docs/build-a-truck.md has the whole way.\n\n\
    Example: robot-agent bring-up --config robot.toml --from motor-ahead"
)]
pub(crate) struct BringUpArgs {
    /// Begin with this step, and do also those after it again that have passed
    #[arg(long, value_name = "STEP", conflicts_with_all = ["only", "restart"])]
    pub(crate) from: Option<String>,
    /// Do this step only, also if it has passed
    #[arg(long, value_name = "STEP", conflicts_with = "restart")]
    pub(crate) only: Option<String>,
    /// Forget what has passed, and begin anew
    #[arg(long)]
    pub(crate) restart: bool,
    /// Show what the steps have come to so far, and do nothing
    #[arg(long, conflicts_with_all = ["from", "only", "restart"])]
    pub(crate) report: bool,
    /// Longest time to wait until something moved by hand is seen
    #[arg(long, value_name = "SECONDS", default_value_t = 120.0, value_parser = patience)]
    pub(crate) patience: f64,
    /// Print the report as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

fn patience(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds| (1.0..=3600.0).contains(seconds));
    seconds.ok_or_else(|| "1 to 3600 seconds".to_owned())
}

fn actuators() -> impl TypedValueParser<Value = Actuator> {
    PossibleValuesParser::new(Actuator::ALL.map(Actuator::name)).try_map(|name| name.parse::<Actuator>())
}

/// `enrol`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "From then on the robot uses this identity: name, fleet and router follow from it. A \
    renewed certificate is enrolled the same way; a running robot takes it when it connects the next time.\n\n\
    Example: robot-agent enrol xtb-1.xtbid --remove"
)]
pub(crate) struct EnrolArgs {
    /// Identity file
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Folder to write to [default: $XDG_CONFIG_HOME/xtb/identity or ~/.config/xtb/identity]
    #[arg(long, value_name = "DIR")]
    pub(crate) to: Option<PathBuf>,
    /// Delete the file afterwards
    #[arg(long)]
    pub(crate) remove: bool,
    /// Replace another identity in this folder
    #[arg(long)]
    pub(crate) force: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// `ports`.
#[derive(Debug, clap::Args)]
pub(crate) struct PortsArgs {
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// Flags that set what the robot is; each may stand before or after a command.
#[derive(Debug, clap::Args)]
pub(crate) struct Settings {
    /// Settings in TOML; see --print-config [env: XTB_AGENT_CONFIG, but for replay]
    #[arg(long, value_name = "FILE", global = true)]
    pub(crate) config: Option<PathBuf>,
    /// The robot's name [default: xtb-1]
    #[arg(long, env = "XTB_NAME", global = true)]
    name: Option<String>,
    /// The fleet's name [default: lab]
    #[arg(long, env = "XTB_FLEET", global = true)]
    fleet: Option<String>,
    /// The router [default: tcp/127.0.0.1:7447]; may be given several times
    #[arg(long, value_name = "ENDPOINT", env = "XTB_CONNECT", value_delimiter = ',', global = true)]
    connect: Vec<String>,
    /// Folder of the robot's identity, or none; name, fleet and router follow from it [default:
    /// $XDG_CONFIG_HOME/xtb/identity or ~/.config/xtb/identity, if `robot-agent enrol` has made it]
    #[arg(long, value_name = "DIR|none", env = "XTB_IDENTITY", global = true)]
    identity: Option<String>,
    /// serial, or simulated (one truck in an empty room). Required, here or in the configuration
    #[arg(long, value_name = "KIND", env = "XTB_HARDWARE", global = true)]
    hardware: Option<String>,
    /// Serial port of the I/O board
    #[arg(long, value_name = "PORT", env = "XTB_BOARD", global = true)]
    board: Option<String>,
    /// Serial port of the gyro
    #[arg(long, value_name = "PORT", env = "XTB_GYRO", global = true)]
    gyro: Option<String>,
    /// Start pose of the truck in the map (ENU: metres, radians) [default: 0,0,1.5708]
    #[arg(long, value_name = "X,Y,YAW", env = "XTB_START_POSE", global = true, allow_hyphen_values = true, value_parser = parse_pose)]
    start_pose: Option<[f64; 3]>,
    /// Run the control loop before all ordinary programs and lock all memory, where the system permits it
    /// (SCHED_FIFO, mlockall)
    #[arg(long, global = true)]
    realtime: bool,
    /// Any other setting, such as goto.reference_rpm=10 (or vehicle.goto.reference_rpm=10)
    #[arg(long = "set", value_name = "KEY=VALUE", global = true)]
    settings: Vec<String>,
}

/// What flags and the environment say of who the robot is and where its routers are.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Given<'a> {
    pub(crate) name: Option<&'a str>,
    pub(crate) fleet: Option<&'a str>,
    pub(crate) connect: &'a [String],
}

fn parse_pose(text: &str) -> Result<[f64; 3], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("{part:?} is not a number")))
        .collect::<Result<_, _>>()?;
    parts.try_into().map_err(|_| "give X,Y,YAW: metres east, metres north, radians".to_owned())
}

impl Settings {
    /// The file with the settings: as given, else as the environment names it.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        self.config.clone().or_else(|| std::env::var_os("XTB_AGENT_CONFIG").map(PathBuf::from))
    }

    /// The settings in force.
    pub(crate) fn load(&self) -> Result<ConfigFile, ConfigProblem> {
        self.over(SettingLayers::default(), self.file().as_deref())
    }

    /// The settings for a replay: of the command line alone, or it would depend on where it is run.
    pub(crate) fn load_for_replay(&self, layers: SettingLayers) -> Result<ConfigFile, ConfigProblem> {
        self.over(layers, self.config.as_deref())
    }

    /// Those of name, fleet and routers that a flag or the environment sets: an identity excludes others.
    pub(crate) fn given(&self) -> Given<'_> {
        Given { name: self.name.as_deref(), fleet: self.fleet.as_deref(), connect: &self.connect }
    }

    /// Whether anything here could make a controller decide otherwise.
    pub(crate) fn change_anything(&self) -> bool {
        self.config.is_some() || !self.settings.is_empty()
    }

    fn over(&self, mut layers: SettingLayers, config: Option<&Path>) -> Result<ConfigFile, ConfigProblem> {
        if let Some(path) = config {
            let origin = path.display().to_string();
            let text = files::text(path, files::MAX_TEXT)
                .map_err(|error| ConfigProblem::Read { path: origin.clone(), reason: error.to_string() })?;
            layers.file(&origin, &text)?;
        }
        // `XTB_IDENTITY=` goes without one, as everywhere.
        let none = |folder: &String| if folder.is_empty() { "none".to_owned() } else { folder.clone() };
        let identity = self.identity.as_ref().map(none);
        for (flag, key, value) in [
            ("--name", "agent.name", &self.name),
            ("--fleet", "agent.fleet", &self.fleet),
            ("--identity", "zenoh.identity", &identity),
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
        if self.realtime {
            layers.set("--realtime", "control.realtime", Value::Boolean(true))?;
        }
        for setting in &self.settings {
            let (key, value) = setting.split_once('=').ok_or_else(|| ConfigProblem::Syntax {
                origin: "--set".into(),
                reason: format!("{setting:?} is not KEY=VALUE"),
            })?;
            layers.set_text("--set", key.trim(), value)?;
        }
        layers.finish()
    }
}
