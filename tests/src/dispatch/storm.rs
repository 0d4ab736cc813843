//! A fleet that works through tasks while its dispatcher, or its robots, are killed at random times; and the
//! reckoning at the end: nothing that was acknowledged is lost, nothing is done twice.

use super::witness::{Reached, Written};
use super::{Asker, Serve, ServePair, Witness, route};
use crate::processes::{Process, Signal, program};
use crate::{Fleet, Setup, eventually, name};
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Notify;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    DispatchBody, DispatchOutcome, LinkLoss, TaskId, TaskList, TaskSpec, TaskState,
};
use xtb_sim::World;
use xtb_sim::fixes::FixTruth;

/// Room and points: nobody has to stand where another one stands, mostly.
const ROOM: &str = "[room]\nwidth_m = 9.0\ndepth_m = 9.0\n";
const REACH_M: f64 = 3.2;
/// A victim is left alone for at most so long, in ms.
const LONGEST_LIFE_MS: u32 = 1_500;
/// Every third victim falls this soon after a submission has left, in ms, at the latest: while it is written.
const SOON_MS: u32 = 20;
/// Both of a pair are killed within this: a stand-by that starts again is usually paired after half of it.
const UNPAIRED_MS: u32 = 800;
/// Between two submissions, in ms, at most.
const LONGEST_PAUSE_MS: u32 = 800;
/// A submission is given this long: the dispatcher is killed again and again meanwhile.
const PATIENCE: Duration = Duration::from_secs(120);
/// Between two looks at the list.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Without any task ended for so many looks, what is left is stuck: 5 min of a process that is not held up.
const STUCK_LOOKS: u32 = 1_500;
/// A robot that was killed this soon after it had reached a goal may have told nobody.
const UNTOLD: Duration = Duration::from_secs(2);

/// Who is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Whom {
    /// The dispatcher's process.
    Dispatcher,
    /// The dispatcher's process and its stand-by's in turns.
    Pair,
    /// Robots' agents, one at a time, which are processes of their own.
    Robots,
}

/// What happens.
#[derive(Debug, Clone, Copy)]
pub struct Storm {
    /// Who is killed.
    pub whom: Whom,
    /// How often.
    pub kills: usize,
    /// Tasks of a round; a new one begins while kills are left.
    pub tasks: usize,
    /// Robots.
    pub robots: usize,
    /// Seed of tasks and times.
    pub seed: u64,
    /// Times real time; 1 where agents are processes.
    pub speed: f64,
}

/// What came of it.
#[derive(Debug, Clone, Default)]
pub struct Totals {
    /// Kills.
    pub kills: usize,
    /// Submissions that were acknowledged.
    pub submissions: usize,
    /// Those of them that had to be asked more than once.
    pub asked_again: usize,
    /// Tasks that were acknowledged.
    pub acknowledged: usize,
    /// Acknowledged tasks that the ledger does not hold.
    pub lost: Vec<TaskId>,
    /// Tasks in the ledger that nobody was given.
    pub doubled: Vec<TaskId>,
    /// Acknowledged tasks that are done.
    pub done: usize,
    /// Tasks that have failed, and why.
    pub failed: Vec<String>,
    /// Tasks that had not ended when nothing went on any more.
    pub stuck: Vec<String>,
    /// Drives that robots reported as reached.
    pub drives: usize,
    /// Drives that were reached twice by a robot that was not killed at that time.
    pub repeated: Vec<String>,
    /// Drives that were reached twice, as the robot was killed before it could tell.
    pub untold: Vec<String>,
    /// Drives that the ledger has as done, and no robot has reported.
    pub undriven: Vec<String>,
    /// Contacts of the trucks.
    pub contacts: u64,
    /// Records in the ledger.
    pub records: usize,
    /// How long each start of the dispatcher took.
    pub ready: Vec<Duration>,
    /// Real time of all.
    pub took: Duration,
}

impl Totals {
    /// Nothing lost, nothing double.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        let empty = [&self.failed, &self.stuck, &self.repeated, &self.undriven];
        let whole =
            self.lost.is_empty() && self.doubled.is_empty() && empty.iter().all(|list| list.is_empty());
        whole && self.done == self.acknowledged && self.contacts == 0
    }
}

