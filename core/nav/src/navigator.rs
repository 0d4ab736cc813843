//! One robot's second level: from a goal to `follow` commands, turn by turn.
//!
//! ```text
//!   goal ──► Planning ──► Following ──► reached
//!              ▲   │          │
//!              │   │          ├─ something unknown in the way, or beside the path ──► Pausing ──┐
//!              │   └ no way ──┴────────────────────────────────────────────► Recovering ────────┤
//!              └────────────────────────────────────────────────────────────────────────────────┘
//! ```
//! Wheels that do not turn while it follows a path have touched something (`touch.rs`): it stands, backs off,
//! and plans anew.
//!
//! Without traffic control the rule of [`giveway`] says who goes first.
//!
//! A path is its own, planned on its own map, or traffic control's, which also says how far along it is
//! released. Planning takes longer than a turn: it goes out as a [`PlanJob`] and comes back as a [`PlanDone`].
//!
//! Words: *released* is the way up to which it may drive; *off* is the distance from the path; *blocked* is
//! what the first level says when an obstacle holds the motor.

mod among;
mod aside;
mod blind;
mod floor;
mod follow;
pub mod giveway;
mod job;
mod look;
mod retreat;
mod room;
mod route;
mod touch;
mod unseen;

pub use floor::Floor;
pub use job::{PlanDone, PlanFailure, PlanJob};
pub use route::Led;

use crate::MapPose;
use crate::car::Car;
use crate::filter::Estimate;
use crate::follower::{Follower, FollowerSettings};
use crate::local::{BumperScan, LocalLayer};
use crate::path::Path;
use crate::settings::NavSettings;
use among::Errand;
use follow::{Following, Recovery};
use job::Planned;
use std::sync::Arc;
use xtb_control::infrared::BumperRanges;
use xtb_control::{Command, Stamp, Steering, VehicleConfig, WheelRpm};
use xtb_protocol::messages::NavPhase;

/// Kept free around the body beside what the map says: tracking and pose error, in m.
pub const MARGIN_M: f64 = 0.06;
/// Kept free ahead of the bumper in the gear driven: the obstacle rule stops at 25 cm.
pub const LOOKOUT_M: f64 = 0.32;
/// Planned circles are wider than the smallest by this factor, so that there is steering to correct with.
pub const RADIUS_FACTOR: f64 = 1.15;
/// Traffic control that has not been heard for this long is gone.
pub const TRAFFIC_LOST_MS: u64 = 3_000;
/// And this long after its last word a robot that was led goes its own way: a service that died is back
/// by then.
pub const ALONE_AFTER_MS: u64 = 10_000;
/// A robot that traffic control has told for this long that there is no way gives its goal up.
pub const NO_WAY_MS: u64 = 20_000;
/// The first level holds it this long before it looks for another way.
const BLOCKED_MS: u64 = 1_500;
/// It waits this long for something unknown to go away, before each further try; all tries together take
/// longer than marks of what has gone need to fade.
const PAUSE_MS: u64 = 5_000;
/// Tries without any way gained before it gives up.
const TRIES: u32 = 6;
/// Ways only to look, for one goal.
const MOST_LOOKS: u32 = 6;
/// After so many tries in vain only marks count that were seen within the last so many ms.
const PATIENT_TRIES: u32 = 4;
const LATELY_MS: u64 = 15_000;
/// Paths for one goal before it gives up.
const MOST_PLANS: u32 = 40;
/// A plan that has not come back after this long is asked for again.
const PLAN_WITHIN_MS: u64 = 15_000;
/// Way along a path that counts as progress, in m.
const PROGRESS_M: f64 = 0.5;
/// Longest reversing of a recovery.
const RECOVERY_MS: u64 = 2_500;
/// Its wheels' speed astern.
const RECOVERY_MPS: f64 = 0.11;

/// What is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// On arrival.
    pub yaw_rad: Option<f64>,
}

/// What a turn knows.
#[derive(Debug, Clone, Copy)]
pub struct Sensed<'a> {
    /// Where it is.
    pub estimate: &'a Estimate,
    /// Signed, in m/s.
    pub speed_mps: f64,
    /// The first level holds the motor because of an obstacle.
    pub blocked: bool,
    /// Front bumper, cm.
    pub ir_front_cm: &'a BumperRanges,
    /// Rear bumper, cm.
    pub ir_rear_cm: &'a BumperRanges,
    /// Whether the range finders have been read since the last turn.
    pub scanned: bool,
}

