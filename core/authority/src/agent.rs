//! The robot's brain: arbitration, lease, goal life cycle and the two rules that keep shins whole.
//!
//! ```text
//!   request ──► validate ► idempotency ► lease ► goal ──┐
//!   setpoint ─► teleop slot (lives 200 ms) ─────────────┼─► turn ──► at most one Command
//!   faults, remote control, link up or down ────────────┘
//! ```
//!
//! Order of arbitration: fault > remote control > teleop > goal. There is one motor writer, the controller; the
//! brain only ever hands it a command, and its answer to every doubt is [`Command::Idle`].

mod requests;

use crate::faults::{FaultBook, stops};
use crate::goal::{Goal, Target};
use crate::lease::LeaseBook;
use crate::replies::ReplyBook;
use std::collections::VecDeque;
use std::sync::Arc;
use xtb_control::controller::Mode;
use xtb_control::frames::{MapFromOdom, MapPose};
use xtb_control::odometry::OdomPose;
use xtb_control::{Command, Outputs, Stamp, Steering, VehicleConfig, WheelRpm};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Event, EventKind, Fault, GoalStatus, InputAges, PoseSource, PoseState, Setpoint, StopReason,
};

/// Events that wait for the uplink; the oldest is dropped and counted when full.
pub const EVENT_QUEUE: usize = 64;

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

/// What a turn can see.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The controller's last outputs.
    pub outputs: &'a Outputs,
    /// Ages of gyro, encoder and converter.
    pub ages: InputAges,
}

/// The place of a message in the order in which messages came in; each has its own.
pub type Arrival = u64;

#[derive(Debug, Clone)]
struct Teleop {
    setpoint: Setpoint,
    at: Stamp,
    delivered: bool,
}

/// The brain.
#[derive(Debug, Clone)]
pub struct Agent {
    identity: Identity,
    setpoint_lifetime_ms: u64,
    max_rpm: f64,
    map: MapFromOdom,
    lease: LeaseBook,
    replies: ReplyBook,
    goal: Option<Goal>,
    teleop: Option<Teleop>,
    /// For the controller, at the next turn.
    pending: Option<Command>,
    link_up: bool,
    idle_because: StopReason,
    faults: FaultBook,
    mode: Mode,
    setpoint_heard: Option<Stamp>,
    /// When any setpoint came last.
    setpoint_seen: Option<Stamp>,
    /// Setpoints are dropped until one is zero, or a lifetime passes without one: a joystick that was
    /// held through a fault does not drive on.
    rearm: bool,
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
    /// Setpoints for another boot, too old, or overtaken.
    pub stale: u64,
}

impl Agent {
    /// A robot that has just booted and stands; nothing moves before a new command.
    #[must_use]
    pub fn new(identity: Identity, vehicle: &VehicleConfig, version: &str) -> Self {
        let mut agent = Self {
            setpoint_lifetime_ms: u64::from(vehicle.teleop.lifetime_ms),
            max_rpm: vehicle.teleop.max_rpm,
            map: MapFromOdom::aligning(&OdomPose::default(), &identity.start_pose),
            lease: LeaseBook::new(identity.epoch),
            replies: ReplyBook::default(),
            goal: None,
            teleop: None,
            pending: None,
            link_up: false,
            idle_because: StopReason::NoCommand,
            faults: FaultBook::default(),
            mode: Mode::Idle,
            setpoint_heard: None,
            setpoint_seen: None,
            rearm: true,
            stopped_by: 0,
            commanded_by: 0,
            events: VecDeque::with_capacity(EVENT_QUEUE),
            event_seq: 0,
            events_dropped: 0,
            refused: 0,
            stale: 0,
            identity,
        };
        agent.emit(Stamp::ZERO, EventKind::Started { version: version.to_owned() });
        agent
    }

    /// Who this is.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// A stop has arrived: the robot stands, whatever waits in a queue.
    pub fn stop(&mut self, now: Stamp, arrival: Arrival) {
        if arrival > self.stopped_by {
            self.stopped_by = arrival;
            self.commanded_by = self.commanded_by.max(arrival);
            self.stand(now, StopReason::Stop, GoalStatus::Cancelled);
        }
    }

