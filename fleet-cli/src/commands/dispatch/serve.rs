//! `dispatch serve`: takes tasks and gives them to robots, until Ctrl-C.

use crate::cli::DispatchServeArgs;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};

/// Serves until it is interrupted.
///
/// # Errors
/// A ledger that cannot be opened, no router, or a second dispatcher.
pub(super) async fn run(_: &Context, _: &DispatchServeArgs) -> Result<Exit> {
    Err(Failure::new(Kind::Failed, "not yet"))
}