/// Slower than this is standing, in m/s: one pulse of the encoder a window is 0.005.
const STANDS_MPS: f64 = 0.01;

impl Sensed<'_> {
    fn stands(&self) -> bool {
        self.speed_mps.abs() < STANDS_MPS
    }
}

/// Why it stands while its goal runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// A path is being planned.
    Planning,
    /// At the end of what is released.
    WaitingForTraffic,
    /// Something unknown is in the way.
    WayBlocked,
    /// It does not know well enough where it is.
    PoseUncertain,
    /// Between two gears.
    AtCusp,
    /// Another robot goes first, and nobody coordinates.
    GivingWay,
}

/// What a turn decides.
#[derive(Debug, Clone, PartialEq)]
pub enum Decision {
    /// For the first level; why, if it stands.
    Go(Command, Option<Standing>),
    /// The goal is reached.
    Reached,
    /// It cannot be reached.
    Failed(String),
}

/// How a path is driven, for the state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress<'a> {
    /// `None` while there is none.
    pub path: Option<&'a Path>,
    /// Traffic control's number of it; 0 = its own, or none.
    pub plan: u64,
    /// What it is at.
    pub phase: NavPhase,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released, in m.
    pub release_m: f64,
    /// Beside it, in m, + = to its left.
    pub off_m: f64,
    /// Who has to pass first.
    pub waits_for: Option<&'a str>,
    /// Where something unknown is in the way, (x, y) in m.
    pub blocked_at: Option<[f64; 2]>,
    /// Paths for this goal so far.
    pub plans: u32,
}

#[derive(Debug, Clone)]
enum Stage {
    /// Asks for a path once it stands.
    Seeking { job: Option<(u64, Stamp)> },
    /// Along a path.
    Following(Box<Following>),
    /// Waits before it tries again.
    Pausing { until: Stamp },
    /// The memorandum's avoidance (§4.6): astern while turning.
    Recovering(Recovery),
    /// Its wheels do not turn. It stands until it is let go, and backs off then.
    Touched { let_go: bool },
}

/// A goal under way.
#[derive(Debug, Clone)]
struct Task {
    aim: Aim,
    stage: Stage,
    /// Plans that found no way since the last progress.
    tries: u32,
    /// Paths that came to nothing since the last progress.
    lost: u32,
    /// Ways only to look.
    looks: u32,
    /// Paths for this goal.
    plans: u32,
    /// What was in the way last.
    blocked_at: Option<[f64; 2]>,
    /// In words, for when it gives up.
    trouble: String,
    recoveries: u32,
    /// Things touched since the last progress.
    touches: u32,
    /// The last plan found no way out of where it stands.
    enclosed: bool,
    standing: Option<Standing>,
    /// Where traffic control's path began that it got off: only another one will do.
    lost_start: Option<MapPose>,
    /// What it is to others, and they to it.
    among: among::Among,
}

/// The second level of one robot.
#[derive(Debug, Clone)]
pub struct Navigator {
    vehicle: VehicleConfig,
    car: Car,
    settings: NavSettings,
    follower: FollowerSettings,
    floor: Option<Arc<Floor>>,
    local: Option<LocalLayer>,
    task: Option<Task>,
    led: route::LedBook,
    neighbours: giveway::Neighbours,
    jobs: u64,
    outbox: Option<PlanJob>,
    wheels: touch::Wheels,
}

impl Navigator {
    /// A navigator without a map.
    #[must_use]
    pub fn new(vehicle: &VehicleConfig, settings: &NavSettings) -> Self {
        Self {
            vehicle: vehicle.clone(),
            car: Car::of(vehicle),
            settings: settings.clone(),
            follower: settings.follower(),
            floor: None,
            local: None,
            task: None,
            led: route::LedBook::default(),
            neighbours: giveway::Neighbours::default(),
            jobs: 0,
            outbox: None,
            wheels: touch::Wheels::default(),
        }
    }

    /// The map that it plans on from now on; a goal under way is planned anew. The same map again changes
    /// nothing.
    pub fn set_floor(&mut self, floor: Arc<Floor>) {
        if self.floor.as_ref().is_some_and(|known| known.map.hash() == floor.map.hash()) {
            return;
        }
        let (fades_ms, beside_ms) = self.settings.fades_ms();
        let local = LocalLayer::new(self.car, Some(floor.map.grid()));
        self.local = Some(local.fading(fades_ms, beside_ms));
        self.floor = Some(floor);
        if let Some(task) = &mut self.task {
            task.seek();
        }
    }

