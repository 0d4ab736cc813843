//! A fleet on three computers, each with a router, two robots and people at it. The routers form a mesh; one of
//! them is killed. With identities or without.

mod cuts;

pub use cuts::{Cut, CutTotals, Cuts};

use crate::hosts::{Host, hosts};
use crate::processes::{Process, Signal, program};
use crate::{eventually, name, robot_name};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use xtb_identity::Registry;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{GoalState, RobotState};
use xtb_protocol::{Name, Uuid};

/// The computers.
const A: usize = 0;
const B: usize = 1;
const C: usize = 2;
const HOSTS: usize = 3;
/// Who all the people are.
const PERSON: &str = "alice";
const ROBOTS: usize = 6;
/// States of each robot after the kill until the gaps are counted: those of a second.
const STATES: u64 = 20;

/// What came of a dead router.
#[derive(Debug, Clone)]
pub struct Failover {
    /// Longest time without a state of a robot whose router it was, as seen from another computer, in s.
    pub gap_s: f64,
    /// The same of the other robots.
    pub others_gap_s: f64,
    /// The goal of a robot elsewhere, which halts unless it hears its client, on a third computer.
    pub elsewhere: GoalState,
    /// The goal of a robot whose router it was, which goes on without its client.
    pub finishing: GoalState,
    /// The goal of a robot whose router it was, which halts, and whose client knew no other router.
    pub halting: GoalState,
}

/// What has come from a robot.
#[derive(Debug, Default)]
struct Heard {
    state: Option<RobotState>,
    at: Option<Instant>,
    states: u64,
    longest_gap: Duration,
}

impl Heard {
    fn take(&mut self, state: RobotState) {
        let now = Instant::now();
        let gap = self.at.map_or(Duration::ZERO, |at| now.duration_since(at));
        self.longest_gap = self.longest_gap.max(gap);
        (self.state, self.at) = (Some(state), Some(now));
        self.states += 1;
    }
}

type HeardFleet = Arc<Mutex<BTreeMap<Name, Heard>>>;

fn lock(fleet: &HeardFleet) -> MutexGuard<'_, BTreeMap<Name, Heard>> {
    fleet.lock().unwrap_or_else(PoisonError::into_inner)
}

/// See the module's documentation.
pub struct Mesh {
    fleet: HeardFleet,
    people: Vec<Process>,
    routers: Vec<Process>,
    _robots: Vec<Process>,
    site: Site,
}

impl Mesh {
    /// Starts everything and waits until the states of all robots come through to the last computer.
    ///
    /// # Errors
    /// Why this machine cannot have three computers in one.
    ///
    /// # Panics
    /// If something does not start.
    pub async fn start(identities: bool) -> Result<Self, String> {
        let hosts = hosts(HOSTS)?;
        let identities = identities.then(|| issue(&hosts));
        let site = Site { hosts, identities };
        let routers = (0..HOSTS).map(|host| site.router(host)).collect();
        let robots = (1..=ROBOTS).map(|number| site.robot(number)).collect();
        let fleet = HeardFleet::default();
        let people = vec![site.watch(&fleet)];
        let mesh = Self { fleet, people, routers, _robots: robots, site };
        mesh.until_all("states of all robots", |heard| heard.state.is_some()).await;
        Ok(mesh)
    }

    /// `kill -9` of the second computer's router while robots drive.
    ///
    /// # Panics
    /// If they cannot be driven, or do not come back.
    pub async fn kill_router(&mut self) -> Failover {
        let (elsewhere, finishing, halting) = (1, 3, 4);
        let all = self.site.nearest_first(C);
        self.follow(C, &all, elsewhere);
        self.follow(B, &self.site.endpoint(B), halting);
        let finish =
            ["wander", robot_name(finishing).as_str(), "--on-link-loss", "finish"].map(str::to_owned);
        assert!(self.succeeds(C, &all, &finish).await, "{} refuses to wander", robot_name(finishing));
        let mut goals = Vec::new();
        for number in [elsewhere, finishing, halting] {
            goals.push(self.runs(number).await);
        }
        self.forget();
        self.routers[B].signal(Signal::Kill);
        let _ = self.routers[B].0.wait();
        self.until_all("states of all robots again", |heard| heard.states >= STATES).await;
        let (gap_s, others_gap_s) =
            (self.longest_gap_s(|host| host == B), self.longest_gap_s(|host| host != B));
        let ended = || async { self.goal(halting).is_some_and(|goal| goal.status.is_final()).then_some(()) };
        eventually("the end of the goal without a client", ended).await;
        let goal = |number, id: Uuid| {
            let goal = self.goal(number).filter(|goal| goal.id == id);
            goal.unwrap_or_else(|| panic!("{} has another goal", robot_name(number)))
        };
        Failover {
            gap_s,
            others_gap_s,
            elsewhere: goal(elsewhere, goals[0]),
            finishing: goal(finishing, goals[1]),
            halting: goal(halting, goals[2]),
        }
    }

