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
//! * Trucks that could get into each other's way form a **region**, planned apart from all others; in one of many
//!   trucks only those without a way are planned, and the others drive on. A result is used only as far as it fits
//!   what was released meanwhile.
//! * Only trucks with a planned goal are led. All others are driven around: those without a goal,
//!   latched, taken over, failed, stalled, or not heard of.

mod arrival_times;
mod attempt;
mod blocker_search;
mod crowd;
mod discretized_path;
mod each;
mod expected;
mod field;
mod group;
mod guides;
mod held_up;
mod in_turn;
mod job;
mod joint;
mod lane;
mod messages;
mod nearby;
mod obstacles;
mod occupancy;
mod order;
mod outstanding;
mod plans;
mod refused;
mod regions;
mod release;
mod results;
mod room;
mod search;
mod separation;
mod standstill;
mod task;
mod truck;
mod unknown;
mod view;

pub use field::Field;
pub use job::{JointJob, JointResult};
pub use messages::Neighbours;
pub use plans::MOST_JOBS;
pub use room::{GridRoom, RoomGeometry};
pub use view::{CoordinatorCounters, Guide, PlannedGoal, ReportedRobot, RouteReport};

use discretized_path::{DiscretizedPath, STEP_M};
use job::Block;
use joint::MOST_TICKS;
use obstacles::Obstacles;
use order::{Order, Runner, run_ahead};
use outstanding::Outstanding;
use plans::MOST_SOON;
use refused::Refused;
use release::Heads;
use standstill::Standstill;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use truck::{Route, Truck, place_of};
use unknown::Unknown;
use xtb_control::Stamp;
use xtb_nav::navigator::LONGEST_PATH_M;

/// Most trucks that are looked at; more are refused ([`Coordinator::refused`]) and counted. A truck takes about 0.15 MB with a way of 50 m and
/// 1.5 MB with the longest, 500 m; the passing order of 500 in one hall a few MB more.
pub const MOST_TRUCKS: usize = 512;
/// A truck that was not heard of for so long makes room for one that speaks, if there are [`MOST_TRUCKS`] and it
/// holds nothing of a route, in ms: until then one that stands in a doorway without a network is driven around,
/// and as long as there is room, for good. Chosen, not measured.
const GONE_MS: u64 = 600_000;
/// No coordinator counts its plans so far, nor can a JSON reader that has 64-bit floating-point numbers only: at
/// a thousand a second it would take 285,000 years. A greater number is none of an earlier coordinator's.
const MOST_PLANS: u64 = 1 << 53;
/// Listens for so long before it releases anything, in ms, 30 states of each robot: what it finds released
/// stays so. Chosen, not measured.
const LISTEN_MS: u64 = 1500;
/// Something stands so long before ways are planned around it, in ms; chosen, not measured.
const SETTLED_MS: u64 = 1500;
/// One that stands there only until it gets a way itself turns away those that would come to it within so much way, in
/// m, ten seconds' drive: the others go on, since it will mostly be gone by then. Chosen with 300 robots in a hall
/// (2 m: much the same; 1 m: longer standstills).
const WAITING_NEAR_M: f64 = 4.0;
/// While more wait for their ways than can get one soon, it turns away only those that have stood for so long
/// themselves, in ms: mostly it has got its way by then. Chosen with 500 robots in a hall: when all were turned away at
/// once, as many gave up their ways as got some; with 300, of which few wait, that is better.
const PATIENT_MS: u64 = 10_000;
/// A job that takes longer is lost, in ms. Jobs end by what they may expand, not by the clock: this is only for
/// one whose thread has died.
const JOB_MS: u64 = 300_000;
/// Nobody moved for so long though someone should, in ms: longer than [`standstill::STANDSTILL_MS`], as all ways
/// are given up then; chosen, not measured.
const DEADLOCK_MS: u64 = 8000;

/// Traffic control.
#[derive(Debug)]
pub struct Coordinator {
    room: Arc<dyn RoomGeometry>,
    /// By ascending id.
    trucks: Vec<Truck>,
    ids_by_name: BTreeMap<String, u32>,
    unknown: Unknown,
    refused: Refused,
    order: Order,
    ids: u32,
    plan: u64,
    jobs: u64,
    /// Joint plans that are being made.
    out: Vec<Outstanding>,
    began: Option<Stamp>,
    moved: Stamp,
    standstill: Standstill,
    seed: u64,
    counters: CoordinatorCounters,
}

