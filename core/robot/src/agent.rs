//! The robot's brain: arbitration, lease, latched stops and the goal's life.
//!
//! ```text
//!   estop, stop ─► latch, neutral ──────────────────────────┐   (overtake every queue)
//!   request ─────► idempotency ► lease ► latches ► goal ────┤
//!   setpoint ────► lease ► sequence ► echo ► teleop slot ───┼─► turn ──► at most one Command
//!   faults, remote control, link up or down ────────────────┘
//! ```
//!
//! A turn looks at everything that can end motion, then asks the table of [`arbitration`](crate::authority::arbitration) who
//! writes the motor. The writer is the controller; the brain only ever hands it a command, and its
//! answer to every doubt is [`Command::Idle`].

mod goals;
mod leases;
mod navigate;
mod next_leg;
mod odometry;
mod params;
mod pose;
mod requests;
mod setpoints;
mod stops;
mod touch;
mod wander_guard;
mod why;

use crate::authority::arbitration::{Facts, MotorWriter, writer};
use crate::authority::assignments::NewestAssignment;
use crate::authority::goal::Goal;
use crate::authority::guard::{Guard, Guards};
use crate::authority::latch::LatchBook;
use crate::authority::lease::{LEASE_FREE_MS, LINK_LOSS_MS, LeaseBook};
use crate::authority::replies::ReplyBook;
use crate::faults::{FaultBook, stops};
use next_leg::NextLeg;
use odometry::OdometryScale;
use setpoints::Teleop;
use std::collections::VecDeque;
use wander_guard::WanderGuard;
use xtb_control::controller::Mode;
use xtb_control::frames::MapPose;
use xtb_control::units::PWM_COUNT_US;
use xtb_control::{Command, Outputs, Stamp, VehicleConfig};
use xtb_nav::NavSettings;
use xtb_nav::localization::PoseFilter;
use xtb_nav::navigator::Navigator;
use xtb_protocol::messages::{Event, EventKind, Fault, GoalEnd, GoalStatus, InputAges, Latch, StopReason};
use xtb_protocol::{Name, Uuid};

/// Events that wait for the uplink, as many as late joiners get (docs/protocol.md); the oldest is dropped and
/// counted when full.
pub const EVENT_QUEUE: usize = 64;
/// Ends of earlier goals that stay readable, a few, as each is in every state; chosen, not measured.
pub const ENDED_GOALS: usize = 8;

/// A speed stick this near to neutral does not move the truck, in counts: the ESC's dead band of ± 30 µs,
/// assumed.
pub(crate) const STICK_NEUTRAL_COUNTS: f64 = 30.0 / PWM_COUNT_US;

/// Who a robot is, fixed at boot.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotIdentity {
    /// Its fleet.
    pub fleet: Name,
    /// Its name.
    pub robot: Name,
    /// Random at boot, below 2^53.
    pub epoch: u64,
    /// Where it stands at boot.
    pub start_pose: MapPose,
}

/// How long clients may take, on the robot's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ClientLimits {
    link_loss_ms: u64,
    lease_free_ms: u64,
    echo_ms: u64,
}

/// What a turn can see.
#[derive(Debug, Clone, Copy)]
pub struct TurnView<'a> {
    /// The controller's last outputs.
    pub outputs: &'a Outputs,
    /// Ages of gyro, encoder and converter.
    pub ages: InputAges,
    /// Whether the motor's last pulse was neutral.
    pub neutral: bool,
    /// Whether the transmitter is held back because it drives too fast.
    pub over_speed: bool,
}

/// The place of a message in the order in which messages came in; each has its own.
pub type Arrival = u64;

/// The brain.
#[derive(Debug, Clone)]
pub struct Agent {
    identity: RobotIdentity,
    setpoint_lifetime_ms: u64,
    limits: ClientLimits,
    max_rpm: f64,
    mps_per_rpm: f64,
    filter: PoseFilter,
    odometry_scale: OdometryScale,
    nav: Navigator,
    params: params::Params,
    lead: navigate::Lead,
    guards: Guards,
    lease: LeaseBook,
    latches: LatchBook,
    replies: ReplyBook,
    goal: Option<Goal>,
    assigned: NewestAssignment,
    /// The next leg of the assignment under way: it begins as soon as the present one is passed or reached.
    next_leg: Option<NextLeg>,
    wander_guard: WanderGuard,
    /// When it last looked where the others are.
    wander_looked: Stamp,
    ended: VecDeque<GoalEnd>,
    teleop: Option<Teleop>,
    /// Number of the last setpoint that was accepted under the present grant.
    last_seq: Option<u64>,
    /// Callers and ids of the last emergency stops: none latches twice.
    estops: VecDeque<(Name, Uuid)>,
    /// Whether the switch at the I/O board was pressed when it was last known.
    stop_switch: bool,
    /// For the controller, at the next turn.
    pending: Option<Command>,
    writer: MotorWriter,
    link_up: bool,
    idle_because: StopReason,
    faults: FaultBook,
    /// What wheels that do not turn mean at present.
    stall_alarm: touch::StallAlarm,
    /// Whether board and gyro have both been well since boot: from then on their loss is latched.
    was_well: bool,
    mode: Mode,
    setpoint_heard: Option<Stamp>,
    /// Whether a setpoint has come from the present holder.
    setpoint_seen: bool,
    /// Setpoints are dropped until one is zero, or the first one of a client that comes anew: a joystick that was held
    /// through a stop does not drive on, however many of its messages were lost meanwhile.
    rearm: bool,
    /// A latch that holds the transmitter was set since the last turn, though it may be reset by now.
    stick_to_rest: bool,
    /// The last stop that was carried out: no command from before it may still begin.
    stopped_by: Arrival,
    /// The last request that changed who drives: no setpoint from before it counts.
    commanded_by: Arrival,
    events: VecDeque<Event>,
    event_seq: u64,
    /// Events that fell out of the full queue.
    pub events_dropped: u64,
    /// Requests that were read and refused.
    pub refused: u64,
    /// Setpoints that were too old, repeated, or overtaken.
    pub stale: u64,
    /// Setpoints without the present lease.
    pub fenced: u64,
}

