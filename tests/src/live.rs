//! Meetings of robots over real Zenoh: simulator, traffic control and, where one is to die, every agent are
//! processes of their own. Goals are sent as any client does; the witness hears the ground truth and what the
//! robots say.
//!
//! Time is the world's, which runs at real time as far as the machine can.

use crate::processes::{Process, Signal, program};
use crate::{GroundTruth, Monitor, Pilot, eventually, name};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;
use xtb_bus::{Bus, SessionRole};
use xtb_chaos::meetings::{Judge, Meeting, ObservedRobot, Setting};
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, Done, LinkLoss, Outcome, PoseSource, RobotState, TruthRobot, Via};
use xtb_protocol::{Name, Uuid};

const FLEET: &str = "lab";
/// The witness looks this often, in s of the world.
const LOOK_S: f64 = 0.2;
/// Longest meeting, in s of the world.
const WITHIN_S: f64 = 300.0;
/// Once all that are left have arrived or have said who is in the way, that has to last for so long, in s.
const TOLD_S: f64 = 20.0;
/// When traffic control is killed, and when it is started again, in s after the goals.
const KILLED_S: f64 = 8.0;
const BACK_S: f64 = 13.0;

/// What goes wrong on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// Nothing.
    None,
    /// `kill -9` of the agent of the first truck in the doorway; the agents must be processes of their own.
    Death,
    /// `kill -9` of traffic control after 8 s; another one, which knows nothing, 5 s later.
    Restart,
}

/// A meeting, and how the machine did.
#[derive(Debug, Clone)]
pub struct Told {
    /// What came of it.
    pub meeting: Meeting,
    /// How many went.
    pub robots: usize,
    /// Whose agent was killed.
    pub killed: Option<String>,
    /// What was latched at the end, and whose: nobody here latches anything, but a machine that is too busy for
    /// its agents does.
    pub latched: Vec<String>,
    /// Real time that it took.
    pub wall_s: f64,
    /// Turns of the control loops that came more than 5 ms late, of all.
    pub turns_late: u64,
}

impl Told {
    /// Nobody touched anything or stood for long, and all have arrived; with one dead in the doorway, the others
    /// have or say who is in the way.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        let left = self.robots - usize::from(self.killed.is_some());
        let all = if self.killed.is_some() { self.meeting.is_told() } else { self.meeting.reached == left };
        self.meeting.contacts == 0 && self.meeting.is_brisk() && self.meeting.ends.len() == left && all
    }
}

/// A fleet in a setting, its traffic control, and a client.
pub struct Live {
    names: Vec<Name>,
    monitor: Monitor,
    pilots: Vec<Pilot>,
    dead: BTreeSet<usize>,
    endpoint: String,
    traffic: Option<Process>,
    agents: Vec<Option<Process>>,
    _bus: Bus,
    _sim: Process,
}

