//! One round of decisions about docks and parking places.

mod orders;

use crate::dispatcher::Dispatcher;
use crate::dispatcher::client_requests::CANCELLED_BY;
use crate::home::{AT_M, HomeRules, Need, OCCUPIED_M, distance_m, is_dock_of, is_same, waypoint};
use crate::task::Task;
use crate::tracked_robot::TrackedRobot;
use crate::travel_cost::TravelCost;
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::messages::{MapPlace, PlaceKind, TaskId, TaskState, Waypoint, Who};

/// A robot whose drive has failed is not sent again for this long, in ms.
const FAILED_MS: u64 = 60_000;
/// One whose drive somebody has cancelled is left alone for this long, in ms.
const CANCELLED_MS: u64 = 600_000;
/// Who has stood at a place for so long stays there, in ms: others pass by.
const STANDS_MS: u64 = 5_000;

/// What is to be done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Decision {
    /// A robot goes there.
    Send { robot: Name, place: Waypoint, charges: bool, why: String },
    /// Somebody's task goes back to the queue, so that its robot can go.
    Release { task: TaskId, why: String },
    /// A drive of ours is not wanted any more; `avoid`: a robot did not get to this place.
    Cancel { task: TaskId, why: String, avoid: Option<(Name, Name)> },
}

/// The place that a robot is at, of these.
pub(super) fn nearest_at<'a>(
    places: impl Iterator<Item = &'a MapPlace>,
    pose: &MapPose,
) -> Option<&'a MapPlace> {
    let near = places.filter(|place| distance_m(place, pose) <= AT_M);
    near.min_by(|a, b| distance_m(a, pose).total_cmp(&distance_m(b, pose)))
}

pub(super) struct Round<'a> {
    of: &'a Dispatcher,
    now_ms: u64,
    rules: &'a HomeRules,
    travel_cost: &'a dyn TravelCost,
    /// Docks, parking and waiting places, and homes.
    places: Vec<&'a MapPlace>,
    /// Who stands at each of them or goes there.
    takers: Vec<BTreeSet<Name>>,
    /// Our own drives that have not ended, by robot.
    own: BTreeMap<&'a Name, &'a Task>,
    /// Robots whose last drive failed or was cancelled a moment ago.
    resting: BTreeSet<Name>,
    /// Docks that become free without more ado.
    leaving: usize,
    /// Robots that were sent away in this round.
    sent: BTreeSet<Name>,
    /// Drives that end in this round.
    cancelled: BTreeSet<TaskId>,
    decisions: Vec<Decision>,
    stays: BTreeMap<Name, String>,
}

impl<'a> Round<'a> {
    pub(super) fn new(
        of: &'a Dispatcher,
        now_ms: u64,
        rules: &'a HomeRules,
        travel_cost: &'a dyn TravelCost,
    ) -> Self {
        let places = of.places.as_deref().unwrap_or_default().iter();
        let is_home = |place: &MapPlace| rules.homes.values().any(|home| *home == place.name);
        let places: Vec<_> =
            places.filter(|place| place.kind != PlaceKind::Place || is_home(place)).collect();
        let own = of.store.open().filter(|task| of.is_own(task));
        let own: BTreeMap<_, _> = own.filter_map(|task| Some((robot_of(task)?, task))).collect();
        let mut round = Self {
            takers: vec![BTreeSet::new(); places.len()],
            resting: resting(of, now_ms),
            leaving: of.robots.values().filter(|robot| leaves(of, robot)).count(),
            sent: BTreeSet::new(),
            cancelled: BTreeSet::new(),
            decisions: Vec::new(),
            stays: BTreeMap::new(),
            of,
            now_ms,
            rules,
            travel_cost,
            places,
            own,
        };
        round.look_who_is_where();
        round
    }

    /// What is to be done, and why robots get no other task.
    pub(super) fn decide(mut self) -> (Vec<Decision>, BTreeMap<Name, String>) {
        self.check_own();
        let robots = self.of.robots.values();
        for robot in robots.clone().filter(|robot| robot.charge.is_charging(self.rules)) {
            self.stay(robot, charging_words(robot, self.rules));
        }
        let ordered = self.obey();
        let due = robots.clone().filter(|robot| !robot.charge.is_charging(self.rules));
        let due = due.filter(|robot| !ordered.contains(&robot.name));
        let mut due: Vec<(Need, &TrackedRobot)> =
            due.filter_map(|robot| Some((robot.charge.need?, robot))).collect();
        let volts = |robot: &TrackedRobot| robot.charge.volts.unwrap_or(0.0);
        due.sort_by(|(a, one), (b, other)| a.cmp(b).then(volts(one).total_cmp(&volts(other))));
        if !due.is_empty() {
            self.travel_cost.begin_round();
        }
        for (need, robot) in due {
            self.bring_home(need, robot);
        }
        if let Some(after_ms) = self.rules.park_after_ms() {
            for robot in robots.filter(|robot| robot.charge.need.is_none()) {
                self.park_idle(robot, after_ms);
            }
        }
        (self.decisions, self.stays)
    }

