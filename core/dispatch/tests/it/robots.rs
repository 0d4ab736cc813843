//! Robots of the model: the agent's rules of lease, assignment and goal, without wheels.

use xtb_control::{Mode, Stamp};
use xtb_protocol::messages::texts::WITHDRAWN;
use xtb_protocol::messages::{
    Assignment, BatteryLevel, Body, Done, GoalEnd, GoalKind, GoalState, GoalStatus, InputAges, Latch,
    LatchState, LinkLoss, NavState, ObstacleView, PoseSource, PoseState, RejectCode, Rejected, Reply,
    Request, RobotState, TaskAction, TiltState, Via,
};
use xtb_protocol::{Name, Uuid};
use xtb_robot::authority::assignments::{Known, NewestAssignment};
use xtb_robot::authority::lease::{LEASE_FREE_MS, LINK_LOSS_MS, LeaseBook};
use xtb_robot::authority::replies::ReplyBook;

/// How fast they drive, in m per ms.
const SPEED: f64 = 0.000_5;

/// A drive that a robot has finished: under which goal, when.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Finished {
    pub(crate) goal: Uuid,
    pub(crate) at_ms: u64,
}

#[derive(Debug, Clone)]
pub(crate) struct Goal {
    pub(crate) id: Uuid,
    pub(crate) by: Name,
    pub(crate) status: GoalStatus,
    pub(crate) reason: Option<String>,
    pub(crate) ends_ms: u64,
    pub(crate) to: Option<(f64, f64)>,
    pub(crate) on_link_loss: LinkLoss,
    pub(crate) limit_ms: Option<u64>,
    /// What that is, if it begins now.
    pub(crate) finish_ms: u64,
    /// Fails on the way, for a reason of the goal's.
    pub(crate) doomed: bool,
}

#[derive(Debug, Clone)]
pub(crate) struct FakeRobot {
    pub(crate) name: Name,
    pub(crate) epoch: u64,
    pub(crate) seq: u64,
    pub(crate) at: (f64, f64),
    pub(crate) lease: LeaseBook,
    pub(crate) goal: Option<Goal>,
    /// The next leg of the assignment under way.
    pub(crate) next_leg: Option<Goal>,
    pub(crate) ended: Vec<GoalEnd>,
    pub(crate) assigned: NewestAssignment,
    pub(crate) replies: ReplyBook,
    /// Since when an emergency stop is latched, in ms since 1970.
    pub(crate) latched: Option<u64>,
    /// Something stands in its way until then.
    pub(crate) blocked_until_ms: u64,
    pub(crate) up: bool,
    pub(crate) finished: Vec<Finished>,
    /// Points at which every drive fails.
    pub(crate) doomed: Vec<(f64, f64)>,
    /// What its battery measures, in V; `None` = it does not.
    pub(crate) battery_v: Option<f64>,
    /// What that means.
    pub(crate) battery_level: BatteryLevel,
    /// A robot without its fence: does what it is told, in whatever order.
    pub(crate) unfenced: bool,
}

impl FakeRobot {
    pub(crate) fn new(name: &str, at: (f64, f64)) -> Self {
        Self {
            name: Name::new(name).unwrap(),
            epoch: 1,
            seq: 0,
            at,
            lease: LeaseBook::new(1),
            goal: None,
            next_leg: None,
            ended: Vec::new(),
            assigned: NewestAssignment::default(),
            replies: ReplyBook::default(),
            latched: None,
            blocked_until_ms: 0,
            up: true,
            finished: Vec::new(),
            doomed: Vec::new(),
            battery_v: None,
            battery_level: BatteryLevel::Unknown,
            unfenced: false,
        }
    }

    /// From now on its battery measures this, in V; the levels are the usual ones.
    pub(crate) fn set_battery(&mut self, volts: f64) {
        self.battery_v = Some(volts);
        self.battery_level = match volts {
            ..6.6 => BatteryLevel::Critical,
            ..6.9 => BatteryLevel::Finish,
            ..7.2 => BatteryLevel::Warn,
            _ => BatteryLevel::Ok,
        };
    }

    pub(crate) fn reboot(&mut self) {
        let epoch = self.epoch + 1;
        let fresh = Self::new(self.name.as_str(), self.at);
        let (finished, doomed) = (std::mem::take(&mut self.finished), std::mem::take(&mut self.doomed));
        *self =
            Self { epoch, lease: LeaseBook::new(epoch), finished, doomed, unfenced: self.unfenced, ..fresh };
    }

    pub(crate) fn running(&self) -> Option<&Goal> {
        self.goal.as_ref().filter(|goal| self.up && !goal.status.is_final())
    }

