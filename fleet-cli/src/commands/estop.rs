//! `estop`: robots stand, latched, until somebody resets them.

use super::stopped;
use crate::args::WhoArgs;
use crate::context::Context;
use crate::exit::Exit;
use clap::Args;
use std::time::{Duration, Instant};
use xtb_client::DispatcherClient;
use xtb_client::client::Client;
use xtb_client::estop::{LINK_WITHIN, estop};
use xtb_client::{ErrorKind, Result};

const ESTOP_HELP: &str = "\
The stop is sent repeatedly until each robot has acknowledged it or --timeout has passed. Exit code 0 means \
that every robot of the roster has acknowledged; without a roster that cannot be confirmed, and it is 3. A \
router that does not answer is tried again for 60 s.

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

/// What people have to do themselves where nobody answers.
pub(super) const MAY_DRIVE: &str = "robots may still drive: use the switch";
/// Between two looks at the link, and between two tries to open one.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// Stops the robots named, or all of the roster and whoever else is there, and latches that.
///
/// # Errors
/// No router for a minute, or nobody to stop.
pub async fn run(ctx: &Context, args: &EstopArgs) -> Result<Exit> {
    let client = open(ctx).await?;
    let all = async {
        let (targets, unknown) = args.who.targets(&client).await?;
        let calling = estop(&client, &targets, ctx.settings.timeout);
        stopped::shown(ctx, &client, (&targets, unknown), calling, "stopped (latched)").await
    };
    let named = async {
        if let Some(targets) = args.who.at_once() {
            // What comes of it is shown with the others.
            let _ = estop(&client, &targets, ctx.settings.timeout).await;
        }
    };
    let exit = tokio::select! {
        ((), exit) = async { tokio::join!(named, all) } => exit,
        never = tell_link(ctx, &client) => match never {},
    };
    let exit = exit.inspect_err(|_| ctx.out.note(MAY_DRIVE))?;
    if exit != Exit::Done {
        ctx.out.note(MAY_DRIVE);
    }
    if !ctx.out.json {
        let whom = if args.who.all { "--all" } else { "ROBOT" };
        ctx.out.note(&format!("reset with `fleet-cli reset {whom}`; this is not a safety-rated stop"));
        if args.who.all && DispatcherClient::of(&client).is_there().await {
            ctx.out.note("the dispatcher assigns no task until `fleet-cli dispatch activate`");
        }
    }
    client.close().await;
    Ok(exit)
}

/// A session. A router that does not answer is tried again: robots may drive meanwhile.
async fn open(ctx: &Context) -> Result<Client> {
    let (began, mut told) = (Instant::now(), false);
    loop {
        let error = match Client::open(&ctx.settings).await {
            Err(error) if error.kind == ErrorKind::NoRouter => error,
            opened => return opened,
        };
        if began.elapsed() > LINK_WITHIN {
            let hint = format!("{MAY_DRIVE}; {}", error.hint);
            return Err(error.hint(hint));
        }
        if !std::mem::replace(&mut told, true) {
            let seconds = LINK_WITHIN.as_secs();
            ctx.out.note(&format!("{error}\n{MAY_DRIVE}; the router is tried again for {seconds} s"));
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// Says when the link is lost and when it is back; does not end.
async fn tell_link(ctx: &Context, client: &Client) -> std::convert::Infallible {
    let mut linked = true;
    loop {
        let is_linked = client.bus().is_linked().await;
        if is_linked != linked {
            linked = is_linked;
            match linked {
                true => ctx.out.note("the router answers again"),
                false => ctx.out.note(&format!("the router is lost: {MAY_DRIVE}; it is waited for")),
            }
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}
