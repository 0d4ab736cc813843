//! What traffic control knows of one truck.

use super::discretized_path::DiscretizedPath;
use super::held_up::HeldUp;
use super::job::{Block, NoWay};
use super::{PlannedGoal, ReportedRobot};
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_control::speed::STANDS_MPS;
use xtb_nav::geometry::rect::{Rect, Stand};
use xtb_nav::navigator::right_of_way::{HEARD_MS, STOPS_S};
use xtb_nav::{Car, Gears, MapPose};

/// Without a report for so long a truck is driven around, in ms: twice as long as a robot is known to other
/// robots, since the others plan anew then, while it stops at its release's end anyhow.
pub(super) const STALE_MS: u64 = 2 * HEARD_MS;
/// A truck that reports less stands, in m/s: twice what the truck itself takes for standing, as a report is
/// older; chosen, not measured.
const REPORT_STANDS_MPS: f64 = 2.0 * STANDS_MPS;
/// So much of the reported way does not count, in m: one place, as the pose is a little off.
const BEHIND_M: f64 = 0.05;
/// A truck that stands so near before its release's end has reached it, in m: one place (5 cm), and what a
/// stop may fall short (`follower.settle_m`, 0.008).
const SHORT_M: f64 = 0.06;
/// Farther beside its path it is not on it any more, in m: well beyond where the truck stops itself
/// (`navigation.drive.deviation_m`, 0.12).
const OFF_M: f64 = 0.3;
/// Released way that is not driven for so long makes a truck stalled, in ms: longer than the truck itself
/// tries (`navigation.drive.no_progress_s`, 6 s).
const STALL_MS: u64 = 8000;
/// Before a truck that is not led and moves at all, in m, beside its speed times [`STOPS_S`]; chosen, not
/// measured.
const STOPPING_M: f64 = 0.1;
/// Faster than this no truck is expected to come, in m/s, whatever it reports (the message allows 2000): more than three
/// times what an XTB does at full throttle. A false report would keep others standing as far away as it pretends to need.
const FASTEST_MPS: f64 = 10.0;

/// After so many ms, doubled each time up to 8 s, the next way is looked for among many trucks; chosen, not
/// measured.
const MISSED_MS: u64 = 500;

/// The body of a truck that has not said what car it is: it is driven around with room to spare, twice an
/// XTB's length, and not led.
const UNKNOWN_CAR: Car =
    Car { front_m: 0.5, rear_m: 0.5, half_width_m: 0.5, radius_m: 1.0, gears: Gears::BOTH };

/// A way that has been given to a truck.
#[derive(Debug, Clone)]
pub(super) struct Route {
    pub(super) plan: u64,
    /// The plan with which it began at its present start.
    pub(super) base: u64,
    pub(super) way: Arc<DiscretizedPath>,
    /// Driven, as reported, in m.
    pub(super) done_m: f64,
    /// Released up to this place.
    pub(super) release: usize,
    /// The same in m; never shrinks.
    pub(super) release_m: f64,
    /// Whether the rest of it is still to be driven.
    pub(super) live: bool,
    /// It leads out of the others' way, not to the goal.
    pub(super) evades: bool,
}

/// Which of the trucks, by ascending id, has this one.
pub(super) fn place_of(trucks: &[Truck], id: u32) -> Option<usize> {
    trucks.binary_search_by_key(&id, |truck| truck.id).ok()
}

