//! A truck's agent as a process: the [`Robot`] with its mailbox, its clock, and what befalls it.
//!
//! The mailbox does what `robot-agent`'s does: requests wait in a bounded queue, eight a turn are answered,
//! stops are numbers that overtake, setpoints pass admission and wait in one place, the latest wins.

use crate::change::Sender;
use crate::time::{MS_PER_TURN, Turn};
use std::collections::VecDeque;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::units::Stamp;
use xtb_protocol::board::Frame;
use xtb_protocol::messages::{
    Body, EventKind, Latch, Lease, RejectCode, Rejected, Reply, Request, RobotState, Setpoint,
};
use xtb_protocol::{Name, Uuid};
use xtb_robot::agent::Arrival;
use xtb_robot::authority::admission::Admission;
use xtb_robot::line::PortTrouble;
use xtb_robot::{Guards, Robot, RobotIdentity};
use xtb_sim::vehicle::Truck;

/// As in `robot-agent`: requests that wait, and those answered in a turn.
const REQUESTS: usize = 64;
const REQUESTS_A_TURN: usize = 8;
/// As in `robot-agent`: emergency stops between two turns.
const ESTOPS: usize = 64;
const SNAPSHOT_MS: u64 = 50;

/// What an agent tells the world in a turn.
#[derive(Debug, Clone)]
pub(crate) enum Told {
    Reply { to: Sender, arrival: Arrival, request: Request, reply: Reply },
    Estopped { to: Sender, id: Uuid, latched: bool },
    Event(EventKind),
    State(Box<RobotState>),
}

#[derive(Debug, Clone)]
struct Job {
    arrival: Arrival,
    by: Sender,
    request: Request,
}

#[derive(Debug, Clone)]
struct Waiting {
    at: Stamp,
    arrival: Arrival,
    by: Sender,
    setpoint: Setpoint,
}

#[derive(Debug, Clone)]
struct EstopCall {
    arrival: Arrival,
    by: Sender,
    id: Uuid,
    /// Whether an acknowledgement is wanted.
    asked: bool,
}

#[derive(Debug, Clone, Default)]
struct Mailbox {
    latest: Arrival,
    stop: Arrival,
    requests: VecDeque<Job>,
    setpoint: Option<Waiting>,
    estops: VecDeque<EstopCall>,
    /// Whose messages come in, under which grant, and when that one was heard.
    admission: Admission,
    grant: Option<Lease>,
    heard: Option<(Lease, Stamp)>,
    rejected: Rejected,
}

impl Mailbox {
    fn next(&mut self) -> Arrival {
        self.latest += 1;
        self.latest
    }

    /// A request came in: if it bears the present lease, the holder lives.
    fn hears(&mut self, at: Stamp, client: &Name, lease: Option<Lease>) {
        if let Some(lease) = lease.filter(|_| self.admission.admits(client, lease)) {
            self.heard = Some((lease, at));
        }
    }
}

/// One truck's agent, dead or alive.
#[derive(Debug)]
pub(crate) struct Process {
    fleet: Name,
    identity_seed: u64,
    vehicle: VehicleConfig,
    robot: Option<Robot>,
    boots: u64,
    boot_at: Turn,
    held_until: Turn,
    stuck_until: Turn,
    guards: Guards,
    ahead_ms: i64,
    booted_ms: u64,
    shown: Stamp,
    plugged: [bool; 2],
    mailbox: Mailbox,
    next_snapshot: Stamp,
    /// Its time in the present turn, if it has one, and the frame for the board.
    turn_at: Option<Stamp>,
    frame: Option<Frame>,
    bytes: Vec<u8>,
}

impl Process {
    /// Not running yet; it boots at the first turn.
    pub(crate) fn new(fleet: &Name, vehicle: &VehicleConfig, identity_seed: u64, guards: Guards) -> Self {
        Self {
            fleet: fleet.clone(),
            identity_seed,
            vehicle: vehicle.clone(),
            robot: None,
            boots: 0,
            boot_at: 0,
            held_until: 0,
            stuck_until: 0,
            guards,
            ahead_ms: 0,
            booted_ms: 0,
            shown: Stamp::ZERO,
            plugged: [true; 2],
            mailbox: Mailbox::default(),
            next_snapshot: Stamp::ZERO,
            turn_at: None,
            frame: None,
            bytes: Vec::with_capacity(4096),
        }
    }

    pub(crate) fn runs(&self) -> bool {
        self.robot.is_some()
    }

