//! The grammar of `traffic` and its verbs.

use super::map::ResolutionArgs;
use clap::{Args, Subcommand};
use std::path::PathBuf;

const SERVE_HELP: &str = "\
Robots whose goals are planned (`goto` on a robot with a map) get their paths from here: each drives as far \
as it was released, in an order in which nobody meets anybody. Without it each plans for itself.";

/// Arguments of `traffic`.
#[derive(Debug, Clone, Args)]
pub struct TrafficArgs {
    /// What to do.
    #[command(subcommand)]
    pub verb: TrafficVerb,
}

/// What to do about traffic.
#[derive(Debug, Clone, Subcommand)]
pub enum TrafficVerb {
    /// Lead the fleet's robots past each other until Ctrl-C.
    Serve(TrafficServeArgs),
    /// Whom traffic control leads, and whom it drives around.
    Status,
}

/// Arguments of `traffic serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct TrafficServeArgs {
    /// Map (map_server YAML) or world (TOML), served to the fleet too [default: the fleet's].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}
