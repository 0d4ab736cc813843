//! The harness: a simulated fleet on a router of its own, and a client that talks to it.
//!
//! Router on port 0, multicast off, a seed, and [`eventually`] instead of sleeps: any number of
//! these run side by side.

pub mod dispatch;
pub mod fuzz;
pub mod hosts;
pub mod identities;
pub mod live;
pub mod load;
pub mod mesh;
mod monitor;
pub mod page_identities;
mod pilot;
mod probe;
pub mod processes;
pub mod ratios;
pub mod rig;
pub mod screen;
pub mod slow_link;
pub mod slow_verbs;
pub mod soak;
pub mod vda5050;
pub mod vehicles;

pub use live::Live;
pub use monitor::{GroundTruth, Monitor};
pub use pilot::Pilot;
pub use probe::Probe;
pub use rig::{Rig, Trial};

use robot_agent::config::AgentConfig;
use std::collections::BTreeMap;
use std::future::Future;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::Mutex as AsyncMutex;
use xtb_bus::{Bus, SessionRole, Subscription};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::keys::{FleetKeys, RobotKeys};
use xtb_protocol::messages::{
    Body, Done, ErrorBody, Event, EventKind, GoalStatus, LinkLoss, Outcome, RobotState, TruthRobot, Via,
};
use xtb_protocol::{Name, Uuid};
use xtb_sim::World;
use xtb_sim::fixes::FixTruth;
use xtb_simulator::{SimulationPlan, Simulator};

/// A generous bound: nothing here takes that long unless something is broken.
pub const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_EVERY: Duration = Duration::from_millis(10);
const ASK_WITHIN: Duration = Duration::from_secs(5);

/// Looks again and again until `look` finds something.
///
/// # Panics
/// After [`PATIENCE`], naming `what`.
pub async fn eventually<T, F: Future<Output = Option<T>>>(what: &str, mut look: impl FnMut() -> F) -> T {
    let give_up = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = look().await {
            return found;
        }
        assert!(Instant::now() < give_up, "waited {PATIENCE:?} in vain for: {what}");
        tokio::time::sleep(LOOK_EVERY).await;
    }
}

/// A name that is known to be one.
///
/// # Panics
/// If it is not.
#[must_use]
pub fn name(text: &str) -> Name {
    Name::new(text).unwrap_or_else(|error| panic!("{error}"))
}

/// Settings of an agent `xtb-1` that a test runs by itself, outside any simulator.
///
/// # Panics
/// If `fleet` is not a name.
#[must_use]
pub fn agent_config(endpoint: &str, fleet: &str) -> AgentConfig {
    AgentConfig {
        identity: None,
        navigation: xtb_nav::NavSettings::default(),
        map: None,
        fleet: name(fleet),
        robot: name("xtb-1"),
        peer: false,
        connect: vec![endpoint.to_owned()],
        start_pose: MapPose::default(),
        vehicle: VehicleConfig::default(),
        record: None,
        settings_file: None,
        realtime: false,
        ros2: None,
        world_speed: 1.0,
    }
}

/// How a goal ends because its computer is too busy: the words of the reason.
const HELD_UP: [&str; 5] =
    ["control loop stalled", "board_silent", "gyro_silent", "board_not_set_up", "encoder_silent"];

/// What then stays latched.
const HELD_UP_LATCHES: [&str; 2] = ["board_lost", "gyro_lost"];

/// How a test's fleet differs from three robots in an empty room at eight times real time.
#[derive(Debug, Clone)]
pub struct Setup {
    /// How many robots.
    pub robots: usize,
    /// Times real time.
    pub speed: f64,
    /// Seed.
    pub seed: u64,
    /// The room.
    pub world: Option<World>,
    /// What the robots are; those beyond are XTBs.
    pub vehicles: Vec<xtb_sim::VehicleFile>,
    /// Start poses: x in m, y in m, yaw in rad.
    pub starts: Vec<(f64, f64, f64)>,
    /// No agents, but ptys here.
    pub pty: Option<PathBuf>,
    /// What measures the robots' poses; nothing, unless a test asks for it.
    pub fixes: FixTruth,
    /// Every robot records into this folder.
    pub record: Option<PathBuf>,
    /// Every robot is a node of ROS 2 in this domain.
    pub ros2: Option<u32>,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            robots: 1,
            speed: 8.0,
            seed: 1,
            world: None,
            vehicles: Vec::new(),
            starts: Vec::new(),
            pty: None,
            fixes: FixTruth::default(),
            record: None,
            ros2: None,
        }
    }
}

