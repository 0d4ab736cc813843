//! `dispatch status`: how the dispatcher stands, without its tasks.

use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::or_interrupted;
use crate::output::{Output, Tone};
use crate::text::task as task_text;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::fleet_stop;
use xtb_client::dispatcher_client::{DispatcherClient, Status};
use xtb_services::dispatch::store::wall_ms;

/// Asks once and prints it.
///
/// # Errors
/// No router, or no dispatcher.
pub(super) async fn run(ctx: &Context) -> Result<Exit> {
    or_interrupted(status(ctx)).await
}

async fn status(ctx: &Context) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let status = DispatcherClient::of(&client).status().await;
    client.close().await;
    ctx.out.result(&status?, |status| text(status, wall_ms(), &ctx.out))?;
    Ok(Exit::Done)
}

fn text(status: &Status, now_ms: u64, out: &Output) -> String {
    let Status { dispatcher: of, suspended } = status;
    let stopped = fleet_stop(suspended);
    let state =
        if stopped.is_some() { out.paint(Tone::Bad, "SUSPENDED") } else { out.paint(Tone::Good, "active") };
    let map = of.map.as_deref().unwrap_or("none");
    let mut lines = vec![
        format!("state    {state}"),
        format!("map      {map}"),
        format!("tasks    {} open, {} of them on robots; {} stored", of.open, of.assigned, of.tasks),
        format!("robots   {} online", of.robots),
        format!("ledger   number {}", of.ledger),
    ];
    if let Some(why) = &of.ledger_failed {
        lines.push(out.paint(Tone::Bad, &format!("the ledger cannot be written: {why}")));
    }
    lines.extend(task_text::suspended(suspended, Some(now_ms), out));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;
    use xtb_protocol::messages::{DispatchStatus, Suspension, SuspensionCause};

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
        let said = text(&Status { dispatcher: dispatcher.clone(), suspended }, 41_000, &out);
        assert!(said.starts_with("state    SUSPENDED\nmap      lab\n"), "{said}");
        assert!(
            said.contains("emergency stop of all robots by cli-1; 3 open tasks wait, for 40 s"),
            "{said}"
        );
        assert!(said.contains("`fleet-cli dispatch activate`"), "{said}");
        let said = text(&Status { dispatcher, suspended: Vec::new() }, 0, &out);
        assert!(said.starts_with("state    active") && !said.contains("SUSPENDED"), "{said}");
    }
}
