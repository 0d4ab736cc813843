//! One robot's second level: from a goal to `follow` commands, turn by turn.
//!
//! ```text
//!   goal ──► Seeking ───► Following ──► reached
//!              ▲   │          │
//!              │   │          ├─ something unknown in the way, or beside the path ──► Pausing ──┐
//!              │   └ no way ──┴────────────────────────────────────────────► Recovering ────────┤
//!              └────────────────────────────────────────────────────────────────────────────────┘
//! ```
//! Wheels that do not turn while it follows a path are in contact with something (`contact`): it stands, backs
//! off, and plans anew.
//!
//! A path is its own, planned on its own map (`replan`), or traffic control's (`traffic_guidance`), which also
//! says how far along it is released. Planning takes longer than a turn: it goes out as a [`PlanJob`] and comes
//! back as a [`PlanDone`]. On the way it looks ahead (`look_ahead`), and goes nowhere without having looked
//! (`visibility`). A goal behind which another one waits is passed without a stop (`passing`). Without traffic
//! control the rule of [`right_of_way`] says who goes first, and `yielding` what
//! the other one does.
//!
//! Words: *released* is the way up to which it may drive; *off* is the distance from the path; *blocked* is
//! what the first level says when an obstacle holds the motor.

mod contact;
mod follow;
mod following;
mod look_ahead;
pub mod near;
mod passing;
mod prepared_map;
mod recovery;
mod replan;
pub mod right_of_way;
mod task;
mod traffic_guidance;
mod turn;
mod visibility;
mod yielding;

pub use passing::PASS_M;
pub use prepared_map::PreparedMap;
pub use replan::{PlanDone, PlanFailure, PlanJob};
pub use traffic_guidance::{
    ALONE_AFTER_MS, BODY_MARGINS_M, GRAZE_M, LEAST_MARGIN_M, LONGEST_PATH_M, NO_WAY_MS, START_WITHIN_M,
    TRAFFIC_LOST_MS, TrafficGuidance,
};
pub use turn::{DriveProgress, HoldReason, Sensed, TargetPose, TurnDecision};

use crate::MapPose;
use crate::geometry::{Car, rect};
use crate::obstacle_layer::{BumperScan, ObstacleLayer, Sight};
use crate::path_follower::{FollowerSettings, PathFollower};
use crate::settings::NavSettings;
use following::{Following, PathPurpose};
use replan::Planned;
use std::sync::Arc;
use task::{Stage, Task};
use turn::stand;
use xtb_control::{Stamp, VehicleConfig};
use xtb_protocol::messages::NavPhase;

/// Kept free around the body beside what the map says, in m: tracking error (0.8 cm at most) and pose error
/// (2.6 cm p95 with fixes at 2 Hz), both as measured in docs/navigation.md.
pub const MARGIN_M: f64 = 0.06;
/// Kept free beside another robot that stands, on top of [`MARGIN_M`], in m: where it stands is not known so
/// well as a wall; chosen, not measured.
const ROBOT_MARGIN_M: f64 = 0.08;
/// Kept free ahead of the bumper in the gear driven on a path of one's own, in m: 1 cm more than what every
/// driving truck needs, for the path that is really driven.
pub const LOOK_OUT_M: f64 = rect::LOOK_OUT_M + 0.01;
/// Planned circles are wider than the smallest by this factor, so that there is steering to correct with; the
/// parkings of docs/navigation.md were driven with it.
pub const RADIUS_FACTOR: f64 = 1.15;
/// Ways only to look, for one goal, so that it ends; chosen, not measured.
const MOST_VANTAGES: u32 = 6;
/// A plan that has not come back after this long is asked for again: all levels of caution together take
/// about 4 s on a small computer (650 000 expansions).
const PLAN_WITHIN_MS: u64 = 15_000;

/// The second level of one robot.
#[derive(Debug, Clone)]
pub struct Navigator {
    vehicle: VehicleConfig,
    car: Car,
    settings: NavSettings,
    follower: FollowerSettings,
    map: Option<Arc<PreparedMap>>,
    obstacles: Option<ObstacleLayer>,
    task: Option<Task>,
    guidance: traffic_guidance::GuidanceState,
    neighbours: right_of_way::Neighbours,
    /// Jobs so far: the number of the last one.
    jobs: u64,
    outbox: Option<PlanJob>,
    stall_monitor: contact::StallMonitor,
}

