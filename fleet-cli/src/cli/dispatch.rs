//! The grammar of `dispatch` and its verbs.

use super::map::ResolutionArgs;
use super::tasks::{TaskGotoArgs, TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs};
use clap::{Args, Subcommand};
use std::path::PathBuf;

const SERVE_HELP: &str = "\
The dispatcher assigns one task at a time to each robot. It stores each task before it acknowledges it, and \
continues after a crash or kill -9. It includes traffic control, unless that runs already.";

const EXPORT_HELP: &str = "\
Each line is one record of the ledger: {\"seq\", \"at_ms\", \"snapshot\", \"intact\", \"record\"}. If the \
ledger is damaged, standard error describes the damage, and the exit code is 1.";

const ACTIVATE_HELP: &str = "\
An emergency stop of all robots suspends the dispatcher, so that the first reset does not set the fleet in \
motion. It keeps its tasks and accepts new ones, but assigns none until it is activated. Robots that are \
still latched get tasks when they are reset.";

const ADOPT_HELP: &str = "\
A task belongs to the map that the fleet used when it was submitted. While the fleet uses a map with another \
name, such tasks are suspended. Adopted tasks that the new map makes unreachable fail, with the reason.";

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
    /// Accept tasks for the fleet and assign them to its robots until Ctrl-C.
    Serve(DispatchServeArgs),
    /// Submit a task: a robot drives to a point.
    Goto(TaskGotoArgs),
    /// Submit a task: a robot drives along points.
    Route(TaskRouteArgs),
    /// Submit a task: a robot drives along points repeatedly.
    Patrol(TaskPatrolArgs),
    /// Submit a task: a robot wanders.
    Wander(TaskWanderArgs),
    /// Submit the tasks in a file, all or none.
    Submit(TaskSubmitArgs),
    /// Show the dispatcher's state: ledger, map, tasks, and what is suspended.
    Status,
    /// Assign tasks again after an emergency stop of all robots.
    #[command(after_help = ACTIVATE_HELP)]
    Activate,
    /// Adopt the tasks of other maps for the fleet's current map.
    #[command(after_help = ADOPT_HELP)]
    Adopt,
    /// Replace the ledger's records by one snapshot; no dispatcher may be running.
    Compact(DispatchCompactArgs),
    /// Print a ledger's records, also while a dispatcher runs or from a damaged ledger.
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
    /// Start a new ledger; an existing one is kept as NAME.before-TIME.ledger.
    #[arg(long)]
    pub fresh: bool,
    /// Map (map_server YAML) or world (TOML), also served to the fleet [default: the fleet's map, if any].
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
