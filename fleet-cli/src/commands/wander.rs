//! `wander`: let a robot wander.

use super::goal::{self, Task};
use crate::cli::WanderArgs;
use crate::context::Context;
use crate::error::{Exit, Result};
use xtb_client::goal::GoalTarget;

/// Starts it; with `--wait` stays until it has ended.
///
/// # Errors
/// No router, no answer, or a refusal.
pub async fn run(ctx: &Context, args: WanderArgs) -> Result<Exit> {
    let WanderArgs { robot, lasting, wait, on_link_loss, lease } = args;
    let (target, on_link_loss) = (GoalTarget::Wander { lasting }, on_link_loss.map(Into::into));
    goal::run(ctx, &Task { robot, target, within: None, wait, on_link_loss, take: lease.take }).await
}
