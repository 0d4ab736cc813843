//! `events`: what happened in the fleet, as the dispatcher's history has it.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::values::{history_kind, moment};
use clap::Args;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use xtb_client::client::Client;
use xtb_client::{DispatcherClient, Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    HistoryEvent, HistoryKind, HistoryPlace, HistoryReply, HistoryRequest, MAX_HISTORY_PAGE,
};

const HELP: &str = "\
The dispatcher keeps the history in a file beside its ledger: 90 days, unless [history] of the fleet config says \
otherwise. With --json each event is one line.

Examples:
  fleet-cli events --since 24h --kind latch --kind alert
  fleet-cli events --robot xtb-1 --search blocked
  fleet-cli events --follow";

/// New events are asked for this often.
const LOOK_EVERY: Duration = Duration::from_millis(500);
/// Events without `--since` and `--limit`.
const USUAL: usize = 50;
/// And with `--since`.
const MOST: usize = 100_000;

/// Arguments of `events`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP)]
pub struct EventsArgs {
    /// Only from then on: a time such as 2026-11-24T08:00:00Z, or how long ago, such as 24h.
    #[arg(long, value_name = "TIME", value_parser = moment)]
    pub since: Option<SystemTime>,
    /// Only of this robot.
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Option<Name>,
    /// Only of this kind; repeat it for several.
    #[arg(long = "kind", value_name = "KIND", value_parser = history_kind())]
    pub kinds: Vec<HistoryKind>,
    /// Only with this in their words, upper or lower case.
    #[arg(long, value_name = "TEXT")]
    pub search: Option<String>,
    /// At most so many, the newest [default: 50; with --since 100000].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub limit: Option<u32>,
    /// Then each new one, until Ctrl-C.
    #[arg(long)]
    pub follow: bool,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<HistoryEvent>];

/// Prints them, and then new ones if asked for.
///
/// # Errors
/// No router, no dispatcher, or one without a history.
pub async fn run(ctx: &Context, args: &EventsArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let told = async {
        let events = last(&client, args).await?;
        if events.is_empty() && !args.follow && !ctx.out.json {
            ctx.out.text("no events")?;
        }
        say(ctx, &events)?;
        if args.follow {
            // Before any event 0 is the last one.
            follow(ctx, &client, args, events.last().map_or(0, |event| event.id)).await?;
        }
        Ok(())
    };
    let told = tokio::select! {
        told = told => told.map(|()| Exit::Done),
        () = interrupted() => Ok(if args.follow { Exit::Done } else { Exit::Interrupted }),
    };
    client.close().await;
    told
}

fn say(ctx: &Context, events: &[HistoryEvent]) -> Result<()> {
    events.iter().try_for_each(|event| ctx.out.result(event, line))
}

fn line(event: &HistoryEvent) -> String {
    let at = UNIX_EPOCH + Duration::from_millis(event.at_ms);
    format!("{}  {:8}  {}", humantime::format_rfc3339_seconds(at), event.kind.as_str(), event.text)
}

async fn page(
    client: &Client,
    args: &EventsArgs,
    place: HistoryPlace,
    limit: usize,
) -> Result<(Vec<HistoryEvent>, bool)> {
    let since = args.since.map(|since| since.duration_since(UNIX_EPOCH).unwrap_or_default());
    let request = HistoryRequest::Events {
        place,
        limit: u32::try_from(limit).unwrap_or(u32::MAX).min(MAX_HISTORY_PAGE),
        since_ms: since.map(|since| u64::try_from(since.as_millis()).unwrap_or(u64::MAX)),
        robot: args.robot.clone(),
        kinds: args.kinds.clone(),
        search: args.search.clone(),
    };
    match DispatcherClient::of(client).history(&request).await? {
        HistoryReply::Events { events, more, .. } => Ok((events, more)),
        other => {
            Err(Error::new(ErrorKind::Failed, format!("not an answer to a question for events: {other:?}")))
        }
    }
}

/// The last ones, oldest first: page after page back from now.
async fn last(client: &Client, args: &EventsArgs) -> Result<Vec<HistoryEvent>> {
    let usual = if args.since.is_some() { MOST } else { USUAL };
    let wanted = args.limit.map_or(usual, |limit| limit as usize);
    let (mut pages, mut count, mut place) = (Vec::new(), 0, HistoryPlace::Newest);
    loop {
        let (events, more) = page(client, args, place, wanted - count).await?;
        count += events.len();
        let first = events.first().map(|event| event.id);
        pages.push(events);
        match first.filter(|_| more && count < wanted) {
            Some(first) => place = HistoryPlace::Before(first),
            None => return Ok(pages.into_iter().rev().flatten().collect()),
        }
    }
}

async fn follow(ctx: &Context, client: &Client, args: &EventsArgs, mut last: u64) -> Result<()> {
    let mut look = tokio::time::interval(LOOK_EVERY);
    loop {
        look.tick().await;
        let events = match page(client, args, HistoryPlace::After(last), MAX_HISTORY_PAGE as usize).await {
            Ok((events, _)) => events,
            // One that is away may come back.
            Err(error) if matches!(error.kind, ErrorKind::NoDispatcher | ErrorKind::OutcomeUnknown) => {
                continue;
            }
            Err(error) => return Err(error),
        };
        say(ctx, &events)?;
        last = events.last().map_or(last, |event| event.id);
    }
}
