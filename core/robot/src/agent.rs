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

mod navigate;
mod odometry;
mod requests;
mod setpoints;
mod stops;
mod touch;
mod why;

use crate::authority::admission::Admission;
use crate::authority::arbitration::{Facts, Writer, writer};
use crate::authority::assignments::Assigned;
use crate::authority::goal::{Goal, Target};
use crate::authority::guard::{Guard, Guards};
use crate::authority::latch::LatchBook;
use crate::authority::lease::{LEASE_FREE_MS, LINK_LOSS_MS, LeaseBook};
use crate::authority::replies::ReplyBook;
use crate::faults::{FaultBook, stops};
use odometry::OdometryScale;
use setpoints::Teleop;
use std::collections::VecDeque;
use std::sync::Arc;
use xtb_control::controller::Mode;
use xtb_control::frames::MapPose;
use xtb_control::odometry::OdomPose;
use xtb_control::{Command, Outputs, Stamp, VehicleConfig};
use xtb_nav::NavSettings;
use xtb_nav::localization::PoseFilter;
use xtb_nav::navigator::Navigator;
use xtb_protocol::messages::texts::client_timeout;
use xtb_protocol::messages::{
    Event, EventKind, Fault, GoalEnd, GoalStatus, InputAges, Latch, Lease, LinkLoss, PoseSource, PoseState,
    StopReason,
};
use xtb_protocol::{Name, Uuid};

/// Events that wait for the uplink; the oldest is dropped and counted when full.
pub const EVENT_QUEUE: usize = 64;
/// Ends of earlier goals that stay readable.
pub const ENDED_GOALS: usize = 8;

/// A speed stick this near to neutral does not move the truck (the ESC's dead band of ± 30 µs,
/// assumed), in counts.
pub(crate) const STICK_NEUTRAL_COUNTS: f64 = 75.0;

