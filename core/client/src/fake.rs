//! A robot that a test plays in the client's own session: it knows the rules of lease, latch and
//! emergency stop, and says what the test wants of everything else.

mod dispatcher;

pub use dispatcher::{FakeDispatcher, FakeDispatcherState};

use crate::client::Client;
use crate::settings::Settings;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use xtb_bus::{Question, Service, SessionRole};
use xtb_control::frames::MapPose;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, Key};
use xtb_protocol::messages::{
    About, BatteryLevel, Body, Done, Estop, Estopped, GoalKind, GoalState, GoalStatus, InputAges, Latch,
    LatchState, Lease, LeaseState, Limits, LinkLoss, NavState, ObstacleView, ParameterInfo, PoseSource,
    PoseState, RejectCode, Rejected, Reply, Request, RobotState, Sensors, TaskId, TaskKind, TaskSpec,
    TaskState, TaskView, TiltState, Via, Waypoint,
};
use xtb_protocol::{Name, Uuid};

/// Somebody who says yes to every command, whichever robot is meant.
pub async fn yes_man(client: &Client) -> Service {
    let (runtime, robots) = (tokio::runtime::Handle::current(), client.keys().clone());
    let each = move |question: Question| {
        let (robot, client) = (question.key().robot.clone().unwrap(), question.client().cloned().unwrap());
        let key = robots.robot(&robot).cmd(Some(&client));
        runtime.spawn(async move {
            let (request, format) = question.decode::<Request>().unwrap();
            question.reply(&key, &Reply::done(request.id, Done::default()), format).await.unwrap();
        });
    };
    client.bus().serve(&client.keys().any_robot().cmd(None), each).await.unwrap()
}

const PUBLISH_EVERY: Duration = Duration::from_millis(20);

pub fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

/// A robot that stands, in boot 7, with nothing wrong.
pub fn state(robot: &str) -> RobotState {
    RobotState {
        robot: name(robot),
        epoch: 7,
        seq: 0,
        tick_ms: 0,
        mode: xtb_control::Mode::Idle,
        lease: None,
        pose: PoseState {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: 0.0,
            source: PoseSource::Odometry,
            age_ms: Some(10),
            sigma_m: 0.02,
            sigma_yaw_rad: 0.01,
            fix_age_ms: None,
            odometry_scale: None,
            odometry_scale_sigma: None,
            fix_delay_ms: None,
        },
        speed_mps: Some(0.0),
        reference_rpm: 0.0,
        steering: 0.0,
        obstacle: ObstacleView { front: Some(false), rear: Some(false) },
        tilt_deg: TiltState::default(),
        battery_v: Some(7.4),
        battery_level: BatteryLevel::Ok,
        goal: None,
        ended_goals: Vec::new(),
        faults: Vec::new(),
        latches: Vec::new(),
        nav: NavState::default(),
        stopped_because: Vec::new(),
        stopped_age_ms: None,
        input_age_ms: InputAges {
            gyro: Some(10),
            encoder: Some(20),
            adc: Some(15),
            remote: None,
            setpoint: None,
        },
        turn_late_us: 0,
        turns_late: 0,
        rejected: Rejected::default(),
    }
}

/// A goal of client `me`.
pub fn goal(id: Uuid, status: GoalStatus) -> GoalState {
    GoalState {
        id,
        kind: GoalKind::Goto,
        x_m: Some(1.0),
        y_m: Some(2.0),
        yaw_rad: None,
        via: Some(Via::Direct),
        status,
        distance_m: Some(1.5),
        age_ms: 0,
        reason: None,
        by: name("me"),
        on_link_loss: LinkLoss::Halt,
    }
}

pub fn latch(latch: Latch, by: &str, present: bool) -> LatchState {
    LatchState { latch, age_ms: 12_000, by: by.into(), present }
}

pub fn about(robot: &str, hash: &str) -> About {
    About {
        robot: name(robot),
        fleet: name("lab"),
        version: env!("CARGO_PKG_VERSION").into(),
        epoch: 7,
        hardware: "serial".into(),
        start_pose: MapPose::default(),
        limits: Limits {
            max_rpm: 30.0,
            admitted_mps: 1.0,
            setpoint_lifetime_ms: 200,
            max_coordinate_m: 1000.0,
        },
        capabilities: Vec::new(),
        vehicle_hash: hash.into(),
        vehicle: vec![ParameterInfo::speaks()],
    }
}

/// Samples in which nothing is seen and nothing moves.
#[must_use]
pub fn sensors(robot: &str) -> Sensors {
    Sensors {
        robot: name(robot),
        tick_ms: 0,
        gyro_yaw: 0,
        encoder_pulses: 0,
        ir_front: vec![0; 6],
        ir_rear: vec![0; 6],
        ir_front_cm: vec![None; 6],
        ir_rear_cm: vec![None; 6],
        tilt: Some([0.0; 2]),
        pistons: Some([0.0; 4]),
        pistons_m: Some([0.0; 4]),
        remote: Some([None; 3]),
        gyro_firmware: None,
        board_firmware: None,
        rpm: 0.0,
        motor_counts: 0,
        steer_front_counts: 0,
        steer_rear_counts: Some(0),
        bumper_counts: [0; 2],
        piston_counts: Some([0; 4]),
    }
}