#[derive(Debug, Clone)]
pub(super) struct Truck {
    pub(super) id: u32,
    pub(super) view: ReportedRobot,
    /// When the view was true.
    pub(super) seen: Stamp,
    pub(super) revision: u64,
    pub(super) route: Option<Route>,
    /// Places of an earlier way that it may still use.
    pub(super) retained: Vec<Stand>,
    pub(super) stalled: bool,
    /// What held it up when it last was stalled.
    pub(super) held_up: Option<HeldUp>,
    /// The last plan that it has reported.
    taken: u64,
    /// Since when no released way is left or progress is made.
    pub(super) busy: Stamp,
    /// Since when it has no live route, and stands where it stands.
    pub(super) fixed_since: Stamp,
    fixed_at: MapPose,
    pub(super) retry_at: Stamp,
    pub(super) retry_ms: u64,
    pub(super) none: Option<NoWay>,
    /// Who has to pass first, and whether that one is led itself.
    pub(super) waits_for: Option<(u32, bool)>,
    /// Since when it has had this goal without being led to it.
    wants_since: Stamp,
    /// No joint plan before that: one of which it was part has just ended.
    pub(super) pause_until: Stamp,
    /// Since when joint plans of which it was part have not led everybody to its goal.
    pub(super) in_vain: Option<Stamp>,
    /// When a way was looked for last among many trucks, and how often in a row there was none.
    tried: Option<Stamp>,
    pub(super) misses: u32,
    /// Its last way met one that was planned elsewhere: everybody is looked at for the next one.
    pub(super) anywhere: bool,
    /// When a better way was looked for last, as it stood.
    pub(super) looked_after: Stamp,
    /// For how long it has stood with this goal, in ms, without the time for which a joint plan was being made.
    pub(super) stood_ms: u64,
}

impl Truck {
    pub(super) fn new(id: u32, now: Stamp, view: ReportedRobot) -> Self {
        Self {
            id,
            seen: now,
            revision: 0,
            route: None,
            retained: Vec::new(),
            stalled: false,
            held_up: None,
            taken: 0,
            busy: now,
            fixed_since: now,
            fixed_at: view.pose,
            retry_at: now,
            retry_ms: 0,
            none: None,
            waits_for: None,
            wants_since: now,
            pause_until: Stamp::ZERO,
            in_vain: None,
            tried: None,
            misses: 0,
            anywhere: false,
            looked_after: Stamp::ZERO,
            stood_ms: 0,
            view,
        }
    }

    /// Its body.
    pub(super) fn car(&self) -> Car {
        self.view.car.unwrap_or(UNKNOWN_CAR)
    }

    /// The goal by which a route is recognised.
    pub(super) fn goal(&self) -> Option<((u64, u128), PlannedGoal)> {
        self.view.goal.map(|goal| ((self.view.epoch, goal.id), goal))
    }

    pub(super) fn is_fresh(&self, now: Stamp) -> bool {
        now.since_ms(self.seen) < STALE_MS
    }

    pub(super) fn stands(&self) -> bool {
        self.view.speed_mps.abs() < REPORT_STANDS_MPS
    }

    /// Whether it can be led: heard of, a known car, able to drive, and sent somewhere.
    pub(super) fn can_be_led(&self, now: Stamp) -> bool {
        self.is_fresh(now) && self.view.car.is_some() && self.view.drives && self.view.goal.is_some()
    }

    /// For how long it has had this goal without being led to it, in ms.
    pub(super) fn waited_ms(&self, now: Stamp) -> u64 {
        now.since_ms(self.wants_since)
    }

    /// For how long it has been delayed, in ms: who has a path is so only while it stands.
    pub(super) fn delayed_ms(&self, now: Stamp) -> u64 {
        if self.is_live() { self.stood_ms } else { self.waited_ms(now).max(self.stood_ms) }
    }

    /// Another turn of so long is over.
    pub(super) fn count_standing(&mut self, now: Stamp, turn_ms: u64) {
        self.stood_ms = if self.can_be_led(now) && self.stands() { self.stood_ms + turn_ms } else { 0 };
    }

    /// It is led to its goal, and has its turn with that.
    pub(super) fn is_served(&mut self, now: Stamp) {
        self.wants_since = now;
        (self.misses, self.anywhere) = (0, false);
    }

    /// Since when it has not been looked after: whoever is longest comes first.
    pub(super) fn neglected_since(&self) -> Stamp {
        self.tried.map_or(self.wants_since, |tried| tried.max(self.wants_since))
    }

