//! `stop`: robots drop their goals and stand.

use super::stopped::{self, Report};
use super::unknown_robots;
use crate::cli::StopArgs;
use crate::context::Context;
use crate::error::{Exit, Result};
use xtb_client::client::Client;
use xtb_client::stop::stop;

/// Stops the robots named, or all of the roster and whoever else is there.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &StopArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let targets = args.who.targets();
    let calling = stop(&client, &targets);
    let robots = &args.who.robots;
    let beside = unknown_robots::reported_beside(calling, ctx, &client, robots, "sent a stop");
    let ((stopped, missing), unknown_robots) = beside.await;
    if stopped.robots.is_empty() {
        return Err(missing.alive.unwrap_or_else(|| client.nobody()).into());
    }
    let report = Report { stopped, unknown_robots };
    ctx.out.result(&report, |report| report.table("stopped", &ctx.out))?;
    stopped::warn(ctx, &missing);
    client.close().await;
    Ok(report.exit())
}