    fn look_who_is_where(&mut self) {
        let of = self.of;
        for robot in of.robots.values() {
            let Some(observed) = &robot.observed else { continue };
            // One that is silent is where it was, as far as anybody else's place is concerned.
            let stands = observed.running().is_none() || robot.silent_ms(self.now_ms) > of.settings.silent_ms;
            for (place, takers) in self.places.iter().zip(&mut self.takers) {
                if stands && distance_m(place, &observed.pose) <= OCCUPIED_M {
                    takers.insert(robot.name.clone());
                }
            }
        }
        let on_robots = of.store.busy().filter_map(|(name, id)| Some((name, of.store.task(id)?)));
        for (name, task) in on_robots.chain(self.own.iter().map(|(name, task)| (*name, *task))) {
            let Some(point) = task.point(task.legs_done) else { continue };
            for (place, takers) in self.places.iter().zip(&mut self.takers) {
                if is_same(place, point) {
                    takers.insert(name.clone());
                }
            }
        }
    }

    fn place_of(&self, task: &Task) -> Option<usize> {
        let point = task.point(task.legs_done)?;
        self.places.iter().position(|place| is_same(place, point))
    }

    fn is_dock_of(&self, place: usize, robot: &Name) -> bool {
        is_dock_of(self.rules, self.places[place], robot)
    }

    /// Drives of ours that make no sense any more end.
    fn check_own(&mut self) {
        let own: Vec<(&Name, &Task)> = self.own.iter().map(|(name, task)| (*name, *task)).collect();
        for (name, task) in own {
            if task.state != TaskState::Cancelling
                && let Some(why) = self.why_not(name, task)
            {
                self.cancel(task, why);
            }
        }
    }

    fn why_not(&self, name: &Name, task: &Task) -> Option<String> {
        if self.of.suspension_state().other_map(task).is_some() {
            return Some("the fleet has another map".to_owned());
        }
        let (Some(places), Some(robot)) = (&self.of.places, self.of.robots.get(name)) else { return None };
        let Some(place) = self.place_of(task) else {
            let gone = !places.iter().any(|place| task.point(0).is_some_and(|point| is_same(place, point)));
            return Some(if gone { "its place is gone" } else { "its place is no dock any more" }.to_owned());
        };
        let others = self.of.robots.values().filter(|other| other.name != *name);
        let stands = |other: &&TrackedRobot| {
            other.observed.as_ref().is_some_and(|observed| {
                observed.stopped_ms.is_some_and(|ms| ms >= STANDS_MS)
                    && observed.running().is_none()
                    && self.of.store.on(&other.name).is_none()
                    && distance_m(self.places[place], &observed.pose) <= OCCUPIED_M
            })
        };
        if let Some(other) = others.into_iter().find(stands) {
            return Some(format!("{} stands at {}", other.name, self.places[place].name));
        }
        if let Some((_, place)) = self.did_not_get_to(task) {
            return Some(format!("{name} does not get to {place}"));
        }
        let charge = &robot.charge;
        if self.is_dock_of(place, name) {
            // One that has not been heard yet, or does not measure it, may be empty.
            let is_full = charge.volts.is_some() && charge.is_enough(self.rules);
            let is_charged = charge.need.is_none() && charge.visit.is_none() && is_full;
            return is_charged.then(|| "its battery is charged".to_owned());
        }
        let works = self.of.store.on(name).is_some_and(|task| !self.of.is_own(task));
        (charge.need.is_none() && (works || self.has_work(robot)))
            .then(|| "there is a task for it".to_owned())
    }

    /// The place that the robot of a drive of ours does not get to, if so.
    fn did_not_get_to(&self, task: &Task) -> Option<(Name, Name)> {
        let assigned = task.assigned.as_ref().filter(|_| task.wants_to_drive())?;
        let robot = self.of.robots.get(&assigned.robot)?;
        let place = self.places[self.place_of(task)?].name.clone();
        robot.charge.is_stuck(self.now_ms, assigned.at_ms).then(|| (robot.name.clone(), place))
    }

    /// Whether a task waits that this robot may do.
    fn has_work(&self, robot: &TrackedRobot) -> bool {
        let of = self.of;
        of.store.open().any(|task| {
            task.state == TaskState::Queued
                && !of.is_own(task)
                && robot.is_eligible(&task.spec.who)
                && !robot.incapable.contains_key(&task.id)
                && of.reserved.get(&task.id).is_none_or(|name| *name == robot.name)
                && of.is_allocatable(self.now_ms, task)
        })
    }

