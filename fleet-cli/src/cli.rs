//! The command line's grammar: global options, verbs and their arguments, nothing else.

mod dashboard;
mod dispatch;
mod fetch_log;
mod map;
mod plan;
mod tasks;
mod top;
mod traffic;

pub use dashboard::DashboardArgs;
pub use dispatch::{
    DispatchArgs, DispatchCompactArgs, DispatchExportArgs, DispatchServeArgs, DispatchVerb, LedgerArgs,
};
pub use fetch_log::FetchLogArgs;
pub use map::{MapArgs, MapCheckArgs, MapImportArgs, MapServeArgs, MapShowArgs, MapVerb, ResolutionArgs};
pub use plan::PlanArgs;
pub use tasks::{
    CancelArgs, PauseArgs, ResumeArgs, RetryArgs, StayArgs, TakeoverArg, TaskArgs, TaskGotoArgs,
    TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs, TasksArgs, TermArgs,
};
pub use top::TopArgs;
pub use traffic::{TrafficArgs, TrafficServeArgs, TrafficVerb};

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum, parser::ValueSource};
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;
use xtb_protocol::Name;
use xtb_protocol::messages::Latch;

/// Where a router listens, and where it is looked for, unless told otherwise.
pub const DEFAULT_ENDPOINT: &str = "tcp/127.0.0.1:7447";

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    failed: refused, goal not reached, task failed or cancelled, contact, port taken …
  2    wrong usage or configuration; nothing was sent
  3    no router, no robot or no dispatcher answered, or the outcome is unknown
  130  interrupted