impl Navigator {
    /// A navigator without a map.
    #[must_use]
    pub fn new(vehicle: &VehicleConfig, settings: &NavSettings) -> Self {
        Self {
            vehicle: vehicle.clone(),
            car: Car::of(vehicle),
            settings: settings.clone(),
            follower: settings.follower_of(vehicle),
            map: None,
            obstacles: None,
            task: None,
            guidance: traffic_guidance::GuidanceState::default(),
            neighbours: right_of_way::Neighbours::default(),
            jobs: 0,
            outbox: None,
            stall_monitor: contact::StallMonitor::default(),
        }
    }

    /// Other speeds, look-ahead and tolerances from now on; what a path is followed with counts from the next path on.
    pub fn set_settings(&mut self, settings: &NavSettings) {
        self.settings = settings.clone();
        self.follower = settings.follower_of(&self.vehicle);
    }

    /// The map that it plans on from now on; a goal under way is planned anew. The same map again changes
    /// nothing.
    pub fn set_map(&mut self, map: Arc<PreparedMap>) {
        if self.map.as_ref().is_some_and(|known| known.map.hash() == map.map.hash()) {
            return;
        }
        let (fades_ms, beside_ms) = self.settings.fades_ms();
        let obstacles = ObstacleLayer::new(self.car, Some(map.map.grid())).seeing(Sight::of(&self.vehicle));
        self.obstacles = Some(obstacles.fading(fades_ms, beside_ms));
        self.map = Some(map);
        if let Some(task) = &mut self.task {
            task.seek();
        }
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> Option<&Arc<PreparedMap>> {
        self.map.as_ref()
    }

    /// The car as it is planned for.
    #[must_use]
    pub fn car(&self) -> &Car {
        &self.car
    }

    /// A goal begins; the one before is forgotten.
    pub fn begin(&mut self, target: TargetPose) {
        self.outbox = None;
        self.guidance.forget_path();
        self.task = Some(Task::new(target));
    }

    /// The goal has ended, however.
    pub fn end(&mut self) {
        (self.task, self.outbox) = (None, None);
        self.guidance.forget_path();
    }

    /// A plan to make: at most one at a time. Whoever takes it brings it back through
    /// [`Navigator::planned`].
    pub fn take_job(&mut self) -> Option<PlanJob> {
        self.outbox.take()
    }

    /// Why it stands; `None` while it drives or has no goal.
    #[must_use]
    pub fn hold_reason(&self) -> Option<HoldReason> {
        self.task.as_ref().and_then(|task| task.hold_reason)
    }

    /// The pose has changed by more than was driven: what stands around is not where it was seen, and a
    /// path is looked for anew.
    pub fn pose_jumped(&mut self) {
        if let Some(obstacles) = &mut self.obstacles {
            obstacles.clear();
        }
        if let Some(task) = &mut self.task {
            task.seek();
        }
    }

    /// What traffic control says of the present goal.
    #[must_use]
    pub fn guidance(&self) -> Option<&TrafficGuidance> {
        self.guidance.last()
    }

    /// How the present goal's path is driven.
    #[must_use]
    pub fn progress(&self) -> Option<DriveProgress<'_>> {
        let task = self.task.as_ref()?;
        let (path, plan, done_m, release_m, off_m) = match &task.stage {
            Stage::Following(following) => {
                let length_m = following.follower.length_m();
                let release_m = following.release_m.min(length_m);
                (
                    Some(&following.path),
                    following.plan,
                    following.follower.way_m(),
                    release_m,
                    following.off_m,
                )
            }
            _ => (None, 0, 0.0, 0.0, 0.0),
        };
        let phase = match (&task.stage, task.hold_reason) {
            (Stage::Seeking { .. }, _) => NavPhase::Planning,
            (Stage::Recovering(_), _) => NavPhase::Recovering,
            (Stage::Following(_), None | Some(HoldReason::AtCusp)) => NavPhase::Following,
            _ => NavPhase::Waiting,
        };
        let guidance = self.guidance.last();
        let waits_for = guidance.and_then(|guidance| guidance.waits_for.as_deref()).or(self.waits_for());
        let (plans, blocked_at) = (task.plans, task.blocked_at);
        Some(DriveProgress { path, plan, phase, done_m, release_m, off_m, waits_for, blocked_at, plans })
    }

    /// What is not on the map.
    #[must_use]
    pub fn obstacle_layer(&self) -> Option<&ObstacleLayer> {
        self.obstacles.as_ref()
    }

    /// A turn of a goal under way; `None` without one.
    pub fn turn(&mut self, now: Stamp, sensed: &Sensed<'_>) -> Option<TurnDecision> {
        self.observe(now, sensed);
        let mut task = self.task.take()?;
        let decision = self.decide(now, sensed, &mut task);
        self.stall_monitor.turn(now, sensed.speed_mps, &decision);
        task.hold_reason = match decision {
            TurnDecision::Go(_, hold_reason) => hold_reason,
            _ => None,
        };
        self.task = Some(task);
        Some(decision)
    }