impl Live {
    /// Starts everything in a folder and waits until all robots know where they are and hear traffic control.
    /// `apart`: agents as processes of their own, on ptys.
    ///
    /// # Panics
    /// If something does not start.
    pub async fn start(setting: &Setting, seed: u64, apart: bool, folder: &Path) -> Self {
        let robots = setting.starts.len();
        let world = folder.join("world.toml");
        std::fs::write(&world, world_file(setting)).unwrap_or_else(|error| panic!("{error}"));
        let mut command = cli(&["sim", "--listen", "tcp/127.0.0.1:0"]);
        command.args(["--robots", &robots.to_string(), "--seed", &seed.to_string(), "--world"]).arg(&world);
        if apart {
            command.arg("--pty").arg(folder);
        }
        let (sim, ready) = Process::start_ready(&mut command);
        let endpoint = ready.split('"').find(|part| part.starts_with("tcp/"));
        let endpoint = endpoint.unwrap_or_else(|| panic!("the simulator says {ready:?}")).to_owned();
        let role = SessionRole::Client { connect: vec![endpoint.clone()] };
        let bus = eventually("a session", || async { xtb_bus::open(&role).await.ok() }).await;
        let monitor = Monitor::listen(&bus, FLEET).await;
        let names: Vec<Name> = (1..=robots).map(|number| name(&format!("xtb-{number}"))).collect();
        let agents = names.iter().zip(&setting.starts);
        let agents =
            agents.filter(|_| apart).map(|(name, start)| Some(agent(name, start, folder, &endpoint)));
        let agents: Vec<_> = agents.collect();
        let mut pilots = Vec::new();
        for name in &names {
            pilots.push(Pilot::new(&bus, FLEET, name.as_str(), "live").await);
        }
        let mut live = Self {
            names,
            monitor,
            pilots,
            dead: BTreeSet::new(),
            endpoint,
            traffic: None,
            agents,
            _bus: bus,
            _sim: sim,
        };
        let knows = |state: &RobotState| state.nav.map.is_some() && state.pose.source == PoseSource::Fixes;
        live.until_all("poses and maps", |_, state| knows(state)).await;
        live.traffic = Some(live.start_traffic());
        live.until_all("traffic control", |_, state| state.nav.traffic).await;
        live
    }

    /// Without `--json` nothing waits for it to be ready.
    fn start_traffic(&self) -> Process {
        let mut command = cli(&["traffic", "serve", "--connect", &self.endpoint]);
        Process::start(command.stdout(Stdio::null()))
    }

    async fn until_all(&self, what: &str, is: impl Fn(usize, &RobotState) -> bool) {
        eventually(what, || async {
            let knows = |(index, name)| self.monitor.state(name).is_some_and(|state| is(index, &state));
            self.names.iter().enumerate().all(knows).then_some(())
        })
        .await;
    }

    fn sights(&self) -> Vec<ObservedRobot> {
        let truth = self.monitor.latest();
        let sight = |name: &Name| {
            let both = truth.robots.get(name).copied().zip(self.monitor.state(name));
            let (truth, state) = both.unwrap_or_else(|| panic!("no {name}"));
            ObservedRobot { truth, state }
        };
        self.names.iter().map(sight).collect()
    }

    fn time_s(&self) -> f64 {
        self.monitor.time_s()
    }

    /// All go to these goals at once; `each` sees every look of the witness.
    ///
    /// # Panics
    /// If a goal is refused, or the world stands still.
    pub async fn meet(
        &mut self,
        goals: &[MapPose],
        trouble: Trouble,
        each: &mut (dyn FnMut(&Meeting, &[ObservedRobot]) + Send),
    ) -> Told {
        let before = self.sights();
        let mut witness = Judge::new(before.iter().map(|sight| sight.truth.contacts));
        self.send(goals).await;
        let (began, mut looked_s, mut told_s) = (Instant::now(), self.time_s(), 0.0);
        while witness.made().took_s < WITHIN_S && told_s < TOLD_S {
            eventually("the world", || async { (self.time_s() >= looked_s + LOOK_S).then_some(()) }).await;
            let (now_s, sights) = (self.time_s(), self.sights());
            let passed_s = now_s - looked_s;
            looked_s = now_s;
            witness.look(passed_s, &sights, &self.dead);
            let made = witness.made();
            each(made, &sights);
            if made.is_over() {
                break;
            }
            told_s = if made.ends.len() < goals.len() && made.is_told() { told_s + passed_s } else { 0.0 };
            self.meddle(trouble, made.took_s, &sights);
        }
        let late = |sights: &[ObservedRobot]| sights.iter().map(|sight| sight.state.turns_late).sum::<u64>();
        let after = self.sights();
        let latched = |sight: &ObservedRobot| {
            let ObservedRobot { state, .. } = sight;
            let latches: Vec<_> = state.latches.iter().map(|latch| latch.latch).collect();
            (!latches.is_empty()).then(|| format!("{} {latches:?} {:?}", state.robot, state.faults))
        };
        Told {
            latched: after.iter().filter_map(latched).collect(),
            robots: goals.len(),
            killed: self.dead.first().map(|&index| self.names[index].to_string()),
            wall_s: began.elapsed().as_secs_f64(),
            turns_late: late(&after) - late(&before),
            meeting: witness.into_made(),
        }
    }

