//! `dispatch`: tasks for the fleet, one verb a file.

mod activate;
mod adopt;
mod compact;
mod export;
mod file;
pub(super) mod points;
mod serve;
mod status;
pub(super) mod submit;
mod wait;

use crate::commands::dispatch::compact::DispatchCompactArgs;
use crate::commands::dispatch::export::DispatchExportArgs;
use crate::commands::dispatch::serve::DispatchServeArgs;
use crate::commands::dispatch::submit::{
    TaskGotoArgs, TaskPatrolArgs, TaskRouteArgs, TaskSubmitArgs, TaskWanderArgs,
};
use crate::context::Context;
use crate::exit::Exit;
use crate::json::Verbs;
use clap::{Args, Subcommand};
use robot_agent::files;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};

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

impl DispatchArgs {
    /// Whether it talks to a fleet.
    pub(super) fn needs_session(&self) -> bool {
        !matches!(self.verb, DispatchVerb::Compact(_) | DispatchVerb::Export(_))
    }
}

/// Which ledger.
#[derive(Debug, Clone, Default, Args)]
pub struct LedgerArgs {
    /// Ledger [default: FLEET.ledger in $XDG_DATA_HOME/xtb or ~/.local/share/xtb].
    #[arg(long, value_name = "FILE")]
    pub ledger: Option<PathBuf>,
}

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[
    ("dispatch serve", serve::JSON),
    ("dispatch goto", submit::JSON),
    ("dispatch route", submit::JSON),
    ("dispatch patrol", submit::JSON),
    ("dispatch wander", submit::JSON),
    ("dispatch submit", submit::JSON),
    ("dispatch status", status::JSON),
    ("dispatch activate", activate::JSON),
    ("dispatch adopt", adopt::JSON),
    ("dispatch compact", compact::JSON),
    ("dispatch export", export::JSON),
];

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &DispatchArgs) -> Result<Exit> {
    match &args.verb {
        DispatchVerb::Serve(args) => serve::run(ctx, args).await,
        DispatchVerb::Goto(args) => submit::goto(ctx, args).await,
        DispatchVerb::Route(args) => submit::route(ctx, args).await,
        DispatchVerb::Patrol(args) => submit::patrol(ctx, args).await,
        DispatchVerb::Wander(args) => submit::wander(ctx, args).await,
        DispatchVerb::Submit(args) => submit::file(ctx, args).await,
        DispatchVerb::Status => status::run(ctx).await,
        DispatchVerb::Activate => activate::run(ctx).await,
        DispatchVerb::Adopt => adopt::run(ctx).await,
        DispatchVerb::Compact(args) => compact::run(ctx, args),
        DispatchVerb::Export(args) => export::run(ctx, args),
    }
}

/// A text file.
///
/// # Errors
/// [`ErrorKind::Config`]: it cannot be read, or is too long.
fn text(path: &Path, max_bytes: usize) -> Result<String> {
    files::text(path, max_bytes).map_err(|error| {
        Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display()))
            .hint("configs/tasks.toml is an example of a file of tasks; `fleet-cli dispatch route --help` describes one of points")
    })
}