impl fmt::Display for Totals {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut ready: Vec<u128> = self.ready.iter().map(Duration::as_millis).collect();
        ready.sort_unstable();
        let at = |part: usize| ready.get((ready.len() * part / 100).min(ready.len().saturating_sub(1)));
        let ms = |part| at(part).map_or_else(|| "-".to_owned(), ToString::to_string);
        writeln!(
            f,
            "{} kills in {:.0} s; {} tasks acknowledged in {} submissions ({} asked again), {} done, {} failed, \
             {} stuck",
            self.kills,
            self.took.as_secs_f64(),
            self.acknowledged,
            self.submissions,
            self.asked_again,
            self.done,
            self.failed.len(),
            self.stuck.len()
        )?;
        writeln!(
            f,
            "lost {}, submitted double {}; {} drives, repeated {}, repeated as the robot was killed before it \
             could tell {}, not driven {}; {} contacts, {} records",
            self.lost.len(),
            self.doubled.len(),
            self.drives,
            self.repeated.len(),
            self.untold.len(),
            self.undriven.len(),
            self.contacts,
            self.records
        )?;
        write!(f, "ready after ms: median {}, 99 % {}, longest {}", ms(50), ms(99), ms(100))?;
        let lists = [&self.failed, &self.stuck, &self.repeated, &self.untold, &self.undriven];
        for line in lists.into_iter().flatten() {
            write!(f, "\n  {line}")?;
        }
        for id in self.lost.iter().chain(&self.doubled) {
            write!(f, "\n  {id} lost or double")?;
        }
        Ok(())
    }
}

/// What submitters were told.
#[derive(Debug, Default)]
struct Told {
    tasks: BTreeSet<TaskId>,
    submissions: usize,
    asked_again: usize,
}

impl Storm {
    /// Lets it pass over a fleet whose ledger is in this folder.
    ///
    /// # Panics
    /// If something does not start, or Zenoh fails.
    pub async fn pass(&self, folder: &Path, mut each: impl FnMut(usize)) -> Totals {
        let began = Instant::now();
        let mut dice = Pcg32::new(self.seed, 0xd15a);
        let apart = self.whom == Whom::Robots;
        let setup = Setup {
            robots: self.robots,
            speed: if apart { 1.0 } else { self.speed },
            seed: self.seed,
            world: Some(World::from_toml(ROOM).unwrap_or_else(|error| panic!("{error}"))),
            pty: apart.then(|| folder.to_owned()),
            fixes: FixTruth { rate_hz: 2.0, ..FixTruth::default() },
            ..Setup::default()
        };
        let fleet = Fleet::start(setup).await;
        let mut agents = Agents::start(&fleet, if apart { Some(folder) } else { None }).await;
        let witness = Witness::listen(&fleet.bus).await;
        let asker = Asker::connect(fleet.simulator.endpoint(), "storm").await;
        let mut serve = Dispatchers::start(self.whom, fleet.simulator.endpoint(), folder, &asker).await;
        let mut ready = vec![serve.ready_within()];
        let (told, enough) = (Arc::<Mutex<Told>>::default(), Arc::<AtomicBool>::default());
        let left = Arc::<Notify>::default();
        let hands = (told.clone(), enough.clone(), left.clone());
        let work = submit(asker.clone(), hands, self.tasks, self.seed);
        let submitting = tokio::spawn(work);

        let mut killed = Vec::new();
        for kill in 0..self.kills {
            let life = millis(&mut dice, LONGEST_LIFE_MS);
            let soon = millis(&mut dice, SOON_MS);
            tokio::select! {
                () = tokio::time::sleep(life) => {}
                () = left.notified(), if kill % 3 == 2 => tokio::time::sleep(soon).await,
            }
            match self.whom {
                Whom::Dispatcher | Whom::Pair => {
                    let again = millis(&mut dice, UNPAIRED_MS);
                    ready.extend(serve.kill(kill, again, &asker).await);
                }
                Whom::Robots => {
                    let number = dice.next_u32() as usize % self.robots + 1;
                    killed.push((name(&format!("xtb-{number}")), Instant::now()));
                    agents.kill_and_restart(&fleet, number).await;
                }
            }
            each(kill + 1);
        }
        enough.store(true, Ordering::Relaxed);
        submitting.await.unwrap_or_else(|error| panic!("{error}"));
        let list = until_ended(&asker).await;
        let written = Written::read(&serve.ledger());
        let told = std::mem::take(&mut *lock(&told));
        let mut totals = reckon(&told, &list, &written, &witness, &killed);
        let truth = fleet.simulator.truth().latest();
        totals.contacts = truth.robots.values().map(|robot| robot.contacts).sum();
        (totals.kills, totals.ready) = (self.kills, ready);
        if !totals.stuck.is_empty() {
            totals.stuck.extend(unfit(&fleet, self.robots).await);
        }
        drop((serve, agents, witness));
        fleet.end().await;
        totals.took = began.elapsed();
        totals
    }
}

/// One dispatcher, or one with a stand-by.
enum Dispatchers {
    One(Serve),
    Two(Box<ServePair>),
}