    /// Waits until `list` on the third computer shows all robots, and on the second one, by the router of another
    /// computer.
    ///
    /// # Panics
    /// If it does not.
    pub async fn lists_all(&self) {
        for host in [C, B] {
            self.until_listed(host, &self.site.nearest_first(host)).await;
        }
    }

    /// Starts the second computer's router again, and waits until a client that knows only it finds all robots.
    ///
    /// # Panics
    /// If it does not.
    pub async fn restart_router(&mut self) {
        self.routers[B] = self.site.router(B);
        self.until_listed(B, &self.site.endpoint(B)).await;
    }

    async fn until_listed(&self, host: usize, routers: &str) {
        let robots: Vec<String> = (1..=ROBOTS).map(|number| robot_name(number).to_string()).collect();
        let list = ["list".to_owned(), "--expect".to_owned(), robots.join(",")];
        eventually("all robots in the list", || async {
            self.succeeds(host, routers, &list).await.then_some(())
        })
        .await;
    }

    /// Somebody makes a robot wander, and stays.
    fn follow(&mut self, host: usize, routers: &str, number: usize) {
        let mut command = self.site.cli(host, routers);
        command.args(["wander", robot_name(number).as_str(), "--wait"]).stdout(Stdio::null());
        self.people.push(Process::start(&mut command));
    }

    /// Whether a command ends with exit code 0.
    async fn succeeds(&self, host: usize, routers: &str, arguments: &[String]) -> bool {
        let mut command = self.site.cli(host, routers);
        command.args(arguments).stdout(Stdio::null());
        let ended = tokio::task::spawn_blocking(move || Process::start(&mut command).0.wait()).await;
        matches!(ended, Ok(Ok(status)) if status.success())
    }

    /// The goal of a robot, once it runs.
    async fn runs(&self, number: usize) -> Uuid {
        let goal = || async { self.goal(number).filter(|goal| !goal.status.is_final()) };
        eventually("a goal that runs", goal).await.id
    }

    fn goal(&self, number: usize) -> Option<GoalState> {
        lock(&self.fleet).get(&robot_name(number))?.state.as_ref()?.goal.clone()
    }

    /// States and gaps count from now on.
    fn forget(&self) {
        for heard in lock(&self.fleet).values_mut() {
            (heard.states, heard.longest_gap) = (0, Duration::ZERO);
        }
    }

    async fn until_all(&self, what: &str, is: impl Fn(&Heard) -> bool) {
        eventually(what, || async {
            let fleet = lock(&self.fleet);
            (fleet.len() == ROBOTS && fleet.values().all(&is)).then_some(())
        })
        .await;
    }

    /// Of the robots on these computers.
    fn longest_gap_s(&self, on: impl Fn(usize) -> bool) -> f64 {
        let fleet = lock(&self.fleet);
        let robots = (1..=ROBOTS).filter(|number| on(home(*number)));
        let gaps = robots.filter_map(|number| Some(fleet.get(&robot_name(number))?.longest_gap));
        gaps.max().unwrap_or(Duration::MAX).as_secs_f64()
    }
}

/// The computer of a robot: xtb-1 and xtb-2 have the first one.
fn home(number: usize) -> usize {
    [A, A, B, B, C, C][number - 1]
}

/// The computers, and what stands on their disks.
struct Site {
    hosts: Vec<Host>,
    identities: Option<TempDir>,
}

impl Site {
    fn endpoint(&self, host: usize) -> String {
        let protocol = if self.identities.is_some() { "tls" } else { "tcp" };
        format!("{protocol}/{}:7447", self.hosts[host].address())
    }

    /// All routers, that of this computer first.
    fn nearest_first(&self, host: usize) -> String {
        let endpoints = (0..HOSTS).map(|n| self.endpoint((host + n) % HOSTS));
        endpoints.collect::<Vec<_>>().join(",")
    }

