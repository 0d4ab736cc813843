//! `dispatch serve`: takes tasks and gives them to robots, until Ctrl-C.

use crate::commands::dispatch::LedgerArgs;
use crate::commands::dispatcher;
use crate::commands::map::ResolutionArgs;
use crate::config;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::map_file;
use crate::text::task as task_text;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::pin::pin;
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::Suspension;
use xtb_services::dispatch::standby::{self, StandbyChange};
use xtb_services::dispatch::store::{self, Store};
use xtb_services::dispatch::{DispatchService, DispatcherCounters, Floor};
use xtb_services::map_server::MapService;

const SERVE_HELP: &str = "\
The dispatcher assigns one task at a time to each robot. It stores each task before it acknowledges it, and \
continues after a crash or kill -9. It includes traffic control, unless that runs already.

With --standby it follows the fleet's dispatcher, keeps a copy of its ledger, and takes over when it is dead. \
Use a ledger of its own, on another computer.";

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
    /// Follow the fleet's dispatcher with a copy of its ledger, and take over when it is dead.
    #[arg(long, conflicts_with = "fresh")]
    pub standby: bool,
    /// Continue with this ledger although another one may have newer records: the other one is lost.
    #[arg(long, conflicts_with_all = ["fresh", "standby"])]
    pub promote: bool,
    /// Map (map_server YAML) or world (TOML), also served to the fleet [default: the fleet's map, if any].
    #[arg(long, value_name = "FILE")]
    pub map: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
    /// Send robots to docks when their battery gets low, and back to work [default: if the fleet config has a section
    /// home].
    #[arg(long)]
    pub home: bool,
}

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
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

/// The line before that of a stand-by.
#[derive(Debug, Serialize, JsonSchema)]
struct StandingBy<'a> {
    ready: bool,
    standby: bool,
    fleet: &'a Name,
    ledger: String,
}

/// What has changed for a stand-by.
#[derive(Debug, Serialize, JsonSchema)]
struct StandbyNews {
    standby: &'static str,
    text: String,
}

/// What it did, said at the end.
#[derive(Debug, Serialize, JsonSchema)]
struct Ended {
    open: u64,
    counters: DispatcherCounters,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] =
    &[line_of::<Ready<'_>>, line_of::<StandingBy<'_>>, line_of::<StandbyNews>, line_of::<Ended>];

/// Serves until it is interrupted.
///
/// # Errors
/// A ledger that cannot be opened, no router, or a second dispatcher; later, a ledger that cannot be gone on
/// with, or a stand-by that has taken over.
pub(super) async fn run(ctx: &Context, args: &DispatchServeArgs) -> Result<Exit> {
    let path = store::path(args.ledger.ledger.as_deref(), &ctx.settings.fleet)?;
    let observer = config::observer(&ctx.observer.0, ctx.observer.1)?;
    let load = |file| map_file::to_serve(&ctx.out, file, args.fine.resolution_m);
    let own = args.map.as_deref().map(load).transpose()?;
    // Before anybody can ask: what is acknowledged has to go there.
    let store = match args.fresh {
        true => Store::fresh(&path, &ctx.settings.fleet)?,
        false => Store::open(&path, &ctx.settings.fleet)?,
    };
    if !args.standby && !args.promote {
        store.no_copy()?;
    }
    let (created, set_aside) = (store.created, store.set_aside.clone());
    let mut stop = pin!(interrupted());
    let client = tokio::select! {
        opened = Client::open(&ctx.settings) => opened?,
        () = &mut stop => return Ok(Exit::Interrupted),
    };
    let Some(store) = to_be_served(ctx, args, &client, store, &mut stop).await? else {
        client.close().await;
        return Ok(Exit::Done);
    };
    let starting = async {
        let maps = match own {
            Some((map, kept)) => {
                let (bus, keys, kept) = (client.bus(), client.keys(), Some(kept));
                Some(MapService::start_kept(bus, keys, &map, kept, ctx.settings.timeout).await?)
            }
            None => None,
        };
        let own = maps.as_ref().map(MapService::maps);
        let floor = Floor { own, home: ctx.home_rules(args.home) };
        let service = DispatchService::start(&client, store, floor, observer, ctx.settings.timeout).await?;
        Ok::<_, Error>((maps, service))
    };
    let (maps, mut service) = tokio::select! {
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
        failure = client.refused() => return Err(failure),
        () = map_file::follow_if_any(args.map.as_deref(), args.fine.resolution_m, maps.as_ref()) => {}
        () = &mut stop => {}
    }
    let standing = service.stop().await?;
    drop(maps);
    client.close().await;
    let ended = Ended { open: standing.status.open, counters: standing.counters };
    ctx.out.result(&ended, |Ended { open, counters }| {
        let DispatcherCounters { questions, asked, ledger, .. } = counters;
        format!(
            "ended: {questions} client requests, {asked} robot requests, {} records in {} writes; {open} \
             tasks are open",
            ledger.records, ledger.commits
        )
    })?;
    Ok(Exit::Done)
}

/// The ledger of an active dispatcher: of a stand-by as soon as it takes over; `None` = it was stopped before.
async fn to_be_served(
    ctx: &Context,
    args: &DispatchServeArgs,
    client: &Client,
    mut store: Store,
    stop: impl Future<Output = ()>,
) -> Result<Option<Store>> {
    if args.standby {
        ready_to_stand_by(ctx, store.ledger.path())?;
        let say = |change: &StandbyChange| say(ctx, change);
        return standby::stand_by(client, store, stop, say).await;
    }
    if args.promote {
        if dispatcher(client).is_there().await {
            return Err(Error::new(ErrorKind::Failed, "this fleet already has a dispatcher")
                .hint("stop it first, or let this one follow it with --standby; nothing was changed"));
        }
        let term = store.promote()?;
        ctx.out.note(&format!("the ledger continues in term {term}"));
    }
    Ok(Some(store))
}

/// What changes for a stand-by: a line of JSON for programs, a note for people.
fn say(ctx: &Context, change: &StandbyChange) {
    let (standby, text) = (change.name(), change.text());
    if !ctx.out.json {
        return ctx.out.note(&text);
    }
    // It goes on if nobody reads it.
    let _ = ctx.out.result(&StandbyNews { standby, text }, |news| news.text.clone());
}

fn ready_to_stand_by(ctx: &Context, path: &Path) -> Result<()> {
    let ledger = path.display().to_string();
    let ready = StandingBy { ready: true, standby: true, fleet: &ctx.settings.fleet, ledger };
    ctx.out.result(&ready, |StandingBy { fleet, ledger, .. }| {
        format!("stand-by of fleet {fleet}, copy of the ledger in {ledger}; stop with Ctrl-C")
    })
}
