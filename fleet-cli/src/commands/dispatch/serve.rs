//! `dispatch serve`: takes tasks and gives them to robots, until Ctrl-C.

use crate::charts::{self, MapService};
use crate::cli::DispatchServeArgs;
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Result};
use crate::interrupt::interrupted;
use crate::services::dispatch::store::{self, Store};
use crate::services::dispatch::{Counters, DispatchService};
use serde::Serialize;
use std::pin::pin;
use xtb_protocol::Name;

/// The one line that says it is ready.
#[derive(Debug, Serialize)]
struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    ledger: String,
    created: bool,
    tasks: usize,
    open: usize,
}

/// What it did, said at the end.
#[derive(Debug, Serialize)]
struct Ended {
    open: usize,
    counters: Counters,
}

/// Serves until it is interrupted.
///
/// # Errors
/// A ledger that cannot be opened, no router, or a second dispatcher; later, a ledger that cannot be gone on
/// with.
pub(super) async fn run(ctx: &Context, args: &DispatchServeArgs) -> Result<Exit> {
    let path = store::path(args.ledger.ledger.as_deref(), &ctx.fleet)?;
    let own = args.map.as_deref().map(|file| charts::read(file, args.fine.resolution_m)).transpose()?;
    // Before anybody can ask: what is acknowledged has to go there.
    let store = Store::open(&path, &ctx.fleet)?;
    let created = store.created;
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(ctx).await?;
        let maps = match &own {
            Some(map) => Some(MapService::start(client.bus(), client.keys(), map, ctx.timeout).await?),
            None => None,
        };
        let service = DispatchService::start(&client, store, own, ctx.timeout).await?;
        Ok::<_, Failure>((client, maps, service))
    };
    let (client, maps, mut service) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let standing = service.standing();
    let ledger = path.display().to_string();
    let (tasks, open) = (standing.tasks, standing.open);
    let ready = Ready { ready: true, fleet: &ctx.fleet, ledger, created, tasks, open };
    ctx.out.result(&ready, |ready| {
        let Ready { fleet, ledger, tasks, open, .. } = ready;
        let new = if ready.created { "new " } else { "" };
        format!(
            "dispatcher of fleet {fleet}, {new}ledger {ledger}: {tasks} tasks, {open} of them open; Ctrl-C \
             ends: robots then stop, or finish their drive if their task says so, and the next `dispatch \
             serve` goes on"
        )
    })?;
    tokio::select! {
        failure = service.ended() => return Err(failure),
        () = &mut stop => {}
    }
    let standing = service.stop().await?;
    drop(maps);
    client.close().await;
    let ended = Ended { open: standing.open, counters: standing.counters };
    ctx.out.result(&ended, |Ended { open, counters }| {
        let Counters { questions, asked, ledger, .. } = counters;
        format!(
            "ended: {questions} questions, {asked} requests to robots, {} records in {} writes; {open} tasks \
             are open",
            ledger.records, ledger.commits
        )
    })?;
    Ok(Exit::Done)
}
