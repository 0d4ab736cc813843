//! `estop`: robots stand, latched, until somebody resets them.

use super::stopped;
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
    let report = stopped::shown(ctx, &client, &args.who, calling, "stopped (latched)").await?;
    if !ctx.out.json {
        ctx.out.note("reset with `fleet-cli reset ROBOT`; this is not a safety-rated stop");
        if args.who.all && DispatcherClient::of(&client).is_there().await {
            ctx.out.note("the dispatcher assigns no task until `fleet-cli dispatch activate`");
        }
    }
    client.close().await;
    Ok(report.exit())
}
