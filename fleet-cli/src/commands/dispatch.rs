//! `dispatch`: tasks for the fleet, one verb a file.

mod activate;
mod adopt;
mod compact;
mod export;
mod file;
mod points;
mod serve;
mod status;
mod submit;
mod wait;

use crate::cli::{DispatchArgs, DispatchVerb};
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use robot_agent::files;
use std::path::Path;

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
/// [`Kind::Config`]: it cannot be read, or is too long.
fn text(path: &Path, max_bytes: usize) -> Result<String> {
    files::text(path, max_bytes)
        .map_err(|error| Failure::new(Kind::Config, format!("cannot read {}: {error}", path.display())))
}
