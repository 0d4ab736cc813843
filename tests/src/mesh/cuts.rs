//! The same three computers, with a dispatcher at the first one and its stand-by at the second one. Cables are cut and
//! mended while people at all three submit tasks: whichever of the two may go on does, nothing that was acknowledged
//! is lost, and nothing is driven twice.

use super::{A, B, C, HOSTS, ROBOTS, Site};
use crate::dispatch::{Witness, Written};
use crate::hosts::hosts;
use crate::processes::Process;
use crate::{PATIENCE, eventually, name, robot_name};
use rand_core::Rng;
use rand_pcg::Pcg32;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::fmt;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{TaskId, TaskList, TaskState};

/// Times of a cut: too short to be noticed, and longer than any of the two waits for the other.
const CUT_MS: std::ops::Range<u32> = 300..10_000;
/// Between two submissions at one computer, at most.
const PAUSE_MS: u32 = 4_000;
/// A submission waits for its answer this long, in s.
const ANSWER_S: &str = "3";
/// Tasks may take so long after the last cut: those of a robot that nobody reached wait for it.
const END_WITHIN: Duration = Duration::from_secs(120);

/// What is pulled out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cut {
    /// The cable between these two computers; the third one still connects them.
    Cable(usize, usize),
    /// Both cables of this one.
    Host(usize),
}

impl Cut {
    /// Where each is pulled out, and what is at its other end: that end only loses its carrier, as it does when a
    /// switch dies, and a computer that is cut off still reaches itself.
    fn cables(self) -> Vec<(usize, usize)> {
        match self {
            Self::Cable(one, other) => vec![(one, other)],
            Self::Host(host) => {
                (0..HOSTS).filter(|other| *other != host).map(|other| (other, host)).collect()
            }
        }
    }
}

/// What happens, one after the other, and for how long. After each the dispatcher and its stand-by have to be a pair
/// again; who ended, because the other one had taken over, starts again as the stand-by.
#[derive(Debug, Clone)]
pub struct Cuts(pub Vec<(Cut, Duration)>);

/// What came of it.
#[derive(Debug, Clone, Default)]
pub struct CutTotals {
    /// Cuts of one cable, and of a computer.
    pub cuts: [usize; 2],
    /// Take-overs.
    pub term: u32,
    /// Submissions that got no answer: whether they are in the ledger nobody knows.
    pub unanswered: usize,
    /// Tasks that were acknowledged.
    pub acknowledged: usize,
    /// Of those, tasks that are done.
    pub done: usize,
    /// Of those, tasks that the ledger does not know.
    pub lost: Vec<TaskId>,
    /// Tasks that have ended otherwise, or have not.
    pub undone: Vec<String>,
    /// Drives that robots reported more than once.
    pub repeated: Vec<String>,
    /// Drives.
    pub drives: usize,
    /// From the mended cable to the pair, the longest.
    pub paired_within: Duration,
}

impl CutTotals {
    /// Nothing lost, nothing double.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        let none = self.lost.is_empty() && self.undone.is_empty() && self.repeated.is_empty();
        none && self.done == self.acknowledged && self.done > 0
    }
}

impl fmt::Display for CutTotals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [cables, computers] = self.cuts;
        write!(
            f,
            "{cables} cables and {computers} computers cut off, {} take-overs; {} tasks acknowledged, {} submissions \
             unanswered; {} done in {} drives, lost {}, repeated {}; a pair again within {:.1} s",
            self.term,
            self.acknowledged,
            self.unanswered,
            self.done,
            self.drives,
            self.lost.len(),
            self.repeated.len(),
            self.paired_within.as_secs_f64()
        )?;
        for line in self.undone.iter().chain(&self.repeated) {
            write!(f, "\n  {line}")?;
        }
        for id in &self.lost {
            write!(f, "\n  {id} lost")?;
        }
        Ok(())
    }
}

impl Cuts {
    /// So many, of any kind, for any time.
    #[must_use]
    pub fn random(cuts: usize, seed: u64) -> Self {
        let mut dice = Pcg32::new(seed, 0xcab1e);
        let mut below = |limit: u32| dice.next_u32() % limit;
        let mut cut = || {
            let host = below(HOSTS as u32) as usize;
            let what = if below(3) == 0 { Cut::Cable(host, (host + 1) % HOSTS) } else { Cut::Host(host) };
            (what, Duration::from_millis(u64::from(CUT_MS.start + below(CUT_MS.end - CUT_MS.start))))
        };
        Self((0..cuts).map(|_| cut()).collect())
    }