    fn router(&self, host: usize) -> Process {
        let mut command = self.hosts[host].command(&program("fleet-cli"));
        command.args(["--json", "router", "--listen", &self.endpoint(host)]);
        // Of each pair one connects to the other.
        let earlier: Vec<String> = (0..host).map(|earlier| self.endpoint(earlier)).collect();
        if !earlier.is_empty() {
            command.args(["--connect", &earlier.join(",")]);
        }
        match &self.identities {
            None => command.arg("--insecure"),
            Some(folder) => command.arg("--pki").arg(folder.path().join(router_name(host))),
        };
        let (process, line) = Process::start_ready(&mut command);
        assert!(line.starts_with("{\"ready\":true"), "the router says {line:?}");
        process
    }

    fn robot(&self, number: usize) -> Process {
        let host = home(number);
        let mut command = self.hosts[host].command(&program("robot-agent"));
        command.args(["--hardware", "simulated"]);
        match &self.identities {
            None => command.args(["--name", robot_name(number).as_str()]),
            Some(folder) => command.arg("--identity").arg(folder.path().join(robot_name(number).as_str())),
        };
        // Each has a room of its own: far from the others on the map, too.
        command.args(["--start-pose", &format!("{},0,1.5708", 50 * number)]);
        command.args(["--connect", &self.nearest_first(host)]);
        Process::start(&mut command)
    }

    fn cli(&self, host: usize, routers: &str) -> Command {
        let mut command = self.hosts[host].command(&program("fleet-cli"));
        command.args(["--json", "--connect", routers]);
        if let Some(folder) = &self.identities {
            command.arg("--identity").arg(folder.path().join(PERSON));
        }
        command
    }

    /// Somebody at the third computer follows all robots.
    fn watch(&self, fleet: &HeardFleet) -> Process {
        let fleet = fleet.clone();
        let keys = FleetKeys::new(name("lab")).any_robot().state();
        self.listen(C, &self.nearest_first(C), &keys, move |state: RobotState| {
            lock(&fleet).entry(state.robot.clone()).or_default().take(state);
        })
    }

    /// Somebody at this computer hears what comes under these keys.
    fn listen<T: DeserializeOwned>(
        &self,
        host: usize,
        routers: &str,
        keys: &str,
        each: impl Fn(T) + Send + 'static,
    ) -> Process {
        let mut command = self.cli(host, routers);
        let mut process = Process::start(command.args(["watch", keys]).stdout(Stdio::piped()));
        let output = process.0.stdout.take().unwrap_or_else(|| panic!("no output"));
        std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if let Ok(Line { value }) = serde_json::from_str(&line) {
                    each(value);
                }
            }
        });
        process
    }
}

fn router_name(host: usize) -> String {
    format!("router{}", host + 1)
}

/// A PKI folder for each router, and an identity for each robot and for the people.
fn issue(hosts: &[Host]) -> TempDir {
    let folder = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let run = |program: &Path, line: &str| {
        let mut command = Command::new(program);
        command.env_clear().env("XTB_PKI", router_name(A)).current_dir(folder.path());
        let output = command.args(line.split_whitespace()).output().unwrap_or_else(|error| panic!("{error}"));
        assert!(output.status.success(), "{line}: {output:?}");
    };
    let (cli, agent) = (program("fleet-cli"), program("robot-agent"));
    run(&cli, &format!("pki init --router-name {}", hosts[A].address()));
    run(&cli, &format!("pki add-person {PERSON} --role operator"));
    run(&cli, &format!("enrol {PERSON}.xtbid --to {PERSON} --remove"));
    for robot in (1..=ROBOTS).map(robot_name) {
        run(&cli, &format!("pki add-robot {robot}"));
        run(&agent, &format!("enrol {robot}.xtbid --to {robot} --remove"));
    }
    for host in [B, C] {
        run(&cli, &format!("pki add-router {} --router-name {}", router_name(host), hosts[host].address()));
    }
    // What was added after a copy was made.
    let registry = |host| folder.path().join(router_name(host)).join(Registry::FILE);
    fs::copy(registry(A), registry(B)).unwrap_or_else(|error| panic!("{error}"));
    folder
}

/// A message as `watch` prints it.
#[derive(Debug, Deserialize)]
struct Line<T> {
    value: T,
}
