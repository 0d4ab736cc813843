//! Traffic control of a fleet: a state machine without I/O.
//!
//! ```text
//!   reports ──► [`Coordinator::robot`] ─┐                    ┌─► guides, one for each truck
//!                                       ├─ [`Coordinator::tick`]
//!   joint plans ─► [`Coordinator::planned`] ◄── elsewhere ◄── [`Coordinator::job`]
//! ```
//!
//! * A **way** is an exact path and its places, 5 cm apart. A **release** is the place up to which a
//!   truck may go whatever happens to the others; it never shrinks. A truck **holds** what it has not
//!   left for sure and what is released to it.
//! * The **passing order** says for each place of each way how far each other truck must be before.
//!   It comes from a joint plan in space and time, and is all that is kept of its clock: a truck that
//!   is late delays others and meets nobody, and what two trucks hold never conflicts.
//! * Only trucks with a planned goal are led. All others are driven around: those without a goal,
//!   latched, taken over, failed, stalled, or not heard of.

pub mod joint;
pub mod rect;
pub mod room;

mod field;
mod order;
mod release;
mod search;
mod timeline;
mod truck;
mod way;

pub use joint::{JointJob, JointResult};
pub use room::{GridRoom, Room};

use crate::{Car, MapPose, Path};
use joint::{Block, MOST_TICKS, Member};
use order::{Order, Runner, run_ahead};
use search::Target;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use truck::{Route, Truck};
use way::{STEP_M, Way};
use xtb_control::Stamp;

/// Most trucks that are looked at; more are ignored and counted.
pub const MOST_TRUCKS: usize = 64;
/// Most arcs of a path that is sent.
pub const MOST_ARCS: usize = 256;
/// With so many arcs a truck goes to its release's end and begins anew there.
const MANY_ARCS: usize = 160;
/// Listens for so long before it releases anything, in ms: what it finds released stays so.
const LISTEN_MS: u64 = 1500;
/// Something stands so long before ways are planned around it, in ms.
const SETTLED_MS: u64 = 1500;
/// Between the end of one joint plan and the beginning of the next, in ms.
const PAUSE_MS: u64 = 300;
/// A job that takes longer is given up, in ms.
const JOB_MS: u64 = 30_000;
/// Nobody moved for so long though someone should, in ms.
const DEADLOCK_MS: u64 = 8000;
/// A way that begins anew begins at most so far from where the truck is when it gets it, in m.
const START_M: f64 = 0.1;
/// Nodes that a joint plan may expand in all.
const BUDGET: u32 = 60_000;

/// A goal that a robot goes for by a planned way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedGoal {
    /// The request's id.
    pub id: u128,
    /// East, in m.
    pub x_m: f64,
    /// North, in m.
    pub y_m: f64,
    /// Heading there; `None` = any.
    pub yaw_rad: Option<f64>,
}

/// The route by which a robot goes, as it says itself.
#[derive(Debug, Clone, PartialEq)]
pub struct RouteReport {
    /// Number of the coordinator's plan.
    pub plan: u64,
    /// The path.
    pub path: Path,
    /// Driven along it, in m.
    pub done_m: f64,
    /// Released along it as far as it knows, in m.
    pub release_m: f64,
}

/// What a robot says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotView {
    /// Its name.
    pub name: String,
    /// Its boot.
    pub epoch: u64,
    /// Where it is.
    pub pose: MapPose,
    /// Standard deviation of the position, in m.
    pub sigma_m: f64,
    /// Speed, negative astern, in m/s.
    pub speed_mps: f64,
    /// The running goal that is reached by a planned way.
    pub goal: Option<PlannedGoal>,
    /// Its route for that goal, if traffic control gave it one.
    pub route: Option<RouteReport>,
    /// Whether it may move: not latched, failed, taken over or driven by hand.
    pub drives: bool,
    /// How old all this is.
    pub age_ms: u64,
}

/// What a robot is told, each tick. A plan continues the one before (the same start, the same pieces
/// up to its release: what has been driven still counts) or begins where the robot stands; one that
/// begins farther than 10 cm from where it is must not be taken up.
#[derive(Debug, Clone, PartialEq)]
pub struct Guide {
    /// Boot and goal for which it is.
    pub goal: Option<(u64, u128)>,
    /// Number of the plan; 0 = none yet.
    pub plan: u64,
    /// The path; `None` = none yet, stand.
    pub path: Option<Path>,
    /// Released along the path, in m: stand there.
    pub release_m: f64,
    /// At most so fast, in m/s.
    pub cruise_mps: f64,
    /// Who has to pass first, or is in the way.
    pub waits_for: Option<String>,
    /// Why there is no path, or no way on.
    pub reason: Option<String>,
}