    /// The map.
    #[must_use]
    pub fn floor(&self) -> Option<&Arc<Floor>> {
        self.floor.as_ref()
    }

    /// The car as it is planned for.
    #[must_use]
    pub fn car(&self) -> &Car {
        &self.car
    }

    /// A goal begins; the one before is forgotten.
    pub fn begin(&mut self, aim: Aim) {
        self.outbox = None;
        self.led.forget_track();
        self.task = Some(Task {
            aim,
            stage: Stage::Seeking { job: None },
            tries: 0,
            lost: 0,
            looks: 0,
            plans: 0,
            blocked_at: None,
            trouble: String::new(),
            recoveries: 0,
            touches: 0,
            enclosed: false,
            standing: Some(Standing::Planning),
            lost_start: None,
            among: among::Among::default(),
        });
    }

    /// The goal has ended, however.
    pub fn end(&mut self) {
        (self.task, self.outbox) = (None, None);
        self.led.forget_track();
    }

    /// A plan to make: at most one at a time. Whoever takes it brings it back through
    /// [`Navigator::planned`].
    pub fn take_job(&mut self) -> Option<PlanJob> {
        self.outbox.take()
    }

    /// Why it stands; `None` while it drives or has no goal.
    #[must_use]
    pub fn standing(&self) -> Option<Standing> {
        self.task.as_ref().and_then(|task| task.standing)
    }

    /// The pose has changed by more than was driven: what stands around is not where it was seen, and a
    /// path is looked for anew.
    pub fn pose_jumped(&mut self) {
        if let Some(local) = &mut self.local {
            local.clear();
        }
        if let Some(task) = &mut self.task {
            task.seek();
        }
    }

    /// What traffic control says of the present goal.
    #[must_use]
    pub fn led_by(&self) -> Option<&Led> {
        self.led.led()
    }

