//! `alerts`: what needs a person, and who has seen it.

use crate::commands::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{Verbs, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use crate::terminal::Terminal;
use clap::{Args, Subcommand};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::pin::pin;
use std::time::Duration;
use xtb_client::client::Client;
use xtb_client::text::robot as describe;
use xtb_client::{DispatcherClient, Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{AckBody, AckReply, AckRequest, Alert, AlertState, FleetAlerts};

const HELP: &str = "\
The dispatcher raises alerts by rules: a latched stop, a robot that is gone, a failed task, a low battery, a robot \
that makes no progress, a suspended dispatcher, a robot with another map. [alerts] of the fleet config has their \
thresholds, and a command or a web hook that is told of each. Exit code 0 means that the dispatcher has answered.

Examples:
  fleet-cli alerts --watch
  fleet-cli alerts ack 3 5
  fleet-cli alerts ack --all";

/// The list is asked for this often.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Arguments of `alerts`.
#[derive(Debug, Clone, Args)]
#[command(after_help = HELP, args_conflicts_with_subcommands = true)]
pub struct AlertsArgs {
    /// What to do.
    #[command(subcommand)]
    pub verb: Option<AlertsVerb>,
    /// Update continuously; q or Ctrl-C quits. Into a pipe: a line for each change.
    #[arg(long)]
    pub watch: bool,
    /// Show ended alerts too.
    #[arg(long)]
    pub all: bool,
    /// Only alerts of this robot.
    #[arg(long, value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Option<Name>,
}

/// What to do with alerts.
#[derive(Debug, Clone, Subcommand)]
pub enum AlertsVerb {
    /// Acknowledge alerts: you have seen them. Your name is shown beside them.
    Ack(AlertsAckArgs),
}

/// Arguments of `alerts ack`.
#[derive(Debug, Clone, Args)]
pub struct AlertsAckArgs {
    /// Numbers of alerts.
    #[arg(value_name = "ID", required_unless_present = "all", conflicts_with = "all")]
    pub ids: Vec<u64>,
    /// All that are open.
    #[arg(long)]
    pub all: bool,
}

/// An alert as `--json` has it.
#[derive(Debug, Serialize, JsonSchema)]
struct Told<'a> {
    #[serde(flatten)]
    alert: &'a Alert,
    state: AlertState,
}

/// What `--json` prints.
#[derive(Debug, Serialize, JsonSchema)]
struct Listed<'a> {
    at_ms: u64,
    alerts: Vec<Told<'a>>,
    left_out: u64,
}

fn told(alert: &Alert) -> Told<'_> {
    Told { alert, state: alert.state() }
}

/// What it prints with `--json`.
pub(super) const JSON: Verbs =
    &[("alerts", &[line_of::<Listed<'_>>, line_of::<Told<'_>>]), ("alerts ack", &[line_of::<AckReply>])];

/// Shows them once, or acknowledges some.
///
/// # Errors
/// No router, no dispatcher, or not allowed.
pub async fn run(ctx: &Context, args: &AlertsArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let done = match &args.verb {
        None => show(ctx, &client, args).await,
        Some(AlertsVerb::Ack(args)) => acknowledge(ctx, &client, args).await,
    };
    client.close().await;
    done
}

async fn show(ctx: &Context, client: &Client, args: &AlertsArgs) -> Result<Exit> {
    let list = DispatcherClient::of(client).alerts().await?;
    let alerts = wanted(&list, args).map(told).collect();
    let listed = Listed { at_ms: list.at_ms, alerts, left_out: list.left_out };
    ctx.out.result(&listed, |_| screen(&list, args, &ctx.out).join("\n"))?;
    Ok(Exit::Done)
}

fn wanted<'a>(list: &'a FleetAlerts, args: &AlertsArgs) -> impl Iterator<Item = &'a Alert> {
    let (all, robot) = (args.all, args.robot.clone());
    list.alerts.iter().filter(move |alert| {
        (all || alert.state() != AlertState::Ended) && (robot.is_none() || alert.robot == robot)
    })
}

fn screen(list: &FleetAlerts, args: &AlertsArgs, out: &Output) -> Vec<String> {
    let mut table = Table::new(&["id", "since", "state", "what", "what to do"]);
    let mut shown = 0;
    for alert in wanted(list, args) {
        shown += 1;
        let (state, tone) = standing(alert);
        let since = Duration::from_millis(list.at_ms.saturating_sub(alert.since_ms));
        table.row(vec![
            TableCell::new(alert.id.to_string(), Tone::Strong),
            TableCell::new(describe::age(since), Tone::Dim),
            TableCell::new(state, tone),
            TableCell::new(alert.text.as_str(), tone),
            TableCell::new(alert.remedy.as_str(), Tone::Plain),
        ]);
    }
    let mut lines: Vec<String> = Vec::new();
    match shown {
        0 => lines.push("no alerts".to_owned()),
        _ => lines.extend(table.render(out).trim_end().lines().map(str::to_owned)),
    }
    if list.left_out > 0 {
        lines.push(out.paint(Tone::Warning, &format!("{} more found no room in the list", list.left_out)));
    }
    lines
}

