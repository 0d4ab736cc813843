//! `dispatch`: tasks for the fleet, one verb a file.

mod compact;
mod export;
mod serve;

use crate::cli::{DispatchArgs, DispatchVerb};
use crate::context::Context;
use crate::error::{Exit, Result};

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &DispatchArgs) -> Result<Exit> {
    match &args.verb {
        DispatchVerb::Serve(args) => serve::run(ctx, args).await,
        DispatchVerb::Compact(args) => compact::run(ctx, args),
        DispatchVerb::Export(args) => export::run(ctx, args),
    }
}