/// What the robot is, and what it was asked.
#[derive(Debug)]
pub struct Fake {
    pub state: RobotState,
    pub lease: Option<(Name, Lease)>,
    root: u32,
    /// The acquire that was granted last: asked again it gets the same lease.
    granted: Option<(Uuid, Lease)>,
    pub asked: Vec<(Name, Body)>,
    /// Whether it carries goals out at all.
    pub mute: bool,
    /// Whether it says yes to a stop and drives on.
    pub stubborn: bool,
}

impl Fake {
    fn reply(&mut self, client: &Name, request: &Request) -> Option<Reply> {
        if !matches!(request.body, Body::Retain {}) {
            self.asked.push((client.clone(), request.body.clone()));
        }
        if self.mute {
            return None;
        }
        let refuse = |code, message: String| Some(Reply::refused(request.id, code, message, "what to do"));
        let done = |done| Some(Reply::done(request.id, done));
        let ours = self.lease.as_ref().is_some_and(|(holder, lease)| {
            holder == client && request.lease.is_some_and(|given| given == *lease)
        });
        match &request.body {
            Body::Acquire { .. } if self.granted.is_some_and(|(id, _)| id == request.id) => {
                let lease = self.granted.map(|(_, lease)| lease);
                done(Done { lease, goal: None })
            }
            Body::Acquire { take } => {
                let other = self.lease.as_ref().filter(|(holder, _)| holder != client);
                if let Some((holder, _)) = other.filter(|_| !take) {
                    return refuse(RejectCode::LeaseHeld, format!("controlled by {holder}"));
                }
                let lease = self.grant(client);
                self.granted = Some((request.id, lease));
                done(Done { lease: Some(lease), goal: None })
            }
            Body::Stop {} => {
                let goal = self.state.goal.as_mut().filter(|goal| !goal.status.is_final() && !self.stubborn);
                goal.into_iter().for_each(|goal| goal.status = GoalStatus::Cancelled);
                done(Done::default())
            }
            _ if request.lease.is_none() => refuse(RejectCode::LeaseRequired, "a lease is needed".into()),
            _ if !ours => refuse(RejectCode::LeaseLost, format!("{client} no longer has control")),
            Body::Retain {} => done(Done::default()),
            Body::Release {} => {
                self.release();
                done(Done::default())
            }
            Body::Withdraw { .. } => done(Done::default()),
            Body::Goto { .. } | Body::Wander { .. } | Body::Assign { .. } => {
                if let Some(latch) = self.state.latches.first() {
                    return refuse(RejectCode::Latched, format!("{} is latched", latch.latch));
                }
                let id = match &request.body {
                    Body::Assign { assignment, .. } => assignment.goal_id(),
                    _ => request.id,
                };
                self.state.goal = Some(goal(id, GoalStatus::Running));
                done(Done { lease: None, goal: Some(id) })
            }
            Body::Cancel { .. } => match &mut self.state.goal {
                Some(goal) if !goal.status.is_final() => {
                    goal.status = GoalStatus::Cancelled;
                    done(Done::default())
                }
                _ => refuse(RejectCode::UnknownGoal, "no such goal is running".into()),
            },
            Body::Reset { latch } => {
                let asked = |set: &LatchState| latch.is_none_or(|latch| latch == set.latch);
                self.state.latches.retain(|set| !asked(set) || set.present);
                match self.state.latches.iter().find(|set| asked(set)) {
                    None => done(Done::default()),
                    Some(left) => refuse(
                        RejectCode::CausePresent,
                        format!("{}: {} is still present", left.latch, left.by),
                    ),
                }
            }
            Body::SetPose { .. } => done(Done::default()),
        }
    }

    /// Grants control to a client, whoever had it.
    pub fn grant(&mut self, client: &Name) -> Lease {
        self.root += 1;
        let lease = Lease { epoch: self.state.epoch, root: self.root };
        self.lease = Some((client.clone(), lease));
        self.state.lease = Some(LeaseState { holder: client.clone(), age_ms: 3 });
        lease
    }

    fn release(&mut self) {
        self.lease = None;
        self.state.lease = None;
    }

    fn estop(&mut self, by: &Name) -> bool {
        if !self.mute && !self.state.latches.iter().any(|set| set.latch == Latch::Estop) {
            self.state.latches.push(latch(Latch::Estop, by.as_str(), false));
        }
        !self.mute
    }
}

/// The robot, for as long as it is held.
pub struct FakeRobot {
    fake: Arc<Mutex<Fake>>,
    _services: Vec<Service>,
    tasks: Vec<tokio::task::JoinHandle<()>>,
    _alive: xtb_bus::PresenceToken,
}