/// What has happened so far.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Joint plans that were used.
    pub plans: u64,
    /// Joint plans that left someone without a way.
    pub without_way: u64,
    /// Times that everybody stood for nothing.
    pub deadlocks: u64,
    /// Passing orders that turned out to block each other.
    pub cyclic: u64,
    /// Trucks that did not use their released way.
    pub stalls: u64,
    /// Reports of trucks beyond [`MOST_TRUCKS`].
    pub ignored: u64,
}

/// Traffic control.
#[derive(Debug)]
pub struct Coordinator {
    car: Car,
    room: Arc<dyn Room>,
    trucks: Vec<Truck>,
    order: Order,
    ids: u32,
    plan: u64,
    jobs: u64,
    job: Option<(u64, Stamp)>,
    next_job: Stamp,
    began: Option<Stamp>,
    moved: Stamp,
    seed: u64,
    counters: Counters,
}

impl Coordinator {
    /// For trucks of one kind in one room; the seed is for orders that are drawn.
    #[must_use]
    pub fn new(car: Car, room: Arc<dyn Room>, seed: u64) -> Self {
        Self {
            car,
            room,
            trucks: Vec::new(),
            order: Order::new(),
            ids: 0,
            plan: 0,
            jobs: 0,
            job: None,
            next_job: Stamp::ZERO,
            began: None,
            moved: Stamp::ZERO,
            seed,
            counters: Counters::default(),
        }
    }

    /// What has happened so far.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Names of the trucks that are led, and of those that are driven around.
    #[must_use]
    pub fn names(&self) -> (Vec<String>, Vec<String>) {
        let of = |live: bool| {
            let trucks = self.trucks.iter().filter(|truck| truck.is_live() == live);
            trucks.map(|truck| truck.view.name.clone()).collect()
        };
        (of(true), of(false))
    }

    /// Another map: everybody stops at the end of what is released, and all ways are looked for anew.
    pub fn map(&mut self, now: Stamp, room: Arc<dyn Room>) {
        self.room = room;
        self.trucks.iter_mut().for_each(|truck| truck.halt(now));
        self.job = None;
        self.stir(now);
    }

    /// A robot that is not there any more: nobody drives around it from now on.
    pub fn forget(&mut self, name: &str) {
        self.trucks.retain(|truck| truck.view.name != name);
    }

    /// A report of a robot. One that is older than the last is dropped.
    pub fn robot(&mut self, now: Stamp, view: RobotView) {
        let seen = Stamp::from_ns(now.ns().saturating_sub(view.age_ms.saturating_mul(1_000_000)));
        let known = self.trucks.iter().position(|truck| truck.view.name == view.name);
        let index = match known {
            Some(index) if self.trucks[index].seen > seen => return,
            Some(index) => index,
            None if self.trucks.len() == MOST_TRUCKS => {
                self.counters.ignored += 1;
                return;
            }
            None => {
                self.ids += 1;
                self.trucks.push(Truck::new(self.ids, seen, view.clone()));
                self.stir(now);
                self.adopt(self.trucks.len() - 1);
                self.trucks.len() - 1
            }
        };
        let (before, could) = (self.trucks[index].confirmed(), self.trucks[index].can_be_led(now));
        let other_goal = self.trucks[index].hear(seen, view);
        if self.trucks[index].confirmed() > before {
            self.moved = now;
        }
        if other_goal || could != self.trucks[index].can_be_led(now) {
            self.stir(now);
        }
    }

    /// Takes over what an earlier coordinator has released to a truck.
    fn adopt(&mut self, index: usize) {
        let truck = &mut self.trucks[index];
        let Some(report) = truck.view.route.clone().filter(|_| truck.view.goal.is_some()) else { return };
        self.plan = self.plan.max(report.plan);
        let way = Way::new(report.path, &self.car);
        let release_m = report.release_m.clamp(0.0, way.length_m);
        // What lies between two places counts as released up to the second one.
        let release = (libm::ceil(release_m / STEP_M - 1e-6) as usize).min(way.last());
        let live = release == way.last();
        let done_m = report.done_m.clamp(0.0, release_m);
        let plan = report.plan;
        truck.route = Some(Route { plan, base: plan, way, done_m, release, release_m, live });
    }

    /// Something has changed: those without a way may try again soon.
    fn stir(&mut self, now: Stamp) {
        for truck in &mut self.trucks {
            truck.retry_at = truck.retry_at.min(now);
            truck.retry_ms = 0;
        }
    }

