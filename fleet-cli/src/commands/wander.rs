//! `wander`: let a robot wander.

use super::goal::{self, Aim, Task};
use crate::cli::WanderArgs;
use crate::context::Context;
use crate::error::{Exit, Result};

/// Starts it; with `--wait` stays until it has ended.
///
/// # Errors
/// No router, no answer, or a refusal.
pub async fn run(ctx: &Context, args: WanderArgs) -> Result<Exit> {
    let WanderArgs { robot, lasting, wait, lease } = args;
    goal::run(ctx, &Task { robot, aim: Aim::Wander { lasting }, within: None, wait, take: lease.take }).await
}
