//! Several robots at once: each is asked by a task of its own, must say and show itself what it did, and whose
//! answers are missing is known by name.

use crate::client::Client;
use crate::error::{Error, Result};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use tokio::task::JoinSet;
use xtb_protocol::Name;

/// Whom to stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Targets {
    /// These.
    Robots(Vec<Name>),
    /// All of the roster and whoever else is there.
    All {
        /// The roster, if it is not empty.
        expect: Vec<Name>,
        /// Robots that were seen: asked at once, before anybody says who is there.
        known: Vec<Name>,
    },
}

impl Targets {
    /// One robot, or all without a roster; the `known` ones are asked at once.
    #[must_use]
    pub fn one_or_all(robot: Option<&Name>, known: &[Name]) -> Self {
        match robot {
            Some(robot) => Self::Robots(vec![robot.clone()]),
            None => Self::All { expect: Vec::new(), known: known.to_vec() },
        }
    }
}

/// What came of it for one robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StopOutcome {
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
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StopReport {
    /// By name.
    pub robots: BTreeMap<Name, StopOutcome>,
    /// Whether every robot that should be there has stopped. Never true when nobody knows which.
    pub complete: bool,
}

impl StopReport {
    /// Complete if all have stopped and none was left out.
    #[must_use]
    pub fn new(robots: BTreeMap<Name, StopOutcome>, gaps: &MissingInfo) -> Self {
        let report = Self { robots, complete: false };
        Self { complete: report.all_stopped() && gaps.none(), ..report }
    }

    /// Whether all who were asked have stopped.
    #[must_use]
    pub fn all_stopped(&self) -> bool {
        self.robots.values().all(|outcome| *outcome == StopOutcome::Stopped)
    }
}

/// Why nobody can say whether the robots asked were all.
#[derive(Debug, Clone, Default)]
pub struct MissingInfo {
    /// Nobody knows which there should be.
    pub no_roster: bool,
    /// Asking for the roster failed.
    pub roster: Option<Error>,
    /// Asking who is there failed.
    pub alive: Option<Error>,
}

impl MissingInfo {
    fn of(alive: Option<Error>, roster: Result<Option<BTreeSet<Name>>>) -> Self {
        match roster {
            Ok(roster) => Self { no_roster: roster.is_none(), roster: None, alive },
            Err(failure) => Self { no_roster: false, roster: Some(failure), alive },
        }
    }

    /// Whether nothing is missing.
    #[must_use]
    pub fn none(&self) -> bool {
        !self.no_roster && self.roster.is_none() && self.alive.is_none()
    }
}

/// Questions on their way to several robots; each robot is asked by a task of its own, once.
pub struct MultiRobot<Ask> {
    client: Client,
    ask: Ask,
    asking: JoinSet<(Name, StopOutcome)>,
    outcomes: BTreeMap<Name, StopOutcome>,
}

impl<Ask, Asking> MultiRobot<Ask>
where
    Ask: Fn(Client, Name) -> Asking,
    Asking: Future<Output = StopOutcome> + Send + 'static,
{
    /// Nobody asked yet; `ask` asks one robot.
    pub fn new(client: &Client, ask: Ask) -> Self {
        Self { client: client.clone(), ask, asking: JoinSet::new(), outcomes: BTreeMap::new() }
    }

    /// Asks these, unless they have been asked.
    pub fn call(&mut self, robots: impl IntoIterator<Item = Name>) {
        for robot in robots {
            // Whatever goes wrong, an answer that did not come is not a standstill.
            if self.outcomes.insert(robot.clone(), StopOutcome::Unknown).is_none() {
                let asking = (self.ask)(self.client.clone(), robot.clone());
                self.asking.spawn(async move { (robot, asking.await) });
            }
        }
    }

    /// Asks everybody as soon as they are heard of. Who is known without asking comes first; neither
    /// question waits for the other, and none of them, slow or failed, keeps the others from being
    /// asked.
    pub async fn call_all(&mut self, expect: &[Name]) -> MissingInfo {
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
                else => return MissingInfo::of(there.flatten(), should.unwrap_or(Ok(None))),
            }
        }
    }

    /// What came of each, once all are answered or given up.
    pub async fn outcomes(mut self) -> BTreeMap<Name, StopOutcome> {
        while let Some(asked) = self.asking.join_next().await {
            match asked {
                Ok((robot, outcome)) => {
                    self.outcomes.insert(robot, outcome);
                }
                Err(error) => tracing::error!("cannot request a stop: {error}"),
            }
        }
        self.outcomes
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;

    #[test]
    fn only_a_known_roster_and_presence_leave_no_gap() {
        let error = || Error::new(ErrorKind::Failed, "get on xtb/lab/sim/roster: no");
        assert!(MissingInfo::default().none());
        assert!(MissingInfo::of(None, Ok(Some(BTreeSet::new()))).none());
        assert!(!MissingInfo::of(None, Ok(None)).none());
        assert!(!MissingInfo::of(None, Err(error())).none());
        assert!(!MissingInfo::of(Some(error()), Ok(Some(BTreeSet::new()))).none());
    }
}