impl Dispatchers {
    async fn start(whom: Whom, endpoint: &str, folder: &Path, asker: &Asker) -> Self {
        match whom {
            Whom::Pair => Self::Two(Box::new(ServePair::start(endpoint, folder, asker).await)),
            Whom::Dispatcher | Whom::Robots => {
                Self::One(Serve::start(endpoint, &folder.join("storm.ledger")))
            }
        }
    }

    fn ready_within(&self) -> Duration {
        match self {
            Self::One(serve) => serve.ready_within,
            Self::Two(pair) => pair.ready_within,
        }
    }

    /// Kills one, or of a pair also both, the second one so long after the first one has been started `again`; how
    /// long it took until there was a dispatcher again.
    async fn kill(&mut self, number: usize, again: Duration, asker: &Asker) -> Option<Duration> {
        match self {
            Self::One(serve) => {
                serve.kill();
                serve.restart();
                Some(serve.ready_within)
            }
            Self::Two(pair) => {
                match number % 4 {
                    0 => return Some(pair.kill_active(asker).await),
                    1 => pair.restart_standby().await,
                    kind => pair.kill_before_paired(kind == 2, again).await,
                }
                None
            }
        }
    }

    fn ledger(&self) -> PathBuf {
        match self {
            Self::One(serve) => serve.ledger.clone(),
            Self::Two(pair) => pair.ledger(true).to_owned(),
        }
    }
}

fn lock(told: &Mutex<Told>) -> std::sync::MutexGuard<'_, Told> {
    told.lock().unwrap_or_else(PoisonError::into_inner)
}

fn millis(dice: &mut Pcg32, below: u32) -> Duration {
    Duration::from_millis(u64::from(dice.next_u32() % below))
}

/// What submitters were told, whether it is enough, and when a submission leaves.
type Hands = (Arc<Mutex<Told>>, Arc<AtomicBool>, Arc<Notify>);

/// Submits rounds of tasks until there is enough; each submission with one id until it is acknowledged.
async fn submit(asker: Asker, (told, enough, sent): Hands, round: usize, seed: u64) {
    let mut dice = Pcg32::new(seed, 0x5ab);
    loop {
        let mut left = round;
        while left > 0 {
            let count = (dice.next_u32() as usize % 3 + 1).min(left);
            left -= count;
            let tasks: Vec<TaskSpec> = (0..count).map(|_| task(&mut dice)).collect();
            sent.notify_waiters();
            let (outcome, asked) = asker.ask_until(DispatchBody::Submit { tasks }, PATIENCE).await;
            let DispatchOutcome::Submitted(ids) = outcome else { panic!("not taken: {outcome:?}") };
            assert_eq!(ids.len(), count, "so many were submitted");
            note(&mut lock(&told), ids, asked);
            tokio::time::sleep(millis(&mut dice, LONGEST_PAUSE_MS)).await;
        }
        // The next round begins when this one is nearly over.
        loop {
            if enough.load(Ordering::Relaxed) {
                return;
            }
            let open = |list: TaskList| list.tasks.iter().filter(|task| !task.state.is_final()).count();
            if asker.list().await.is_some_and(|list| open(list) < 10) {
                break;
            }
            tokio::time::sleep(LOOK_EVERY).await;
        }
    }
}

/// A submission was acknowledged.
fn note(told: &mut Told, ids: Vec<TaskId>, asked: u32) {
    told.submissions += 1;
    told.asked_again += usize::from(asked > 1);
    for id in ids {
        assert!(told.tasks.insert(id), "{id} was given to two submissions");
    }
}

/// One or two drives; it is begun anew as often as needed.
fn task(dice: &mut Pcg32) -> TaskSpec {
    let mut share = || f64::from(dice.next_u32()) / f64::from(u32::MAX);
    let mut point = || (REACH_M * (2.0 * share() - 1.0), REACH_M * (2.0 * share() - 1.0));
    let points = [point(), point()];
    let drives = if share() < 0.5 { 1 } else { 2 };
    // One that goes on without its dispatcher may be there before the next one has started.
    let on_link_loss = if share() < 0.5 { LinkLoss::Finish } else { LinkLoss::Halt };
    TaskSpec { retries: 100, on_link_loss, finish_s: 300.0, ..route(&points[..drives]) }
}

