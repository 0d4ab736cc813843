//! `extend`: more points for a route that has not ended.

use crate::commands::change::report;
use crate::commands::dispatch::points;
use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use clap::Args;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_protocol::messages::{DispatchBody, TaskId};

const HELP: &str = "\
The robot continues to the new points after its last one, also if it is already driving. With --after the points \
are added only if the route has that many points now, or has exactly these after them already: the same command \
again adds nothing twice.

Example: fleet-cli extend t17 3,0 4,0,90 --after 2";

/// Arguments of `extend`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct ExtendArgs {
    /// Route, such as t17.
    #[arg(value_name = "TASK")]
    pub task: TaskId,
    /// Points in order, or a file of points.
    #[arg(value_name = "FILE|POINTS", required = true)]
    pub points: Vec<String>,
    /// Points that the route has without these [default: as many as it has now].
    #[arg(long, value_name = "N")]
    pub after: Option<u32>,
}

/// Adds points to a route.
///
/// # Errors
/// No router, no dispatcher, a point that is none, or a refusal.
pub async fn run(ctx: &Context, args: ExtendArgs) -> Result<Exit> {
    let points = points::read(ctx, &args.points).await?;
    let client = Client::open(&ctx.settings).await?;
    let dispatcher = dispatcher(&client);
    let changes = async {
        let after = match args.after {
            Some(after) => after,
            None => {
                let known = dispatcher.show(args.task).await?.task.spec.kind.points().len();
                u32::try_from(known).unwrap_or(u32::MAX)
            }
        };
        dispatcher.change(DispatchBody::Extend { task: args.task, after, points }).await
    };
    let changes = changes.await;
    client.close().await;
    report(ctx, &changes?.tasks)
}
