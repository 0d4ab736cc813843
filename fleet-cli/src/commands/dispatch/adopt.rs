//! `dispatch adopt`: the tasks of other maps are taken over to the fleet's.

use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::json::{LineKind, line_of};
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::Adopted;

/// Tasks that are named one by one.
const NAMED: usize = 10;

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Adopted>];

/// Takes them over, and says which.
///
/// # Errors
/// No router, no dispatcher, no map, or its ledger cannot be written.
pub(super) async fn run(ctx: &Context) -> Result<Exit> {
    or_interrupted(adopt(ctx)).await
}

async fn adopt(ctx: &Context) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let adopted = dispatcher(&client).adopt().await;
    client.close().await;
    let adopted = adopted?;
    let Some(map) = &adopted.map else {
        return Err(Error::new(
            ErrorKind::Failed,
            "the dispatcher has no map: no task is suspended because of a \
            map",
        )
        .hint("serve one with `fleet-cli map serve` or `dispatch serve --map`"));
    };
    ctx.out.result(&adopted, |adopted| {
        let named = adopted.tasks.iter().take(NAMED).map(ToString::to_string).collect::<Vec<_>>().join(", ");
        match adopted.tasks.len() {
            0 => format!("no task belongs to a map other than {map}"),
            1 => format!("1 task adopted for map {map}: {named}"),
            count if count <= NAMED => format!("{count} tasks adopted for map {map}: {named}"),
            count => format!("{count} tasks adopted for map {map}: {named} and {} more", count - NAMED),
        }
    })?;
    if !adopted.tasks.is_empty() && !ctx.out.json {
        ctx.out.note("tasks that are unreachable on this map fail; `fleet-cli tasks` shows them");
    }
    Ok(Exit::Done)
}
