//! `estop`: robots stand, latched, until somebody resets them.

use super::stopped;
use crate::args::WhoArgs;
use crate::context::Context;
use crate::exit::Exit;
use clap::Args;
use xtb_client::DispatcherClient;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::estop::estop;

const ESTOP_HELP: &str = "\
The stop is sent repeatedly until each robot has acknowledged it or --timeout has passed. Exit code 0 means \
that every robot of the roster has acknowledged; without a roster that cannot be confirmed, and it is 3.

This is not a safety-rated stop: it needs the radio link, the robot's computer and this program. Keep a \
switch for the motor's power within reach.";

/// Arguments of `estop`.
#[derive(Debug, Clone, Args)]
#[command(after_help = ESTOP_HELP)]
pub struct EstopArgs {
    /// Which robots.
    #[command(flatten)]
    pub who: WhoArgs,
}

/// Stops the robots named, or all of the roster and whoever else is there, and latches that.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &EstopArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let (targets, unknown) = args.who.targets(&client).await?;
    let calling = estop(&client, &targets, ctx.settings.timeout);
    let exit = stopped::shown(ctx, &client, (&targets, unknown), calling, "stopped (latched)").await?;
    if !ctx.out.json {
        ctx.out.note("reset with `fleet-cli reset ROBOT`; this is not a safety-rated stop");
        if args.who.all && DispatcherClient::of(&client).is_there().await {
            ctx.out.note("the dispatcher assigns no task until `fleet-cli dispatch activate`");
        }
    }
    client.close().await;
    Ok(exit)
}