    /// What each robot is told now. At 5 to 10 Hz.
    pub fn tick(&mut self, now: Stamp) -> BTreeMap<String, Guide> {
        let began = *self.began.get_or_insert(now);
        if self.job.is_some_and(|(_, since)| now.since_ms(since) > JOB_MS) {
            self.job = None;
        }
        let (mut changed, mut stalls) = (false, 0);
        for truck in &mut self.trucks {
            let stalled = truck.stalled;
            changed |= truck.watch(now);
            stalls += u64::from(truck.stalled && !stalled);
        }
        self.counters.stalls += stalls;
        if changed {
            self.stir(now);
        }
        let blocks = self.blocks();
        if self.job.is_none() && now.since_ms(began) >= LISTEN_MS {
            self.turn_away(now, &blocks);
            for index in 0..self.trucks.len() {
                if release::grow(&mut self.trucks, index, &self.order, &blocks) {
                    self.moved = now;
                }
            }
            self.break_deadlock(now);
        }
        (0..self.trucks.len())
            .map(|index| (self.trucks[index].view.name.clone(), self.guide(index)))
            .collect()
    }

    /// Everything that is driven around, and what led trucks may still use of earlier ways.
    fn blocks(&self) -> Vec<Block> {
        let block = |truck: &Truck| {
            let stands = if truck.is_live() { truck.retained.clone() } else { truck.block(&self.car) };
            Block { id: truck.id, name: truck.view.name.clone(), stands }
        };
        self.trucks.iter().map(block).filter(|block| !block.stands.is_empty()).collect()
    }

    /// Who would run into something that stays there looks for another way.
    fn turn_away(&mut self, now: Stamp, blocks: &[Block]) {
        let settled: BTreeSet<u32> = self
            .trucks
            .iter()
            .filter(|truck| !truck.is_live() && now.since_ms(truck.fixed_since) >= SETTLED_MS)
            .map(|truck| truck.id)
            .collect();
        for truck in &mut self.trucks {
            let mut others =
                blocks.iter().filter(|block| block.id != truck.id && settled.contains(&block.id));
            if others.any(|block| release::meets(truck, block)) {
                truck.halt(now);
                truck.retry_at = now;
            }
        }
    }

    /// The net below: nobody moves though somebody should.
    fn break_deadlock(&mut self, now: Stamp) {
        let open = self.trucks.iter().any(|truck| truck.is_live() && !truck.is_complete());
        if !open {
            self.moved = now;
        }
        if now.since_ms(self.moved) > DEADLOCK_MS {
            self.counters.deadlocks += 1;
            self.seed = self.seed.wrapping_add(1);
            self.moved = now;
            self.trucks.iter_mut().filter(|truck| !truck.is_complete()).for_each(|truck| truck.halt(now));
            self.stir(now);
        }
    }

    fn guide(&self, index: usize) -> Guide {
        let truck = &self.trucks[index];
        let name =
            |id: u32| self.trucks.iter().find(|other| other.id == id).map(|other| other.view.name.clone());
        let waits = truck.waits_for.filter(|_| truck.is_live());
        let blocked = truck.none.as_ref().filter(|_| !truck.is_live());
        let waits_for =
            waits.and_then(|(id, _)| name(id)).or_else(|| blocked.and_then(|none| none.by.clone()));
        let reason = match (waits, blocked) {
            _ if truck.view.goal.is_none() => None,
            (Some((id, false)), _) => name(id).map(|name| format!("blocked by {name}")),
            (_, Some(none)) => Some(none.reason.clone()),
            _ if truck.is_live() => None,
            _ => Some("planning".to_owned()),
        };
        let route = truck.route.as_ref();
        Guide {
            goal: truck.goal().map(|(key, _)| key),
            plan: route.map_or(0, |route| route.plan),
            path: route.map(|route| route.way.path.clone()),
            release_m: route.map_or(0.0, |route| route.release_m),
            cruise_mps: release::cruise_mps(&self.trucks, index),
            waits_for,
            reason,
        }
    }

    /// Work for another thread, if there is any: at most one job is out at a time, and nothing is
    /// released until its result is back in [`Self::planned`].
    pub fn job(&mut self, now: Stamp) -> Option<JointJob> {
        let began = self.began?;
        if self.job.is_some() || now < self.next_job || now.since_ms(began) < LISTEN_MS {
            return None;
        }
        let members: Vec<Member> = self.trucks.iter().filter_map(|truck| self.member(now, truck)).collect();
        let due = |truck: &Truck| !truck.is_live() && truck.retry_at <= now;
        let is_due = |member: &Member| self.trucks.iter().any(|truck| truck.id == member.id && due(truck));
        if !members.iter().any(|member| member.wanting && is_due(member)) {
            return None;
        }
        let ids: BTreeSet<u32> = members.iter().map(|member| member.id).collect();
        let mut blocks = self.blocks();
        // A member that goes on from its release's end is no obstacle; what one that begins anew may
        // still use of its old way is.
        let goes_on = |truck: &&Truck| ids.contains(&truck.id) && truck.retained.is_empty() && !truck.stalled;
        let on: BTreeSet<u32> = self.trucks.iter().filter(goes_on).map(|truck| truck.id).collect();
        blocks.retain(|block| !on.contains(&block.id));
        self.jobs += 1;
        self.job = Some((self.jobs, now));
        let (order, room) = (self.order.clone(), Arc::clone(&self.room));
        let seed = self.seed.wrapping_add(self.jobs);
        Some(JointJob { id: self.jobs, room, car: self.car, members, blocks, order, seed, budget: BUDGET })
    }

