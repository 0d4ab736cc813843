//! `estop`: robots stand, latched, until somebody resets them.

use super::stopped::{self, Report};
use super::unknown_robots;
use crate::cli::EstopArgs;
use crate::context::Context;
use crate::error::{Exit, Result};
use xtb_client::DispatcherClient;
use xtb_client::client::Client;
use xtb_client::estop::estop;

/// Stops the robots named, or all of the roster and whoever else is there, and latches that.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &EstopArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let targets = args.who.targets();
    let calling = estop(&client, &targets, ctx.settings.timeout);
    let robots = &args.who.robots;
    let beside = unknown_robots::reported_beside(calling, ctx, &client, robots, "sent a stop");
    let ((stopped, missing), unknown_robots) = beside.await;
    if stopped.robots.is_empty() {
        return Err(missing.alive.unwrap_or_else(|| client.nobody()).into());
    }
    let report = Report { stopped, unknown_robots };
    ctx.out.result(&report, |report| report.table("stopped (latched)", &ctx.out))?;
    stopped::warn(ctx, &missing);
    if !ctx.out.json {
        ctx.out.note("reset with `fleet-cli reset ROBOT`; this is not a safety-rated stop");
        if args.who.all && DispatcherClient::of(&client).is_there().await {
            ctx.out.note("the dispatcher assigns no task until `fleet-cli dispatch activate`");
        }
    }
    client.close().await;
    Ok(report.exit())
}
