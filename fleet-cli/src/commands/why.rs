//! `why`: the chain of reasons for which a robot stands, or for which it may drive.

mod chain;

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::robots::once_each;
use chain::{Verdict, Why};
use clap::Args;
use futures_util::future::join_all;
use std::collections::BTreeSet;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_client::fleet_view::{FleetView, RobotView, by_number};
use xtb_client::{Error, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{RobotState, StopReason, Suspension};

/// Arguments of `why`.
#[derive(Debug, Clone, Args)]
pub struct WhyArgs {
    /// Robots.
    #[arg(value_name = "ROBOT", value_parser = Name::robot, required = true)]
    pub robots: Vec<Name>,
}

const LABEL_WIDTH: usize = 8;

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Why>];

/// Asks once, and explains the answers. A robot that nobody can say anything about makes it
/// [`Exit::Unknown`].
///
/// # Errors
/// No router.
pub async fn run(ctx: &Context, args: &WhyArgs) -> Result<Exit> {
    let client = Client::open(&ctx.settings).await?;
    let mut robots = once_each(&args.robots);
    robots.sort_by_cached_key(by_number);
    let (asked, fleet) = (&client, &ctx.settings.fleet);
    let views = join_all(robots.iter().map(|robot| async move {
        let (wanted, keys) = (BTreeSet::from([robot.clone()]), asked.keys().robot(robot));
        let view = FleetView::ask_robots(asked, fleet, &keys, &wanted).await?;
        Ok::<_, Error>(view.only(std::slice::from_ref(robot)))
    }))
    .await;
    let suspended =
        DispatcherClient::of(&client).status().await.map(|status| status.suspended).unwrap_or_default();
    client.close().await;
    let mut exit = Exit::Done;
    for (i, view) in views.into_iter().enumerate() {
        let view = view?;
        let Some(why) = view.robots.first().map(chain::explain) else { return Ok(Exit::Unknown) };
        let why = why.beside(&suspended);
        if i > 0 && !ctx.out.json {
            ctx.out.text("")?;
        }
        ctx.out.result(&why, |why| text(why, &ctx.out))?;
        if why.verdict == Verdict::Unknown {
            exit = Exit::Unknown;
        }
    }
    Ok(exit)
}

/// Whether a reason to stand holds only as long as the latch of its name does.
pub(crate) fn only_latched(reason: StopReason) -> bool {
    chain::only_latched(reason)
}

/// Whether it drives, or rests only in passing while it is under way.
pub(crate) fn drives(state: &RobotState) -> bool {
    state.latches.is_empty() && state.stopped_because.iter().all(|&reason| chain::passes(reason))
}

/// Why, of a robot that is known already, without colours.
pub(crate) fn in_words(robot: &RobotView, suspended: &[Suspension]) -> String {
    text(&chain::explain(robot).beside(suspended), &Output { json: false, colors: false })
}

fn text(why: &Why, out: &Output) -> String {
    let tone = match why.verdict {
        Verdict::Drives => Tone::Good,
        Verdict::Stands => Tone::Strong,
        Verdict::Unknown => Tone::Bad,
    };
    let mut lines = vec![out.paint(tone, &why.headline)];
    for reason in &why.reasons {
        let label = out.paint(Tone::Dim, &format!("{:LABEL_WIDTH$}", reason.kind.label()));
        lines.push(format!("  {label} {}", out.paint(reason.tone(), &reason.text)));
        if let Some(hint) = &reason.hint {
            lines.push(format!("  {:LABEL_WIDTH$} {}", "", out.paint(Tone::Dim, &format!("→ {hint}"))));
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_protocol::messages::{Latch, StopReason};

    #[test]
    fn each_reason_is_a_line_and_what_to_do_the_next() {
        let state = RobotState {
            latches: vec![fake::latch(Latch::Estop, "cli-1", false)],
            stopped_because: vec![StopReason::Estop],
            stopped_age_ms: Some(12_000),
            ..fake::state("xtb-1")
        };
        let robot = RobotView {
            name: fake::name("xtb-1"),
            alias: None,
            alive: true,
            state: Some(state),
            age_ms: Some(30),
            tags: Vec::new(),
            start_pose: None,
        };
        let text = text(&chain::explain(&robot), &Output { json: false, colors: false });
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("xtb-1: stopped for 12.0 s (mode idle, state 30 ms old)"));
        assert_eq!(
            lines.next(),
            Some("  latch    emergency stop: estop latched by cli-1, 12.0 s ago; cause gone")
        );
        assert_eq!(
            lines.next(),
            Some(
                "           → `fleet-cli reset xtb-1 --latch estop`, then give a new command (a dispatcher needs none)"
            )
        );
    }
}
