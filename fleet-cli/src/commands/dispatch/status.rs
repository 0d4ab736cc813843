//! `dispatch status`: how the dispatcher stands, without its tasks.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::output::{Output, Tone};
use crate::text::task as task_text;
use serde::Serialize;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::fleet_stop;
use xtb_client::dispatcher_client::{DispatcherClient, Status};
use xtb_client::text::robot::fixed;
use xtb_protocol::messages::{FleetHomes, HomeStatus, RobotHome, StandbyReply, StandbyView};
use xtb_services::dispatch::store::wall_ms;

/// How it stands, and how with its stand-by.
#[derive(Debug, Serialize)]
struct Shown {
    #[serde(flatten)]
    status: Status,
    /// In which term it assigns; `None` = it is older than terms.
    term: Option<u32>,
    standby: Option<Standby>,
    /// Which robots are at a dock or on the way to one; `None` = it is older than docks.
    homes: Option<FleetHomes>,
}

/// Its stand-by.
#[derive(Debug, Serialize)]
struct Standby {
    #[serde(flatten)]
    view: StandbyView,
    /// Records that only the dispatcher has.
    behind: u64,
}

impl Shown {
    fn of(status: Status, reply: Option<StandbyReply>, homes: Option<FleetHomes>) -> Self {
        let term = reply.as_ref().map(|reply| reply.term);
        let standby = reply.and_then(|reply| {
            let view = reply.standby?;
            Some(Standby { behind: reply.last.saturating_sub(view.last), view })
        });
        Self { status, term, standby, homes }
    }
}

/// Asks once and prints it.
///
/// # Errors
/// No router, or no dispatcher.
pub(super) async fn run(ctx: &Context) -> Result<Exit> {
    or_interrupted(status(ctx)).await
}

async fn status(ctx: &Context) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let dispatcher = DispatcherClient::of(&client);
    let shown = match dispatcher.status().await {
        Ok(status) => {
            let (standby, homes) = tokio::join!(dispatcher.standby(), dispatcher.homes());
            standby.and_then(|standby| Ok(Shown::of(status, standby, homes?)))
        }
        Err(error) => Err(error),
    };
    client.close().await;
    ctx.out.result(&shown?, |shown| text(shown, wall_ms(), &ctx.out))?;
    Ok(Exit::Done)
}

fn text(shown: &Shown, now_ms: u64, out: &Output) -> String {
    let Shown { status: Status { dispatcher: of, suspended }, term, standby, homes } = shown;
    let stopped = fleet_stop(suspended);
    let state =
        if stopped.is_some() { out.paint(Tone::Bad, "SUSPENDED") } else { out.paint(Tone::Good, "active") };
    let map = of.map.as_deref().unwrap_or("none");
    let mut lines = vec![
        format!("state    {state}"),
        format!("map      {map}"),
        format!("tasks    {} open, {} of them on robots; {} stored", of.open, of.assigned, of.tasks),
        format!("robots   {} online", of.robots),
        format!(
            "ledger   number {}{}",
            of.ledger,
            term.map(|term| format!(", term {term}")).unwrap_or_default()
        ),
        format!(
            "stand-by {}",
            standby.as_ref().map_or("none".to_owned(), |standby| of_standby(standby, out))
        ),
    ];
    if let Some(why) = &of.ledger_failed {
        lines.push(out.paint(Tone::Bad, &format!("the ledger cannot be written: {why}")));
    }
    lines.extend(homes.iter().flat_map(|homes| of_homes(homes, out)));
    lines.extend(task_text::suspended(suspended, Some(now_ms), out));
    lines.join("\n")
}

