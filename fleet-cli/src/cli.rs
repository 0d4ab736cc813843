//! The command line's grammar: global options, verbs and their arguments, nothing else.

mod dashboard;
mod dispatch;
mod fetch_log;
mod map;
mod plan;
mod recording;
mod robots;
mod shell;
mod sim;
mod tasks;
mod top;
mod traffic;
mod usage;
mod values;

pub use dashboard::DashboardArgs;
pub use dispatch::{
    DispatchArgs, DispatchCompactArgs, DispatchExportArgs, DispatchServeArgs, DispatchVerb, LedgerArgs,
};
pub use fetch_log::FetchLogArgs;
pub use map::{MapArgs, MapCheckArgs, MapImportArgs, MapServeArgs, MapShowArgs, MapVerb, ResolutionArgs};
pub use plan::PlanArgs;
pub use recording::{ExportArgs, PlayArgs, RecordArgs};
pub use robots::{
    DoctorArgs, EstopArgs, GotoArgs, LeaseArgs, ListArgs, ResetArgs, SetPoseArgs, StatusArgs, StopArgs,
    TeleopArgs, ViaArg, WanderArgs, WatchArgs, WhoArgs, WhyArgs,
};
pub use shell::{CompletionsArgs, NamesArgs, NamesOf};
pub use sim::{DemoArgs, FixArgs, RouterArgs, SimArgs};
pub use tasks::{
    CancelArgs, LinkLossArg, PauseArgs, ResumeArgs, RetryArgs, StayArgs, TakeoverArg, TaskArgs, TaskGotoArgs,
    TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs, TasksArgs, TermArgs,
};
pub use top::TopArgs;
pub use traffic::{TrafficArgs, TrafficServeArgs, TrafficVerb};
pub use usage::failure as usage_failure;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum, parser::ValueSource};
use robot_agent::logging::LogFormat;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;
use values::seconds;
use xtb_protocol::Name;

/// Where a router listens, and where it is looked for, unless told otherwise.
pub use xtb_client::DEFAULT_ENDPOINT;

const EXIT_CODES: &str = "\
Exit codes:
  0    done
  1    failed: refused, goal not reached, task failed or cancelled, contact, port in use …
  2    wrong usage or configuration; nothing was sent
  3    no router, robot or dispatcher answered, or the outcome is unknown
  4    name taken: another robot or simulator of this fleet uses it
  130  interrupted