/// A running fleet and a client.
pub struct Fleet {
    /// The robots and their world.
    pub simulator: Simulator,
    /// The client's session.
    pub bus: Bus,
    keys: FleetKeys,
    pilots: AsyncMutex<BTreeMap<usize, Arc<Pilot>>>,
}

impl Fleet {
    /// Starts it and waits until all robots are alive.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn start(setup: Setup) -> Self {
        let pose = |&(x_m, y_m, yaw_rad): &(f64, f64, f64)| MapPose { x_m, y_m, yaw_rad };
        let plan = SimulationPlan {
            fixes: setup.fixes.clone(),
            fleet: name("lab"),
            robots: setup.robots,
            first: 1,
            fleet_size: None,
            world: setup.world,
            vehicles: setup.vehicles,
            starts: setup.starts.iter().map(pose).collect(),
            seed: setup.seed,
            speed: setup.speed,
            listen: "tcp/127.0.0.1:0".into(),
            connect: Vec::new(),
            pki: None,
            identity: None,
            pty: setup.pty,
            board: None,
            truth_log: None,
            record: setup.record,
            ros2: setup.ros2,
        };
        let simulator = Simulator::start(plan).await.unwrap_or_else(|failure| panic!("{failure}"));
        let robots = simulator.roster().robots.len();
        let moved = || async { (simulator.truth().latest().robots.len() == robots).then_some(()) };
        eventually("the world's first turn", moved).await;
        let role = SessionRole::Client { connect: vec![simulator.endpoint().to_owned()] };
        let bus = xtb_bus::open(&role).await.unwrap_or_else(|error| panic!("{error}"));
        Self { simulator, bus, keys: FleetKeys::new(name("lab")), pilots: AsyncMutex::default() }
    }

    /// Keys of `xtb-<number>`.
    #[must_use]
    pub fn robot(&self, number: usize) -> RobotKeys {
        self.keys.robot(&robot_name(number))
    }

    /// Keys of any robot.
    #[must_use]
    pub fn any_robot(&self) -> RobotKeys {
        self.keys.any_robot()
    }

    /// The client `test` of a robot.
    pub async fn pilot(&self, number: usize) -> Arc<Pilot> {
        let mut pilots = self.pilots.lock().await;
        if let Some(pilot) = pilots.get(&number) {
            return pilot.clone();
        }
        let pilot = Arc::new(Pilot::new(&self.bus, "lab", robot_name(number).as_str(), "test").await);
        pilots.insert(number, pilot.clone());
        pilot
    }

    /// Asks a robot until it answers, with the lease where one is needed.
    ///
    /// # Panics
    /// If Zenoh fails, or nobody answers in time.
    pub async fn ask(&self, number: usize, body: Body) -> Outcome {
        self.pilot(number).await.ask(body).await
    }

    /// Sends a goal, which must be accepted. Its policy is `finish`: at eight times real time, a busy
    /// machine could take a client for a silent one.
    ///
    /// # Panics
    /// If it is refused.
    pub async fn goto(&self, number: usize, x_m: f64, y_m: f64) -> Uuid {
        let body = Body::Goto {
            x_m,
            y_m,
            yaw_rad: None,
            via: Some(Via::Direct),
            on_link_loss: LinkLoss::Finish,
            finish_s: 300.0,
        };
        let mut outcome = self.ask(number, body.clone()).await;
        // A busy computer can have held up a line before.
        let held_up = |error: &ErrorBody| HELD_UP_LATCHES.iter().any(|latch| error.message.contains(latch));
        if matches!(&outcome, Outcome::Error(error) if held_up(error)) {
            self.ask(number, Body::Reset { latch: None }).await;
            outcome = self.ask(number, body).await;
        }
        match outcome {
            Outcome::Ok(Done { goal: Some(goal), .. }) => goal,
            other => panic!("the goal was not accepted: {other:?}"),
        }
    }

    /// A robot's state, asked for now.
    ///
    /// # Panics
    /// If nobody answers in time.
    pub async fn state(&self, number: usize) -> RobotState {
        let keys = self.robot(number);
        eventually("a state", || async {
            let answers = self.bus.get(&keys.state(), ASK_WITHIN).await;
            answers.unwrap_or_else(|error| panic!("{error}")).first().and_then(|answer| answer.decode().ok())
        })
        .await
    }

    /// Waits until a robot's state satisfies `is`.
    ///
    /// # Panics
    /// If it does not in time.
    pub async fn until(&self, number: usize, what: &str, is: impl Fn(&RobotState) -> bool) -> RobotState {
        eventually(what, || async { Some(self.state(number).await).filter(|state| is(state)) }).await
    }

    /// Waits until this goal has ended.
    ///
    /// # Panics
    /// If it does not in time, or another goal has taken its place.
    pub async fn outcome(&self, number: usize, id: Uuid) -> GoalStatus {
        let ended = |state: &RobotState| {
            // The reply to its request may come before the first state that has it.
            let Some(goal) = &state.goal else { return false };
            let over = state.ended_goals.iter().any(|ended| ended.id == id);
            assert!(!over, "another goal has taken its place");
            goal.id == id && goal.status.is_final()
        };
        let state = self.until(number, "the goal's end", ended).await;
        state.goal.map_or(GoalStatus::Failed, |goal| goal.status)
    }

    /// Drives the robot to a point. On a busy computer a control loop, or a line, can be held up for so long that the
    /// robot rightly ends its goal: then it is sent again, a few times.
    ///
    /// # Panics
    /// If it does not get there, or ends its goal for another reason.
    pub async fn reaches(&self, number: usize, x_m: f64, y_m: f64) {
        for _ in 0..5 {
            let goal = self.goto(number, x_m, y_m).await;
            if self.outcome(number, goal).await == GoalStatus::Reached {
                return;
            }
            let reason = self.state(number).await.goal.and_then(|goal| goal.reason).unwrap_or_default();
            assert!(HELD_UP.iter().any(|held_up| reason.contains(held_up)), "{reason}");
            self.ask(number, Body::Reset { latch: None }).await;
        }
        panic!("this computer is too busy: xtb-{number} was held up each time");
    }

    /// Sends a setpoint with the lease.
    ///
    /// # Panics
    /// If Zenoh fails or the lease is refused.
    pub async fn setpoint(&self, number: usize, rpm: f64, steering: f64) {
        self.pilot(number).await.setpoint(rpm, steering).await;
    }

    /// Where a truck really is.
    ///
    /// # Panics
    /// If there is no such truck.
    #[must_use]
    pub fn truth(&self, number: usize) -> TruthRobot {
        let truth = self.simulator.truth().latest();
        *truth.robots.get(&robot_name(number)).unwrap_or_else(|| panic!("no truck {number}"))
    }

    /// Simulated time in s.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.simulator.truth().latest().t_s
    }

    /// Waits for simulated time to pass.
    pub async fn simulated(&self, seconds: f64) {
        let until = self.time_s() + seconds;
        eventually("simulated time", || async { (self.time_s() >= until).then_some(()) }).await;
    }

    /// Who is alive.
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn alive(&self) -> Vec<String> {
        let keys = self.bus.alive(&self.any_robot().alive(), ASK_WITHIN).await;
        keys.unwrap_or_else(|error| panic!("{error}"))
    }

    /// Collects a robot's events from now on (and its last ones).
    ///
    /// # Panics
    /// If Zenoh fails.
    pub async fn events(&self, number: usize) -> Events {
        let found = Arc::<Mutex<Vec<Event>>>::default();
        let list = found.clone();
        let subscription = self
            .bus
            .subscribe_events(&self.robot(number).event(), move |incoming| {
                if let Ok(event) = incoming.decode::<Event>() {
                    list.lock().unwrap_or_else(PoisonError::into_inner).push(event);
                }
            })
            .await;
        Events { found, _subscription: subscription.unwrap_or_else(|error| panic!("{error}")) }
    }

    /// Ends everything.
    pub async fn end(self) {
        self.bus.close().await;
        self.simulator.stop().await;
    }
}

fn robot_name(number: usize) -> Name {
    name(&format!("xtb-{number}"))
}

/// Events as they came in.
pub struct Events {
    found: Arc<Mutex<Vec<Event>>>,
    _subscription: Subscription,
}

impl Events {
    /// How often a goal was reported with this status.
    #[must_use]
    pub fn count(&self, goal: Uuid, wanted: GoalStatus) -> usize {
        let found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let is = |kind: &EventKind| matches!(kind, EventKind::Goal { id, status, .. } if *id == goal && *status == wanted);
        found.iter().filter(|event| is(&event.kind)).count()
    }
}
