//! `goto`: send a robot to a point of the map.

use super::goal::{self, Task};
use crate::cli::GotoArgs;
use crate::context::Context;
use crate::error::{Exit, Result};
use xtb_client::goal::GoalTarget;

/// Sends the goal; with `--wait` stays until it has ended.
///
/// # Errors
/// No router, no answer, or a refusal.
pub async fn run(ctx: &Context, args: GotoArgs) -> Result<Exit> {
    let GotoArgs { robot, x_m, y_m, yaw, via, wait, within, on_link_loss, lease } = args;
    let target = GoalTarget::Point { x_m, y_m, yaw_rad: yaw.map(f64::to_radians), via: via.map(Into::into) };
    let on_link_loss = on_link_loss.map(Into::into);
    goal::run(ctx, &Task { robot, target, within, wait, on_link_loss, take: lease.take }).await
}