/// A line for each robot that is at a dock or parking place, or has to go to one.
fn of_homes(homes: &FleetHomes, out: &Output) -> Vec<String> {
    let line = |home: &RobotHome| {
        let place = home.place.as_ref().map(|place| format!(" {place}")).unwrap_or_default();
        let volts = home.battery_v.map(|volts| format!(", {} V", fixed(volts, 2))).unwrap_or_default();
        let task = home.task.map(|task| format!(", {task}")).unwrap_or_default();
        let why = if home.why.is_empty() { String::new() } else { format!(": {}", home.why) };
        let (tone, what) = match home.status {
            HomeStatus::OnTheWay => (Tone::Plain, "on the way to"),
            HomeStatus::Charging => (Tone::Good, "charging at"),
            HomeStatus::Charged => (Tone::Good, "charged at"),
            HomeStatus::NotCharging => (Tone::Bad, "NOT CHARGING at"),
            HomeStatus::Parked => (Tone::Plain, "parked at"),
            HomeStatus::AfterTask => (Tone::Plain, "goes to a dock after its task"),
            HomeStatus::WaitsForDock => (Tone::Warning, "waits for a dock"),
            HomeStatus::NeedsHelp => (Tone::Bad, "NEEDS HELP to get to a dock"),
        };
        format!("         {} {}{volts}{task}{why}", home.robot, out.paint(tone, &format!("{what}{place}")))
    };
    match homes.active {
        false => Vec::new(),
        true if homes.robots.is_empty() => {
            vec!["docks    no robot at a dock or on the way to one".to_owned()]
        }
        true => [format!("docks    {} robots", homes.robots.len())]
            .into_iter()
            .chain(homes.robots.iter().map(line))
            .collect(),
    }
}

fn of_standby(Standby { view, behind }: &Standby, out: &Output) -> String {
    let paired = if view.paired {
        out.paint(Tone::Good, "paired")
    } else {
        out.paint(Tone::Warning, "not paired: it cannot take over by itself")
    };
    let records = if *behind == 1 { "record" } else { "records" };
    format!("{paired}; {behind} {records} behind, heard {} ms ago", view.age_ms)
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;
    use xtb_protocol::messages::{Copied, DispatchStatus, Suspension, SuspensionCause};

    #[test]
    fn a_suspended_dispatcher_says_so_and_what_ends_it() {
        let dispatcher = DispatchStatus {
            ledger: 7,
            ledger_failed: None,
            map: Some("lab".into()),
            tasks: 9,
            open: 3,
            assigned: 0,
            robots: 2,
        };
        let cause = SuspensionCause::FleetStop { by: Some(name("cli-1")) };
        let suspended = vec![Suspension { cause, since_ms: 1000, tasks: 3 }];
        let out = Output { json: false, colors: false };
        let shown = |dispatcher, suspended, reply| Shown::of(Status { dispatcher, suspended }, reply, None);
        let said = text(&shown(dispatcher.clone(), suspended, None), 41_000, &out);
        assert!(said.contains("stand-by none"), "{said}");
        assert!(said.starts_with("state    SUSPENDED\nmap      lab\n"), "{said}");
        assert!(
            said.contains("emergency stop of all robots by cli-1; 3 open tasks wait, for 40 s"),
            "{said}"
        );
        assert!(said.contains("`fleet-cli dispatch activate`"), "{said}");
        let reply = StandbyReply {
            run: 1,
            ledger: 7,
            term: 2,
            last: 12,
            standby: Some(StandbyView { copy: 9, paired: true, last: 11, age_ms: 40 }),
            held: None,
            witnesses: None,
            copied: Copied::Records(Vec::new()),
        };
        let shown = shown(dispatcher, Vec::new(), Some(reply));
        let said = text(&shown, 0, &out);
        assert!(said.starts_with("state    active") && !said.contains("SUSPENDED"), "{said}");
        assert!(said.contains("number 7, term 2"), "{said}");
        assert!(said.contains("stand-by paired; 1 record behind, heard 40 ms ago"), "{said}");
        let json = serde_json::to_value(&shown).unwrap();
        assert_eq!(
            (&json["term"], &json["standby"]["behind"], &json["open"]),
            (&2.into(), &1.into(), &3.into())
        );
    }
}