impl FakeRobot {
    pub async fn start(client: &Client, robot: &str) -> Self {
        let keys = client.keys().robot(&name(robot));
        let bus = client.bus();
        let fake = Fake {
            state: state(robot),
            lease: None,
            root: 0,
            granted: None,
            asked: Vec::new(),
            mute: false,
            stubborn: false,
        };
        let fake = Arc::new(Mutex::new(fake));
        let (sender, questions) = mpsc::unbounded_channel::<Question>();
        let mut services = Vec::new();
        for key in [keys.cmd(None), keys.estop(None), keys.state(), keys.about()] {
            let sender = sender.clone();
            let each = move |question| sender.send(question).unwrap_or_default();
            services.push(bus.serve(&key, each).await.unwrap());
        }
        let answering =
            tokio::spawn(answer(Arc::clone(&fake), keys.clone(), about(robot, "00c0ffee"), questions));
        let publisher =
            bus.publisher::<RobotState>(&keys.state(), &Channel::State, Format::Postcard).await.unwrap();
        let shown = Arc::clone(&fake);
        let began = Instant::now();
        let publishing = tokio::spawn(async move {
            let mut tick = tokio::time::interval(PUBLISH_EVERY);
            loop {
                tick.tick().await;
                let state = {
                    let mut fake = shown.lock().unwrap();
                    fake.state.seq += 1;
                    fake.state.tick_ms = u64::try_from(began.elapsed().as_millis()).unwrap();
                    fake.state.clone()
                };
                publisher.put(&state).await.unwrap();
            }
        });
        let _alive = bus.declare_alive(&keys.alive()).await.unwrap();
        Self { fake, _services: services, tasks: vec![answering, publishing], _alive }
    }

    pub fn lock(&self) -> MutexGuard<'_, Fake> {
        self.fake.lock().unwrap()
    }

    /// Once what a test waits for is so.
    pub async fn until(&self, so: impl Fn(&Fake) -> bool) {
        let mut look = tokio::time::interval(Duration::from_millis(5));
        while !so(&self.lock()) {
            look.tick().await;
        }
    }
}

impl Drop for FakeRobot {
    fn drop(&mut self) {
        self.tasks.iter().for_each(tokio::task::JoinHandle::abort);
    }
}

async fn answer(
    fake: Arc<Mutex<Fake>>,
    keys: xtb_protocol::keys::RobotKeys,
    about: About,
    mut questions: mpsc::UnboundedReceiver<Question>,
) {
    while let Some(question) = questions.recv().await {
        let channel = question.key().channel.clone();
        let client = channel.client().cloned().unwrap_or_else(|| name("nobody"));
        if channel == Channel::State {
            let state = fake.lock().unwrap().state.clone();
            question.reply(&keys.state(), &state, Format::Postcard).await.unwrap();
        } else if channel == Channel::About {
            question.reply(&keys.about(), &about, Format::Postcard).await.unwrap();
        } else if matches!(channel, Channel::Estop(_)) {
            let (Estop { .. }, format) = question.decode().unwrap();
            let robot = Key::parse(&keys.state()).unwrap().robot.unwrap();
            if fake.lock().unwrap().estop(&client) {
                let reply = Estopped { robot, latched: true };
                question.reply(&keys.estop(Some(&client)), &reply, format).await.unwrap();
            }
        } else {
            let (request, format) = question.decode::<Request>().unwrap();
            let reply = fake.lock().unwrap().reply(&client, &request);
            if let Some(reply) = reply {
                question.reply(&keys.cmd(Some(&client)), &reply, format).await.unwrap();
            }
        }
    }
}

/// A task of client `me` that is to drive to (1, 2), since 1 s, in its third.
pub fn task(number: u64, state: TaskState) -> TaskView {
    let to = Waypoint { x_m: 1.0, y_m: 2.0, yaw_rad: None };
    let on = matches!(state, TaskState::Queued | TaskState::Paused);
    TaskView {
        id: TaskId::new(number),
        state,
        since_ms: 2000,
        reason: None,
        robot: (!on).then(|| name("xtb-1")),
        map: None,
        legs_done: u32::from(state == TaskState::Done),
        legs: Some(1),
        failures: 0,
        by: name("me"),
        submitted_ms: 1000,
        spec: TaskSpec::new(TaskKind::Goto { to }),
    }
}

impl Client {
    /// A client `me` of fleet `lab` on a session of its own, in which a test plays the robots.
    pub async fn alone(timeout: Duration) -> Self {
        let own = |text: &str| Name::new(text).unwrap();
        let settings = Settings {
            connect: Vec::new(),
            identity: None,
            fleet: own("lab"),
            client: own("me"),
            timeout,
            robots: Vec::new(),
            aliases: Default::default(),
        };
        let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
        Self::on(&settings, xtb_bus::open(&role).await.unwrap())
    }

    /// Another session of the same fleet, connected to this one.
    pub async fn another(&self) -> Self {
        let role = SessionRole::Client { connect: self.bus().locators().await };
        Self::on(self.settings(), xtb_bus::open(&role).await.unwrap())
    }
}