impl Agent {
    /// A robot that has just booted and stands; nothing moves before a new command.
    #[must_use]
    pub fn new(identity: RobotIdentity, vehicle: &VehicleConfig, version: &str) -> Self {
        let mut agent = Self {
            setpoint_lifetime_ms: u64::from(vehicle.teleop.lifetime_ms),
            limits: ClientLimits {
                link_loss_ms: LINK_LOSS_MS,
                lease_free_ms: LEASE_FREE_MS,
                echo_ms: setpoints::ECHO_MS,
            },
            max_rpm: vehicle.teleop.max_rpm,
            mps_per_rpm: vehicle.mps_per_rpm(),
            filter: pose::filter(vehicle, &NavSettings::default(), &identity),
            odometry_scale: OdometryScale::default(),
            nav: Navigator::new(vehicle, &NavSettings::default()),
            params: params::Params::new(vehicle, &NavSettings::default()),
            lead: navigate::Lead::default(),
            guards: Guards::default(),
            lease: LeaseBook::new(identity.epoch),
            latches: LatchBook::default(),
            replies: ReplyBook::default(),
            goal: None,
            assigned: NewestAssignment::default(),
            next_leg: None,
            wander_guard: WanderGuard::default(),
            wander_looked: Stamp::ZERO,
            ended: VecDeque::with_capacity(ENDED_GOALS),
            teleop: None,
            last_seq: None,
            estops: VecDeque::with_capacity(stops::ESTOP_IDS),
            stop_switch: false,
            pending: None,
            writer: MotorWriter::Nobody,
            link_up: false,
            idle_because: StopReason::NoCommand,
            faults: FaultBook::default(),
            stall_alarm: touch::StallAlarm::default(),
            was_well: false,
            mode: Mode::Idle,
            setpoint_heard: None,
            setpoint_seen: false,
            rearm: true,
            stick_to_rest: false,
            stopped_by: 0,
            commanded_by: 0,
            events: VecDeque::with_capacity(EVENT_QUEUE),
            event_seq: 0,
            events_dropped: 0,
            refused: 0,
            stale: 0,
            fenced: 0,
            identity,
        };
        agent.nav.set_name(agent.identity.robot.as_str());
        agent.emit(Stamp::ZERO, EventKind::Started { version: version.to_owned() });
        agent
    }

    /// Other settings of the second level, before its first turn.
    pub fn set_navigation(&mut self, vehicle: &VehicleConfig, settings: &NavSettings) {
        self.filter = pose::filter(vehicle, settings, &self.identity);
        self.nav = Navigator::new(vehicle, settings);
        self.params = params::Params::new(vehicle, settings);
    }

    /// Which rules are in force; see [`Guard`].
    pub fn set_guards(&mut self, guards: Guards) {
        self.guards = guards;
    }

    /// The robot's world runs at `speed` times real time, where its clients live: they are given as much
    /// more of its time. 1 for every real robot.
    pub fn set_world_speed(&mut self, speed: f64) {
        let scaled = |ms: u64| (ms as f64 * speed.max(1.0)) as u64;
        self.setpoint_lifetime_ms = scaled(self.setpoint_lifetime_ms);
        let ClientLimits { link_loss_ms, lease_free_ms, echo_ms } = &mut self.limits;
        for limit in [link_loss_ms, lease_free_ms, echo_ms] {
            *limit = scaled(*limit);
        }
    }

    /// Who this is.
    #[must_use]
    pub fn identity(&self) -> &RobotIdentity {
        &self.identity
    }

    /// Whether the session to the router stands.
    pub fn set_link(&mut self, up: bool) {
        self.link_up = up;
    }

