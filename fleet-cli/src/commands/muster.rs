//! What `stop` and `estop` share: each robot is asked at once and must say and show so itself, and whose answers
//! are missing is said by name.

use crate::client::Client;
use crate::context::Context;
use crate::error::{Exit, Failure, Result};
use crate::output::{Output, Tone};
use crate::table::{Cell, Table};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use tokio::task::JoinSet;
use xtb_protocol::Name;

/// What came of it for one robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Outcome {
    /// It said so, and its own state shows it.
    Stopped,
    /// It said that it would not.
    Refused,
    /// It did not answer, or had no room for the request: it may be driving.
    Unknown,
    /// It answered, and no state of its own shows it: it may be driving.
    Unconfirmed,
    /// Somebody answered, and no robot of this name is there.
    Absent,
    /// More than one program answers for it: nobody knows which one is the robot.
    Ambiguous,
}

/// What came of it for all.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// By name.
    pub(super) robots: BTreeMap<Name, Outcome>,
    /// Whether every robot that should be there has stopped. Never true when nobody knows which.
    pub(super) complete: bool,
    /// Who was named and is unknown to roster and fleet, with who was probably meant.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) unknown_robots: BTreeMap<Name, Option<Name>>,
}

impl Report {
    /// Complete if all have stopped and none was left out.
    pub(super) fn new(robots: BTreeMap<Name, Outcome>, gaps: &Gaps) -> Self {
        let report = Self { robots, complete: false, unknown_robots: BTreeMap::new() };
        Self { complete: report.all_stopped() && gaps.none(), ..report }
    }

    /// Whether all who were asked have stopped.
    pub(super) fn all_stopped(&self) -> bool {
        self.robots.values().all(|outcome| *outcome == Outcome::Stopped)
    }

    /// 0 only if it is complete.
    pub(super) fn exit(&self) -> Exit {
        let refused = self.robots.values().any(|outcome| *outcome == Outcome::Refused);
        match self.complete {
            true => Exit::Done,
            false if refused => Exit::Failed,
            false => Exit::Unknown,
        }
    }

    /// A row for each robot; `stopped` is what that is called.
    pub(super) fn table(&self, stopped: &str, out: &Output) -> String {
        let mut table = Table::new(&["name", "outcome"]);
        for (robot, outcome) in &self.robots {
            let outcome = match outcome {
                Outcome::Stopped => Cell::new(stopped, Tone::Good),
                Outcome::Refused => Cell::new("refused", Tone::Bad),
                Outcome::Unknown => Cell::new("unknown (no answer: it may be driving)", Tone::Bad),
                Outcome::Unconfirmed => {
                    Cell::new("not confirmed (answered, but its state does not show it)", Tone::Bad)
                }
                Outcome::Absent => Cell::new(
                    "not confirmed (answered, but no such robot is there: `fleet-cli doctor`)",
                    Tone::Bad,
                ),
                Outcome::Ambiguous => {
                    Cell::new("not confirmed (several programs answer for it: `fleet-cli doctor`)", Tone::Bad)
                }
            };
            table.row(vec![Cell::new(robot.as_str(), Tone::Strong), outcome]);
        }
        table.render(out)
    }
}

/// Why nobody can say whether the robots asked were all.
#[derive(Debug, Default)]
pub(super) struct Gaps {
    /// Nobody knows which there should be.
    pub(super) no_roster: bool,
    /// Asking for the roster failed.
    pub(super) roster: Option<Failure>,
    /// Asking who is there failed.
    pub(super) alive: Option<Failure>,
}

impl Gaps {
    fn of(alive: Option<Failure>, roster: Result<Option<BTreeSet<Name>>>) -> Self {
        match roster {
            Ok(roster) => Self { no_roster: roster.is_none(), roster: None, alive },
            Err(failure) => Self { no_roster: false, roster: Some(failure), alive },
        }
    }

    pub(super) fn none(&self) -> bool {
        !self.no_roster && self.roster.is_none() && self.alive.is_none()
    }