    /// Sends the goals, and waits until every robot has its own.
    async fn send(&self, goals: &[MapPose]) {
        let latched: Vec<bool> = self.sights().iter().map(|sight| !sight.state.latches.is_empty()).collect();
        let mut sent = Vec::<Uuid>::new();
        for ((pilot, goal), latched) in self.pilots.iter().zip(goals).zip(latched) {
            if latched {
                pilot.ask(Body::Reset { latch: None }).await;
            }
            let body = Body::Goto {
                x_m: goal.x_m,
                y_m: goal.y_m,
                yaw_rad: Some(goal.yaw_rad),
                via: Some(Via::Planned),
                on_link_loss: LinkLoss::Finish,
                finish_s: WITHIN_S,
            };
            match pilot.ask(body).await {
                Outcome::Ok(Done { goal: Some(goal), .. }) => sent.push(goal),
                other => panic!("the goal was not accepted: {other:?}"),
            }
        }
        let has =
            |index: usize, state: &RobotState| state.goal.as_ref().is_some_and(|goal| goal.id == sent[index]);
        self.until_all("the goals in the states", has).await;
    }

    fn meddle(&mut self, trouble: Trouble, at_s: f64, sights: &[ObservedRobot]) {
        match trouble {
            Trouble::Death if self.dead.is_empty() => {
                let in_doorway = |sight: &ObservedRobot| {
                    let TruthRobot { x_m, y_m, .. } = sight.truth;
                    Setting::is_in_doorway(x_m, y_m)
                };
                let Some(index) = sights.iter().position(in_doorway) else { return };
                let agent = self.agents.get_mut(index).and_then(Option::take);
                agent.unwrap_or_else(|| panic!("no process of its own")).signal(Signal::Kill);
                self.dead.insert(index);
            }
            Trouble::Restart if (KILLED_S..BACK_S).contains(&at_s) => drop(self.traffic.take()),
            // One that is refused, as its predecessor is still thought alive, is started again.
            Trouble::Restart if at_s >= BACK_S && !self.traffic.as_mut().is_some_and(Process::runs) => {
                self.traffic = Some(self.start_traffic());
            }
            _ => {}
        }
    }
}

fn cli(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.arg("--json").args(arguments);
    command
}

fn agent(name: &Name, start: &MapPose, lines: &Path, endpoint: &str) -> Process {
    let pose = format!("{:.4},{:.4},{:.4}", start.x_m, start.y_m, start.yaw_rad);
    let line = |device: &str| lines.join(format!("{name}.{device}"));
    let mut command = Command::new(program("robot-agent"));
    command.args(["--hardware", "serial", "--name", name.as_str(), "--connect", endpoint]);
    command.arg("--board").arg(line("board")).arg("--gyro").arg(line("gyro")).args(["--start-pose", &pose]);
    Process::start(&mut command)
}

/// The setting's world with its starts.
fn world_file(setting: &Setting) -> String {
    let mut world: toml::Table = toml::from_str(setting.world).unwrap_or_else(|error| panic!("{error}"));
    let start = |pose: &MapPose| {
        let fields = [("x_m", pose.x_m), ("y_m", pose.y_m), ("yaw_rad", pose.yaw_rad)];
        toml::Value::Table(fields.map(|(key, value)| (key.to_owned(), value.into())).into_iter().collect())
    };
    world.insert("starts".into(), setting.starts.iter().map(start).collect::<Vec<_>>().into());
    world.to_string()
}
