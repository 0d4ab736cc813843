//! `map`: the floor that the fleet plans on, one verb a file.

mod check;
mod history;
mod import;
mod picture;
mod serve;
mod show;

use crate::commands::map::check::MapCheckArgs;
use crate::commands::map::history::MapHistoryArgs;
use crate::commands::map::import::MapImportArgs;
use crate::commands::map::serve::MapServeArgs;
use crate::commands::map::show::MapShowArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::json::Verbs;
use crate::values::number;
use clap::{Args, Subcommand};
use xtb_client::Result;
use xtb_nav::{Grid, Map};
use xtb_sim::MAP_RESOLUTION_M;

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
    /// Show who changed a map, when and why.
    History(MapHistoryArgs),
    /// Publish a map to the fleet until Ctrl-C.
    Serve(MapServeArgs),
}

/// How fine a world is drawn.
#[derive(Debug, Clone, Copy, Args)]
pub struct ResolutionArgs {
    /// Cell size for a world's map, in m; a map file has its own.
    #[arg(long = "resolution", value_name = "M", default_value_t = MAP_RESOLUTION_M, value_parser = cell)]
    pub resolution_m: f64,
}

fn cell(text: &str) -> std::result::Result<f64, String> {
    number(text, *Grid::RESOLUTION_M.start(), *Grid::RESOLUTION_M.end(), "metres")
}

impl MapArgs {
    /// Whether it talks to a fleet.
    pub(super) fn needs_session(&self) -> bool {
        match &self.verb {
            MapVerb::Show(args) => args.live,
            MapVerb::History(args) => args.file.is_none(),
            MapVerb::Check(_) | MapVerb::Import(_) => false,
            MapVerb::Serve(_) => true,
        }
    }
}

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[
    ("map show", show::JSON),
    ("map check", check::JSON),
    ("map import", import::JSON),
    ("map serve", serve::JSON),
    ("map history", history::JSON),
];

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &MapArgs) -> Result<Exit> {
    match &args.verb {
        MapVerb::Show(args) => or_interrupted(show::run(ctx, args)).await,
        MapVerb::Check(args) => check::run(ctx, args),
        MapVerb::History(args) => or_interrupted(history::run(ctx, args)).await,
        MapVerb::Import(args) => import::run(ctx, args),
        MapVerb::Serve(args) => serve::run(ctx, args).await,
    }
}

/// Width and depth, in m.
fn size_m(map: &Map) -> [f64; 2] {
    [map.grid().width(), map.grid().height()].map(|cells| rounded(cells as f64 * map.grid().resolution_m()))
}

/// To the sixth decimal: 56.12 instead of 56.120000000000005.
fn rounded(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}

/// In m: `12.20 × 14.20 m, cells of 5 cm`.
fn size(map: &Map) -> String {
    let [width_m, depth_m] = size_m(map);
    format!("{width_m:.2} × {depth_m:.2} m, cells of {}", centimetres(map.grid().resolution_m()))
}

fn centimetres(metres: f64) -> String {
    let text = format!("{:.1}", metres * 100.0);
    format!("{} cm", text.trim_end_matches(".0"))
}