/// Who a robot is, fixed at boot.
#[derive(Debug, Clone, PartialEq)]
pub struct Identity {
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
pub struct View<'a> {
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
    identity: Identity,
    setpoint_lifetime_ms: u64,
    limits: ClientLimits,
    max_rpm: f64,
    mps_per_rpm: f64,
    filter: PoseFilter,
    odometry_scale: OdometryScale,
    nav: Navigator,
    lead: navigate::Lead,
    guards: Guards,
    lease: LeaseBook,
    latches: LatchBook,
    replies: ReplyBook,
    goal: Option<Goal>,
    assigned: Assigned,
    ended: VecDeque<GoalEnd>,
    teleop: Option<Teleop>,
    /// Number of the last setpoint that was accepted under the present grant.
    last_seq: Option<u64>,
    /// Callers and ids of the last emergency stops: none latches twice.
    estops: VecDeque<(Name, Uuid)>,
    /// For the controller, at the next turn.
    pending: Option<Command>,
    writer: Writer,
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
    pub fn new(identity: Identity, vehicle: &VehicleConfig, version: &str) -> Self {
        let mut agent = Self {
            setpoint_lifetime_ms: u64::from(vehicle.teleop.lifetime_ms),
            limits: ClientLimits {
                link_loss_ms: LINK_LOSS_MS,
                lease_free_ms: LEASE_FREE_MS,
                echo_ms: setpoints::ECHO_MS,
            },
            max_rpm: vehicle.teleop.max_rpm,
            mps_per_rpm: vehicle.mps_per_rpm(),
            filter: filter(vehicle, &NavSettings::default(), &identity),
            odometry_scale: OdometryScale::default(),
            nav: Navigator::new(vehicle, &NavSettings::default()),
            lead: navigate::Lead::default(),
            guards: Guards::default(),
            lease: LeaseBook::new(identity.epoch),
            latches: LatchBook::default(),
            replies: ReplyBook::default(),
            goal: None,
            assigned: Assigned::default(),
            ended: VecDeque::with_capacity(ENDED_GOALS),
            teleop: None,
            last_seq: None,
            estops: VecDeque::with_capacity(stops::ESTOP_IDS),
            pending: None,
            writer: Writer::Nobody,
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
        self.filter = filter(vehicle, settings, &self.identity);
        self.nav = Navigator::new(vehicle, settings);
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
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Whether the session to the router stands.
    pub fn set_link(&mut self, up: bool) {
        self.link_up = up;
    }

    /// The odometry was set back: the pose in the map stays what it was.
    pub fn rezeroed(&mut self, before: &OdomPose, after: &OdomPose) {
        self.filter.rezeroed(before, after);
    }

    /// One turn: what the controller shall do now, if anything new.
    pub fn turn(&mut self, now: Stamp, view: View<'_>) -> Option<Command> {
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
    fn watch_faults(&mut self, now: Stamp, view: View<'_>) {
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

    fn watch_goal(&mut self, now: Stamp, outputs: &Outputs) {
        let heard = self.lease.silent_ms(now).is_some_and(|ms| ms < self.limits.link_loss_ms);
        let present = self.lease.present();
        let halts = self.guards.on(Guard::LinkLossHalt);
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        if halts && goal.on_link_loss == LinkLoss::Halt && !(heard && goal.lease == present) {
            let words = client_timeout(&goal.by);
            return self.stand(now, StopReason::LeaseExpired, GoalStatus::Failed, Some(&words));
        }
        if goal.status == GoalStatus::Accepted {
            return;
        }
        if let Some(limit) = goal.limit
            && now >= limit.at
        {
            let words = (limit.then == GoalStatus::Failed).then_some("time limit reached");
            return self.stand(now, StopReason::TimeUp, limit.then, words);
        }
        if goal.is_planned() {
            return;
        }
        if let (Target::Point { .. }, Some(decision)) = (goal.target, &outputs.goto) {
            goal.distance_m = Some(decision.distance_m);
            if decision.arrived {
                self.idle_because = StopReason::GoalReached;
                return self.end_goal(now, GoalStatus::Reached, None);
            }
        }
        self.goal_is(now, outputs.blocked.then_some("an obstacle in the driving direction"));
    }

    /// The goal runs, or is blocked by this.
    fn goal_is(&mut self, now: Stamp, blocked: Option<&str>) {
        let status = if blocked.is_some() { GoalStatus::Blocked } else { GoalStatus::Running };
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        if goal.status != status || goal.reason.as_deref() != blocked {
            let news = goal.status != status;
            goal.becomes(now, status, blocked);
            let (id, reason) = (goal.id, blocked.map(str::to_owned));
            if news {
                self.emit(now, EventKind::Goal { id, status, reason });
            }
        }
    }

    /// A lease that nobody retains becomes free.
    fn watch_lease(&mut self, now: Stamp) {
        let silent = self.lease.silent_ms(now).is_some_and(|ms| ms >= self.limits.lease_free_ms);
        if silent && self.guards.on(Guard::LeaseExpiry) && self.lease.free() {
            self.emit(now, EventKind::Lease { holder: None });
        }
    }

    /// The table has the last word: what it does not let write, ends.
    fn arbitrate(&mut self, now: Stamp) {
        self.writer = writer(&self.facts());
        let network = matches!(self.writer, Writer::Setpoint | Writer::Goal);
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
    pub fn writer(&self) -> Writer {
        self.writer
    }

    /// Everything ends, the robot stands.
    fn stand(&mut self, now: Stamp, because: StopReason, goal_becomes: GoalStatus, words: Option<&str>) {
        self.end_goal(now, goal_becomes, words);
        self.teleop = None;
        self.idle_because = because;
        self.pending = Some(Command::Idle);
    }

    fn end_goal(&mut self, now: Stamp, status: GoalStatus, reason: Option<&str>) {
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        goal.becomes(now, status, reason);
        let event = EventKind::Goal { id: goal.id, status, reason: reason.map(str::to_owned) };
        self.nav.end();
        self.emit(now, event);
    }

    fn under_way(&self) -> bool {
        self.goal_runs() || self.teleop.is_some()
    }

    fn goal_runs(&self) -> bool {
        self.goal.as_ref().is_some_and(|goal| !goal.status.is_final())
    }

    fn emit(&mut self, now: Stamp, kind: EventKind) {
        if self.events.len() == EVENT_QUEUE {
            self.events.pop_front();
            self.events_dropped += 1;
        }
        let Identity { robot, epoch, .. } = &self.identity;
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

    /// The present or last goal.
    #[must_use]
    pub fn goal(&self) -> Option<&Goal> {
        self.goal.as_ref()
    }

    /// How the goals before the present one ended, newest first.
    pub fn ended_goals(&self) -> impl Iterator<Item = GoalEnd> {
        self.ended.iter().copied()
    }

    /// The lease's book.
    #[must_use]
    pub fn lease(&self) -> &LeaseBook {
        &self.lease
    }

    /// Whose messages may come in now.
    #[must_use]
    pub fn admission(&self) -> Admission {
        if !self.guards.on(Guard::LeaseFence) || !self.guards.on(Guard::LeaseRequired) {
            return Admission::Anyone;
        }
        match (self.lease.holder(), self.lease.present()) {
            (Some(holder), Some(lease)) => Admission::Holder(holder.clone(), lease),
            _ => Admission::Nobody,
        }
    }

    /// The holder was heard at the door, whatever becomes of its message.
    pub fn heard(&mut self, at: Stamp, lease: Lease) {
        let alive = self.lease.silent_ms(at).is_some_and(|ms| ms < self.limits.lease_free_ms)
            || !self.guards.on(Guard::LeaseExpiry);
        if alive && self.lease.present() == Some(lease) {
            self.lease.heard(at);
        }
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

    /// How far the truck goes for each metre that its encoder counts; 1 as long as fixes have not shown it.
    #[must_use]
    pub fn odometry_scale(&self) -> f64 {
        self.odometry_scale.way()
    }

    /// What is wrong with odometry and pose fixes, with what was seen.
    #[must_use]
    pub fn pose_faults(&self, now: Stamp) -> Vec<(Fault, Option<Arc<str>>)> {
        let estimate = self.filter.estimate(now);
        let scale = self.odometry_scale.fault().map(|words| (Fault::OdometryScale, Some(words.into())));
        let frozen = estimate.frozen.then_some((Fault::FixesFrozen, None));
        let contradict = estimate.contradicted.then_some((Fault::FixesContradict, None));
        [scale, frozen, contradict].into_iter().flatten().collect()
    }

    /// Where the robot is in the map.
    #[must_use]
    pub fn pose(&self, now: Stamp, view: View<'_>) -> PoseState {
        let estimate = self.filter.estimate(now);
        let MapPose { x_m, y_m, yaw_rad } = estimate.pose;
        let age_ms = view.ages.gyro.zip(view.ages.encoder).map(|(gyro, encoder)| gyro.max(encoder));
        let source = match (age_ms, estimate.fix_age_ms) {
            (None, _) => PoseSource::Start,
            (Some(_), None) => PoseSource::Odometry,
            (Some(_), Some(_)) => PoseSource::Fixes,
        };
        PoseState {
            x_m,
            y_m,
            yaw_rad,
            source,
            age_ms,
            sigma_m: estimate.sigma_m,
            sigma_yaw_rad: estimate.sigma_yaw_rad,
            fix_age_ms: estimate.fix_age_ms,
            odometry_scale: (estimate.fixes.accepted > 0).then_some(1.0 + estimate.wheel_scale),
            odometry_scale_sigma: (estimate.fixes.accepted > 0).then_some(estimate.wheel_scale_sigma),
            fix_delay_ms: estimate.fix_delay_ms(),
        }
    }
}

/// A filter of a robot that stands at its start pose.
fn filter(vehicle: &VehicleConfig, settings: &NavSettings, identity: &Identity) -> PoseFilter {
    PoseFilter::new(vehicle, settings.filter(), Stamp::ZERO, &OdomPose::default(), &identity.start_pose)
}
