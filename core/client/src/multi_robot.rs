//! Several robots at once: each is asked by a task of its own, must say and show itself what it did, and whose
//! answers are missing is known by name.

use crate::client::Client;
use crate::crowd::Crowd;
use crate::error::{Error, Result};
use crate::heard::Heard;
use futures_util::{StreamExt, stream};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::pin::pin;
use tokio::task::{JoinError, JoinSet};
use xtb_protocol::Name;

/// Robots that only a roster names are asked while fewer than this many are being asked. It keeps a roster that
/// somebody has invented from filling the link, and what takes several messages from taking so long with hundreds of
/// robots that leases run out meanwhile; chosen, not measured.
const MOST_AT_ONCE: usize = 64;

/// What comes of each, in their order; not more than some dozens are under way at the same time, and one that takes
/// long holds up only its own place.
pub async fn in_turn<Each: Future>(each: impl IntoIterator<Item = Each>) -> Vec<Each::Output> {
    let numbered = |(number, one): (usize, Each)| async move { (number, one.await) };
    // Of an iterator with closures, rustc cannot tell whether it is Send.
    let each: Vec<_> = each.into_iter().enumerate().map(numbered).collect();
    let mut results: Vec<_> = stream::iter(each).buffer_unordered(MOST_AT_ONCE).collect().await;
    results.sort_unstable_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct StopReport {
    /// By name.
    pub robots: BTreeMap<Name, StopOutcome>,
    /// Whether every robot that should be there has stopped. Never true when nobody knows which, or there are none.
    pub complete: bool,
}

impl StopReport {
    /// Complete if all have stopped and none was left out.
    #[must_use]
    pub fn new(robots: BTreeMap<Name, StopOutcome>, gaps: &MissingInfo) -> Self {
        let report = Self { robots, complete: false };
        Self { complete: !report.robots.is_empty() && report.all_stopped() && gaps.none(), ..report }
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
    crowd: Crowd,
    asking: JoinSet<(Name, StopOutcome)>,
    /// At all of them at once.
    looking: JoinSet<()>,
    outcomes: BTreeMap<Name, StopOutcome>,
    /// To be asked when there is room.
    waiting: BTreeSet<Name>,
}

impl<Ask, Asking> MultiRobot<Ask>
where
    Ask: Fn(Client, Name, Crowd) -> Asking,
    Asking: Future<Output = StopOutcome> + Send + 'static,
{
    /// Nobody asked yet; `ask` asks one robot.
    pub fn new(client: &Client, ask: Ask) -> Self {
        let (asking, looking) = (JoinSet::new(), JoinSet::new());
        let (outcomes, waiting) = (BTreeMap::new(), BTreeSet::new());
        Self { client: client.clone(), ask, crowd: Crowd::default(), asking, looking, outcomes, waiting }
    }

    /// All who are being asked.
    pub(crate) fn crowd(&self) -> Crowd {
        self.crowd.clone()
    }

    /// Asks these at once, unless they have been asked.
    pub fn call(&mut self, robots: impl IntoIterator<Item = Name>) {
        for robot in robots {
            if self.is_new(&robot) || self.waiting.remove(&robot) {
                self.start(robot);
            }
        }
    }

    /// Asks these as soon as there is room, unless they have been asked.
    fn call_in_turn(&mut self, robots: impl IntoIterator<Item = Name>) {
        for robot in robots {
            if self.is_new(&robot) {
                self.waiting.insert(robot);
            }
        }
        self.fill();
    }

    /// Whether it is heard of for the first time. Whatever goes wrong from now on, an answer that did not come is
    /// not a standstill.
    fn is_new(&mut self, robot: &Name) -> bool {
        let is_new = !self.outcomes.contains_key(robot);
        if is_new {
            self.outcomes.insert(robot.clone(), StopOutcome::Unknown);
        }
        is_new
    }

    fn start(&mut self, robot: Name) {
        let asking = (self.ask)(self.client.clone(), robot.clone(), self.crowd.clone());
        self.asking.spawn(async move { (robot, asking.await) });
    }

    fn fill(&mut self) {
        while self.asking.len() < MOST_AT_ONCE {
            let Some(robot) = self.waiting.pop_first() else { return };
            self.start(robot);
        }
    }

    /// One has been asked: the next.
    fn ended(&mut self, asked: std::result::Result<(Name, StopOutcome), JoinError>) {
        match asked {
            Ok((robot, outcome)) => {
                self.outcomes.insert(robot, outcome);
            }
            Err(error) => tracing::error!("cannot request a stop: {error}"),
        }
        self.fill();
    }

    /// Asks everybody as soon as they are heard of. Who is `known` without asking comes first; neither
    /// question waits for the other, and none of them, slow or failed, keeps the others from being
    /// asked. Only those whom nobody but a simulator's roster names wait for room.
    pub async fn call_all(&mut self, expect: &[Name], known: &[Name]) -> MissingInfo {
        let client = self.client.clone();
        self.looking = self.crowd.together(&client);
        self.call(known.iter().cloned().chain(client.told_roster(expect)));
        let (mut alive, mut roster) = (pin!(client.alive()), pin!(client.roster(expect)));
        let (mut there, mut should) = (None, None);
        loop {
            tokio::select! {
                found = &mut alive, if there.is_none() => {
                    self.call(found.iter().flatten().cloned());
                    there = Some(found.err());
                }
                found = &mut roster, if should.is_none() => {
                    self.call_in_turn(found.iter().flatten().flatten().cloned());
                    should = Some(found);
                }
                Some(asked) = self.asking.join_next(), if there.is_none() || should.is_none() => {
                    self.ended(asked);
                }
                else => return MissingInfo::of(there.flatten(), should.unwrap_or(Ok(None))),
            }
        }
    }

    /// What came of each, once all are answered or given up.
    pub async fn outcomes(mut self) -> BTreeMap<Name, StopOutcome> {
        self.end().await;
        self.outcomes
    }

    /// The same, and then of those who have answered a question to all, and are none of those asked by name or did not
    /// answer that.
    pub(crate) async fn outcomes_and_of<A: Clone>(mut self, heard: &Heard<A>) -> BTreeMap<Name, StopOutcome> {
        self.end().await;
        for robot in heard.robots() {
            if matches!(self.outcomes.get(&robot), None | Some(StopOutcome::Unknown)) {
                self.start(robot);
            }
        }
        self.outcomes().await
    }

    async fn end(&mut self) {
        while let Some(asked) = self.asking.join_next().await {
            self.ended(asked);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::ErrorKind;
    use crate::fake::name;
    use std::cell::Cell;
    use std::sync::{Arc, Mutex};
    use std::time::Duration;
    use tokio::sync::watch;
    use xtb_bus::Question;
    use xtb_protocol::codec::Format;
    use xtb_protocol::messages::{Roster, RosterEntry};

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_is_there_is_asked_at_once_though_a_roster_names_many_who_are_not() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let (key, runtime) = (client.keys().sim_roster(), tokio::runtime::Handle::current());
        let own_key = key.clone();
        let each = move |question: Question| {
            let own_key = own_key.clone();
            runtime.spawn(async move {
                let bare = |name| RosterEntry { name, tags: Vec::new(), start_pose: None };
                let robots = (0..200).map(|n| bare(self::name(&format!("ghost-{n}")))).collect();
                question.reply(&own_key, &Roster { robots }, Format::Json).await.unwrap();
            });
        };
        let _roster = client.bus().serve(&key, each).await.unwrap();
        let there = name("xtb-1");
        let _token = client.bus().declare_alive(&client.keys().robot(&there).alive()).await.unwrap();
        // Nobody answers before the test says so.
        let (answers, gate) = watch::channel(false);
        let asked = Arc::new(Mutex::new(Vec::<Name>::new()));
        let asking = Arc::clone(&asked);
        let mut calls = MultiRobot::new(&client, move |_, robot, _| {
            asking.lock().unwrap().push(robot);
            let mut gate = gate.clone();
            async move {
                gate.wait_for(|open| *open).await.unwrap();
                StopOutcome::Absent
            }
        });
        assert!(calls.call_all(&[], &[]).await.none());
        let at_once = asked.lock().unwrap().clone();
        assert!(at_once.contains(&there));
        assert!((MOST_AT_ONCE..=MOST_AT_ONCE + 1).contains(&at_once.len()), "{}", at_once.len());
        // One that waits and turns out to be there waits no longer.
        let last = name("ghost-99");
        assert!(!at_once.contains(&last));
        calls.call([last.clone()]);
        assert_eq!(asked.lock().unwrap().last(), Some(&last));
        answers.send_replace(true);
        let outcomes = calls.outcomes().await;
        assert_eq!(outcomes.len(), 201);
        assert!(outcomes.values().all(|outcome| *outcome == StopOutcome::Absent));
        assert_eq!(asked.lock().unwrap().len(), 201, "each once");
    }

    #[tokio::test]
    async fn some_dozens_are_under_way_at_the_same_time_and_results_keep_their_order() {
        let (begun, most, ended) = (&Cell::new(0_usize), &Cell::new(0), &Cell::new(0));
        let each = (0..200).map(|i| async move {
            begun.set(begun.get() + 1);
            most.set(begun.get().max(most.get()));
            tokio::task::yield_now().await;
            begun.set(begun.get() - 1);
            ended.set(ended.get() + 1);
            while i == 0 && ended.get() < 200 {
                tokio::task::yield_now().await; // the first takes longest
            }
            i
        });
        assert_eq!(in_turn(each).await, (0..200).collect::<Vec<_>>());
        assert_eq!(most.get(), MOST_AT_ONCE);
    }

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