JSON: with --json each result is one line on standard output, and so is an error:
  {\"error\":{\"code\":…,\"message\":…,\"hint\":…}}";

/// Drive, monitor, send and stop a fleet of XTB robots from one terminal.
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
    /// Router to connect to; repeat it or separate several with commas [default: tcp/127.0.0.1:7447].
    #[arg(long, global = true, env = "XTB_CONNECT", value_name = "ENDPOINT", value_delimiter = ',')]
    pub connect: Vec<String>,
    /// Whether `--connect` stands on the command line (not in the environment).
    #[arg(skip)]
    pub connect_given: bool,
    /// Fleet [default: lab].
    #[arg(long, global = true, env = "XTB_FLEET", value_name = "NAME")]
    pub fleet: Option<Name>,
    /// Print JSON, one line per result.
    #[arg(long, global = true)]
    pub json: bool,
    /// Fleet config (TOML) [default: $XDG_CONFIG_HOME/xtb/fleet.toml or ~/.config/xtb/fleet.toml, if
    /// present].
    #[arg(long, global = true, env = "XTB_CONFIG", value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Name of this client, shown as the controlling client of a robot [default: cli- and six random digits].
    #[arg(long, global = true, value_name = "NAME")]
    pub client: Option<Name>,
    /// Longest time to wait for a router or an answer, in s.
    #[arg(long, global = true, value_name = "SECONDS", default_value = "2", value_parser = seconds)]
    pub timeout: Duration,
    /// When to use colours.
    #[arg(long, global = true, value_name = "WHEN", default_value = "auto")]
    pub color: ColorChoice,
    /// Format of the log on standard error; XTB_LOG=debug makes it detailed.
    #[arg(long, global = true, value_name = "FORMAT", env = "XTB_LOG_FORMAT", default_value = "text")]
    pub log_format: LogFormat,
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
    /// List the robots and their state.
    List(ListArgs),
    /// Show the state of robots in detail.
    Status(StatusArgs),
    /// Explain why a robot is stopped, or is allowed to drive, and what to do.
    Why(WhyArgs),
    /// Check router, roster, versions, clocks and configs, and show what to do.
    Doctor(DoctorArgs),
    /// Send a robot to a point on the map.
    Goto(GotoArgs),
    /// Make a robot wander.
    Wander(WanderArgs),
    /// Stop robots: cancels their goals.
    Stop(StopArgs),
    /// Emergency stop: robots stay stopped until they are reset (not a safety-rated stop).
    Estop(EstopArgs),
    /// Reset latched stops whose cause is gone; robots stay stopped until a new command.
    Reset(ResetArgs),
    /// Set the pose of a stopped robot, when its pose is uncertain or wrong.
    SetPose(SetPoseArgs),
    /// Drive a robot by hand.
    Teleop(TeleopArgs),
    /// Full-screen view of the fleet: map, robots, events; keys send, stop and drive.
    Top(TopArgs),
    /// Print messages as JSON lines.
    Watch(WatchArgs),
    /// Record the fleet's messages into MCAP, for Foxglove, Python, `play` and `export`.
    Record(RecordArgs),
    /// Play back a recording of the fleet.
    Play(PlayArgs),
    /// Export a recording of the fleet as tables.
    Export(ExportArgs),
    /// Download a recording from a robot.
    FetchLog(FetchLogArgs),
    /// Show, check, import or serve a map.
    Map(MapArgs),
    /// Traffic control: coordinate robots with planned goals.
    Traffic(TrafficArgs),
    /// Dispatcher: accept tasks for the fleet and assign them to its robots.
    Dispatch(DispatchArgs),
    /// Show the dispatcher's tasks.
    Tasks(TasksArgs),
    /// Show one task and its history.
    Task(TaskArgs),
    /// Cancel tasks; the answer comes when their robots have confirmed.
    Cancel(CancelArgs),
    /// Pause tasks; their robots stop.
    Pause(PauseArgs),
    /// Resume tasks that are paused or on hold.
    Resume(ResumeArgs),
    /// Queue failed or cancelled tasks again.
    Retry(RetryArgs),
    /// Show and control the fleet in a browser.
    Dashboard(DashboardArgs),
    /// Run a router: the only infrastructure that a small lab needs.
    Router(RouterArgs),
    /// Run simulated robots with real agents.
    Sim(SimArgs),
    /// Show simulated robots driving to their goals.
    Demo(DemoArgs),
    /// Plan collision-free paths for many robots at once, without a fleet.
    Plan(PlanArgs),
    /// Print a completion script; in bash, fish and zsh it completes the names of robots and tasks.
    Completions(CompletionsArgs),
    /// Print the names of robots or tasks, for completion scripts.
    #[command(hide = true)]
    Names(NamesArgs),
}

impl Cli {
    /// Reads a command line, the program's name first.
    ///
    /// # Errors
    /// Wrong usage; and the texts of `--help` and `--version`, which clap treats alike.
    pub fn read(arguments: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        let mut command = Self::command();
        let read = command.try_get_matches_from_mut(arguments.into_iter().map(shielded));
        let matches = read.map_err(usage::with_tip)?;
        let mut cli = Self::from_arg_matches(&matches).map_err(|error| error.format(&mut command))?;
        cli.global.connect_given = matches.value_source("connect") == Some(ValueSource::CommandLine);
        cli.global.connect.retain(|endpoint| !endpoint.is_empty());
        Ok(cli)
    }

    /// Whether the verb draws on the whole terminal for as long as it runs.
    #[must_use]
    pub fn takes_screen(&self) -> bool {
        match &self.verb {
            Verb::Top(_) => true,
            Verb::Play(args) => args.dashboard.is_none() && !args.lines && !self.global.json,
            _ => false,
        }
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

#[cfg(test)]
mod tests;
