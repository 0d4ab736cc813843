//! What is known of a robot now: learned from its state, forgotten at a restart.

mod observed;

pub use observed::{ObservedEstop, ObservedGoal, ObservedState};

use crate::home::Charge;
use crate::settings::DispatcherSettings;
use crate::transition::TaskOutcome;
use crate::travel_cost::ANY_CAR;
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::Stamp;
use xtb_control::frames::MapPose;
use xtb_nav::Car;
use xtb_protocol::messages::{Assignment, Body, GoalStatus, Lease, Request, RobotState, TaskId, Who};
use xtb_protocol::{Name, Uuid};
use xtb_robot::operator::{Call, Operator};

/// A goal that something keeps from getting anywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StalledGoal {
    /// Which goal.
    pub goal: Uuid,
    /// Since when, in ms since 1970.
    pub since_ms: u64,
    /// Where it was then.
    pub at: MapPose,
    /// Since when nothing is in its way.
    pub clear_ms: Option<u64>,
}

/// A robot that has come so far is not stuck any more, in m.
const PROGRESS_M: f64 = 0.5;
/// Nor is one in whose way nothing has been for so long, in ms.
const CLEAR_MS: u64 = 10_000;

impl StalledGoal {
    /// With one state more: another goal, way made, and nothing in the way for long end it.
    fn next(before: Option<Self>, now_ms: u64, observed: &ObservedState) -> Option<Self> {
        let goal = observed.running()?;
        let blocked = goal.status == GoalStatus::Blocked;
        let new = Self { goal: goal.id, since_ms: now_ms, at: observed.pose, clear_ms: None };
        let on = before.filter(|stuck| {
            let way_m = libm::hypot(observed.pose.x_m - stuck.at.x_m, observed.pose.y_m - stuck.at.y_m);
            stuck.goal == goal.id && way_m < PROGRESS_M
        });
        match (on, blocked) {
            (None, blocked) => blocked.then_some(new),
            (Some(stuck), true) => Some(Self { clear_ms: None, ..stuck }),
            (Some(stuck), false) => {
                let clear_ms = stuck.clear_ms.unwrap_or(now_ms);
                let still = now_ms.saturating_sub(clear_ms) < CLEAR_MS;
                still.then_some(Self { clear_ms: Some(clear_ms), ..stuck })
            }
        }
    }
}

/// What a pending request is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RequestPurpose {
    /// The lease.
    Acquire,
    /// To give it back.
    Release,
    /// To begin a drive.
    Assign(Assignment),
    /// To end an assignment.
    Withdraw {
        /// Its number.
        seq: u64,
    },
}

/// The one request that a robot has to answer.
#[derive(Debug, Clone)]
pub struct PendingRequest {
    /// Its id.
    pub id: Uuid,
    /// What it is for.
    pub purpose: RequestPurpose,
    /// When to ask again and when to give up.
    pub call: Call,
}

/// A robot as the dispatcher knows it.
#[derive(Debug, Clone)]
pub struct TrackedRobot {
    /// Its name.
    pub name: Name,
    /// From the roster.
    pub tags: BTreeSet<String>,
    /// From its factsheet; `None` = not read yet.
    pub capabilities: Option<BTreeSet<String>>,
    /// The same; `None` = not read yet, or it does not say.
    pub car: Option<Car>,
    /// Whether the roster names it.
    pub in_roster: bool,
    /// Whether its presence is declared.
    pub alive: bool,
    /// When its last state came; before the first, when we began to listen.
    pub last_heard_ms: u64,
    /// What it said; `None` = nothing yet.
    pub observed: Option<ObservedState>,
    /// Our lease.
    pub operator: Operator,
    /// The last request of ours that keeps the lease, or lets a goal begin.
    pub last_sent_ms: u64,
    /// What it has to answer.
    pub pending: Option<PendingRequest>,
    /// So many requests in a row it has not answered, over all its boots.
    pub unanswered: u32,
    /// The last assignment for which it was asked to drive, in this run of ours.
    pub asked_seq: Option<u64>,
    /// Since when it is tracked, in this run of ours.
    pub tracked_since_ms: u64,
    /// Since when its states are of the present boot, in this run of ours.
    pub boot_since_ms: u64,
    /// Nothing is asked before this.
    pub next_request_ms: u64,
    /// No task for it before this, and why.
    pub avoid_until: Option<(u64, String)>,
    /// Tasks that it cannot do, until it restarts.
    pub incapable: BTreeMap<TaskId, String>,
    /// The last assignment and drive that it has acknowledged, and with which state it was then.
    pub acked: Option<(u64, u32, u64)>,
    /// The assignment and drive that it would not take while the drive before was under way.
    pub next_leg_refused: Option<(u64, u32)>,
    /// The last assignment whose withdrawal it has confirmed, in this boot.
    pub withdrawn: Option<u64>,
    /// What becomes of its task as soon as it has confirmed the end of this assignment.
    pub pending_outcome: Option<(u64, TaskOutcome)>,
    /// Since when something is in the way of its goal.
    pub blocked_since_ms: Option<u64>,
    /// What is in its way comes and goes, and it gets nowhere.
    pub stuck: Option<StalledGoal>,
    /// Since when nobody else holds it.
    pub uncontested_since_ms: u64,
    /// Since when it has no task.
    pub idle_since_ms: u64,
    /// Its battery, and the dock where it stands.
    pub charge: Charge,
    /// Why it gets no task of anybody's for now: its battery comes first.
    pub stays_for: Option<String>,
}