    /// A way was looked for among many, and there was none: for as long as another one that has its turn stands in the
    /// way that counts for nothing.
    pub(super) fn missed(&mut self, now: Stamp, other_has_turn: bool) {
        self.tried = Some(now);
        self.misses += u32::from(!other_has_turn);
    }

    /// Whether it waits for its next try among many.
    pub(super) fn backs_off(&self, now: Stamp) -> bool {
        self.misses > 0
            && self.tried.is_some_and(|tried| now.since_ms(tried) < MISSED_MS << self.misses.min(4))
    }

    pub(super) fn is_live(&self) -> bool {
        self.route.as_ref().is_some_and(|route| route.live)
    }

    /// Takes a report. True if the situation is another one now.
    pub(super) fn hear(&mut self, seen: Stamp, view: ReportedRobot) -> bool {
        let other_goal = self.goal().map(|(key, _)| key) != view.goal.map(|goal| (view.epoch, goal.id));
        let has_passed = other_goal && self.has_passed(&view);
        let other_car = self.view.car != view.car;
        self.view = view;
        if other_car {
            self.measure();
        }
        self.seen = seen;
        if other_goal {
            match has_passed {
                true => self.halt(seen),
                false => self.drop_route(),
            }
            self.stalled = false;
            self.none = None;
            self.wants_since = seen;
            (self.misses, self.anywhere) = (0, false);
            self.stood_ms = 0;
        }
        let confirmed = match (&mut self.route, &self.view.route) {
            (Some(route), Some(report)) if (route.base..=route.plan).contains(&report.plan) => {
                if report.done_m > route.done_m + 0.01 {
                    self.busy = seen;
                    self.stalled = false;
                }
                self.taken = report.plan;
                route.done_m = report.done_m.clamp(route.done_m, route.release_m.max(route.done_m));
                true
            }
            (Some(_), _) => false,
            (None, _) => self.view.speed_mps.abs() < REPORT_STANDS_MPS,
        };
        if confirmed {
            self.retained.clear();
        }
        other_goal
    }

    /// Whether it has passed its goal, and says so while it drives on to the end of its route: all of that is released,
    /// and its next route goes on from there.
    fn has_passed(&self, view: &ReportedRobot) -> bool {
        let Some(route) = self.route.as_ref().filter(|route| route.live && !route.evades) else {
            return false;
        };
        let follows =
            view.route.as_ref().is_some_and(|report| (route.base..=route.plan).contains(&report.plan));
        let goes_on = self.view.goal.is_some() && view.goal.is_some() && view.epoch == self.view.epoch;
        follows && goes_on && !self.stalled && self.is_complete()
    }

    /// It is another car than was known: its body takes other room along its route.
    fn measure(&mut self) {
        let car = self.car();
        if let Some(route) = &mut self.route {
            route.way = Arc::new(DiscretizedPath::new(route.way.path.clone(), &car));
        }
    }

    /// Forgets its route; what is released of it stays taken until it stands.
    pub(super) fn drop_route(&mut self) {
        self.retain_held();
        self.route = None;
        self.revision += 1;
    }

    /// What it holds stays taken until it is known to be elsewhere.
    pub(super) fn retain_held(&mut self) {
        let held = self.held().to_vec();
        self.retained.extend(held);
    }

    /// Gives up the rest of its route; what is released stays.
    pub(super) fn halt(&mut self, now: Stamp) {
        if let Some(route) = self.route.as_mut().filter(|route| route.live) {
            route.live = false;
            self.fixed_since = now;
            self.revision += 1;
        }
    }

    /// The place that it has surely reached.
    pub(super) fn confirmed(&self) -> usize {
        let Some(route) = &self.route else { return 0 };
        if self.stands() && route.done_m >= route.release_m - SHORT_M {
            return route.release;
        }
        let behind = BEHIND_M + self.view.sigma_m.clamp(0.0, 0.1);
        route.way.place((route.done_m - behind).max(0.0)).min(route.release)
    }