    /// One turn: what the controller shall do now, if anything new.
    pub fn turn(&mut self, now: Stamp, view: TurnView<'_>) -> Option<Command> {
        self.locate(now, view);
        self.watch_remote(now, view.outputs.mode);
        self.watch_faults(now, view);
        self.watch_goal(now, view.outputs);
        self.watch_teleop(now);
        self.watch_lease(now);
        if view.outputs.mode != self.mode {
            self.emit(now, EventKind::Mode { from: self.mode, to: view.outputs.mode });
            self.mode = view.outputs.mode;
        }
        self.arbitrate(now);
        let command = self.pending.take().or_else(|| self.navigate(now, view));
        let command = command.or_else(|| self.guard_wander(now, view));
        if let (Some(Command::Goto(_) | Command::Wander | Command::Follow { .. }), Some(goal)) =
            (command, &mut self.goal)
            && goal.status == GoalStatus::Accepted
        {
            goal.becomes(now, GoalStatus::Running, None);
            let event = EventKind::Goal { id: goal.id, status: GoalStatus::Running, reason: None };
            self.emit(now, event);
        }
        command.map(|command| self.odometry_scale.correct(command))
    }

    /// A fault that must stop the robot ends everything that moves; its end starts nothing.
    fn watch_faults(&mut self, now: Stamp, view: TurnView<'_>) {
        let unheard = requests::unheard(view).is_some();
        if let Some((fault, reason)) = self.faults.stopping() {
            self.rearm = true;
            if self.under_way() {
                let words = format!("{} fault: {fault}", fault.place());
                self.stand(now, reason, GoalStatus::Failed, Some(&words));
            }
        } else {
            self.was_well |= !unheard;
        }
        self.rearm |= unheard;
    }

    /// The transmitter has taken over, or was lost: what the network asked for is over.
    fn watch_remote(&mut self, now: Stamp, mode: Mode) {
        if !matches!(mode, Mode::Manual | Mode::Fault) {
            return;
        }
        if mode == Mode::Manual && self.guards.on(Guard::RemoteTakeover) {
            let took_over = self.mode != Mode::Manual && self.lease.holder().is_some();
            if self.under_way() || took_over {
                self.latch_as(now, Latch::RemoteTakeover, "the transmitter");
                self.pending = None;
            }
        }
        self.rearm = true;
    }

    /// The table has the last word: what it does not let write, ends.
    fn arbitrate(&mut self, now: Stamp) {
        self.writer = writer(&self.facts());
        let network = matches!(self.writer, MotorWriter::Setpoint | MotorWriter::Goal);
        if !network && self.under_way() {
            let because = self.latches.all().next().map_or(StopReason::RemoteLost, Latch::reason);
            self.stand(
                now,
                because,
                GoalStatus::Failed,
                Some(
                    "blocked by a latch, a fault or the remote \
                control",
                ),
            );
        }
    }

    fn facts(&self) -> Facts {
        let holds = self.guards.on(Guard::LatchHolds);
        let of_the_network = |fault: Fault| fault.place() == "gyro" || fault == Fault::RemoteLost;
        let mut stopping = self.faults.present().filter(|fault| stops(*fault).is_some());
        let manual = self.mode == Mode::Manual;
        Facts {
            latched: self.holds_transmitter(),
            broken: stopping.clone().any(|fault| !of_the_network(fault)),
            manual,
            network_held: (holds && self.latches.all().next().is_some())
                || stopping.next().is_some()
                || self.mode == Mode::Fault,
            setpoint: self.teleop.is_some(),
            goal: self.goal_runs(),
        }
    }

    /// Who wrote the motor at the last turn.
    #[must_use]
    pub fn writer(&self) -> MotorWriter {
        self.writer
    }

    /// Everything ends, the robot stands.
    fn stand(&mut self, now: Stamp, because: StopReason, goal_becomes: GoalStatus, words: Option<&str>) {
        self.end_goal(now, goal_becomes, words);
        self.teleop = None;
        self.idle_because = because;
        self.pending = Some(Command::Idle);
    }

    fn under_way(&self) -> bool {
        self.goal_runs() || self.teleop.is_some()
    }

    fn emit(&mut self, now: Stamp, kind: EventKind) {
        if self.events.len() == EVENT_QUEUE {
            self.events.pop_front();
            self.events_dropped += 1;
        }
        let RobotIdentity { robot, epoch, .. } = &self.identity;
        self.events.push_back(Event {
            robot: robot.clone(),
            epoch: *epoch,
            seq: self.event_seq,
            tick_ms: now.ms(),
            kind,
        });
        self.event_seq += 1;
    }

    /// Whether events wait to be taken.
    #[must_use]
    pub fn has_events(&self) -> bool {
        !self.events.is_empty()
    }

    /// The oldest event that has not been taken yet.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// What is broken.
    #[must_use]
    pub fn faults(&self) -> &FaultBook {
        &self.faults
    }

    /// Age of the last setpoint.
    #[must_use]
    pub fn setpoint_age_ms(&self, now: Stamp) -> Option<u64> {
        self.setpoint_heard.map(|at| now.since_ms(at))
    }
}
