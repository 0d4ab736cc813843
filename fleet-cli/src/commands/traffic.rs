//! `traffic`: control of who goes first, one verb a file.

mod serve;
mod status;

use crate::cli::{TrafficArgs, TrafficVerb};
use crate::context::Context;
use crate::error::{Exit, Result};
use crate::interrupt::or_interrupted;

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