    /// What its controller commands, −1..=1.
    pub(crate) fn steering(&self) -> f64 {
        self.robot.as_ref().map_or(0.0, |robot| robot.outputs().steering)
    }

    /// Random at each boot, below 2^53.
    pub(crate) fn epoch(&self) -> u64 {
        (self.identity_seed.wrapping_add(self.boots).wrapping_mul(0x9E37_79B9_7F4A_7C15)) >> 12
    }

    pub(crate) fn kill(&mut self, boot_at: Turn) {
        (self.robot, self.boot_at) = (None, boot_at);
        self.mailbox = Mailbox::default();
    }

    pub(crate) fn hold(&mut self, until: Turn) {
        self.held_until = self.held_until.max(until);
    }

    pub(crate) fn jump_clock(&mut self, ms: i64) {
        self.ahead_ms += ms;
    }

    pub(crate) fn stick_clock(&mut self, until: Turn) {
        self.stuck_until = until;
    }

    pub(crate) fn plug(&mut self, board: bool, plugged: bool) {
        self.plugged[usize::from(!board)] = plugged;
    }

    /// The agent's own clock.
    pub(crate) fn clock(&self, now: Turn) -> Stamp {
        let ms = (u64::from(now) * MS_PER_TURN - self.booted_ms).saturating_add_signed(self.ahead_ms);
        if now < self.stuck_until { self.shown } else { Stamp::from_ms(ms) }
    }

    /// A request arrives. A refusal at once, if the queue is full.
    pub(crate) fn ask(&mut self, now: Turn, by: Sender, name: &Name, request: Request) -> Option<Reply> {
        let (at, arrival) = (self.clock(now), self.mailbox.next());
        self.mailbox.hears(at, name, request.lease);
        if matches!(request.body, Body::Stop {}) {
            self.mailbox.stop = arrival;
        }
        if self.mailbox.requests.len() == REQUESTS {
            self.mailbox.rejected.overloaded += 1;
            return Some(Reply::refused(request.id, RejectCode::Overloaded, "", ""));
        }
        self.mailbox.requests.push_back(Job { arrival, by, request });
        None
    }

    /// A setpoint arrives.
    pub(crate) fn setpoint(&mut self, now: Turn, by: Sender, name: &Name, setpoint: Setpoint) {
        let at = self.clock(now);
        if !self.mailbox.admission.admits(name, setpoint.lease) {
            self.mailbox.rejected.fenced += 1;
            return;
        }
        let arrival = self.mailbox.next();
        let newer = |old: &Waiting| old.setpoint.lease == setpoint.lease && old.setpoint.seq > setpoint.seq;
        let late = self.mailbox.setpoint.as_ref().is_some_and(newer);
        let new = Waiting { at, arrival, by, setpoint };
        if late || self.mailbox.setpoint.replace(new).is_some() {
            self.mailbox.rejected.setpoints_overwritten += 1;
        }
    }

    /// An emergency stop arrives. One more than there is room for takes the place of the newest.
    pub(crate) fn estop(&mut self, by: Sender, id: Uuid, asked: bool) {
        let arrival = self.mailbox.next();
        if self.mailbox.estops.len() == ESTOPS {
            self.mailbox.estops.pop_back();
        }
        self.mailbox.estops.push_back(EstopCall { arrival, by, id, asked });
    }

    /// The number of the latest message that has come in.
    pub(crate) fn latest(&self) -> Arrival {
        self.mailbox.latest
    }

