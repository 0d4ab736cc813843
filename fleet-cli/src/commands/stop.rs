//! `stop`: robots drop their goals and stand.

use super::stopped;
use crate::args::WhoArgs;
use crate::context::Context;
use crate::exit::Exit;
use clap::Args;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::stop::stop;

/// Arguments of `stop`.
#[derive(Debug, Clone, Args)]
pub struct StopArgs {
    /// Which robots.
    #[command(flatten)]
    pub who: WhoArgs,
}

/// Stops the robots named, or all of the roster and whoever else is there.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &StopArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let all = async {
        let (targets, unknown) = args.who.targets(&client).await?;
        let stopping = stop(&client, &targets);
        stopped::shown(ctx, &client, (&targets, unknown), stopping, "stopped").await
    };
    let named = async {
        if let Some(targets) = args.who.at_once() {
            // What comes of it is shown with the others.
            let _ = stop(&client, &targets).await;
        }
    };
    let ((), exit) = tokio::join!(named, all);
    client.close().await;
    exit
}
