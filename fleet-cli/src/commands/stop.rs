//! `stop`: robots drop their goals and stand; each is asked at once and must say so itself.

use crate::cli::StopArgs;
use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Kind, Result};
use crate::output::{Output, Tone};
use crate::table::{Cell, Table};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
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
    /// It did not answer, or had no room for the request: it may be driving.
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
    let mut stops = Stops::new(&client);
    let gaps = if args.all {
        stop_all(&client, &mut stops, &args.expect).await
    } else {
        stops.ask(args.robots.iter().cloned());
        Gaps::default()
    };
    let robots = stops.outcomes().await;
    if robots.is_empty() {
        return Err(gaps.alive.unwrap_or_else(|| client.nobody()));
    }
    let all_stopped = robots.values().all(|outcome| *outcome == Outcome::Stopped);
    let report = Report { robots, complete: all_stopped && gaps.none() };
    ctx.out.result(&report, |report| table(report, &ctx.out))?;
    warn(ctx, &gaps);
    client.close().await;
    Ok(exit(&report))
}

fn exit(report: &Report) -> Exit {
    let refused = report.robots.values().any(|outcome| *outcome == Outcome::Refused);
    match report.complete {
        true => Exit::Done,
        false if refused => Exit::Failed,
        false => Exit::Unknown,
    }
}

/// Why nobody can say whether the robots asked were all.
#[derive(Debug, Default)]
struct Gaps {
    /// Nobody knows which there should be.
    no_roster: bool,
    /// Asking for the roster failed.
    roster: Option<Failure>,
    /// Asking who is there failed.
    alive: Option<Failure>,
}

impl Gaps {
    fn of(alive: Option<Failure>, roster: Result<Option<BTreeSet<Name>>>) -> Self {
        match roster {
            Ok(roster) => Self { no_roster: roster.is_none(), roster: None, alive },
            Err(failure) => Self { no_roster: false, roster: Some(failure), alive },
        }
    }

    fn none(&self) -> bool {
        !self.no_roster && self.roster.is_none() && self.alive.is_none()
    }
}

/// Stops everybody as soon as they are heard of. Who is known without asking comes first; neither
/// question waits for the other, and none of them, slow or failed, keeps the others from being
/// stopped.
async fn stop_all(client: &Client, stops: &mut Stops, expect: &[Name]) -> Gaps {
    stops.ask(client.told_roster(expect));
    let (mut alive, mut roster) = (pin!(client.alive()), pin!(client.roster(expect)));
    let (mut there, mut should) = (None, None);
    loop {
        tokio::select! {
            found = &mut alive, if there.is_none() => {
                stops.ask(found.iter().flatten().cloned());
                there = Some(found.err());
            }
            found = &mut roster, if should.is_none() => {
                stops.ask(found.iter().flatten().flatten().cloned());
                should = Some(found);
            }
            else => return Gaps::of(there.flatten(), should.unwrap_or(Ok(None))),
        }
    }
}

/// Stops on their way; each robot is asked by a task of its own, once.
struct Stops {
    client: Client,
    asking: JoinSet<(Name, Outcome)>,
    outcomes: BTreeMap<Name, Outcome>,
}

impl Stops {
    fn new(client: &Client) -> Self {
        Self { client: client.clone(), asking: JoinSet::new(), outcomes: BTreeMap::new() }
    }

    fn ask(&mut self, robots: impl IntoIterator<Item = Name>) {
        for robot in robots {
            // Whatever goes wrong, an answer that did not come is not a standstill.
            if self.outcomes.insert(robot.clone(), Outcome::Unknown).is_none() {
                self.asking.spawn(stop(self.client.clone(), robot));
            }
        }
    }

    /// What came of each, once all are answered or given up.
    async fn outcomes(mut self) -> BTreeMap<Name, Outcome> {
        while let Some(asked) = self.asking.join_next().await {
            match asked {
                Ok((robot, outcome)) => {
                    self.outcomes.insert(robot, outcome);
                }
                Err(error) => tracing::error!("asking a robot to stop: {error}"),
            }
        }
        self.outcomes
    }
}