/// Waits until every task has ended, or nothing goes on any more.
async fn until_ended(asker: &Asker) -> TaskList {
    let (mut ended_before, mut looks) = (0, 0);
    loop {
        if let Some(list) = asker.list().await {
            let ended = list.tasks.iter().filter(|task| task.state.is_final()).count();
            looks = if ended > ended_before { 0 } else { looks + 1 };
            ended_before = ended;
            if ended == list.tasks.len() || looks > STUCK_LOOKS {
                return list;
            }
        }
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// Robots that could not go on, and why.
async fn unfit(fleet: &Fleet, robots: usize) -> Vec<String> {
    let mut lines = Vec::new();
    for number in 1..=robots {
        let state = fleet.state(number).await;
        let latches: Vec<_> = state.latches.iter().map(|latch| latch.latch).collect();
        let goal = state.goal.map(|goal| (goal.status, goal.reason));
        let because = (state.stopped_because, state.lease.map(|lease| lease.holder));
        lines.push(format!("xtb-{number} {latches:?} {:?} {goal:?} {because:?}", state.faults));
    }
    lines
}

fn reckon(
    told: &Told,
    list: &TaskList,
    written: &Written,
    witness: &Witness,
    killed: &[(Name, Instant)],
) -> Totals {
    let mut totals = Totals {
        submissions: told.submissions,
        asked_again: told.asked_again,
        acknowledged: told.tasks.len(),
        lost: told.tasks.difference(&written.submitted).copied().collect(),
        doubled: written.submitted.difference(&told.tasks).copied().collect(),
        records: written.records,
        ..Totals::default()
    };
    for task in &list.tasks {
        let line = || format!("{} {:?} on {:?}: {:?}", task.id, task.state, task.robot, task.reason);
        match task.state {
            TaskState::Done => totals.done += usize::from(told.tasks.contains(&task.id)),
            state if state.is_final() => totals.failed.push(line()),
            _ => totals.stuck.push(line()),
        }
    }
    let drives = witness.drives(written);
    totals.drives = drives.values().map(Vec::len).sum();
    for ((task, leg), reached) in &drives {
        let [first, _, ..] = reached.as_slice() else { continue };
        let line =
            format!("{task} drive {leg} was reached {} times, first by {}", reached.len(), first.robot);
        let list = if was_killed(first, killed) { &mut totals.untold } else { &mut totals.repeated };
        list.push(line);
    }
    let driven = |drive: &(TaskId, u32)| drives.contains_key(drive);
    let undriven = written.legs.keys().filter(|drive| !driven(drive));
    totals.undriven =
        undriven.map(|(task, leg)| format!("{task} drive {leg} is done, and nobody was there")).collect();
    totals
}

fn was_killed(reached: &Reached, killed: &[(Name, Instant)]) -> bool {
    let soon = |at: Instant| at + UNTOLD >= reached.at && at <= reached.at + UNTOLD;
    killed.iter().any(|(robot, at)| *robot == reached.robot && soon(*at))
}

/// Agents as processes of their own, if they are.
struct Agents {
    folder: Option<std::path::PathBuf>,
    processes: Vec<Option<Process>>,
}

impl Agents {
    async fn start(fleet: &Fleet, folder: Option<&Path>) -> Self {
        let robots = fleet.simulator.roster().robots.len();
        let mut agents =
            Self { folder: folder.map(Path::to_owned), processes: (0..robots).map(|_| None).collect() };
        if folder.is_some() {
            for number in 1..=robots {
                agents.begin(fleet, number);
            }
            eventually("the agents", || async { (fleet.alive().await.len() == robots).then_some(()) }).await;
        }
        agents
    }

    /// Where its truck stands now.
    fn begin(&mut self, fleet: &Fleet, number: usize) {
        let Some(lines) = &self.folder else { return };
        let truth = fleet.truth(number);
        let line = |device: &str| lines.join(format!("xtb-{number}.{device}"));
        let mut command = Command::new(program("robot-agent"));
        command.args(["--hardware", "serial", "--name", &format!("xtb-{number}")]);
        command.args(["--connect", fleet.simulator.endpoint()]).arg("--board").arg(line("board"));
        command.arg("--gyro").arg(line("gyro")).arg("--start-pose");
        command.arg(format!("{:.4},{:.4},{:.4}", truth.x_m, truth.y_m, truth.yaw_rad));
        self.processes[number - 1] = Some(Process::start(&mut command));
    }

    async fn kill_and_restart(&mut self, fleet: &Fleet, number: usize) {
        if let Some(mut process) = self.processes[number - 1].take() {
            process.signal(Signal::Kill);
            let _ = process.0.wait();
        }
        let stands = || async { (fleet.truth(number).speed_mps == 0.0).then_some(()) };
        eventually("the truck to stand", stands).await;
        let key = fleet.robot(number).alive();
        let gone = || async {
            let alive = fleet.alive().await;
            (!alive.contains(&key)).then_some(())
        };
        eventually("its death to be known", gone).await;
        self.begin(fleet, number);
        let back = || async { fleet.alive().await.contains(&key).then_some(()) };
        eventually("the agent again", back).await;
    }
}
