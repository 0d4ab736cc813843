//! `stop`: robots drop their goals and stand; each is asked at once and must say so itself.

use crate::cli::StopArgs;
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::output::{Output, Tone};
use crate::table::{Cell, Table};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use tokio::task::JoinSet;
use xtb_protocol::Name;
use xtb_protocol::messages::Body;

/// What came of it for one robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Outcome {
    /// It said so.
    Stopped,
    /// It said that it would not.
    Refused,
    /// It did not answer: it may be driving.
    Unknown,
}

#[derive(Debug, Serialize)]
struct Report {
    robots: BTreeMap<Name, Outcome>,
    /// Whether every robot that should be there has stopped. Never true when nobody knows which.
    complete: bool,
}

/// Stops the robots named, or all of the roster and whoever else is there.
///
/// # Errors
/// No router, or nobody to stop.
pub async fn run(ctx: &Context, args: &StopArgs) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let (robots, roster_known) = targets(&client, args).await?;
    if robots.is_empty() {
        return Err(client.nobody());
    }
    let robots = stop_each(&client, robots).await;
    let all_stopped = robots.values().all(|outcome| *outcome == Outcome::Stopped);
    let report = Report { robots, complete: all_stopped && roster_known };
    ctx.out.result(&report, |report| table(report, &ctx.out))?;
    if !roster_known {
        warn_without_roster(ctx);
    }
    client.close().await;
    let refused = report.robots.values().any(|outcome| *outcome == Outcome::Refused);
    Ok(match report.complete {
        true => Exit::Done,
        false if refused => Exit::Failed,
        false => Exit::Unknown,
    })
}

/// Whom to stop, and whether these are all that should be there.
async fn targets(client: &Client, args: &StopArgs) -> Result<(BTreeSet<Name>, bool)> {
    if !args.all {
        return Ok((args.robots.iter().cloned().collect(), true));
    }
    let (roster, alive) = tokio::join!(client.roster(&args.expect), client.alive());
    let roster = roster?;
    let known = roster.is_some();
    let mut robots = alive?;
    robots.extend(roster.into_iter().flatten());
    Ok((robots, known))
}

async fn stop_each(client: &Client, robots: BTreeSet<Name>) -> BTreeMap<Name, Outcome> {
    // Whatever goes wrong, an answer that did not come is not a standstill.
    let mut outcomes: BTreeMap<Name, Outcome> =
        robots.iter().map(|robot| (robot.clone(), Outcome::Unknown)).collect();
    let mut asking = JoinSet::new();
    for robot in robots {
        let client = client.clone();
        asking.spawn(async move {
            let outcome = match client.request(&robot, Body::Stop {}).await {
                Ok(_) => Outcome::Stopped,
                Err(Failure { kind: Kind::Refused(_), .. }) => Outcome::Refused,
                Err(failure) => {
                    tracing::debug!("stopping {robot}: {failure}");
                    Outcome::Unknown
                }
            };
            (robot, outcome)
        });
    }
    while let Some(asked) = asking.join_next().await {
        match asked {
            Ok((robot, outcome)) => {
                outcomes.insert(robot, outcome);
            }
            Err(error) => tracing::error!("asking a robot to stop: {error}"),
        }
    }
    outcomes
}

fn table(report: &Report, out: &Output) -> String {
    let mut table = Table::new(&["name", "outcome"]);
    for (robot, outcome) in &report.robots {
        let outcome = match outcome {
            Outcome::Stopped => Cell::new("stopped", Tone::Good),
            Outcome::Refused => Cell::new("refused", Tone::Bad),
            Outcome::Unknown => Cell::new("unknown (no answer: it may be driving)", Tone::Bad),
        };
        table.row(vec![Cell::new(robot.as_str(), Tone::Strong), outcome]);
    }
    table.render(out)
}

fn warn_without_roster(ctx: &Context) {
    if !ctx.out.json {
        ctx.out.note("warning: without a roster nobody can say whether these were all robots");
        ctx.out.note("hint: name them with --expect a,b,c or as [[robots]] in the fleet config");
    }
}