/// In words, and how good it is.
fn standing(alert: &Alert) -> (String, Tone) {
    let by = alert.acknowledged.as_ref().map(|ack| format!(" by {}", ack.who())).unwrap_or_default();
    match alert.state() {
        AlertState::Open => ("OPEN".to_owned(), Tone::Bad),
        AlertState::Acknowledged => (format!("acknowledged{by}"), Tone::Warning),
        AlertState::Ended if by.is_empty() => ("ended".to_owned(), Tone::Dim),
        AlertState::Ended => (format!("ended, acknowledged{by}"), Tone::Dim),
    }
}

async fn acknowledge(ctx: &Context, client: &Client, args: &AlertsAckArgs) -> Result<Exit> {
    let body = if args.all { AckBody::All {} } else { AckBody::Alerts { ids: args.ids.clone() } };
    let reply = dispatcher(client).acknowledge(&AckRequest { body, person: ctx.person() }).await?;
    ctx.out.result(&reply, |AckReply { acknowledged, before, .. }| {
        let more = if before.is_empty() { String::new() } else { format!("; {} before", before.len()) };
        format!("{} acknowledged{more}", acknowledged.len())
    })?;
    if reply.unknown.is_empty() {
        return Ok(Exit::Done);
    }
    let unknown: Vec<String> = reply.unknown.iter().map(u64::to_string).collect();
    let message = format!("no such alert: {}", unknown.join(", "));
    Err(Error::new(ErrorKind::Failed, message).hint("`fleet-cli alerts --all` shows all that are kept"))
}

/// Keeps showing them.
///
/// # Errors
/// No router, or no dispatcher at the start.
pub async fn watch(ctx: &Context, args: &AlertsArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let on_a_screen = std::io::stdout().is_terminal() && std::io::stdin().is_terminal();
    let exit = match ctx.out.json || !on_a_screen {
        true => follow(ctx, &client, args).await,
        false => repaint(ctx, &client, args).await,
    };
    client.close().await;
    exit
}

/// A line for each alert that is new or has changed.
async fn follow(ctx: &Context, client: &Client, args: &AlertsArgs) -> Result<Exit> {
    let mut stop = pin!(interrupted());
    let mut shown: BTreeMap<u64, AlertState> = BTreeMap::new();
    let (mut look, mut first) = (tokio::time::interval(LOOK_EVERY), true);
    loop {
        let list = tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            list = async { look.tick().await; DispatcherClient::of(client).alerts().await } => list,
        };
        let list = match list {
            Ok(list) => list,
            // One that is away may come back.
            Err(failure) if !first && is_away(&failure) => continue,
            Err(failure) => return Err(failure),
        };
        for alert in &list.alerts {
            let is_new = shown.insert(alert.id, alert.state()) != Some(alert.state());
            let asked = args.robot.is_none() || alert.robot == args.robot;
            let old = first && alert.state() == AlertState::Ended && !args.all;
            if is_new && asked && !old {
                ctx.out.result(&told(alert), |_| {
                    format!("{} {}: {}", alert.id, standing(alert).0, alert.text)
                })?;
            }
        }
        shown.retain(|id, _| list.alerts.iter().any(|alert| alert.id == *id));
        first = false;
    }
}

fn is_away(failure: &Error) -> bool {
    matches!(failure.kind, ErrorKind::NoDispatcher | ErrorKind::OutcomeUnknown)
}

async fn repaint(ctx: &Context, client: &Client, args: &AlertsArgs) -> Result<Exit> {
    let mut list = DispatcherClient::of(client).alerts().await?;
    let mut terminal = Terminal::open()?;
    let mut stop = pin!(interrupted());
    let mut trouble: Option<String> = None;
    loop {
        let title = format!("alerts of fleet {} · q quits", ctx.settings.fleet);
        let mut lines = vec![ctx.out.paint(Tone::Dim, &title), String::new()];
        lines.extend(trouble.as_ref().map(|trouble| ctx.out.paint(Tone::Bad, &format!("STALE: {trouble}"))));
        lines.extend(screen(&list, args, &ctx.out));
        terminal.paint(&lines)?;
        let coming = async {
            tokio::time::sleep(LOOK_EVERY).await;
            DispatcherClient::of(client).alerts().await
        };
        let came = tokio::select! {
            () = &mut stop => return Ok(Exit::Done),
            () = terminal.left() => return Ok(Exit::Done),
            came = coming => came,
        };
        match came {
            Ok(newer) => (list, trouble) = (newer, None),
            Err(failure) if is_away(&failure) => trouble = Some(failure.message),
            Err(failure) => return Err(failure),
        }
    }
}
