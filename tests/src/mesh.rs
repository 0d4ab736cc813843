//! A fleet on three computers, each with a router, two robots and people at it. The routers form a mesh; one of
//! them is killed.

use crate::hosts::{Host, hosts};
use crate::processes::{Process, Signal, program};
use crate::{eventually, name, robot_name};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{GoalState, RobotState};
use xtb_protocol::{Name, Uuid};

/// The computers.
const A: usize = 0;
const B: usize = 1;
const C: usize = 2;
const HOSTS: usize = 3;
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
    hosts: Vec<Host>,
}

impl Mesh {
    /// Starts everything and waits until the states of all robots come through to the last computer.
    ///
    /// # Errors
    /// Why this machine cannot have three computers in one.
    ///
    /// # Panics
    /// If something does not start.
    pub async fn start() -> Result<Self, String> {
        let hosts = hosts(HOSTS)?;
        let routers = (0..HOSTS).map(|host| router(&hosts, host)).collect();
        let robots = (1..=ROBOTS).map(|number| robot(&hosts, number)).collect();
        let fleet = HeardFleet::default();
        let people = vec![watch(&hosts, &fleet)];
        let mesh = Self { fleet, people, routers, _robots: robots, hosts };
        mesh.until_all("states of all robots", |heard| heard.state.is_some()).await;
        Ok(mesh)
    }

    /// `kill -9` of the second computer's router while robots drive.
    ///
    /// # Panics
    /// If they cannot be driven, or do not come back.
    pub async fn kill_router(&mut self) -> Failover {
        let (elsewhere, finishing, halting) = (1, 3, 4);
        let all = nearest_first(&self.hosts, C);
        self.follow(C, &all, elsewhere);
        self.follow(B, &endpoint(&self.hosts[B]), halting);
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
            self.until_listed(host, &nearest_first(&self.hosts, host)).await;
        }
    }

    /// Starts the second computer's router again, and waits until a client that knows only it finds all robots.
    ///
    /// # Panics
    /// If it does not.
    pub async fn restart_router(&mut self) {
        self.routers[B] = router(&self.hosts, B);
        self.until_listed(B, &endpoint(&self.hosts[B])).await;
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
        let mut command = cli(&self.hosts[host], routers);
        command.args(["wander", robot_name(number).as_str(), "--wait"]).stdout(Stdio::null());
        self.people.push(Process::start(&mut command));
    }

    /// Whether a command ends with exit code 0.
    async fn succeeds(&self, host: usize, routers: &str, arguments: &[String]) -> bool {
        let mut command = cli(&self.hosts[host], routers);
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

fn endpoint(host: &Host) -> String {
    format!("tcp/{}:7447", host.address())
}

/// All routers, that of this computer first.
fn nearest_first(hosts: &[Host], host: usize) -> String {
    let endpoints = (0..HOSTS).map(|n| endpoint(&hosts[(host + n) % HOSTS]));
    endpoints.collect::<Vec<_>>().join(",")
}

fn router(hosts: &[Host], host: usize) -> Process {
    let others: Vec<String> = (1..HOSTS).map(|n| endpoint(&hosts[(host + n) % HOSTS])).collect();
    let mut command = cli(&hosts[host], &others.join(","));
    let (process, line) =
        Process::start_ready(command.args(["router", "--insecure", "--listen", &endpoint(&hosts[host])]));
    assert!(line.starts_with("{\"ready\":true"), "the router says {line:?}");
    process
}

fn robot(hosts: &[Host], number: usize) -> Process {
    let host = home(number);
    let mut command = hosts[host].command(&program("robot-agent"));
    command.args(["--hardware", "simulated", "--name", robot_name(number).as_str()]);
    // Each has a room of its own: far from the others on the map, too.
    command.args(["--start-pose", &format!("{},0,1.5708", 50 * number)]);
    command.args(["--connect", &nearest_first(hosts, host)]);
    Process::start(&mut command)
}

fn cli(host: &Host, routers: &str) -> Command {
    let mut command = host.command(&program("fleet-cli"));
    command.args(["--json", "--connect", routers]);
    command
}

/// A message as `watch` prints it.
#[derive(Debug, Deserialize)]
struct Line {
    value: RobotState,
}

/// Somebody at the third computer follows all robots.
fn watch(hosts: &[Host], fleet: &HeardFleet) -> Process {
    let states = FleetKeys::new(name("lab")).any_robot().state();
    let mut command = cli(&hosts[C], &nearest_first(hosts, C));
    let mut process = Process::start(command.args(["watch", &states]).stdout(Stdio::piped()));
    let output = process.0.stdout.take().unwrap_or_else(|| panic!("no output"));
    let fleet = fleet.clone();
    std::thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if let Ok(Line { value }) = serde_json::from_str(&line) {
                lock(&fleet).entry(value.robot.clone()).or_default().take(value);
            }
        }
    });
    process
}
