//! `status`: everything about robots, once or for as long as somebody looks.

mod block;
mod live;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use clap::Args;
use std::collections::BTreeSet;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::fleet_view::{FleetView, RobotView};
use xtb_protocol::Name;

/// Arguments of `status`.
#[derive(Debug, Clone, Args)]
pub struct StatusArgs {
    /// Robots [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// Update continuously; q or Ctrl-C quits.
    #[arg(long)]
    pub watch: bool,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<FleetView>, line_of::<RobotView>];

/// Prints a block for each robot, or with `--watch` keeps showing them.
///
/// # Errors
/// No router, or nobody is there.
pub async fn run(ctx: &Context, args: &StatusArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let wanted: BTreeSet<Name> = match args.robots.is_empty() {
        true => client.roster(&[]).await?.unwrap_or_default(),
        false => args.robots.iter().cloned().collect(),
    };
    let exit = if args.watch {
        live::run(ctx, &client, args, &wanted).await?
    } else {
        once(ctx, &client, args, &wanted).await?
    };
    client.close().await;
    Ok(exit)
}

async fn once(ctx: &Context, client: &Client, args: &StatusArgs, wanted: &BTreeSet<Name>) -> Result<Exit> {
    let view = FleetView::ask(client, &ctx.settings.fleet, wanted).await?.only(&args.robots);
    if !view.robots.iter().any(|robot| robot.alive)
        && let Some(error) = client.not_admitted().await
    {
        return Err(error);
    }
    if view.robots.is_empty() {
        return Err(client.nobody());
    }
    ctx.out.result(&view, |view| {
        let blocks = view.robots.iter().map(|robot| block::lines(robot, &ctx.out).join("\n"));
        blocks.collect::<Vec<_>>().join("\n\n")
    })?;
    Ok(if view.is_known() { Exit::Done } else { Exit::Unknown })
}