impl TrackedRobot {
    /// One of which nothing is known yet.
    #[must_use]
    pub fn new(name: Name, now_ms: u64) -> Self {
        Self {
            name,
            tags: BTreeSet::new(),
            capabilities: None,
            car: None,
            in_roster: false,
            alive: false,
            last_heard_ms: now_ms,
            observed: None,
            operator: Operator::default(),
            last_sent_ms: 0,
            pending: None,
            unanswered: 0,
            asked_seq: None,
            tracked_since_ms: now_ms,
            boot_since_ms: now_ms,
            next_request_ms: 0,
            avoid_until: None,
            incapable: BTreeMap::new(),
            acked: None,
            next_leg_refused: None,
            withdrawn: None,
            pending_outcome: None,
            blocked_since_ms: None,
            stuck: None,
            uncontested_since_ms: now_ms,
            idle_since_ms: now_ms,
            charge: Charge::default(),
            stays_for: None,
        }
    }

    /// Its state came. One that is older than the last of the same boot changes nothing, nor does one of another
    /// boot before the last one is silent: it may be from before that, and come late.
    pub fn observe(&mut self, now_ms: u64, state: &RobotState, me: &Name, settings: &DispatcherSettings) {
        let before = self.observed.as_ref();
        let is_late = |observed: &ObservedState| match observed.epoch == state.epoch {
            true => observed.seq >= state.seq,
            false => self.silent_ms(now_ms) < settings.silent_ms,
        };
        if before.is_some_and(is_late) {
            return;
        }
        if before.is_none_or(|observed| observed.epoch != state.epoch) {
            // Another boot: whatever was asked of the one before is void.
            let had_one = self.pending.take().is_some();
            self.unanswered = self.unanswered.saturating_add(u32::from(had_one));
            self.operator = Operator::default();
            self.boot_since_ms = now_ms;
            (self.acked, self.withdrawn, self.next_request_ms) = (None, None, 0);
            self.next_leg_refused = None;
            self.incapable.clear();
            self.pending_outcome = None;
        }
        let observed = ObservedState::of(now_ms, state).after(before);
        if before.is_some_and(|before| before.map != observed.map) {
            // What it refused for lack of a map, or on another one, it may do now.
            self.incapable.clear();
        }
        if observed.holder.as_ref().is_some_and(|holder| holder != me) {
            self.uncontested_since_ms = now_ms;
        }
        let blocked = observed.running().is_some_and(|goal| goal.status == GoalStatus::Blocked);
        self.blocked_since_ms = if blocked { self.blocked_since_ms.or(Some(now_ms)) } else { None };
        self.stuck = StalledGoal::next(self.stuck, now_ms, &observed);
        (self.observed, self.last_heard_ms) = (Some(observed), now_ms);
    }

    /// Whether it has confirmed that it will never drive for this assignment.
    #[must_use]
    pub fn has_released(&self, seq: u64) -> bool {
        self.withdrawn.is_some_and(|withdrawn| withdrawn >= seq)
    }

    /// Whether it has acknowledged this drive, in this boot.
    #[must_use]
    pub fn has_acknowledged(&self, of: &Assignment) -> bool {
        self.acked.is_some_and(|(seq, leg, _)| (seq, leg) == (of.assign_seq, of.leg))
    }

    /// Whether it has acknowledged or refused this leg after the present one, in this boot.
    #[must_use]
    pub fn has_answered_for(&self, next: &Assignment) -> bool {
        self.has_acknowledged(next) || self.next_leg_refused == Some((next.assign_seq, next.leg))
    }

    /// How long it has been silent, in ms.
    #[must_use]
    pub fn silent_ms(&self, now_ms: u64) -> u64 {
        now_ms.saturating_sub(self.last_heard_ms)
    }

    /// Whether its states come in.
    #[must_use]
    pub fn is_online(&self, now_ms: u64, settings: &DispatcherSettings) -> bool {
        self.observed.is_some() && self.silent_ms(now_ms) < settings.silent_ms
    }

    /// Somebody else who holds its lease.
    #[must_use]
    pub fn other_holder(&self, me: &Name) -> Option<&Name> {
        self.observed.as_ref()?.holder.as_ref().filter(|holder| *holder != me)
    }