    fn cancel(&mut self, task: &Task, why: String) {
        if !self.of.writes.has_task(task.id) && self.cancelled.insert(task.id) {
            self.decisions.push(Decision::Cancel { task: task.id, why, avoid: self.did_not_get_to(task) });
        }
    }

    fn stay(&mut self, robot: &TrackedRobot, why: String) {
        self.stays.insert(robot.name.clone(), why);
    }

    /// A robot needs a dock.
    fn bring_home(&mut self, need: Need, robot: &TrackedRobot) {
        let name = &robot.name;
        let own = self.own.get(name).copied();
        let busy = self.of.store.on(name).filter(|task| !self.of.is_own(task));
        let waits = busy.filter(|_| need == Need::Now);
        let low = format!("{name}: {}", low_words(robot));
        let target = own.and_then(|task| self.place_of(task)).filter(|place| self.is_dock_of(*place, name));
        if let Some(place) = target {
            self.stay(robot, format!("goes to {} to charge", self.places[place].name));
            return self.release(robot, waits, low);
        }
        if !self.can_drive(robot) || (need == Need::AfterTask && busy.is_some()) {
            return;
        }
        let mine = |place: &MapPlace| is_dock_of(self.rules, place, name);
        let why = low_words(robot);
        if self.resting.contains(name) {
            return self.stay(robot, format!("{why}: its last drive to a dock failed or was cancelled"));
        }
        match self.nearest_free(robot, mine) {
            Some(place) => {
                let to = self.places[place].name.clone();
                self.stay(robot, format!("{why}: goes to {to}"));
                match own {
                    Some(task) => self.cancel(task, format!("{why}: goes to {to} instead")),
                    None => self.send(robot, place, format!("{why}: to {to}")),
                }
                self.takers[place].insert(name.clone());
                self.release(robot, waits, low);
            }
            None => {
                if need == Need::Now {
                    self.stay(robot, format!("{why}: waits for a dock"));
                    self.release(robot, waits, low);
                    if own.is_none() && !self.is_parked(robot) {
                        self.park(robot, format!("{why}: waits for a dock"));
                    }
                }
                self.make_room(robot);
            }
        }
    }

    /// Its present task has to wait, if it may.
    fn release(&mut self, robot: &TrackedRobot, busy: Option<&Task>, why: String) {
        let Some(task) = busy.filter(|task| task.wants_to_drive()) else { return };
        let seq = task.assigned.as_ref().map(|assigned| assigned.seq);
        let leaves = robot.pending_outcome.as_ref().is_some_and(|(pending, _)| Some(*pending) == seq);
        if !leaves && !self.of.writes.has_task(task.id) {
            self.decisions.push(Decision::Release { task: task.id, why });
        }
    }

    /// Whether it would obey us.
    fn can_drive(&self, robot: &TrackedRobot) -> bool {
        let of = self.of;
        let ours = |observed: &crate::tracked_robot::ObservedState| {
            observed.running().is_none_or(|goal| goal.by.as_ref() == Some(&of.identity.me))
        };
        robot.is_online(self.now_ms, &of.settings)
            && of.membership(robot).is_ok()
            && robot.other_holder(&of.identity.me).is_none()
            // Whoever has just let it go may mean to go on.
            && self.now_ms.saturating_sub(robot.uncontested_since_ms) >= of.settings.settle_ms
            && robot
                .observed
                .as_ref()
                .is_some_and(|observed| observed.unavailable.is_none() && ours(observed))
    }