    /// The places that it has not left for sure and may go to.
    pub(super) fn held(&self) -> &[Stand] {
        self.route.as_ref().map_or(&[], |route| &route.way.stands[self.confirmed()..=route.release])
    }

    /// Whether it has left all that was ever released to it.
    pub(super) fn holds_nothing(&self) -> bool {
        self.route.is_none() && self.retained.is_empty()
    }

    /// Whether all of its way is released.
    pub(super) fn is_complete(&self) -> bool {
        self.route.as_ref().is_some_and(|route| route.release == route.way.last())
    }

    /// Notices that it is not where, or not as fast as, it should be. True if that is news.
    pub(super) fn watch(&mut self, now: Stamp) -> bool {
        let fixed_m =
            libm::hypot(self.view.pose.x_m - self.fixed_at.x_m, self.view.pose.y_m - self.fixed_at.y_m);
        let moved = fixed_m > 0.1;
        if moved || self.is_live() {
            self.fixed_since = now;
            self.fixed_at = self.view.pose;
        }
        let mut changed = moved && !self.is_live();
        if self.is_live() && !self.can_be_led(now) {
            self.halt(now);
            changed = true;
        }
        let aside =
            self.is_complete() && self.stands() && self.route.as_ref().is_some_and(|route| route.evades);
        if aside && self.is_live() && self.confirmed() == self.route.as_ref().map_or(0, |route| route.release)
        {
            self.halt(now);
            self.retry_at = now;
        }
        let Some(route) = &self.route else { return changed };
        let way_left =
            route.release_m - route.done_m > 0.1 || (route.release == route.way.last() && !route.evades);
        let (there, _) = route.way.path.at(route.done_m);
        let off_m = libm::hypot(there.x_m - self.view.pose.x_m, there.y_m - self.view.pose.y_m);
        let off = self.can_be_led(now) && self.retained.is_empty() && off_m > OFF_M;
        if !way_left || !self.can_be_led(now) {
            self.busy = now;
        }
        // It got off its path, or went its own way while nobody led it.
        let lost = self.view.route.is_none() && (route.base..=route.plan).contains(&self.taken);
        if !self.stalled && (off || lost && self.can_be_led(now) || now.since_ms(self.busy) > STALL_MS) {
            self.stalled = true;
            self.halt(now);
            self.retry_at = now;
            changed = true;
        }
        if self.stalled {
            self.held_up = HeldUp::reported(now, &self.view).or(self.held_up);
        }
        changed
    }

    /// What it is led around and nobody else is, if there is something.
    pub(super) fn own_block(&self, now: Stamp) -> Option<Block> {
        self.held_up?.block(now, (self.id, &self.car(), &self.view.pose))
    }

    /// Where it has to be driven around, as one that is not led.
    pub(super) fn block(&self) -> Vec<Stand> {
        // One that goes on to the end of what is released needs its look-out there.
        let goes_on = self.view.drives && !self.stalled;
        let held = self.retained.iter().chain(self.held());
        let mut stands: Vec<Stand> =
            held.map(|stand| Stand { look: stand.look.filter(|_| goes_on), ..*stand }).collect();
        stands.push(Stand { body: self.stopping_body(), look: None });
        stands
    }

    /// Its body, and what it drives through until it stands.
    pub(super) fn stopping_body(&self) -> Rect {
        let (car, speed_mps) = (self.car(), self.view.speed_mps);
        let believed_mps = speed_mps.abs().min(FASTEST_MPS);
        let stopping_m = if self.stands() { 0.0 } else { STOPPING_M + STOPS_S * believed_mps };
        let longer = Car {
            front_m: car.front_m + if speed_mps > 0.0 { stopping_m } else { 0.0 },
            rear_m: car.rear_m + if speed_mps < 0.0 { stopping_m } else { 0.0 },
            ..car
        };
        Rect::body(&longer, &self.view.pose)
    }
}