async fn stop(client: Client, robot: Name) -> (Name, Outcome) {
    let outcome = match client.request(&robot, Body::Stop {}).await {
        Ok(_) => Outcome::Stopped,
        Err(Failure { kind: Kind::Refused(_), .. }) => Outcome::Refused,
        Err(failure) => {
            tracing::debug!("stopping {robot}: {failure}");
            Outcome::Unknown
        }
    };
    (robot, outcome)
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

fn warn(ctx: &Context, gaps: &Gaps) {
    if ctx.out.json || gaps.none() {
        return;
    }
    for failure in [&gaps.alive, &gaps.roster].into_iter().flatten() {
        ctx.out.note(&format!("warning: there may be more robots: {failure}"));
    }
    if gaps.alive.is_none() {
        ctx.out.note("warning: without a roster nobody can say whether these were all robots");
    }
    ctx.out.note("hint: name them with --expect a,b,c or as [[robots]] in the fleet config");
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use tokio::sync::mpsc;
    use xtb_bus::{Question, Service};
    use xtb_protocol::codec::Format;
    use xtb_protocol::messages::{Done, Reply, Request, Roster};

    /// Passes the questions on `key_expr` on.
    async fn questions(client: &Client, key_expr: &str) -> (Service, mpsc::UnboundedReceiver<Question>) {
        let (sender, receiver) = mpsc::unbounded_channel();
        let each = move |question| sender.send(question).unwrap_or_default();
        (client.bus().serve(key_expr, each).await.unwrap(), receiver)
    }

    fn failure() -> Failure {
        Failure::new(Kind::Failed, "get on xtb/lab/sim/roster: no")
    }

    fn report(outcomes: &[Outcome], complete: bool) -> Report {
        let named = outcomes.iter().enumerate();
        let robots = named.map(|(i, outcome)| (Name::new(&format!("xtb-{i}")).unwrap(), *outcome));
        Report { robots: robots.collect(), complete }
    }

    #[test]
    fn only_a_known_roster_and_presence_leave_no_gap() {
        assert!(Gaps::default().none());
        assert!(Gaps::of(None, Ok(Some(BTreeSet::new()))).none());
        assert!(!Gaps::of(None, Ok(None)).none());
        assert!(!Gaps::of(None, Err(failure())).none());
        assert!(!Gaps::of(Some(failure()), Ok(Some(BTreeSet::new()))).none());
    }

    #[test]
    fn a_gap_makes_it_unknown_and_a_refusal_failed() {
        assert_eq!(exit(&report(&[Outcome::Stopped], true)), Exit::Done);
        assert_eq!(exit(&report(&[Outcome::Stopped], false)), Exit::Unknown);
        assert_eq!(exit(&report(&[Outcome::Unknown, Outcome::Refused], false)), Exit::Failed);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_robot_that_is_there_is_stopped_before_the_roster_is_known() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = Name::new("xtb-1").unwrap();
        let keys = client.keys().robot(&robot);
        let (_commands, mut commands) = questions(&client, &keys.cmd(None)).await;
        let roster_key = client.keys().sim_roster();
        let (_rosters, mut rosters) = questions(&client, &roster_key).await;
        let _token = client.bus().declare_alive(&keys.alive()).await.unwrap();
        let own_key = keys.cmd(Some(client.name()));
        let world = tokio::spawn(async move {
            let stop = commands.recv().await.unwrap();
            let (request, format) = stop.decode::<Request>().unwrap();
            stop.reply(&own_key, &Reply::done(request.id, Done::default()), format).await.unwrap();
            drop(stop);
            // The roster comes only now.
            let question = rosters.recv().await.unwrap();
            question.reply(&roster_key, &Roster { robots: Vec::new() }, Format::Json).await.unwrap();
        });
        let mut stops = Stops::new(&client);
        let gaps = stop_all(&client, &mut stops, &[]).await;
        assert!(gaps.none(), "{gaps:?}");
        assert_eq!(stops.outcomes().await, BTreeMap::from([(robot, Outcome::Stopped)]));
        world.await.unwrap();
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_roster_that_does_not_answer_leaves_a_gap_and_stops_nobody_less() {
        let client = Client::alone(Duration::from_millis(300)).await;
        let robot = Name::new("xtb-1").unwrap();
        let keys = client.keys().robot(&robot);
        let (_rosters, _unanswered) = questions(&client, &client.keys().sim_roster()).await;
        let _token = client.bus().declare_alive(&keys.alive()).await.unwrap();
        let mut stops = Stops::new(&client);
        let gaps = stop_all(&client, &mut stops, &[]).await;
        assert!(gaps.no_roster && gaps.alive.is_none(), "{gaps:?}");
        assert!(stops.outcomes().await.contains_key(&robot));
    }
}
