//! The grammar of `map` and its verbs.

use super::values::number;
use clap::{Args, Subcommand};
use std::path::PathBuf;
use xtb_nav::Grid;
use xtb_sim::CHART_RESOLUTION_M;

const CHECK_HELP: &str = "\
Problems (no room for the truck, a zone outside the map, keep-outs that divide the free space) make the \
exit code 1; warnings (several islands, doors too narrow) do not.";

const SERVE_HELP: &str = "\
Robots plan on the served map. Only one map can be served at a time.";

/// Arguments of `map`.
#[derive(Debug, Clone, Args)]
pub struct MapArgs {
    /// What to do with a map.
    #[command(subcommand)]
    pub verb: MapVerb,
}

/// What to do with a map.
#[derive(Debug, Clone, Subcommand)]
pub enum MapVerb {
    /// Draw a map file or the fleet's map.
    Show(MapShowArgs),
    /// Check a map for problems.
    Check(MapCheckArgs),
    /// Write a world or a map as map_server files: YAML and PGM.
    Import(MapImportArgs),
    /// Publish a map to the fleet until Ctrl-C.
    Serve(MapServeArgs),
}

/// Arguments of `map show`.
#[derive(Debug, Clone, Args)]
pub struct MapShowArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE", required_unless_present = "live")]
    pub file: Option<PathBuf>,
    /// The fleet's current map.
    #[arg(long, conflicts_with_all = ["file", "resolution_m"])]
    pub live: bool,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Arguments of `map check`.
#[derive(Debug, Clone, Args)]
#[command(after_help = CHECK_HELP)]
pub struct MapCheckArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Check for the truck of this robot-agent config (TOML) [default: the XTB].
    #[arg(long, value_name = "FILE")]
    pub car_from: Option<PathBuf>,
    /// Check for the truck of this vehicle file, such as configs/vehicles/long.toml.
    #[arg(long, value_name = "FILE", conflicts_with = "car_from")]
    pub vehicle: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Arguments of `map import`.
#[derive(Debug, Clone, Args)]
pub struct MapImportArgs {
    /// World (TOML) or map (map_server YAML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// YAML file to write; the image is written next to it, with the extension .pgm.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite existing files.
    #[arg(long)]
    pub force: bool,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Arguments of `map serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct MapServeArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// How fine a world is drawn.
#[derive(Debug, Clone, Copy, Args)]
pub struct ResolutionArgs {
    /// Cell size for a world's map, in m; a map file has its own.
    #[arg(long = "resolution", value_name = "M", default_value_t = CHART_RESOLUTION_M, value_parser = cell)]
    pub resolution_m: f64,
}

fn cell(text: &str) -> Result<f64, String> {
    number(text, *Grid::RESOLUTION_M.start(), *Grid::RESOLUTION_M.end(), "metres")
}