    /// Says them.
    pub(super) fn warn(&self, ctx: &Context) {
        if ctx.out.json || self.none() {
            return;
        }
        for failure in [&self.alive, &self.roster].into_iter().flatten() {
            ctx.out.note(&format!("warning: there may be more robots: {failure}"));
        }
        if self.alive.is_none() {
            ctx.out.note("warning: without a roster nobody can say whether these were all robots");
        }
        ctx.out.note("hint: name them with --expect a,b,c or as [[robots]] in the fleet config");
    }
}

/// Questions on their way; each robot is asked by a task of its own, once.
pub(super) struct Muster<Ask> {
    client: Client,
    ask: Ask,
    asking: JoinSet<(Name, Outcome)>,
    outcomes: BTreeMap<Name, Outcome>,
}

impl<Ask, Asking> Muster<Ask>
where
    Ask: Fn(Client, Name) -> Asking,
    Asking: Future<Output = Outcome> + Send + 'static,
{
    /// Nobody asked yet; `ask` asks one robot.
    pub(super) fn new(client: &Client, ask: Ask) -> Self {
        Self { client: client.clone(), ask, asking: JoinSet::new(), outcomes: BTreeMap::new() }
    }

    /// Asks these, unless they have been asked.
    pub(super) fn call(&mut self, robots: impl IntoIterator<Item = Name>) {
        for robot in robots {
            // Whatever goes wrong, an answer that did not come is not a standstill.
            if self.outcomes.insert(robot.clone(), Outcome::Unknown).is_none() {
                let asking = (self.ask)(self.client.clone(), robot.clone());
                self.asking.spawn(async move { (robot, asking.await) });
            }
        }
    }

    /// Asks everybody as soon as they are heard of. Who is known without asking comes first; neither
    /// question waits for the other, and none of them, slow or failed, keeps the others from being
    /// asked.
    pub(super) async fn call_all(&mut self, expect: &[Name]) -> Gaps {
        let client = self.client.clone();
        self.call(client.told_roster(expect));
        let (mut alive, mut roster) = (pin!(client.alive()), pin!(client.roster(expect)));
        let (mut there, mut should) = (None, None);
        loop {
            tokio::select! {
                found = &mut alive, if there.is_none() => {
                    self.call(found.iter().flatten().cloned());
                    there = Some(found.err());
                }
                found = &mut roster, if should.is_none() => {
                    self.call(found.iter().flatten().flatten().cloned());
                    should = Some(found);
                }
                else => return Gaps::of(there.flatten(), should.unwrap_or(Ok(None))),
            }
        }
    }

    /// What came of each, once all are answered or given up.
    pub(super) async fn outcomes(mut self) -> BTreeMap<Name, Outcome> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Kind;

    fn failure() -> Failure {
        Failure::new(Kind::Failed, "get on xtb/lab/sim/roster: no")
    }

    fn exit(outcomes: &[Outcome], gaps: &Gaps) -> Exit {
        let named = outcomes.iter().enumerate();
        let robots = named.map(|(i, outcome)| (Name::new(&format!("xtb-{i}")).unwrap(), *outcome));
        Report::new(robots.collect(), gaps).exit()
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
        let (none, gap) = (Gaps::default(), Gaps { no_roster: true, ..Gaps::default() });
        assert_eq!(exit(&[Outcome::Stopped], &none), Exit::Done);
        assert_eq!(exit(&[Outcome::Stopped], &gap), Exit::Unknown);
        assert_eq!(exit(&[Outcome::Stopped, Outcome::Unknown], &none), Exit::Unknown);
        for doubtful in [Outcome::Unconfirmed, Outcome::Absent, Outcome::Ambiguous] {
            assert_eq!(exit(&[Outcome::Stopped, doubtful], &none), Exit::Unknown);
        }
        assert_eq!(exit(&[Outcome::Unknown, Outcome::Refused], &gap), Exit::Failed);
    }
}
