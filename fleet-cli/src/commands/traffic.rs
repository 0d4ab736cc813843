//! `traffic`: control of who goes first, one verb a file.

mod serve;
mod status;

use crate::commands::traffic::serve::TrafficServeArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::json::Verbs;
use clap::{Args, Subcommand};
use xtb_client::Result;

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

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[("traffic serve", serve::JSON), ("traffic status", status::JSON)];

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &TrafficArgs) -> Result<Exit> {
    match &args.verb {
        TrafficVerb::Serve(args) => serve::run(ctx, args).await,
        TrafficVerb::Status => or_interrupted(status::run(ctx)).await,
    }
}