    /// Makes them, with the ledgers in this folder.
    ///
    /// # Errors
    /// Why this machine cannot have three computers in one.
    ///
    /// # Panics
    /// If something does not start, or the two are no pair again.
    pub async fn pass(&self, folder: &Path, mut each: impl FnMut(usize)) -> Result<CutTotals, String> {
        let mut fleet = SplitFleet::start(folder).await?;
        let mut totals = CutTotals::default();
        let enough = Arc::<AtomicBool>::default();
        let told = Arc::<Mutex<Told>>::default();
        let people: Vec<_> = (0..HOSTS)
            .map(|host| tokio::spawn(submit(fleet.site.clone(), host, told.clone(), enough.clone())))
            .collect();
        for (number, &(cut, duration)) in self.0.iter().enumerate() {
            totals.cuts[usize::from(matches!(cut, Cut::Host(_)))] += 1;
            fleet.plug(cut, false);
            tokio::time::sleep(duration).await;
            fleet.plug(cut, true);
            totals.paired_within = totals.paired_within.max(fleet.pair_again().await);
            each(number + 1);
        }
        enough.store(true, Ordering::Relaxed);
        for person in people {
            person.await.unwrap_or_else(|error| panic!("{error}"));
        }
        let told = std::mem::take(&mut *told.lock().unwrap_or_else(PoisonError::into_inner));
        fleet.reckon(told, &mut totals).await;
        Ok(totals)
    }
}

/// What those who submit were told.
#[derive(Debug, Default)]
struct Told {
    tasks: BTreeSet<TaskId>,
    unanswered: usize,
}

struct SplitFleet {
    site: Arc<Site>,
    witness: Witness,
    dispatchers: [Process; 2],
    ledgers: [PathBuf; 2],
    _others: Vec<Process>,
}

impl SplitFleet {
    async fn start(folder: &Path) -> Result<Self, String> {
        let site = Arc::new(Site { hosts: hosts(HOSTS)?, identities: None });
        let mut others: Vec<Process> = (0..HOSTS).map(|host| site.router(host)).collect();
        others.extend((1..=ROBOTS).map(|number| site.robot(number)));
        let witness = Witness::default();
        let events = FleetKeys::new(name("lab")).any_robot().event();
        // A robot's events are heard at its own computer, whatever is cut.
        others.extend((0..HOSTS).map(|host| {
            let hears = witness.clone();
            site.listen(host, &site.endpoint(host), &events, move |event| hears.take(event))
        }));
        let ledgers = ["a.ledger", "b.ledger"].map(|name| folder.join(name));
        let first = serve(&site, A, &ledgers[A], false);
        eventually("a dispatcher", || status(&site)).await;
        let dispatchers = [first, serve(&site, B, &ledgers[B], true)];
        let mut fleet = Self { site, witness, dispatchers, ledgers, _others: others };
        fleet.pair_again().await;
        eventually("all robots", || async {
            status(&fleet.site).await.filter(|status| status.robots == ROBOTS)
        })
        .await;
        Ok(fleet)
    }

    fn plug(&self, cut: Cut, is_in: bool) {
        for (one, other) in cut.cables() {
            self.site.hosts[one].plug(&self.site.hosts[other], is_in);
        }
    }