    /// A setpoint that arrived at `at`; replaces the one before and takes over from a goal. One of
    /// another boot, one that is dead already, or one from before the last stop or goal is dropped.
    pub fn setpoint(&mut self, now: Stamp, at: Stamp, arrival: Arrival, client: &Name, setpoint: &Setpoint) {
        let of_this_boot = setpoint.lease.is_none_or(|lease| lease.epoch == self.identity.epoch);
        let alive = now.since_ms(at) < self.setpoint_lifetime_ms;
        let before = self.setpoint_seen.replace(at);
        let paused = before.is_none_or(|before| at.since_ms(before) >= self.setpoint_lifetime_ms);
        self.rearm &= setpoint.rpm != 0.0 && !paused;
        if !of_this_boot || !alive || arrival < self.commanded_by || self.rearm {
            self.stale += 1;
            return;
        }
        if let Some(lease) = setpoint.lease {
            self.lease.touch(at, client, lease);
        }
        self.setpoint_heard = Some(at);
        if self.goal_runs() {
            self.end_goal(at, GoalStatus::Cancelled, Some("teleoperation took over"));
            self.pending = Some(Command::Idle);
        }
        self.teleop = Some(Teleop { setpoint: *setpoint, at, delivered: false });
    }

    /// Whether the session to the router stands.
    pub fn set_link(&mut self, up: bool) {
        self.link_up = up;
    }

    /// What is broken now: all of it, with the system's words. News are reported.
    pub fn set_faults(&mut self, now: Stamp, current: &[(Fault, Option<Arc<str>>)]) {
        for (fault, detail) in current {
            if self.faults.begin(now, *fault, detail.as_deref()) {
                let detail = detail.as_deref().map(str::to_owned);
                self.emit(now, EventKind::Fault { fault: *fault, present: true, detail });
            }
        }
        while let Some(fault) = self.faults.end_other_than(current) {
            self.emit(now, EventKind::Fault { fault, present: false, detail: None });
        }
    }

    /// What is broken.
    #[must_use]
    pub fn faults(&self) -> &FaultBook {
        &self.faults
    }

    /// The odometry was set back: the pose in the map stays what it was.
    pub fn rezeroed(&mut self, before: &OdomPose, after: &OdomPose) {
        self.map = MapFromOdom::aligning(after, &self.map.pose(before));
    }

    /// One turn: what the controller shall do now, if anything new.
    pub fn turn(&mut self, now: Stamp, view: View<'_>) -> Option<Command> {
        if self.lease.expire(now) {
            self.emit(now, EventKind::Lease { holder: None });
        }
        self.watch_faults(now);
        self.watch_remote(now, view.outputs.mode);
        let remote = matches!(view.outputs.mode, Mode::Manual | Mode::Fault);
        self.rearm |= remote || self.faults.stopping().is_some() || requests::unheard(view).is_some();
        self.watch_goal(now, view.outputs);
        self.watch_teleop(now);
        if view.outputs.mode != self.mode {
            self.emit(now, EventKind::Mode { from: self.mode, to: view.outputs.mode });
            self.mode = view.outputs.mode;
        }
        let command = self.pending.take();
        if let (Some(Command::Goto(_) | Command::Wander), Some(goal)) = (command, &mut self.goal) {
            goal.becomes(now, GoalStatus::Running, None);
            let event = EventKind::Goal { id: goal.id, status: GoalStatus::Running, reason: None };
            self.emit(now, event);
        }
        command
    }

    /// A fault that must stop the robot ends everything that moves; its end starts nothing.
    fn watch_faults(&mut self, now: Stamp) {
        if let Some((_, reason)) = self.faults.stopping()
            && self.under_way()
        {
            self.stand(now, reason, GoalStatus::Failed);
        }
    }

    /// The transmitter has taken over: what the network asked for is over.
    fn watch_remote(&mut self, now: Stamp, mode: Mode) {
        if mode == Mode::Manual && self.under_way() {
            self.end_goal(now, GoalStatus::Cancelled, Some("the remote control took over"));
            self.teleop = None;
            self.pending = None;
            self.idle_because = StopReason::NoCommand;
        }
    }

