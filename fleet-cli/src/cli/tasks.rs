//! The grammar of tasks: what can be submitted, and what can be done about them afterwards.

use super::values::{degrees, metres, part_of_a_day, seconds};
use clap::{ArgGroup, Args, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;
use xtb_protocol::Name;
use xtb_protocol::messages::{LinkLoss, MAX_PRIORITY, OnTakeover, TaskId};

const GOTO_EXAMPLE: &str = "\
Example: fleet-cli dispatch goto 4 2 --yaw 90 --tag red --wait";

const ROUTE_HELP: &str = "\
A point is X,Y or X,Y,YAW (m, degrees). A file has one point per line, with commas or spaces; # starts a \
comment.

Examples:
  fleet-cli dispatch route 1,0 2,0 2,2,90 --loops 2
  fleet-cli dispatch route corridor.txt --robot xtb-1";

const PATROL_HELP: &str = "\
A point is X,Y or X,Y,YAW (m, degrees). A file has one point per line, with commas or spaces; # starts a \
comment.

Example: fleet-cli dispatch patrol -1,0 -1,4 3,4 --dwell 5 --for 600";

const WANDER_EXAMPLE: &str = "\
Example: fleet-cli dispatch wander --for 60 --robot xtb-3";

const SUBMIT_HELP: &str = "\
The file is checked as a whole, here and by the dispatcher: all of its tasks are accepted, or none.

  [[task]]
  goto = [4.0, 2.0, 90]              # x and y in m, optionally yaw in degrees
  robot = \"xtb-1\"                    # or tag = \"red\", or able = \"wander\"

  [[task]]
  patrol = [[0, 0], [0, 3]]          # or route, with loops
  dwell_s = 5
  for_s = 600                        # default: until it is cancelled
  priority = 7                       # also deadline_s, retries, grace_s,
                                     # on_takeover, on_link_loss, finish_s

  [[task]]
  wander_for_s = 60

Example: fleet-cli dispatch submit tasks.toml --wait";

const TASKS_HELP: &str = "\
Exit code 0 means that the dispatcher has answered. With --json the list is one array; with --watch each \
change is one line.

Example: fleet-cli tasks --watch";

const CANCEL_HELP: &str = "\
The answer comes when the robot has confirmed that it has ended the task. If that takes more than 5 s, the \
command says so and ends with exit code 3; the dispatcher keeps trying.

Example: fleet-cli cancel t17 t18";

const WAIT_HELP: &str = "Waiting for tasks";

/// Arguments of `dispatch goto`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true, after_help = GOTO_EXAMPLE)]
pub struct TaskGotoArgs {
    /// East, in m.
    #[arg(value_name = "X", value_parser = metres)]
    pub x_m: f64,
    /// North, in m.
    #[arg(value_name = "Y", value_parser = metres)]
    pub y_m: f64,
    /// Yaw on arrival, in degrees counter-clockwise from east [default: any].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch route`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ROUTE_HELP)]
pub struct TaskRouteArgs {
    /// Points in order, or a file of points.
    #[arg(value_name = "FILE|POINTS", required = true)]
    pub points: Vec<String>,
    /// Number of loops.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub loops: u32,
    /// Waiting time at each point.
    #[arg(long = "dwell", value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub dwell_s: f64,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch patrol`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PATROL_HELP)]
pub struct TaskPatrolArgs {
    /// Points in order, or a file of points; after the last point the first one follows again.
    #[arg(value_name = "FILE|POINTS", required = true)]
    pub points: Vec<String>,
    /// Total duration [default: until it is cancelled].
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Option<Duration>,
    /// Waiting time at each point.
    #[arg(long = "dwell", value_name = "SECONDS", default_value = "0", value_parser = part_of_a_day)]
    pub dwell_s: f64,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch wander`.
#[derive(Debug, Clone, Args)]
#[command(after_help = WANDER_EXAMPLE)]
pub struct TaskWanderArgs {
    /// Duration.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    pub lasting: Duration,
    /// Who, when, how.
    #[command(flatten)]
    pub terms: TermArgs,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Arguments of `dispatch submit`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SUBMIT_HELP)]
pub struct TaskSubmitArgs {
    /// Tasks (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Staying with them.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// Who does a task, when, and what becomes of it when something is in its way.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Task options")]
pub struct TermArgs {
    /// Only this robot [default: a free robot nearby].
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot, group = "who")]
    pub robot: Option<Name>,
    /// Only robots with this tag in the roster (red or @red).
    #[arg(long, value_name = "TAG", group = "who")]
    pub tag: Option<String>,
    /// Only robots with this capability in their factsheet.
    #[arg(long, value_name = "CAPABILITY", group = "who")]
    pub able: Option<String>,
    /// Priority, from 0 (last) to 9 (first).
    #[arg(long, value_name = "0..9", default_value_t = 5,
        value_parser = clap::value_parser!(u8).range(0..=i64::from(MAX_PRIORITY)))]
    pub priority: u8,
    /// The task fails unless it is done within this time from now [default: none].
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub deadline: Option<Duration>,
    /// Number of retries after a robot has failed.
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=100))]
    pub retries: u32,
    /// What happens to the task when another client takes control of its robot or stops it.
    #[arg(long, value_name = "WHAT", value_enum, default_value = "requeue")]
    pub on_takeover: TakeoverArg,
    /// How long the task waits for a robot that is offline or under another client's control.
    #[arg(long, value_name = "SECONDS", default_value = "30", value_parser = part_of_a_day)]
    pub grace: f64,
    /// What the robot does without a connection to the dispatcher.
    #[arg(long, value_name = "WHAT", value_enum, default_value = "halt")]
    pub on_link_loss: LinkLossArg,
    /// With --on-link-loss finish: time limit of one drive [default: 300].
    #[arg(long, value_name = "SECONDS", value_parser = part_of_a_day, requires = "on_link_loss")]
    pub finish: Option<f64>,
}

/// What a robot does when it hears nothing more from whoever sent it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LinkLossArg {
    /// The robot stops; its task waits or goes to another robot.
    Halt,
    /// The robot continues to its current goal.
    Finish,
}

impl From<LinkLossArg> for LinkLoss {
    fn from(arg: LinkLossArg) -> Self {
        match arg {
            LinkLossArg::Halt => Self::Halt,
            LinkLossArg::Finish => Self::Finish,
        }
    }
}

/// What becomes of a task whose robot somebody else took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TakeoverArg {
    /// After --grace the task is queued again, for any robot.
    Requeue,
    /// The task waits for this robot.
    Resume,
    /// The task fails.
    Fail,
}

impl From<TakeoverArg> for OnTakeover {
    fn from(arg: TakeoverArg) -> Self {
        match arg {
            TakeoverArg::Requeue => Self::Requeue,
            TakeoverArg::Resume => Self::Resume,
            TakeoverArg::Fail => Self::Fail,
        }
    }
}

/// Whether to stay until a task has ended.
#[derive(Debug, Clone, Copy, Args)]
#[command(next_help_heading = WAIT_HELP)]
pub struct StayArgs {
    /// Wait and show progress until the task has ended: exit code 0 = done, 1 = failed or cancelled. Ctrl-C
    /// ends only this command; the dispatcher keeps the task.
    #[arg(long)]
    pub wait: bool,
    /// Ctrl-C cancels the task.
    #[arg(long, requires = "wait")]
    pub cancel_on_interrupt: bool,
}

/// Arguments of `tasks`.
#[derive(Debug, Clone, Args)]
#[command(after_help = TASKS_HELP)]
pub struct TasksArgs {
    /// Update continuously; q or Ctrl-C quits.
    #[arg(long)]
    pub watch: bool,
    /// Show all ended tasks, not only the latest.
    #[arg(long)]
    pub all: bool,
    /// Only tasks of this robot: in progress, ended or waiting for it.
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Option<Name>,
}

/// Arguments of `task`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example: fleet-cli task t17")]
pub struct TaskArgs {
    /// Task, such as t17.
    #[arg(value_name = "TASK")]
    pub task: TaskId,
}

/// Arguments of `cancel`.
#[derive(Debug, Clone, Args)]
#[command(after_help = CANCEL_HELP, group = ArgGroup::new("which").args(["tasks", "all"]).required(true))]
pub struct CancelArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK")]
    pub tasks: Vec<TaskId>,
    /// All tasks that have not ended.
    #[arg(long)]
    pub all: bool,
}

/// Arguments of `pause`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The robots stop and are free for other tasks. Example: fleet-cli pause t17")]
pub struct PauseArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}

/// Arguments of `resume`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The tasks continue at their last point. Example: fleet-cli resume t17")]
pub struct ResumeArgs {
    /// Tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}

/// Arguments of `retry`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "The tasks continue at their last point. Example: fleet-cli retry t17")]
pub struct RetryArgs {
    /// Failed or cancelled tasks, such as t17.
    #[arg(value_name = "TASK", required = true)]
    pub tasks: Vec<TaskId>,
}
