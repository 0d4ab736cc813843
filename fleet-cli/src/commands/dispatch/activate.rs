//! `dispatch activate`: tasks are assigned again after an emergency stop of all robots.

use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::json::{LineKind, line_of};
use crate::text::task as task_text;
use schemars::JsonSchema;
use serde::Serialize;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_protocol::messages::Suspension;

/// What it came to.
#[derive(Debug, Serialize, JsonSchema)]
struct Activated {
    active: bool,
    /// What this has ended.
    ended: Option<Suspension>,
    /// What is suspended all the same.
    suspended: Vec<Suspension>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Activated>];

/// Activates it, and says what that has ended.
///
/// # Errors
/// No router, no dispatcher, or its ledger cannot be written.
pub(super) async fn run(ctx: &Context) -> Result<Exit> {
    or_interrupted(activate(ctx)).await
}

async fn activate(ctx: &Context) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let activated = dispatcher(&client).activate().await;
    client.close().await;
    let (ended, suspended) = activated?;
    let done = Activated { active: true, ended, suspended };
    ctx.out.result(&done, |done| {
        let first = match &done.ended {
            Some(Suspension { tasks: 1, .. }) => {
                "the dispatcher is active again, with 1 open task".to_owned()
            }
            Some(ended) => format!("the dispatcher is active again, with {} open tasks", ended.tasks),
            None => "the dispatcher was already active".to_owned(),
        };
        let more = task_text::suspended(&done.suspended, None, &ctx.out);
        [first].into_iter().chain(more).collect::<Vec<_>>().join("\n")
    })?;
    Ok(Exit::Done)
}