    /// How the present goal's path is driven.
    #[must_use]
    pub fn progress(&self) -> Option<Progress<'_>> {
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
        let phase = match (&task.stage, task.standing) {
            (Stage::Seeking { .. }, _) => NavPhase::Planning,
            (Stage::Recovering(_), _) => NavPhase::Recovering,
            (Stage::Following(_), None | Some(Standing::AtCusp)) => NavPhase::Following,
            _ => NavPhase::Waiting,
        };
        let waits_for = self.led.led().and_then(|led| led.waits_for.as_deref()).or(self.waits_for());
        let (plans, blocked_at) = (task.plans, task.blocked_at);
        Some(Progress { path, plan, phase, done_m, release_m, off_m, waits_for, blocked_at, plans })
    }

    /// What the local layer holds.
    #[must_use]
    pub fn local(&self) -> Option<&LocalLayer> {
        self.local.as_ref()
    }

    /// A turn of a goal under way; `None` without one.
    pub fn turn(&mut self, now: Stamp, sensed: &Sensed<'_>) -> Option<Decision> {
        self.look(now, sensed);
        let mut task = self.task.take()?;
        let decision = self.decide(now, sensed, &mut task);
        self.wheels.turn(now, sensed.speed_mps, &decision);
        task.standing = match decision {
            Decision::Go(_, standing) => standing,
            _ => None,
        };
        self.task = Some(task);
        Some(decision)
    }

    /// The range finders, into the local layer.
    fn look(&mut self, now: Stamp, sensed: &Sensed<'_>) {
        let others = self.others(now);
        if let (Some(floor), Some(local), true) = (&self.floor, &mut self.local, sensed.scanned) {
            let scan = BumperScan {
                pose: sensed.estimate.pose,
                sigma_m: sensed.estimate.sigma_m,
                front_cm: *sensed.ir_front_cm,
                rear_cm: *sensed.ir_rear_cm,
            };
            local.see(now, &scan, Some(floor.map.grid()), &others);
        }
    }

    fn decide(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> Decision {
        task.among.waits_for = None;
        self.follow_lead(now, sensed, task);
        if let Some(reason) = self.led.no_way(now).filter(|_| sensed.stands()) {
            return Decision::Failed(reason.to_owned());
        }
        match &mut task.stage {
            Stage::Seeking { .. } => self.seek(now, sensed, task),
            Stage::Following(_) => self.follow(now, sensed, task),
            Stage::Pausing { until } => {
                let until = *until;
                self.pause(now, until, sensed, task)
            }
            Stage::Recovering(_) => self.recover(now, sensed, task),
            Stage::Touched { let_go: false } => stand(Standing::WayBlocked),
            Stage::Touched { let_go: true } => self.back_off(now, sensed, task),
        }
    }

    /// Stands until there is a path; asks for one unless traffic control makes it.
    fn seek(&mut self, now: Stamp, sensed: &Sensed<'_>, task: &mut Task) -> Decision {
        let stand = stand(Standing::Planning);
        let Stage::Seeking { job } = &mut task.stage else { return stand };
        let (Some(floor), Some(local)) = (&self.floor, &self.local) else {
            return Decision::Failed("the robot has no map".to_owned());
        };
        let asked = job.is_some_and(|(_, at)| now.since_ms(at) < PLAN_WITHIN_MS);
        if asked || !sensed.stands() || self.led.may_lead(now) {
            return stand;
        }
        self.jobs += 1;
        *job = Some((self.jobs, now));
        self.outbox = Some(PlanJob {
            number: self.jobs,
            now,
            floor: floor.clone(),
            layer: local.clone(),
            // Whoever waits for long believes only what was seen lately.
            lately_ms: lately_ms(task.tries),
            may_look: task.looks < MOST_LOOKS,
            car: self.car,
            cruise_mps: self.settings.drive.meeting_mps,
            start: sensed.estimate.pose,
            aim: task.aim,
            others: self.in_the_search(now, &sensed.estimate.pose),
            retreat: self.retreat_from(now, task),
        });
        stand
    }

    /// A plan comes back.
    pub fn planned(&mut self, now: Stamp, done: PlanDone) {
        let Some(mut task) = self.task.take() else { return };
        if matches!(task.stage, Stage::Seeking { job: Some((number, _)) } if number == done.number)
            && let Some((planned, errand)) = self.among(now, &mut task, done.result, done.by)
        {
            self.take_up(now, &mut task, planned, errand);
        }
        self.task = Some(task);
    }

    /// A path that was planned is driven from now on.
    fn take_up(&self, now: Stamp, task: &mut Task, planned: Planned, errand: Errand) {
        let Planned { path, look, wary } = planned;
        let exact = look || errand == Errand::Retreat || task.aim.yaw_rad.is_some();
        let tolerance = self.settings.tolerance(exact);
        match Follower::new(&path, &self.car, self.follower.clone(), tolerance) {
            Ok(follower) => {
                task.plans += 1;
                task.looks += u32::from(look);
                let mut following = Following::own(path, follower, look);
                following.wary = wary;
                following.lately_ms = lately_ms(task.tries);
                following.cruise_mps = self.settings.drive.meeting_mps;
                following.held.errand = errand;
                task.stage = Stage::Following(Box::new(following));
            }
            Err(error) => task.no_way(now, PlanFailure::for_good(error.to_string())),
        }
    }
}

impl Task {
    /// Plans anew, from where it stands; what it touches comes first.
    fn seek(&mut self) {
        if self.is_touching() {
            return;
        }
        self.stage = Stage::Seeking { job: None };
    }

    /// There is no way at present: another try later, or the end.
    fn no_way(&mut self, now: Stamp, failure: PlanFailure) {
        self.tries += 1;
        self.trouble = failure.words;
        self.enclosed = failure.enclosed;
        if let Some(at) = failure.at {
            self.blocked_at = Some(at);
        }
        self.stage = match failure.for_good {
            true => {
                self.tries = TRIES + 1;
                Stage::Pausing { until: now }
            }
            false => Stage::Pausing { until: now.plus_ms(PAUSE_MS) },
        };
    }

    /// In words, once it gives up.
    fn failure(&self) -> String {
        if let Some(words) = self.blamed() {
            return words;
        }
        match self.blocked_at {
            Some([x_m, y_m]) => format!("blocked near ({x_m:.2}, {y_m:.2}): {}", self.trouble),
            None => self.trouble.clone(),
        }
    }
}

/// Marks count that were seen within this time.
fn lately_ms(tries: u32) -> u64 {
    if tries < PATIENT_TRIES { u64::MAX } else { LATELY_MS }
}

/// Stands with straight wheels.
fn stand(why: Standing) -> Decision {
    Decision::Go(Command::Follow { rpm: WheelRpm::ZERO, steering: Steering::CENTRED }, Some(why))
}