    /// Waits until both are a pair, however often one of them has to start again: how long that took.
    async fn pair_again(&mut self) -> Duration {
        let began = Instant::now();
        loop {
            for host in [A, B] {
                if !self.dispatchers[host].runs() {
                    self.dispatchers[host] = serve(&self.site, host, &self.ledgers[host], true);
                }
            }
            let paired = status(&self.site).await.is_some_and(|status| status.is_paired());
            if paired && self.dispatchers.iter_mut().all(Process::runs) {
                return began.elapsed();
            }
            if began.elapsed() >= PATIENCE {
                panic!("no pair: {}", self.describe().await);
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
    }

    /// What each computer sees, and what the dispatchers said.
    async fn describe(&self) -> String {
        let mut text = String::new();
        for host in [A, B, C] {
            text += &format!("{:?}\n", status_at(&self.site, host).await);
        }
        for ledger in &self.ledgers {
            text += &std::fs::read_to_string(ledger.with_extension("out")).unwrap_or_default();
        }
        text
    }

    async fn reckon(&mut self, told: Told, totals: &mut CutTotals) {
        let began = Instant::now();
        let list = loop {
            let all = ["tasks", "--all"].map(str::to_owned);
            let list = ask::<TaskList>(&self.site, C, &all).await;
            let ended = |list: &TaskList| list.tasks.iter().all(|task| task.state.is_final());
            match list {
                Some(list) if ended(&list) || began.elapsed() > END_WITHIN => break list,
                _ => tokio::time::sleep(Duration::from_millis(200)).await,
            }
        };
        totals.term = status(&self.site).await.map_or(0, |status| status.term);
        // Both have the same records by now, but for the last moment.
        let [a, b] = [A, B].map(|host| Written::read(&self.ledgers[host]));
        let written = if a.records > b.records { a } else { b };
        (totals.acknowledged, totals.unanswered) = (told.tasks.len(), told.unanswered);
        totals.lost = told.tasks.difference(&written.submitted).copied().collect();
        for task in &list.tasks {
            if task.state == TaskState::Done {
                totals.done += usize::from(told.tasks.contains(&task.id));
            } else {
                let line = format!("{} {:?} on {:?}: {:?}", task.id, task.state, task.robot, task.reason);
                totals.undone.push(line);
            }
        }
        for ((task, leg), reached) in self.witness.drives(&written) {
            totals.drives += reached.len();
            if reached.len() > 1 {
                totals.repeated.push(format!("{task} drive {leg} was reached {} times", reached.len()));
            }
        }
    }
}

/// A dispatcher; what it prints goes to a file beside its ledger.
fn serve(site: &Site, host: usize, ledger: &Path, standby: bool) -> Process {
    let mut command = site.cli(host, &site.endpoint(host));
    command.args(["dispatch", "serve", "--ledger"]).arg(ledger);
    if standby {
        command.arg("--standby");
    }
    let output = File::create(ledger.with_extension("out")).unwrap_or_else(|error| panic!("{error}"));
    Process::start(command.stdout(output))
}

/// What `dispatch status` says, as far as it is of interest here.
#[derive(Debug, Deserialize)]
struct Status {
    robots: usize,
    term: u32,
    standby: Option<StandbyStatus>,
}

#[derive(Debug, Deserialize)]
struct StandbyStatus {
    paired: bool,
}

impl Status {
    fn is_paired(&self) -> bool {
        self.standby.as_ref().is_some_and(|standby| standby.paired)
    }
}

/// As seen from the third computer.
async fn status(site: &Arc<Site>) -> Option<Status> {
    status_at(site, C).await
}

async fn status_at(site: &Arc<Site>, host: usize) -> Option<Status> {
    ask(site, host, &["dispatch", "status"].map(str::to_owned)).await
}

/// What a verb prints at this computer, if it succeeds.
async fn ask<T: DeserializeOwned>(site: &Arc<Site>, host: usize, verb: &[String]) -> Option<T> {
    let mut command: Command = site.cli(host, &site.endpoint(host));
    command.env_clear().args(["--timeout", ANSWER_S]).args(verb).stdin(Stdio::null());
    let output = tokio::task::spawn_blocking(move || command.output()).await.ok()?.ok()?;
    output.status.success().then(|| serde_json::from_slice(&output.stdout).ok())?
}

/// Somebody at this computer submits tasks for any robot, one at a time, until it is enough.
async fn submit(site: Arc<Site>, host: usize, told: Arc<Mutex<Told>>, enough: Arc<AtomicBool>) {
    #[derive(Deserialize)]
    struct Submitted {
        id: TaskId,
    }
    let mut dice = Pcg32::new(host as u64, 0x5ab);
    while !enough.load(Ordering::Relaxed) {
        let number = 1 + dice.next_u32() as usize % ROBOTS;
        let (x, y) = (50 * number, dice.next_u32() % 2);
        let policy = if dice.next_u32().is_multiple_of(2) { "finish" } else { "halt" };
        let (x, y, robot) = (x.to_string(), y.to_string(), robot_name(number).to_string());
        let verb =
            ["dispatch", "goto", &x, &y, "--robot", &robot, "--on-link-loss", policy, "--retries", "9"];
        let submitted = ask::<Submitted>(&site, host, &verb.map(str::to_owned)).await;
        {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            match submitted {
                Some(Submitted { id }) => assert!(told.tasks.insert(id), "{id} was given to two submissions"),
                None => told.unanswered += 1,
            }
        }
        let pause = Duration::from_millis(u64::from(dice.next_u32() % PAUSE_MS));
        tokio::time::sleep(pause).await;
    }
}