    /// Boots the agent when its time has come. True if it does now.
    pub(crate) fn boot(&mut self, now: Turn, truck: &mut Truck) -> bool {
        if self.robot.is_some() || now < self.boot_at {
            return false;
        }
        let Ok(name) = Name::robot(truck.name()) else { return false };
        // Who opens a port finds nothing in it from before.
        truck.take_board_tx(&mut self.bytes);
        truck.take_gyro_tx(&mut self.bytes);
        let truth = truck.truth();
        self.boots += 1;
        self.booted_ms = u64::from(now) * MS_PER_TURN;
        (self.ahead_ms, self.shown, self.next_snapshot) = (0, Stamp::ZERO, Stamp::ZERO);
        (self.held_until, self.stuck_until) = (now, now);
        let identity = RobotIdentity {
            fleet: self.fleet.clone(),
            robot: name,
            epoch: self.epoch(),
            start_pose: MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad },
        };
        let robot = Robot::new(identity, self.vehicle.clone(), "days");
        self.mailbox = Mailbox { admission: robot.agent().admission(), ..Mailbox::default() };
        self.robot = Some(robot.with_guards(self.guards));
        true
    }

    /// A turn begins, unless the process is dead or held up: what the truck has sent. [`Process::turn`] and
    /// [`Process::speak`] are its other parts.
    pub(crate) fn listen(&mut self, now: Turn, truck: &mut Truck) {
        let at = self.clock(now);
        self.turn_at = (self.robot.is_some() && now >= self.held_until).then_some(at);
        let Some((at, robot)) = self.turn_at.zip(self.robot.as_mut()) else { return };
        self.shown = at;
        listen(robot, truck, at, self.plugged, &mut self.bytes);
    }

    /// Whether it has the present turn.
    pub(crate) fn has_turn(&self) -> bool {
        self.turn_at.is_some()
    }

    /// What clients want, then the robot's turn.
    pub(crate) fn turn(&mut self, link_up: bool, names: &[Name], told: &mut Vec<Told>) {
        let Some((at, robot)) = self.turn_at.zip(self.robot.as_mut()) else { return };
        self.mailbox.take_orders(robot, at, link_up, names, told);
        self.frame = robot.turn(at);
    }

    /// What it sends to its truck, and tells the world.
    pub(crate) fn speak(&mut self, truck: &mut Truck, told: &mut Vec<Told>) {
        let Some((at, robot)) = self.turn_at.zip(self.robot.as_mut()) else { return };
        speak(robot, truck, at, self.plugged, self.frame.take());
        if at >= self.next_snapshot || robot.agent().has_events() {
            self.next_snapshot = at.plus_ms(SNAPSHOT_MS);
            let state = robot.state(at, self.mailbox.rejected);
            told.push(Told::State(Box::new(state)));
        }
        while let Some(event) = robot.agent_mut().next_event() {
            told.push(Told::Event(event.kind));
        }
    }
}

impl Mailbox {
    /// Stops first, then requests in their order, then the setpoint.
    fn take_orders(&mut self, robot: &mut Robot, now: Stamp, up: bool, names: &[Name], told: &mut Vec<Told>) {
        while let Some(EstopCall { arrival, by, id, asked }) = self.estops.pop_front() {
            robot.agent_mut().estop(now, arrival, &names[usize::from(by.name)], id);
            if asked {
                told.push(Told::Estopped { to: by, id, latched: robot.agent().is_latched(Latch::Estop) });
            }
        }
        if let Some((lease, at)) = self.heard.take() {
            robot.agent_mut().heard(at, lease);
        }
        robot.agent_mut().set_link(up);
        robot.agent_mut().stop(now, self.stop);
        for _ in 0..REQUESTS_A_TURN {
            let Some(Job { arrival, by, request }) = self.requests.pop_front() else { break };
            let reply = robot.request(now, arrival, &names[usize::from(by.name)], &request);
            told.push(Told::Reply { to: by, arrival, request, reply });
        }
        if let Some(Waiting { at, arrival, by, setpoint }) = self.setpoint.take() {
            robot.agent_mut().setpoint(now, at, arrival, &names[usize::from(by.name)], &setpoint);
        }
        let grant = robot.agent().lease().present();
        if self.grant != grant || self.admission == Admission::Anyone {
            (self.admission, self.grant) = (robot.agent().admission(), grant);
        }
    }
}

const UNPLUGGED: (PortTrouble, &str) = (PortTrouble::Unplugged, "no such device");

fn listen(robot: &mut Robot, truck: &mut Truck, now: Stamp, plugged: [bool; 2], bytes: &mut Vec<u8>) {
    bytes.clear();
    truck.take_board_tx(bytes);
    robot.board_port(now, (!plugged[0]).then_some(UNPLUGGED));
    if plugged[0] {
        robot.board_bytes(now, bytes);
    }
    bytes.clear();
    truck.take_gyro_tx(bytes);
    robot.gyro_port(now, (!plugged[1]).then_some(UNPLUGGED));
    if plugged[1] {
        robot.gyro_bytes(now, bytes);
    }
}

fn speak(robot: &mut Robot, truck: &mut Truck, now: Stamp, plugged: [bool; 2], frame: Option<Frame>) {
    if let Some(frame) = frame
        && plugged[0]
    {
        truck.board_rx(frame.as_bytes());
    }
    while let Some(frame) = robot.board_request(now) {
        if !plugged[0] {
            break; // what was lost is asked for again
        }
        truck.board_rx(frame.as_bytes());
    }
    if let Some(command) = robot.gyro_request(now)
        && plugged[1]
    {
        truck.gyro_rx(command);
    }
}
