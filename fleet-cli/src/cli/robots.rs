//! The grammar of verbs for robots: looking at them, sending, driving and stopping them.

use super::LinkLossArg;
use super::values::{degrees, latch, metres, rpm, seconds};
use clap::{ArgGroup, Args};
use std::time::Duration;
use xtb_client::multi_robot::Targets;
use xtb_protocol::Name;
use xtb_protocol::messages::Latch;

const ESTOP_HELP: &str = "\
The stop is sent repeatedly until each robot has acknowledged it or --timeout has passed. Exit code 0 means \
that every robot of the roster has acknowledged; without a roster that cannot be confirmed, and it is 3.

This is not a safety-rated stop: it needs the radio link, the robot's computer and this program. Keep a \
switch for the motor's power within reach.";

/// Arguments of `list`.
#[derive(Debug, Clone, Args)]
pub struct ListArgs {
    /// Expected robots, separated by commas [default: the roster of the config or the simulator].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot)]
    pub expect: Vec<Name>,
}

/// Arguments of `status`.
#[derive(Debug, Clone, Args)]
pub struct StatusArgs {
    /// Robots [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// Update continuously; q or Ctrl-C quits.
    #[arg(long)]
    pub watch: bool,
}

/// Arguments of `why`.
#[derive(Debug, Clone, Args)]
pub struct WhyArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot, required = true)]
    pub robots: Vec<Name>,
}

/// Arguments of `doctor`.
#[derive(Debug, Clone, Args)]
pub struct DoctorArgs {
    /// Expected robots, separated by commas [default: the roster of the config or the simulator].
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
    /// Driving mode [default: planned if the robot has a map, else direct].
    #[arg(long, value_enum)]
    pub via: Option<ViaArg>,
    /// Wait and show progress until the goal ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// Time limit of the goal [default: 300 without --wait, none with it].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub within: Option<Duration>,
    /// What the robot does after 0.5 s without a message from this program: halt, or finish the goal
    /// [default: halt with --wait, else finish].
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_link_loss: Option<LinkLossArg>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// How a goal is driven to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum ViaArg {
    /// Straight to the point (A-to-B of TM 2004-262); stops at obstacles.
    Direct,
    /// Along a planned path, around obstacles on the map and those that the range finders detect.
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
    /// Take control from another client; without this, a robot under another client's control refuses.
    #[arg(long)]
    pub take: bool,
}

/// Arguments of `wander`.
#[derive(Debug, Clone, Args)]
pub struct WanderArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Duration [default: until stopped, or 300 s without --wait].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
    /// Wait and show progress until it ends; Ctrl-C cancels it.
    #[arg(long)]
    pub wait: bool,
    /// What the robot does after 0.5 s without a message from this program: halt, or finish [default: halt
    /// with --wait, else finish].
    #[arg(long, value_enum, value_name = "POLICY")]
    pub on_link_loss: Option<LinkLossArg>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Which robots are to stop.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("who").args(["robots", "all"]).required(true))]
pub struct WhoArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// All robots of the roster and all others present.
    #[arg(long)]
    pub all: bool,
    /// Roster for --all, separated by commas [default: the config's or the simulator's].
    #[arg(long, value_name = "ROBOTS", value_delimiter = ',', value_parser = Name::robot, requires = "all")]
    pub expect: Vec<Name>,
}

impl WhoArgs {
    /// Whom that means.
    #[must_use]
    pub fn targets(&self) -> Targets {
        match self.all {
            true => Targets::All { expect: self.expect.clone(), known: Vec::new() },
            false => Targets::Robots(self.robots.clone()),
        }
    }
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
    /// Which robots; with --all those that have anything latched, after a question.
    #[command(flatten)]
    pub who: WhoArgs,
    /// With --all: do not ask for confirmation.
    #[arg(long, requires = "all")]
    pub yes: bool,
    /// Only this latch [default: all].
    #[arg(long, value_name = "NAME", value_parser = latch())]
    pub latch: Option<Latch>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Arguments of `set-pose`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct SetPoseArgs {
    /// Robot; it must be stopped.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// East, in m.
    #[arg(value_name = "X", value_parser = metres)]
    pub x_m: f64,
    /// North, in m.
    #[arg(value_name = "Y", value_parser = metres)]
    pub y_m: f64,
    /// Yaw, in degrees counter-clockwise from east [default: the current yaw].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
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
    /// Maximum wheel speed, in rpm [default: the robot's limit].
    #[arg(long, value_name = "R", value_parser = rpm)]
    pub max_rpm: Option<f64>,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// Arguments of `watch`.
#[derive(Debug, Clone, Args)]
pub struct WatchArgs {
    /// Zenoh key expression, such as `xtb/lab/*/event` or `xtb/**`; about and roster are read once, commands
    /// cannot be watched.
    #[arg(value_name = "KEYEXPR")]
    pub key_expr: String,
    /// Stop after this many messages.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub count: Option<u64>,
}