JSON: with --json each result is one line on standard output; so is an error:
  {\"error\":{\"code\":…,\"message\":…,\"hint\":…}}";

const ESTOP_HELP: &str = "\
It is sent again and again until each robot has acknowledged it or --timeout is over. Exit code 0 means \
that every robot of the roster has; without a roster nobody can know that, and it is 3.

This is no safety-rated stop: it needs the radio link, the robot's computer and this program. Keep a \
switch for the motor's power within reach.";

/// Drive, watch, send and stop a fleet of XTB robots from one terminal.
#[derive(Debug, Parser)]
#[command(name = "fleet-cli", version, after_help = EXIT_CODES, infer_long_args = false)]
pub struct Cli {
    /// Options of every verb.
    #[command(flatten)]
    pub global: GlobalArgs,
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// Options that stand before or after the verb.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Global options")]
pub struct GlobalArgs {
    /// Router to connect to; several: repeat it or separate them with commas [default: tcp/127.0.0.1:7447].
    #[arg(long, global = true, env = "XTB_CONNECT", value_name = "ENDPOINT", value_delimiter = ',')]
    pub connect: Vec<String>,
    /// Whether `--connect` stands on the command line (not in the environment).
    #[arg(skip)]
    pub connect_given: bool,
    /// Fleet to work with [default: lab].
    #[arg(long, global = true, env = "XTB_FLEET", value_name = "NAME")]
    pub fleet: Option<Name>,
    /// Print JSON, one line a result.
    #[arg(long, global = true)]
    pub json: bool,
    /// Fleet config (TOML) [default: $XDG_CONFIG_HOME/xtb/fleet.toml or ~/.config/xtb/fleet.toml if there].
    #[arg(long, global = true, env = "XTB_CONFIG", value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// This client's name, as robots show it beside their lease [default: cli- and six random digits].
    #[arg(long, global = true, value_name = "NAME")]
    pub client: Option<Name>,
    /// How long to wait for a router or an answer, in s.
    #[arg(long, global = true, value_name = "SECONDS", default_value = "2", value_parser = seconds)]
    pub timeout: Duration,
    /// Colours.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    pub color: ColorChoice,
}

/// When to use colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ColorChoice {
    /// On a terminal, unless NO_COLOR is set.
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Show which robots are there and how they are.
    List(ListArgs),
    /// Show everything about robots.
    Status(StatusArgs),
    /// Explain why a robot stands, or may drive, and what to do.
    Why(WhyArgs),
    /// Check router, roster, versions, clocks and configs, and say what to do.
    Doctor(DoctorArgs),
    /// Send a robot to a point of the map.
    Goto(GotoArgs),
    /// Let a robot wander.
    Wander(WanderArgs),
    /// Stop robots: they drop their goals and stand.
    Stop(StopArgs),
    /// Emergency stop: robots stand until they are reset (not a safety-rated stop).
    Estop(EstopArgs),
    /// End a robot's latched stops whose cause is gone; it stands until a new command.
    Reset(ResetArgs),
    /// Drive a robot by hand.
    Teleop(TeleopArgs),
    /// Show the fleet on the whole terminal: map, robots, events; keys send, stop and drive.
    Top(TopArgs),
    /// Print messages as JSON lines.
    Watch(WatchArgs),
    /// Bring a robot's own recording here.
    FetchLog(FetchLogArgs),
    /// Show, check, import or serve a map of the floor.
    Map(MapArgs),
    /// Lead robots with planned goals past each other.
    Traffic(TrafficArgs),
    /// Take tasks for the fleet, and give them to its robots.
    Dispatch(DispatchArgs),
    /// Show the dispatcher's tasks.
    Tasks(TasksArgs),
    /// Show one task and how it came to be so.
    Task(TaskArgs),
    /// End tasks; the answer comes when their robots have confirmed.
    Cancel(CancelArgs),
    /// Put tasks aside; their robots stop.
    Pause(PauseArgs),
    /// Let tasks go on that are paused or held.
    Resume(ResumeArgs),
    /// Queue tasks again that have failed or were cancelled.
    Retry(RetryArgs),
    /// Show the fleet in a browser, and command it from there.
    Dashboard(DashboardArgs),
    /// Run a router: all the infrastructure that a small lab needs.
    Router(RouterArgs),
    /// Run simulated robots with real agents.
    Sim(SimArgs),
    /// Show simulated robots driving to their goals.
    Demo(DemoArgs),
    /// Plan ways for many robots at once, without a fleet: none ever touches another.
    Plan(PlanArgs),
    /// Print a completion script; in bash and fish it knows the robots and tasks that there are.
    Completions(CompletionsArgs),
    /// Print the names that there are, for completion scripts.
    #[command(hide = true)]
    Names(NamesArgs),
}

/// Arguments of `list`.
#[derive(Debug, Clone, Args)]
pub struct ListArgs {
    /// Robots that should be there, separated by commas [default: the config's or the simulator's roster].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

/// Arguments of `status`.
#[derive(Debug, Clone, Args)]
pub struct StatusArgs {
    /// Robots [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// Keep showing it; q or Ctrl-C leaves.
    #[arg(long)]
    pub watch: bool,
}

/// Arguments of `why`.
#[derive(Debug, Clone, Args)]
pub struct WhyArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
}

/// Arguments of `doctor`.
#[derive(Debug, Clone, Args)]
pub struct DoctorArgs {
    /// Robots that should be there, separated by commas [default: the config's or the simulator's roster].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

/// Arguments of `goto`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct GotoArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// East, in m.
    #[arg(value_name = "X", value_parser = metres)]
    pub x_m: f64,
    /// North, in m.
    #[arg(value_name = "Y", value_parser = metres)]
    pub y_m: f64,
    /// Yaw on arrival, in degrees counter-clockwise from east; only along a planned path.
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// How to drive there [default: planned if the robot has a map, else direct].
    #[arg(long, value_enum)]
    pub via: Option<ViaArg>,
    /// Stay and show progress until the goal ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// Give the goal up after this long [default: 300 without --wait, none with it].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub within: Option<Duration>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// How a goal is driven to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ViaArg {
    /// The memorandum's A-to-B: straight, and it stops at obstacles.
    Direct,
    /// Along a planned path, around what the map and the range finders know of.
    Planned,
}

impl From<ViaArg> for xtb_protocol::messages::Via {
    fn from(via: ViaArg) -> Self {
        match via {
            ViaArg::Direct => Self::Direct,
            ViaArg::Planned => Self::Planned,
        }
    }
}

/// Whether a verb may take control from its holder.
#[derive(Debug, Clone, Copy, Args)]
pub struct LeaseArgs {
    /// Take control from whoever has it; without this, a robot that somebody controls refuses.
    #[arg(long)]
    pub take: bool,
}

/// Arguments of `wander`.
#[derive(Debug, Clone, Args)]
pub struct WanderArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// How long [default: until stopped, or 300 s without --wait].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
    /// Stay and show progress until it ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Which robots are to stop.
#[derive(Debug, Clone, Args)]
pub struct WhoArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot, required_unless_present = "all")]
    pub robots: Vec<Name>,
    /// All robots of the roster, and all others that are there.
    #[arg(long, conflicts_with = "robots")]
    pub all: bool,
    /// Roster for --all, separated by commas [default: the config's or the simulator's].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot, requires = "all")]
    pub expect: Vec<Name>,
}