impl Coordinator {
    /// For trucks in one room, each with the car of its own reports; the seed is for orders that are drawn.
    #[must_use]
    pub fn new(room: Arc<dyn RoomGeometry>, seed: u64) -> Self {
        Self {
            room,
            trucks: Vec::new(),
            ids_by_name: BTreeMap::new(),
            unknown: Unknown::default(),
            refused: Refused::default(),
            order: Order::new(),
            ids: 0,
            plan: 0,
            jobs: 0,
            out: Vec::new(),
            began: None,
            moved: Stamp::ZERO,
            standstill: Standstill::default(),
            seed,
            counters: CoordinatorCounters::default(),
        }
    }

    /// What has happened so far.
    #[must_use]
    pub fn counters(&self) -> CoordinatorCounters {
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
    pub fn map(&mut self, now: Stamp, room: Arc<dyn RoomGeometry>) {
        self.room = room;
        self.trucks.iter_mut().for_each(|truck| truck.halt(now));
        self.out.clear();
        self.stir(now);
    }

    /// A robot that is not there any more: nobody drives around it from now on.
    pub fn forget(&mut self, name: &str) {
        self.refused.remove(name);
        if let Some(id) = self.ids_by_name.remove(name) {
            self.trucks.retain(|truck| truck.id != id);
            self.drop_order_of(id);
        }
    }

    /// A report of a robot. One that is older than the last is dropped.
    pub fn robot(&mut self, now: Stamp, view: ReportedRobot) {
        let seen = Stamp::from_ns(now.ns().saturating_sub(view.age_ms.saturating_mul(1_000_000)));
        let known = self.ids_by_name.get(&view.name).and_then(|&id| place_of(&self.trucks, id));
        let index = match known {
            Some(index) if self.trucks[index].seen > seen => return,
            Some(index) => index,
            None if self.trucks.len() == MOST_TRUCKS && !self.make_room(now, seen) => {
                self.counters.ignored += 1;
                self.refused.add(seen, &view);
                return;
            }
            None => {
                self.ids += 1;
                self.refused.remove(&view.name);
                self.ids_by_name.insert(view.name.clone(), self.ids);
                self.trucks.push(Truck::new(self.ids, seen, view.clone()));
                self.stir(now);
                self.adopt(self.trucks.len() - 1);
                self.trucks.len() - 1
            }
        };
        let (before, could) = (self.trucks[index].confirmed(), self.trucks[index].can_be_led(now));
        let blocked_at_m = view.blocked_at_m;
        let other_goal = self.trucks[index].hear(seen, view);
        if self.trucks[index].confirmed() > before {
            self.moved = now;
        }
        if let Some(at_m) = blocked_at_m
            && self.unknown.report(now, at_m, &self.trucks)
        {
            self.stir(now);
        }
        if other_goal || could != self.trucks[index].can_be_led(now) {
            self.stir(now);
        }
    }

    /// Whoever was heard of longest ago goes, if it is gone, for one that was heard of at `seen`. True if one went.
    /// A robot that is gone may still be told of, with its old age: it displaces nobody.
    fn make_room(&mut self, now: Stamp, seen: Stamp) -> bool {
        let is_gone = |seen: Stamp| now.since_ms(seen) >= GONE_MS;
        let may_go = |truck: &&Truck| is_gone(truck.seen) && truck.holds_nothing();
        let goes = self.trucks.iter().filter(may_go).min_by_key(|truck| truck.seen).map(|truck| truck.id);
        let Some(goes) = goes.filter(|_| !is_gone(seen)) else { return false };
        self.trucks.retain(|truck| truck.id != goes);
        self.ids_by_name.retain(|_, id| *id != goes);
        self.drop_order_of(goes);
        true
    }

    /// Takes over what an earlier coordinator has released to a truck. A path that no robot would follow is not
    /// one of a coordinator's: it would fill the memory with its places.
    fn adopt(&mut self, index: usize) {
        let truck = &mut self.trucks[index];
        let Some(report) = truck.view.route.clone().filter(|_| truck.view.goal.is_some()) else { return };
        let length_m = report.path.length_m();
        if length_m > LONGEST_PATH_M || report.release_m > length_m + STEP_M {
            return;
        }
        let way = Arc::new(DiscretizedPath::new(report.path, &truck.car()));
        let release_m = report.release_m.clamp(0.0, way.length_m);
        // What lies between two places counts as released up to the second one.
        let release = (libm::ceil(release_m / STEP_M - 1e-6) as usize).min(way.last());
        let live = release == way.last();
        let done_m = report.done_m.clamp(0.0, release_m);
        let plan = report.plan;
        truck.route = Some(Route { plan, base: plan, way, done_m, release, release_m, live, evades: false });
        if plan > MOST_PLANS {
            // The next number would be none: what it says it holds stays taken until it stands, then it is led anew.
            truck.drop_route();
            return;
        }
        self.plan = self.plan.max(plan);
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
        self.out.retain(|job| now.since_ms(job.since) <= JOB_MS);
        let (mut changed, mut stalls) = (false, 0);
        for truck in &mut self.trucks {
            let stalled = truck.stalled;
            changed |= truck.watch(now);
            stalls += u64::from(truck.stalled && !stalled);
        }
        self.counters.stalls += stalls;
        self.unknown.fade(now);
        self.refused.fade(now);
        if changed {
            self.stir(now);
        }
        if now.since_ms(began) >= LISTEN_MS {
            self.release(now);
        }
        self.end_standstill(now);
        let heads = Heads::of(&self.trucks);
        (0..self.trucks.len())
            .map(|index| (self.trucks[index].view.name.clone(), self.guide(now, index, &heads)))
            .collect()
    }

    /// Lets everybody go on for whom no other way is being looked for.
    fn release(&mut self, now: Stamp) {
        let waits: BTreeSet<u32> = self.out.iter().flat_map(Outstanding::frozen).collect();
        let reach_m = self.trucks.iter().map(|truck| truck.car().reach_m()).fold(0.0, f64::max);
        let blocks = self.blocks();
        self.turn_away(now, &Obstacles::of(&blocks, reach_m), &waits);
        // Who has just given up its way is in the way from now on.
        let blocks = self.blocks();
        let obstacles = Obstacles::of(&blocks, reach_m);
        for index in 0..self.trucks.len() {
            if !waits.contains(&self.trucks[index].id)
                && release::grow(&mut self.trucks, index, &self.order, &obstacles.all)
            {
                self.moved = now;
            }
        }
        if self.out.is_empty() {
            self.break_deadlock(now);
        }
    }

    /// Everything that is driven around, and what led trucks may still use of earlier ways.
    fn blocks(&self) -> Vec<Block> {
        let block = |truck: &Truck| {
            let stands = if truck.is_live() { truck.retained.clone() } else { truck.block() };
            Block { id: truck.id, only: None, name: truck.view.name.clone(), stands }
        };
        let trucks = self.trucks.iter().map(block).filter(|block| !block.stands.is_empty());
        trucks.chain(self.unknown.blocks()).collect()
    }

    /// Who would run into something that stays there looks for another way; into one that has none itself, only when
    /// it is near. Among many somebody always waits for one: whoever gave up its way for that would stand in others'.
    fn turn_away(&mut self, now: Stamp, obstacles: &Obstacles<'_>, waits: &BTreeSet<u32>) {
        let waiting = self.trucks.iter().filter(|truck| !truck.is_live() && truck.can_be_led(now)).count();
        let patient_ms = if waiting > MOST_SOON { PATIENT_MS } else { 0 };
        // Whether each only waits for a way.
        let settled: BTreeMap<u32, bool> = self
            .trucks
            .iter()
            .filter(|truck| !truck.is_live() && now.since_ms(truck.fixed_since) >= SETTLED_MS)
            .map(|truck| (truck.id, truck.can_be_led(now)))
            .chain(self.unknown.ids().map(|id| (id, false)))
            .collect();
        for truck in self.trucks.iter_mut().filter(|truck| !waits.contains(&truck.id)) {
            let waiting_m = if truck.stood_ms >= patient_ms { WAITING_NEAR_M } else { 0.0 };
            let within_m = |id| settled.get(&id).map(|&waits| if waits { waiting_m } else { f64::MAX });
            if obstacles.meet(truck, within_m) {
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
