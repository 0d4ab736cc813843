//! The grammar of `dispatch` and its verbs.

use super::map::ResolutionArgs;
use super::tasks::{TaskGotoArgs, TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs};
use clap::{Args, Subcommand};
use std::path::PathBuf;

const SERVE_HELP: &str = "\
It gives tasks to robots, one each, and writes down what was acknowledged before it says so: after a crash, \
kill -9 included, it goes on where it was. It contains traffic control, unless that runs already.";

const EXPORT_HELP: &str = "\
Each line is a record as the ledger has it: {\"seq\", \"at_ms\", \"snapshot\", \"intact\", \"record\"}. What is \
wrong with a damaged ledger is said on standard error, and the exit code is 1.";

const ACTIVATE_HELP: &str = "\
An emergency stop of all robots suspends the dispatcher, so that the first reset does not set the fleet in \
motion: its tasks stay, new ones are taken, none is assigned until it is activated. Robots that are still \
latched get tasks when they are reset.";

const ADOPT_HELP: &str = "\
A task is of the map that the fleet had when it was submitted. While the fleet has a map of another name, such \
tasks are suspended. Those that are taken over and that the map makes unreachable fail, with the reason.";

/// Arguments of `dispatch`.
#[derive(Debug, Clone, Args)]
pub struct DispatchArgs {
    /// What to do.
    #[command(subcommand)]
    pub verb: DispatchVerb,
}

/// What to do about dispatch.
#[derive(Debug, Clone, Subcommand)]
pub enum DispatchVerb {
    /// Take tasks for the fleet and give them to its robots until Ctrl-C.
    Serve(DispatchServeArgs),
    /// Submit a task: a robot drives to a point.
    Goto(TaskGotoArgs),
    /// Submit a task: a robot drives along points.
    Route(TaskRouteArgs),
    /// Submit a task: a robot drives along points again and again.
    Patrol(TaskPatrolArgs),
    /// Submit a task: a robot wanders.
    Wander(TaskWanderArgs),
    /// Submit the tasks of a file, all or none.
    Submit(TaskSubmitArgs),
    /// Show how the dispatcher stands: ledger, map, tasks, and what is suspended.
    Status,
    /// Let it assign tasks again after an emergency stop of all robots.
    #[command(after_help = ACTIVATE_HELP)]
    Activate,
    /// Take the tasks of other maps over to the one that the fleet has now.
    #[command(after_help = ADOPT_HELP)]
    Adopt,
    /// Replace what the ledger holds by one snapshot of it; no dispatcher may run.
    Compact(DispatchCompactArgs),
    /// Print a ledger's records, also beside a running dispatcher or what is left of a damaged one.
    Export(DispatchExportArgs),
}

/// Which ledger.
#[derive(Debug, Clone, Default, Args)]
pub struct LedgerArgs {
    /// Ledger [default: FLEET.ledger in $XDG_DATA_HOME/xtb or ~/.local/share/xtb].
    #[arg(long, value_name = "FILE")]
    pub ledger: Option<PathBuf>,
}

/// Arguments of `dispatch serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct DispatchServeArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
    /// Begin a new ledger; the one that is there is kept beside it, as NAME.before-TIME.ledger.
    #[arg(long)]
    pub fresh: bool,
    /// Map (map_server YAML) or world (TOML), served to the fleet too [default: the fleet's, if there is one].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Arguments of `dispatch compact`.
#[derive(Debug, Clone, Args)]
pub struct DispatchCompactArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
}

/// Arguments of `dispatch export`.
#[derive(Debug, Clone, Args)]
#[command(after_help = EXPORT_HELP)]
pub struct DispatchExportArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
}
