//! The grammar of `traffic` and its verbs.

use super::map::ResolutionArgs;
use clap::{Args, Subcommand};
use std::path::PathBuf;

const SERVE_HELP: &str = "\
Robots with planned goals (`goto` on a robot with a map) get their paths from traffic control. Each drives \
only as far as it has clearance, in an order without conflicts. Without traffic control each robot plans for \
itself.";

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
    /// Coordinate the fleet's robots until Ctrl-C.
    Serve(TrafficServeArgs),
    /// Show which robots traffic control coordinates, and which ones it plans around.
    Status,
}

/// Arguments of `traffic serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct TrafficServeArgs {
    /// Map (map_server YAML) or world (TOML), also served to the fleet [default: the fleet's map].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}