    /// The nearest of these places that is nobody else's.
    fn nearest_free(&self, robot: &TrackedRobot, wanted: impl Fn(&MapPlace) -> bool) -> Option<usize> {
        let (pose, car) = (robot.observed.as_ref()?.pose, robot.car());
        let free = |place: &usize| self.takers[*place].iter().all(|taker| *taker == robot.name);
        let may = |place: &MapPlace| wanted(place) && robot.charge.may_use(self.now_ms, &place.name);
        let open = (0..self.places.len()).filter(|place| may(self.places[*place])).filter(free);
        let reachable = open.filter_map(|place| {
            let point = waypoint(self.places[place]);
            self.travel_cost.admits(&car, &point).ok()?;
            Some((place, self.travel_cost.distance_m(&car, &pose, &point)))
        });
        reachable.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(place, _)| place)
    }

    fn send(&mut self, robot: &TrackedRobot, place: usize, why: String) {
        if self.resting.contains(&robot.name) {
            return;
        }
        let charges = self.is_dock_of(place, &robot.name);
        let (robot, place) = (robot.name.clone(), waypoint(self.places[place]));
        self.sent.insert(robot.clone());
        self.decisions.push(Decision::Send { robot, place, charges, why });
    }

    /// To a parking place, or else to where robots wait.
    fn park(&mut self, robot: &TrackedRobot, why: String) -> bool {
        let of_kind = |kind| move |place: &MapPlace| place.kind == kind;
        let place = self
            .nearest_free(robot, of_kind(PlaceKind::Parking))
            .or_else(|| self.nearest_free(robot, of_kind(PlaceKind::Waiting)));
        let Some(place) = place else { return false };
        let why = format!("{why}; to {}", self.places[place].name);
        self.send(robot, place, why);
        self.takers[place].insert(robot.name.clone());
        true
    }

    fn is_parked(&self, robot: &TrackedRobot) -> bool {
        let Some(observed) = &robot.observed else { return false };
        nearest_at(self.places.iter().copied(), &observed.pose).is_some()
    }

    /// Somebody who is charged leaves a dock for one who needs it, unless somebody leaves one anyway.
    fn make_room(&mut self, needy: &TrackedRobot) {
        if self.leaving > 0 {
            self.leaving -= 1;
            return;
        }
        let of = self.of;
        let charged = of.robots.values().filter(|robot| {
            robot.charge.visit.as_ref().is_some_and(|visit| self.is_of(needy, &visit.place))
                && robot.charge.need.is_none()
                && robot.charge.is_enough(self.rules)
                && !self.own.contains_key(&robot.name)
                && !self.sent.contains(&robot.name)
                && of.is_free(self.now_ms, robot)
        });
        let volts = |robot: &&TrackedRobot| robot.charge.volts.unwrap_or(0.0);
        if let Some(robot) = charged.max_by(|a, b| volts(a).total_cmp(&volts(b))) {
            self.park(robot, format!("{} needs its dock", needy.name));
        }
    }

    /// Whether the robot could be charged there.
    fn is_of(&self, robot: &TrackedRobot, place: &Name) -> bool {
        let is_its = |of: &&MapPlace| is_dock_of(self.rules, of, &robot.name);
        self.places.iter().any(|of| of.name == *place && is_its(of))
            && robot.charge.may_use(self.now_ms, place)
    }

    /// A robot without anything to do goes out of the way.
    fn park_idle(&mut self, robot: &TrackedRobot, after_ms: u64) {
        let since_ms = robot.idle_since_ms.max(robot.uncontested_since_ms);
        if self.now_ms.saturating_sub(since_ms) >= after_ms
            && self.of.is_free(self.now_ms, robot)
            && !self.own.contains_key(&robot.name)
            && !self.sent.contains(&robot.name)
            && !self.stays.contains_key(&robot.name)
            && !self.is_parked(robot)
            && !self.has_work(robot)
        {
            self.park(robot, format!("no task for {} s", after_ms / 1000));
        }
    }
}

/// The robot that one of our drives is for.
pub(super) fn robot_of(task: &Task) -> Option<&Name> {
    match &task.spec.who {
        Who::Robot(name) => Some(name),
        Who::Any | Who::Tag(_) | Who::Able(_) => None,
    }
}

/// Whether a robot at a dock is about to leave it.
fn leaves(of: &Dispatcher, robot: &TrackedRobot) -> bool {
    robot.charge.visit.is_some() && of.store.on(&robot.name).is_some()
}

/// Robots that are not to be sent anywhere for a while: their last drive of ours failed, or somebody cancelled it.
pub(super) fn resting(of: &Dispatcher, now_ms: u64) -> BTreeSet<Name> {
    let mut seen = BTreeSet::new();
    let mut resting = BTreeSet::new();
    for task in of.store.ended().filter(|task| of.is_own(task)) {
        let Some(name) = robot_of(task).filter(|name| seen.insert((*name).clone())) else { continue };
        let by_person = task.reason.as_ref().is_some_and(|reason| reason.starts_with(CANCELLED_BY));
        let for_ms = match task.state {
            TaskState::Failed => FAILED_MS,
            TaskState::Cancelled if by_person => CANCELLED_MS,
            _ => 0,
        };
        if now_ms < task.since_ms + for_ms {
            resting.insert(name.clone());
        }
    }
    resting
}

pub(super) fn low_words(robot: &TrackedRobot) -> String {
    let volts = robot.charge.volts.map(|volts| format!(" ({volts:.2} V)")).unwrap_or_default();
    format!("battery low{volts}")
}

pub(super) fn charging_words(robot: &TrackedRobot, rules: &HomeRules) -> String {
    let place = robot.charge.visit.as_ref().map_or("a dock", |visit| visit.place.as_str());
    let volts = robot.charge.volts.map_or_else(
        || "its voltage is not measured any more, ".to_owned(),
        |volts| format!("{volts:.2} V, "),
    );
    format!("charging at {place}: {volts}works again from {:.2} V", robot.charge.resume_v(rules))
}
