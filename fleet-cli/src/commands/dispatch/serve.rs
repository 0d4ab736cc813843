//! `dispatch serve`: takes tasks and gives them to robots, until Ctrl-C.

use crate::commands::dispatch::LedgerArgs;
use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::map_file;
use crate::text::task as task_text;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::pin::pin;
use xtb_client::client::Client;
use xtb_client::{Error, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::Suspension;
use xtb_services::dispatch::store::{self, Store};
use xtb_services::dispatch::{Counters, DispatchService};
use xtb_services::map_server::MapService;

const SERVE_HELP: &str = "\
The dispatcher assigns one task at a time to each robot. It stores each task before it acknowledges it, and \
continues after a crash or kill -9. It includes traffic control, unless that runs already.";

/// Arguments of `dispatch serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = SERVE_HELP)]
pub struct DispatchServeArgs {
    /// Which ledger.
    #[command(flatten)]
    pub ledger: LedgerArgs,
    /// Start a new ledger; an existing one is kept as NAME.before-TIME.ledger.
    #[arg(long)]
    pub fresh: bool,
    /// Map (map_server YAML) or world (TOML), also served to the fleet [default: the fleet's map, if any].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize)]
struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    ledger: String,
    created: bool,
    /// Where the ledger of before is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    set_aside: Option<String>,
    /// The map that tasks are taken for.
    map: Option<String>,
    tasks: u64,
    open: u64,
    suspended: Vec<Suspension>,
}

/// What it did, said at the end.
#[derive(Debug, Serialize)]
struct Ended {
    open: u64,
    counters: Counters,
}

/// Serves until it is interrupted.
///
/// # Errors
/// A ledger that cannot be opened, no router, or a second dispatcher; later, a ledger that cannot be gone on
/// with.
pub(super) async fn run(ctx: &Context, args: &DispatchServeArgs) -> Result<Exit> {
    let path = store::path(args.ledger.ledger.as_deref(), &ctx.settings.fleet)?;
    let own = args.map.as_deref().map(|file| map_file::read(file, args.fine.resolution_m)).transpose()?;
    // Before anybody can ask: what is acknowledged has to go there.
    let store = match args.fresh {
        true => Store::fresh(&path, &ctx.settings.fleet)?,
        false => Store::open(&path, &ctx.settings.fleet)?,
    };
    let (created, set_aside) = (store.created, store.set_aside.clone());
    let mut stop = pin!(interrupted());
    let starting = async {
        let client = Client::open(&ctx.settings).await?;
        let maps = match &own {
            Some(map) => {
                Some(MapService::start(client.bus(), client.keys(), map, ctx.settings.timeout).await?)
            }
            None => None,
        };
        let service = DispatchService::start(&client, store, own, ctx.settings.timeout).await?;
        Ok::<_, Error>((client, maps, service))
    };
    let (client, maps, mut service) = tokio::select! {
        started = starting => started?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let standing = service.standing();
    let ready = Ready {
        ready: true,
        fleet: &ctx.settings.fleet,
        ledger: path.display().to_string(),
        created,
        set_aside: set_aside.map(|path| path.display().to_string()),
        map: standing.status.map.clone(),
        tasks: standing.status.tasks,
        open: standing.status.open,
        suspended: standing.suspended.clone(),
    };
    ctx.out.result(&ready, |Ready { fleet, ledger, created, tasks, .. }| {
        let (new, found) = (if *created { "new " } else { "" }, standing.found());
        format!(
            "dispatcher of fleet {fleet}, {new}ledger {ledger}: {found}, {tasks} tasks stored; stop with \
             Ctrl-C: robots then stop, or finish their drive if their task allows it; the next `dispatch \
             serve` continues"
        )
    })?;
    if !ctx.out.json {
        task_text::found(ctx, &standing.suspended, ready.set_aside.as_deref());
    }
    tokio::select! {
        failure = service.ended() => return Err(failure),
        () = &mut stop => {}
    }
    let standing = service.stop().await?;
    drop(maps);
    client.close().await;
    let ended = Ended { open: standing.status.open, counters: standing.counters };
    ctx.out.result(&ended, |Ended { open, counters }| {
        let Counters { questions, asked, ledger, .. } = counters;
        format!(
            "ended: {questions} client requests, {asked} robot requests, {} records in {} writes; {open} \
             tasks are open",
            ledger.records, ledger.commits
        )
    })?;
    Ok(Exit::Done)
}
