//! `vda5050`: the fleet's robots towards a master control, one verb a file.

mod serve;

use crate::commands::vda5050::serve::Vda5050ServeArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::Verbs;
use clap::{Args, Subcommand};
use xtb_client::Result;

/// Arguments of `vda5050`.
#[derive(Debug, Clone, Args)]
pub struct Vda5050Args {
    /// What to do.
    #[command(subcommand)]
    pub verb: Vda5050Verb,
}

/// What to do about VDA 5050.
#[derive(Debug, Clone, Subcommand)]
pub enum Vda5050Verb {
    /// Show the fleet's robots to a master control, and carry out its orders, until Ctrl-C.
    Serve(Vda5050ServeArgs),
}

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[("vda5050 serve", serve::JSON)];

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &Vda5050Args) -> Result<Exit> {
    match &args.verb {
        Vda5050Verb::Serve(args) => serve::run(ctx, args).await,
    }
}