    pub(crate) fn end(&mut self, status: GoalStatus, reason: Option<&str>) {
        self.next_leg = None;
        if let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) {
            (goal.status, goal.reason) = (status, reason.map(str::to_owned));
        }
    }

    pub(crate) fn latch(&mut self, now_ms: u64) {
        self.latched = self.latched.or(Some(now_ms));
        self.end(GoalStatus::Failed, Some("blocked by a latch, a fault or the remote control"));
    }

    /// It can go on when that is over, and arrives as much later.
    pub(crate) fn obstruct(&mut self, now_ms: u64, until_ms: u64) {
        let stands_ms = until_ms.saturating_sub(self.blocked_until_ms.max(now_ms));
        self.blocked_until_ms = self.blocked_until_ms.max(until_ms);
        if let Some(goal) = self.goal.as_mut() {
            goal.ends_ms += stands_ms;
        }
    }

    pub(crate) fn turn(&mut self, now_ms: u64) {
        if !self.up {
            return;
        }
        let silent = self.lease.silent_ms(Stamp::from_ms(now_ms));
        if silent.is_none_or(|ms| ms >= LINK_LOSS_MS)
            && self.running().is_some_and(|goal| goal.on_link_loss == LinkLoss::Halt)
        {
            self.end(GoalStatus::Failed, Some("controlling client dispatch timed out"));
        }
        if silent.is_some_and(|ms| ms >= LEASE_FREE_MS) {
            self.lease.free();
        }
        let Some(goal) = self.goal.as_mut().filter(|goal| !goal.status.is_final()) else { return };
        let blocked = now_ms < self.blocked_until_ms;
        goal.status = if blocked { GoalStatus::Blocked } else { GoalStatus::Running };
        goal.reason = blocked.then(|| "obstacle in front".to_owned());
        if goal.limit_ms.is_some_and(|limit_ms| now_ms >= limit_ms) {
            return self.end(GoalStatus::Failed, Some("time limit reached"));
        }
        if now_ms >= goal.ends_ms {
            if goal.doomed {
                return self.end(GoalStatus::Failed, Some("blocked near (1.0, 1.0)"));
            }
            goal.status = GoalStatus::Reached;
            self.finished.push(Finished { goal: goal.id, at_ms: now_ms });
            self.at = goal.to.unwrap_or(self.at);
            if let Some(next) = self.next_leg.take() {
                let ends_ms = self.arrives_ms(now_ms, next.to);
                let limit_ms = next.limit_ms.map(|_| now_ms + next.finish_ms);
                self.begin(Goal { ends_ms, limit_ms, ..next });
            }
        }
    }

    pub(crate) fn request(&mut self, now_ms: u64, client: &Name, request: &Request) -> Option<Reply> {
        if !self.up {
            return None;
        }
        let each_time = matches!(request.body, Body::Retain {} | Body::Stop {});
        if !each_time && let Some(reply) = self.replies.find(client, request.id) {
            return Some(reply.clone());
        }
        let reply = match self.carry_out(now_ms, client, request) {
            Ok(done) => Reply::done(request.id, done),
            Err((code, message)) => Reply::refused(request.id, code, message, ""),
        };
        if !each_time {
            self.replies.remember(client, reply.clone(), self.lease.holder());
        }
        Some(reply)
    }

    fn carry_out(
        &mut self,
        now_ms: u64,
        client: &Name,
        request: &Request,
    ) -> Result<Done, (RejectCode, String)> {
        let now = Stamp::from_ms(now_ms);
        let present = request.lease.is_some_and(|lease| self.lease.is_present(client, lease));
        if present {
            self.lease.heard(now);
        } else if !matches!(request.body, Body::Acquire { .. } | Body::Stop {} | Body::Withdraw { .. }) {
            return Err((RejectCode::LeaseLost, "not the present lease".into()));
        }
        match &request.body {
            Body::Acquire { take } => {
                let other = self.lease.holder().is_some_and(|holder| holder != client);
                if other && !take {
                    return Err((RejectCode::LeaseHeld, "held".into()));
                }
                if other && self.running().is_some_and(|goal| goal.on_link_loss == LinkLoss::Halt) {
                    self.end(GoalStatus::Cancelled, Some("another client took control"));
                }
                Ok(Done { lease: Some(self.lease.grant(now, client)), goal: None })
            }
            Body::Release {} => {
                self.lease.free();
                if self.running().is_some_and(|goal| goal.on_link_loss == LinkLoss::Halt) {
                    self.end(GoalStatus::Cancelled, Some("control was released"));
                }
                Ok(Done::default())
            }
            Body::Stop {} => {
                self.end(GoalStatus::Cancelled, None);
                Ok(Done::default())
            }
            Body::Withdraw { ledger, assign_seq } => {
                if present {
                    self.assigned.withdraw(client, *ledger, *assign_seq);
                } else {
                    self.assigned.withdraw_without_lease(client, *ledger, *assign_seq);
                }
                let of = self.running().and_then(|goal| Assignment::of_goal(*ledger, goal.id));
                if of.is_some_and(|(seq, _)| seq <= *assign_seq) {
                    self.end(GoalStatus::Cancelled, Some(WITHDRAWN));
                }
                Ok(Done::default())
            }
            Body::Assign { assignment, errand, on_link_loss, finish_s } => {
                let goals = self.goal.iter().chain(&self.next_leg).map(|goal| goal.id);
                let goals = goals.chain(self.ended.iter().map(|end| end.id));
                match self.assigned.check(assignment, goals) {
                    _ if self.unfenced => {}
                    Ok(Known::New) => {}
                    Ok(Known::Already) => return Ok(Done { lease: None, goal: Some(assignment.goal_id()) }),
                    Err((code, message, _)) => return Err((code, message)),
                }
                let before = Assignment { leg: assignment.leg.wrapping_sub(1), ..*assignment }.goal_id();
                let present = self.goal.iter().map(|goal| (goal.id, goal.status));
                let mut goals = present.chain(self.ended.iter().map(|end| (end.id, end.status)));
                let missed = |(id, status): (Uuid, GoalStatus)| {
                    id == before && status.is_final() && status != GoalStatus::Reached
                };
                if !self.unfenced && goals.any(missed) {
                    return Err((RejectCode::UnknownGoal, "the leg before was not reached".into()));
                }
                if self.battery_level >= BatteryLevel::Finish {
                    return Err((RejectCode::BatteryLow, "battery too low to start a command".into()));
                }
                if self.latched.is_some() {
                    return Err((RejectCode::Latched, "estop".into()));
                }
                let to = match errand {
                    TaskAction::Goto { x_m, y_m, .. } => Some((*x_m, *y_m)),
                    TaskAction::Wander { .. } => None,
                };
                let finish_ms = (finish_s * 1000.0) as u64;
                let goal = Goal {
                    id: assignment.goal_id(),
                    by: client.clone(),
                    status: GoalStatus::Accepted,
                    reason: None,
                    ends_ms: self.arrives_ms(now_ms, to),
                    to,
                    on_link_loss: *on_link_loss,
                    limit_ms: (*on_link_loss == LinkLoss::Finish).then_some(now_ms + finish_ms),
                    finish_ms,
                    doomed: to.is_some_and(|to| self.doomed.contains(&to)),
                };
                match self.running() {
                    Some(present) if present.by == *client && present.id == before && to.is_some() => {
                        self.next_leg = Some(goal);
                    }
                    _ => self.begin(goal),
                }
                self.assigned.begun(client, assignment);
                Ok(Done { lease: None, goal: Some(assignment.goal_id()) })
            }
            _ => Ok(Done::default()),
        }
    }

    /// When it is there, if it leaves now.
    fn arrives_ms(&self, now_ms: u64, to: Option<(f64, f64)>) -> u64 {
        let way = to.map_or(2.0, |(x, y)| (x - self.at.0).hypot(y - self.at.1));
        self.blocked_until_ms.max(now_ms) + 200 + (way / SPEED) as u64
    }

    pub(crate) fn begin(&mut self, goal: Goal) {
        self.end(GoalStatus::Replaced, None);
        if let Some(before) = self.goal.replace(goal) {
            self.ended.insert(0, GoalEnd { id: before.id, status: before.status });
            self.ended.truncate(8);
        }
    }

    pub(crate) fn state(&mut self, now_ms: u64) -> RobotState {
        self.seq += 1;
        let latch = |since_ms: u64| LatchState {
            latch: Latch::Estop,
            age_ms: now_ms.saturating_sub(since_ms),
            by: "cli-7".into(),
            present: false,
        };
        RobotState {
            robot: self.name.clone(),
            epoch: self.epoch,
            seq: self.seq,
            tick_ms: now_ms,
            mode: Mode::Idle,
            lease: self.lease.state(Stamp::from_ms(now_ms)),
            pose: PoseState {
                x_m: self.at.0,
                y_m: self.at.1,
                yaw_rad: 0.0,
                source: PoseSource::Odometry,
                age_ms: Some(0),
                sigma_m: 0.0,
                sigma_yaw_rad: 0.0,
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
            battery_v: self.battery_v,
            battery_level: self.battery_level,
            goal: self.goal.as_ref().map(|goal| GoalState {
                id: goal.id,
                kind: GoalKind::Goto,
                x_m: None,
                y_m: None,
                yaw_rad: None,
                via: goal.to.map(|_| Via::Planned),
                status: goal.status,
                distance_m: None,
                age_ms: 0,
                reason: goal.reason.clone(),
                by: goal.by.clone(),
                on_link_loss: goal.on_link_loss,
            }),
            ended_goals: self.ended.clone(),
            faults: Vec::new(),
            latches: self.latched.map(latch).into_iter().collect(),
            nav: NavState::default(),
            stopped_because: Vec::new(),
            stopped_age_ms: self.running().is_none().then_some(60_000),
            input_age_ms: InputAges::default(),
            turn_late_us: 0,
            turns_late: 0,
            rejected: Rejected::default(),
        }
    }
}