    fn watch_goal(&mut self, now: Stamp, outputs: &Outputs) {
        let Some(goal) = &mut self.goal else { return };
        if goal.status.is_final() || goal.status == GoalStatus::Accepted {
            return;
        }
        if let Some(limit) = goal.limit
            && now >= limit.at
        {
            return self.stand(now, StopReason::TimeUp, limit.then);
        }
        if let (Target::Point { .. }, Some(decision)) = (goal.target, &outputs.goto) {
            goal.distance_m = Some(decision.distance_m);
            if decision.arrived {
                self.idle_because = StopReason::GoalReached;
                return self.end_goal(now, GoalStatus::Reached, None);
            }
        }
        let status = if outputs.blocked { GoalStatus::Blocked } else { GoalStatus::Running };
        if goal.status != status {
            let reason = outputs.blocked.then_some("an obstacle in the driving direction");
            goal.becomes(now, status, reason);
            let (id, reason) = (goal.id, reason.map(str::to_owned));
            self.emit(now, EventKind::Goal { id, status, reason });
        }
    }

    /// The two rules: a setpoint lives 200 ms on this clock, and a lost session ends teleoperation.
    fn watch_teleop(&mut self, now: Stamp) {
        let Some(teleop) = &mut self.teleop else { return };
        if now.since_ms(teleop.at) >= self.setpoint_lifetime_ms {
            return self.stand(now, StopReason::SetpointExpired, GoalStatus::Cancelled);
        }
        if !self.link_up {
            return self.stand(now, StopReason::LinkLost, GoalStatus::Cancelled);
        }
        if std::mem::replace(&mut teleop.delivered, true) {
            return;
        }
        let rpm = teleop.setpoint.rpm.clamp(-self.max_rpm, self.max_rpm);
        if let (Ok(rpm), Ok(steering)) =
            (WheelRpm::try_from(rpm), Steering::try_from(teleop.setpoint.steering))
        {
            self.pending = Some(Command::Teleop { rpm, steering });
        }
    }

    /// Everything ends, the robot stands.
    fn stand(&mut self, now: Stamp, because: StopReason, goal_becomes: GoalStatus) {
        let reason = (goal_becomes == GoalStatus::Failed).then_some(match because {
            StopReason::BoardLost => "the board was lost",
            StopReason::GyroLost => "the gyro was lost",
            StopReason::RemoteLost => "the remote control's signal was lost",
            _ => "its time was up",
        });
        self.end_goal(now, goal_becomes, reason);
        self.teleop = None;
        self.idle_because = because;
        self.pending = Some(Command::Idle);
    }

    fn end_goal(&mut self, now: Stamp, status: GoalStatus, reason: Option<&str>) {
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        goal.becomes(now, status, reason);
        let event = EventKind::Goal { id: goal.id, status, reason: reason.map(str::to_owned) };
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

    /// The lease's book.
    #[must_use]
    pub fn lease(&self) -> &LeaseBook {
        &self.lease
    }

    /// Age of the last setpoint.
    #[must_use]
    pub fn setpoint_age_ms(&self, now: Stamp) -> Option<u64> {
        self.setpoint_heard.map(|at| now.since_ms(at))
    }

    /// Where the robot is in the map.
    #[must_use]
    pub fn pose(&self, view: View<'_>) -> PoseState {
        let MapPose { x_m, y_m, yaw_rad } = self.map.pose(&view.outputs.pose);
        let age_ms = view.ages.gyro.zip(view.ages.encoder).map(|(gyro, encoder)| gyro.max(encoder));
        let source = if age_ms.is_some() { PoseSource::Odometry } else { PoseSource::Start };
        PoseState { x_m, y_m, yaw_rad, source, age_ms }
    }

    /// Why the robot stands; empty while it drives.
    #[must_use]
    pub fn stopped_because(&self, view: View<'_>) -> Vec<StopReason> {
        let outputs = view.outputs;
        let mut reasons = Vec::new();
        match outputs.mode {
            Mode::Idle => reasons.push(self.idle_because),
            Mode::Wander if outputs.reference_rpm == 0.0 => reasons.push(StopReason::WanderPause),
            Mode::Teleop if outputs.reference_rpm == 0.0 => reasons.push(StopReason::SetpointZero),
            Mode::Manual if outputs.demanded.abs() <= STICK_NEUTRAL_COUNTS => {
                reasons.push(StopReason::RemoteNeutral)
            }
            Mode::Fault => reasons.push(StopReason::RemoteLost),
            _ => {}
        }
        if outputs.blocked {
            let ahead = outputs.demanded > 0.0;
            reasons.push(if ahead { StopReason::ObstacleFront } else { StopReason::ObstacleRear });
        }
        for reason in self.faults.present().filter_map(stops) {
            if !reasons.contains(&reason) {
                reasons.push(reason);
            }
        }
        reasons
    }
}
