//! What `stop` and `estop` print: who has stopped, who has not said so, and whether these were all.

use super::unknown_robots;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use xtb_client::client::Client;
use xtb_client::fleet_view::by_number;
use xtb_client::multi_robot::{MissingInfo, StopOutcome, StopReport, Targets};
use xtb_client::{Error, Result};
use xtb_protocol::Name;

/// What came of it for all.
#[derive(Debug, Serialize, JsonSchema)]
struct Report {
    #[serde(flatten)]
    stopped: StopReport,
    /// Who was named and is unknown to roster and fleet, with who was probably meant.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    unknown_robots: BTreeMap<Name, Option<Name>>,
}

impl Report {
    /// 0 only if it is complete.
    fn exit(&self) -> Exit {
        let refused = self.stopped.robots.values().any(|outcome| *outcome == StopOutcome::Refused);
        match self.stopped.complete {
            true => Exit::Done,
            false if refused => Exit::Failed,
            false => Exit::Unknown,
        }
    }

    /// A row for each robot; `stopped` is what that is called.
    fn table(&self, stopped: &str, out: &Output) -> String {
        let mut table = Table::new(&["name", "outcome"]);
        let mut robots: Vec<_> = self.stopped.robots.iter().collect();
        robots.sort_by_key(|(robot, _)| by_number(robot));
        for (robot, outcome) in robots {
            let outcome = match outcome {
                StopOutcome::Stopped => TableCell::new(stopped, Tone::Good),
                StopOutcome::Refused => TableCell::new("refused", Tone::Bad),
                StopOutcome::Unknown => TableCell::new("unknown (no answer: it may be driving)", Tone::Bad),
                StopOutcome::Unconfirmed => {
                    TableCell::new("not confirmed (answered, but its state does not show it)", Tone::Bad)
                }
                StopOutcome::Absent => TableCell::new(
                    "not confirmed (answered, but no such robot is present: `fleet-cli doctor`)",
                    Tone::Bad,
                ),
                StopOutcome::Ambiguous => TableCell::new(
                    "not confirmed (several programs answer for it: `fleet-cli doctor`)",
                    Tone::Bad,
                ),
            };
            table.row(vec![TableCell::new(robot.as_str(), Tone::Strong), outcome]);
        }
        table.render(out)
    }
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report>];

/// Waits for what `calling` brings, shows it, and says how the command ends; `stopped` is what that is called.
/// Whom it is for comes with the tag that nobody has.
///
/// # Errors
/// Nobody to stop.
pub(super) async fn shown(
    ctx: &Context,
    client: &Client,
    (targets, unknown): (&Targets, Option<Error>),
    calling: impl Future<Output = (StopReport, MissingInfo)>,
    stopped: &str,
) -> Result<Exit> {
    let named = match targets {
        Targets::Robots(named) => named.as_slice(),
        Targets::All { .. } => &[],
    };
    let beside = unknown_robots::reported_beside(calling, ctx, client, named, "sent a stop");
    let ((found, missing), unknown_robots) = beside.await;
    if found.robots.is_empty() {
        return Err(missing.alive.unwrap_or_else(|| client.nobody()));
    }
    if found.robots.values().all(|outcome| *outcome == StopOutcome::Unknown)
        && let Some(error) = client.not_admitted().await
    {
        return Err(error);
    }
    let report = Report { stopped: found, unknown_robots };
    ctx.out.result(&report, |report| report.table(stopped, &ctx.out))?;
    warn(ctx, &missing);
    if let Some(error) = &unknown {
        ctx.out.failure(error);
    }
    Ok(unknown.map_or(report.exit(), |error| report.exit().worse(error.kind.into())))
}

/// Says why nobody can tell whether these were all robots.
fn warn(ctx: &Context, missing: &MissingInfo) {
    if ctx.out.json || missing.none() {
        return;
    }
    for error in [&missing.alive, &missing.roster].into_iter().flatten() {
        ctx.out.note(&format!("warning: there may be more robots: {error}"));
    }
    if missing.alive.is_none() {
        ctx.out.note("warning: without a roster it is unknown whether these are all robots");
    }
    ctx.out.note("hint: list them with --expect a,b,c or as [[robots]] in the fleet config");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exit(outcomes: &[StopOutcome], missing: &MissingInfo) -> Exit {
        let named = outcomes.iter().enumerate();
        let robots = named.map(|(i, outcome)| (Name::new(&format!("xtb-{i}")).unwrap(), *outcome));
        let stopped = StopReport::new(robots.collect(), missing);
        Report { stopped, unknown_robots: BTreeMap::new() }.exit()
    }

    #[test]
    fn a_gap_makes_it_unknown_and_a_refusal_failed() {
        let (none, gap) = (MissingInfo::default(), MissingInfo { no_roster: true, ..MissingInfo::default() });
        assert_eq!(exit(&[StopOutcome::Stopped], &none), Exit::Done);
        assert_eq!((exit(&[StopOutcome::Stopped], &gap), exit(&[], &none)), (Exit::Unknown, Exit::Unknown));
        assert_eq!(exit(&[StopOutcome::Stopped, StopOutcome::Unknown], &none), Exit::Unknown);
        for doubtful in [StopOutcome::Unconfirmed, StopOutcome::Absent, StopOutcome::Ambiguous] {
            assert_eq!(exit(&[StopOutcome::Stopped, doubtful], &none), Exit::Unknown);
        }
        assert_eq!(exit(&[StopOutcome::Unknown, StopOutcome::Refused], &gap), Exit::Failed);
    }
}