/// Arguments of `stop`.
#[derive(Debug, Clone, Args)]
pub struct StopArgs {
    /// Which robots.
    #[command(flatten)]
    pub who: WhoArgs,
}

/// Arguments of `estop`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ESTOP_HELP)]
pub struct EstopArgs {
    /// Which robots.
    #[command(flatten)]
    pub who: WhoArgs,
}

/// Arguments of `reset`.
#[derive(Debug, Clone, Args)]
pub struct ResetArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Only this latch [default: all].
    #[arg(long, value_name = "NAME", value_parser = latch())]
    pub latch: Option<Latch>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Arguments of `teleop`.
#[derive(Debug, Clone, Args)]
pub struct TeleopArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Fastest wheel speed asked for, in rpm [default: the robot's limit].
    #[arg(long, value_name = "R", value_parser = rpm)]
    pub max_rpm: Option<f64>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Arguments of `watch`.
#[derive(Debug, Clone, Args)]
pub struct WatchArgs {
    /// Zenoh key expression, such as `xtb/lab/*/event` or `xtb/**`; about and roster answer once, commands cannot be watched.
    #[arg(value_name = "KEYEXPR")]
    pub key_expr: String,
    /// End after this many messages.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}

/// Arguments of `router`.
#[derive(Debug, Clone, Args)]
pub struct RouterArgs {
    /// Where to listen; port 0 takes a free one.
    #[arg(long, value_name = "ENDPOINT", default_value = DEFAULT_ENDPOINT)]
    pub listen: String,
}

/// Arguments of `sim`.
#[derive(Debug, Clone, Args)]
pub struct SimArgs {
    /// How many robots: xtb-1 … xtb-N.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// World (TOML) [default: an empty room].
    #[arg(long, value_name = "FILE")]
    pub world: Option<PathBuf>,
    /// Seed of every random number.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Times real time.
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    pub speed: f64,
    /// Where its router listens [default: tcp/127.0.0.1:7447]; with --connect it runs no router.
    #[arg(long, value_name = "ENDPOINT")]
    pub listen: Option<String>,
    /// Start no agents; make two serial lines for each truck instead: DIR/ROBOT.board and DIR/ROBOT.gyro.
    #[arg(long, value_name = "DIR")]
    pub pty: Option<PathBuf>,
    /// Write the ground truth at board rate, as JSON lines.
    #[arg(long, value_name = "FILE")]
    pub truth_log: Option<PathBuf>,
    /// Record every sample, command and decision of each robot: DIR/ROBOT-….mcap.
    #[arg(long, value_name = "DIR", conflicts_with = "pty")]
    pub record: Option<PathBuf>,
    /// Run a dispatcher (and traffic control) too, and say at the end what each robot did.
    #[arg(long)]
    pub dispatch: bool,
    /// Its ledger [default: FLEET.ledger in $XDG_DATA_HOME/xtb/sim or ~/.local/share/xtb/sim].
    #[arg(long, value_name = "FILE", requires = "dispatch")]
    pub ledger: Option<PathBuf>,
    /// End as soon as there were tasks and all have ended; exit code 1 if one failed or a truck was touched.
    #[arg(long, requires = "dispatch")]
    pub until_done: bool,
    /// What measures the robots' poses.
    #[command(flatten)]
    pub fixes: FixArgs,
    /// No router and no agents, but a bad day of a virtual fleet: tells what happens on the day of --seed,
    /// and whether a rule of docs/safety.md was broken.
    #[arg(long = "virtual", conflicts_with_all = ["robots", "world", "speed", "listen", "pty", "truth_log", "record", "dispatch"])]
    pub virtual_day: bool,
}

/// A simulated tracker that measures where the robots are.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = "Pose fixes")]
pub struct FixArgs {
    /// Pose fixes a second; 0 = none: odometry alone, which drifts.
    #[arg(long = "fixes", value_name = "HZ", default_value_t = 2.0, value_parser = fix_rate)]
    pub rate_hz: f64,
    /// Their noise, a standard deviation in m.
    #[arg(long = "fix-noise", value_name = "METRES", default_value_t = 0.05, value_parser = fix_noise)]
    pub noise_m: f64,
    /// The part of them that is somewhere else altogether, 0 to 1.
    #[arg(long = "fix-outliers", value_name = "PART", default_value_t = 0.0, value_parser = part)]
    pub outliers: f64,
    /// Mean time between drop-outs of about 5 s, in s; 0 = none.
    #[arg(long = "fix-drop-outs", value_name = "SECONDS", default_value_t = 0.0, value_parser = drop_outs)]
    pub drop_out_every_s: f64,
}

impl FixArgs {
    /// As the simulator takes it.
    #[must_use]
    pub fn truth(self) -> xtb_sim::fixes::FixTruth {
        let Self { rate_hz, noise_m, outliers, drop_out_every_s } = self;
        xtb_sim::fixes::FixTruth { rate_hz, noise_m, outliers, drop_out_every_s, ..Default::default() }
    }
}

/// Arguments of `demo`.
#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    /// No live picture.
    #[arg(long)]
    pub headless: bool,
    /// How many robots.
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub robots: usize,
    /// Seed of every random number.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Times real time.
    #[arg(long, value_name = "X", default_value_t = 4.0)]
    pub speed: f64,
    /// Goals of each robot.
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub goals: usize,
    /// Where its router listens; port 0 takes a free one.
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/127.0.0.1:0")]
    pub listen: String,
}

/// Arguments of `completions`.
#[derive(Debug, Clone, Args)]
pub struct CompletionsArgs {
    /// For which shell.
    #[arg(value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

/// Arguments of `names`.
#[derive(Debug, Clone, Args)]
pub struct NamesArgs {
    /// Of what.
    #[arg(value_enum)]
    pub of: NamesOf,
}

/// What has names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum NamesOf {
    /// Robots that are there.
    Robots,
    /// Tasks of the dispatcher, newest first.
    Tasks,
}

impl Cli {
    /// Reads a command line, the program's name first.
    ///
    /// # Errors
    /// Wrong usage; and the texts of `--help` and `--version`, which clap treats alike.
    pub fn read(arguments: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        let mut command = Self::command();
        let matches = command.try_get_matches_from_mut(arguments.into_iter().map(shielded))?;
        let mut cli = Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        cli.global.connect_given = matches.value_source("connect") == Some(ValueSource::CommandLine);
        cli.global.connect.retain(|endpoint| !endpoint.is_empty());
        Ok(cli)
    }

    /// Whether the verb draws on the whole terminal for as long as it runs.
    #[must_use]
    pub fn takes_screen(&self) -> bool {
        matches!(self.verb, Verb::Top(_))
    }
}

/// clap takes `-1,0` for an option. A blank in front makes it a value, and points are read without it.
fn shielded(argument: OsString) -> OsString {
    let is_point = argument.to_str().is_some_and(|text| {
        let digits = text.strip_prefix('-').unwrap_or_default();
        digits.contains(',') && digits.starts_with(|c: char| c.is_ascii_digit() || c == '.')
    });
    if !is_point {
        return argument;
    }
    let mut shielded = OsString::from(" ");
    shielded.push(argument);
    shielded
}

/// The latches by name: completions know them, so they must be written down.
const LATCHES: [&str; Latch::ALL.len()] =
    ["estop", "remote_takeover", "board_lost", "gyro_lost", "runaway", "sensor_fault", "battery_critical"];

fn latch() -> impl TypedValueParser<Value = Latch> {
    PossibleValuesParser::new(LATCHES).try_map(|name| name.parse::<Latch>())
}

fn number(text: &str, min: f64, max: f64, unit: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (min..=max).contains(&value) => Ok(value),
        _ => Err(format!("expected a number of {unit} within {min}..={max}")),
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    number(text, 0.01, 86_400.0, "seconds").map(Duration::from_secs_f64)
}

/// Seconds from 0 to a day.
fn part_of_a_day(text: &str) -> Result<f64, String> {
    number(text, 0.0, 86_400.0, "seconds")
}

fn metres(text: &str) -> Result<f64, String> {
    let most = xtb_protocol::messages::MAX_COORDINATE_M;
    number(text, -most, most, "metres")
}

fn fix_rate(text: &str) -> Result<f64, String> {
    number(text, 0.0, 50.0, "Hz")
}

fn fix_noise(text: &str) -> Result<f64, String> {
    number(text, 0.001, 10.0, "metres")
}

fn part(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0, "parts of one")
}

fn drop_outs(text: &str) -> Result<f64, String> {
    number(text, 0.0, 1.0e6, "seconds")
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, -360.0, 360.0, "degrees")
}

fn rpm(text: &str) -> Result<f64, String> {
    number(text, 1.0, xtb_control::WheelRpm::MAX, "rpm")
}

#[cfg(test)]
mod tests;