    /// The range finders, into the obstacle layer.
    fn observe(&mut self, now: Stamp, sensed: &Sensed<'_>) {
        let others = self.others(now);
        if let (Some(map), Some(obstacles), true) = (&self.map, &mut self.obstacles, sensed.scanned) {
            let scan = BumperScan {
                pose: sensed.estimate.pose,
                sigma_m: sensed.estimate.sigma_m,
                front_cm: *sensed.ir_front_cm,
                rear_cm: *sensed.ir_rear_cm,
            };
            obstacles.see(now, &scan, Some(map.map.grid()), &others);
        }
    }

    fn decide(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> TurnDecision {
        task.yielding.waits_for = None;
        if let Err(why) = self.follow_guidance(now, sensed, task) {
            return TurnDecision::Failed(why);
        }
        if let Some(reason) = self.guidance.no_way(now).filter(|_| sensed.stands()) {
            return TurnDecision::Failed(reason.to_owned());
        }
        match task.stage {
            Stage::Seeking { .. } => self.seek(now, sensed, task),
            Stage::Following(_) => self.follow(now, sensed, task),
            Stage::Pausing { until } => self.pause(now, until, sensed, task),
            Stage::Recovering(_) => self.recover(now, sensed, task),
            Stage::Contact { released: false } => stand(HoldReason::WayBlocked),
            Stage::Contact { released: true } => self.back_off(now, sensed, task),
        }
    }

    /// Stands until there is a path; asks for one unless traffic control makes it.
    fn seek(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> TurnDecision {
        let stand = stand(HoldReason::Planning);
        let Stage::Seeking { job } = &mut task.stage else { return stand };
        if self.map.is_none() {
            return TurnDecision::Failed("the robot has no map".to_owned());
        }
        let asked = job.is_some_and(|(_, at)| now.since_ms(at) < PLAN_WITHIN_MS);
        if asked || !sensed.stands() || self.guidance.may_return(now) {
            return stand;
        }
        self.jobs += 1;
        *job = Some((self.jobs, now));
        self.outbox = self.plan_job(now, task, sensed.estimate.pose);
        stand
    }

    /// The last job of all, a path to the goal from here; `None` without a map.
    fn plan_job(&self, now: Stamp, task: &Task, start: MapPose) -> Option<PlanJob> {
        Some(PlanJob {
            number: self.jobs,
            now,
            map: self.map.clone()?,
            obstacles: self.obstacles.clone()?,
            seen_within_ms: task.seen_within_ms(),
            vantage_allowed: task.vantages < MOST_VANTAGES,
            car: self.car,
            cruise_mps: self.settings.meeting_mps(),
            start,
            target: task.target,
            others: self.standing_robots(now, &start),
            retreat: self.retreat_from(now, task),
        })
    }

    /// A plan comes back.
    pub fn planned(&mut self, now: Stamp, done: PlanDone) {
        let Some(mut task) = self.task.take() else { return };
        if passing::is_for(&task, done.number) {
            self.go_beyond(&mut task, done.result);
        } else if matches!(task.stage, Stage::Seeking { job: Some((number, _)) } if number == done.number)
            && let Some((planned, purpose)) = self.accept_plan(now, &mut task, done.result, done.by)
        {
            self.take_up(now, &mut task, planned, purpose);
        }
        self.task = Some(task);
    }

    /// A path that was planned is driven from now on.
    fn take_up(&self, now: Stamp, task: &mut Task, planned: Planned, purpose: PathPurpose) {
        let Planned { path, to_vantage, expects_thin } = planned;
        let exact = to_vantage || purpose == PathPurpose::Retreat || task.target.yaw_rad.is_some();
        let tolerance = self.settings.tolerance(exact);
        match PathFollower::new(&path, &self.car, self.follower.clone(), tolerance) {
            Ok(follower) => {
                task.plans += 1;
                task.vantages += u32::from(to_vantage);
                let mut following = Following::own(path, follower, to_vantage);
                following.expects_thin = expects_thin;
                following.seen_within_ms = task.seen_within_ms();
                following.cruise_mps = self.settings.meeting_mps();
                following.held.purpose = purpose;
                task.stage = Stage::Following(Box::new(following));
            }
            Err(error) => task.no_way(now, PlanFailure::for_good(error.to_string())),
        }
    }
}