    /// Our lease, if its state does not show another holder.
    #[must_use]
    pub fn lease(&self, me: &Name) -> Option<Lease> {
        self.operator.lease().filter(|_| self.other_holder(me).is_none())
    }

    /// Why it can have no task now, if so.
    ///
    /// # Errors
    /// In words.
    pub fn availability(&self, now_ms: u64, settings: &DispatcherSettings, me: &Name) -> Result<(), String> {
        let Some(observed) = &self.observed else { return Err("no message yet".to_owned()) };
        if !self.is_online(now_ms, settings) {
            return Err(format!("no message for {} s", self.silent_ms(now_ms) / 1000));
        }
        if let Some(unavailable) = &observed.unavailable {
            return Err(unavailable.clone());
        }
        if let Some(holder) = self.other_holder(me) {
            return Err(format!("controlled by {holder}"));
        }
        if let Some(goal) = observed.running() {
            let by = goal.by.as_ref().map_or("another client", Name::as_str);
            return Err(format!("driving to a goal of {by}"));
        }
        match &self.avoid_until {
            Some((until_ms, why)) if now_ms < *until_ms => Err(why.clone()),
            _ => Ok(()),
        }
    }

    /// Its body and turning circle, as far as they are known.
    #[must_use]
    pub fn car(&self) -> Car {
        self.car.unwrap_or(ANY_CAR)
    }

    /// Whether it may do a task for these.
    #[must_use]
    pub fn is_eligible(&self, who: &Who) -> bool {
        match who {
            Who::Any => true,
            Who::Robot(name) => *name == self.name,
            Who::Tag(tag) => self.tags.contains(tag.trim_start_matches('@')),
            Who::Able(able) => self.capabilities.as_ref().is_some_and(|all| all.contains(able)),
        }
    }

    /// Nothing is asked of it, and no task given, for a while.
    pub fn avoid(&mut self, now_ms: u64, for_ms: u64, why: String) {
        self.avoid_until = Some((now_ms + for_ms, why));
    }

    /// The pending request will not be answered any more. True if there was one.
    pub fn give_up(&mut self) -> bool {
        let had_one = self.pending.take().is_some();
        self.unanswered = self.unanswered.saturating_add(u32::from(had_one));
        had_one
    }

    /// Whether it answers nothing, and can begin no drive for this assignment: this run has not asked for one,
    /// what an earlier run asked for has arrived by now or never will, and its state shows none that is under way.
    #[must_use]
    pub fn has_never_answered(
        &self,
        now_ms: u64,
        ledger: u64,
        seq: u64,
        settings: &DispatcherSettings,
    ) -> bool {
        let mut goals = self.observed.iter().flat_map(|observed| observed.goals.iter());
        let drives = goals.any(|goal| {
            let of = Assignment::of_goal(ledger, goal.id);
            of.is_some() && !goal.status.is_final()
        });
        self.unanswered >= settings.most_unanswered
            && self.asked_seq != Some(seq)
            && now_ms.saturating_sub(self.tracked_since_ms) >= settings.halted_ms
            // A late state of another boot would have been followed by one of the present boot.
            && now_ms.saturating_sub(self.boot_since_ms) >= 2 * settings.silent_ms
            && !drives
    }

    /// A request goes out and has to be answered.
    pub fn begin_request(
        &mut self,
        now_ms: u64,
        id: Uuid,
        purpose: RequestPurpose,
        body: Body,
        settings: &DispatcherSettings,
    ) {
        if let RequestPurpose::Assign(assignment) = purpose {
            self.asked_seq = Some(assignment.assign_seq);
        }
        let now = Stamp::from_ms(now_ms);
        let call = self.operator.call(id, body, now, now.plus_ms(settings.request_timeout_ms));
        self.pending = Some(PendingRequest { id, purpose, call });
    }

    /// A request that keeps the lease, if one is due.
    pub fn retain(&mut self, now_ms: u64, id: Uuid) -> Option<Request> {
        let body = self.operator.retain(Stamp::from_ms(now_ms))?;
        Some(Request { id, lease: self.operator.lease(), body })
    }
}

/// Of the robots that may do a task for these the one that fits through most: any car if one of them has been heard
/// and has not said what it is, or none has.
#[must_use]
pub fn smallest_car(robots: &BTreeMap<Name, TrackedRobot>, who: &Who) -> Car {
    let may = || robots.values().filter(|robot| robot.is_eligible(who));
    if may().any(|robot| robot.observed.is_some() && robot.car.is_none()) {
        return ANY_CAR;
    }
    let cars = may().filter_map(|robot| robot.car);
    cars.min_by(|a, b| a.core_m().total_cmp(&b.core_m())).unwrap_or(ANY_CAR)
}