    /// A truck as a joint plan sees it; `None` = it is driven around.
    fn member(&self, now: Stamp, truck: &Truck) -> Option<Member> {
        let (_, goal) = truck.goal()?;
        let wanting = !truck.is_live();
        if !truck.can_be_led(now) {
            return None;
        }
        let goes_on =
            truck.route.as_ref().filter(|route| !truck.stalled && route.way.path.pieces.len() < MANY_ARCS);
        let (way, done_m, held) = match goes_on.or(truck.route.as_ref().filter(|_| !wanting)) {
            Some(route) => (route.way.clone(), route.done_m, route.release),
            None if truck.stands() => (Way::new(Path::standing(truck.view.pose), &self.car), 0.0, 0),
            None => return None,
        };
        Some(Member {
            id: truck.id,
            name: truck.view.name.clone(),
            revision: truck.revision,
            way,
            done_m,
            held,
            wanting,
            target: Target { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: goal.yaw_rad },
        })
    }

    /// The result of a job. What does not fit any more is left out: such a truck is not led now.
    pub fn planned(&mut self, now: Stamp, result: JointResult) {
        if self.job.is_none_or(|(id, _)| id != result.id) {
            return;
        }
        self.job = None;
        self.next_job = Stamp::from_ns(now.ns() + PAUSE_MS * 1_000_000);
        self.counters.without_way += u64::from(!result.none.is_empty());
        self.counters.plans += u64::from(!result.plans.is_empty());
        for none in result.none {
            let fits = |truck: &&mut Truck| truck.id == none.id && truck.revision == none.revision;
            if let Some(truck) = self.trucks.iter_mut().find(fits) {
                truck.retry_ms = (truck.retry_ms * 2).clamp(1000, 10_000);
                truck.retry_at = Stamp::from_ns(now.ns() + truck.retry_ms * 1_000_000);
                truck.none = Some(none);
            }
        }
        let any = !result.plans.is_empty();
        for plan in result.plans {
            let fits = |truck: &&mut Truck| truck.id == plan.id && truck.revision == plan.revision;
            if let Some(truck) = self.trucks.iter_mut().find(fits)
                && plan.way.path.pieces.len() <= MOST_ARCS
            {
                self.plan += 1;
                lead(truck, now, self.plan, plan.way);
            }
        }
        if any {
            self.order = result.order;
            self.moved = now;
            if !self.is_acyclic() {
                self.counters.cyclic += 1;
                self.trucks.iter_mut().filter(|truck| !truck.is_complete()).for_each(|truck| truck.halt(now));
            }
        }
    }

    /// Whether everybody who is led would arrive if nobody failed.
    #[must_use]
    pub fn is_acyclic(&self) -> bool {
        let routes = self.trucks.iter().filter_map(|truck| truck.route.as_ref().map(|route| (truck, route)));
        let runners: Vec<Runner<'_>> = routes
            .filter(|(_, route)| route.live)
            .map(|(truck, route)| Runner { id: truck.id, way: &route.way, done_m: route.done_m })
            .collect();
        run_ahead(&runners, &self.order, MOST_TICKS).is_some()
    }
}

/// Gives a truck its new way.
fn lead(truck: &mut Truck, now: Stamp, plan: u64, way: Way) {
    let goes_on = |route: &Route| route.way.path.start == way.path.start && !truck.stalled;
    if !truck.route.as_ref().is_some_and(goes_on) {
        let (start, here) = (way.path.start, truck.view.pose);
        if !truck.stands() || libm::hypot(start.x_m - here.x_m, start.y_m - here.y_m) > START_M {
            return;
        }
        truck.retain_held();
        truck.route = None;
    }
    truck.revision += 1;
    truck.none = None;
    truck.busy = now;
    truck.stalled = false;
    let continued = truck.route.take();
    truck.route = Some(match continued {
        Some(before) => Route { plan, way, live: true, ..before },
        None => Route { plan, base: plan, way, done_m: 0.0, release: 0, release_m: 0.0, live: true },
    });
}
