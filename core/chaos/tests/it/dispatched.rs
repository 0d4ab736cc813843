//! The dispatcher over whole robots with traffic control: they work through tasks while it is killed at
//! its writes and messages get lost.

use crate::drive::Drive;
use crate::meetings::fleet;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::FRAC_PI_2;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_dispatch::dispatcher::DispatcherIdentity;
use xtb_dispatch::{Dispatcher, DispatcherSettings, Effect, HomeRules, LedgerEntry, MapTravelCost, Record};
use xtb_nav::Car;
use xtb_nav::rooms::Draw;
use xtb_protocol::Name;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{
    Assignment, DispatchBody, DispatchRequest, GoalStatus, MapPlace, NEXT_LEG, Request, TaskId, TaskKind,
    TaskSpec, TaskState, Waypoint,
};
use xtb_sim::{STEP_NS, Sequential, World};

const LEDGER: u64 = 0x1234;
/// The dispatcher hears, decides and asks this often.
const TICK_NS: u64 = 50_000_000;
const EPOCH_MS: u64 = 1_800_000_000_000;
const OPEN: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0";
const DOOR: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\n\
    [[walls]]\npoints = [[-4.0, 0.0], [-0.75, 0.0]]\n[[walls]]\npoints = [[0.75, 0.0], [4.0, 0.0]]";

/// A working day.
pub(crate) struct Shift {
    pub(crate) drive: Drive,
    ground: MapTravelCost,
    pub(crate) dispatcher: Dispatcher,
    ledger: Vec<LedgerEntry>,
    draw: Draw,
    loss: f64,
    /// Dies at each so many writes; every other time after they are durable. 0 = never.
    pub(crate) kill_each: u64,
    writes: u64,
    pub(crate) kills: u64,
    arrivals: u64,
    submissions: u128,
    /// Where robots go by themselves, and the places for that.
    pub(crate) home: Option<(HomeRules, Vec<MapPlace>)>,
    /// Goals that were seen reached.
    reached: BTreeSet<Uuid>,
}

fn me() -> Name {
    Name::new("dispatch").unwrap()
}

fn dispatcher(now_ms: u64, run: u64, entries: Vec<LedgerEntry>) -> Dispatcher {
    let identity = DispatcherIdentity { me: me(), ledger: LEDGER, run };
    Dispatcher::recover(now_ms, identity, DispatcherSettings::default(), entries).unwrap()
}

impl Shift {
    fn new(world: &str, robots: usize, seed: u64) -> Self {
        let starts: Vec<MapPose> = (0..robots)
            .map(|n| MapPose { x_m: n as f64 * 1.5 - 2.25, y_m: -2.5, yaw_rad: FRAC_PI_2 })
            .collect();
        Self::of(world, fleet(world, &starts, seed), seed)
    }

    /// These robots, in this world.
    pub(crate) fn of(world: &str, drive: Drive, seed: u64) -> Self {
        let map = World::from_toml(world).unwrap().to_map(0.05).unwrap();
        let mut shift = Self {
            drive,
            ground: MapTravelCost::new(map),
            dispatcher: dispatcher(EPOCH_MS, 1, Vec::new()),
            ledger: Vec::new(),
            draw: Draw::new(seed),
            loss: 0.0,
            kill_each: 0,
            writes: 0,
            kills: 0,
            arrivals: 1_000_000,
            submissions: 0,
            home: None,
            reached: BTreeSet::new(),
        };
        shift.tell_factsheets();
        shift
    }

    pub(crate) fn now_ms(&self) -> u64 {
        EPOCH_MS + self.drive.lockstep.now().ms()
    }

    /// What a dispatcher that has just begun is told of the robots, and of places.
    pub(crate) fn tell_factsheets(&mut self) {
        let (now_ms, car) = (self.now_ms(), Car::of(&VehicleConfig::default()));
        for index in 0..self.drive.lockstep.simulation().trucks().len() {
            let name = Name::new(&format!("xtb-{}", index + 1)).unwrap();
            self.dispatcher.set_factsheet(now_ms, &name, &[NEXT_LEG.to_owned()], Some(car));
        }
        if let Some((rules, places)) = &self.home {
            self.dispatcher.set_home_rules(Some(rules.clone()));
            self.dispatcher.set_places(places);
        }
    }

    fn is_lost(&mut self) -> bool {
        self.draw.uniform(0.0, 1.0) < self.loss
    }

    /// The same submission again and again, until it is taken.
    fn submit(&mut self, tasks: Vec<TaskSpec>) {
        self.submit_as(1, tasks);
    }

    /// One submission more.
    pub(crate) fn submit_more(&mut self, tasks: Vec<TaskSpec>) {
        self.submissions += 1;
        self.submit_as(self.submissions, tasks);
    }

    fn submit_as(&mut self, number: u128, tasks: Vec<TaskSpec>) {
        let request = DispatchRequest { id: Uuid::from_u128(number), body: DispatchBody::Submit { tasks } };
        let (now_ms, client) = (self.now_ms(), Name::new("cli-7").unwrap());
        self.dispatcher.request(now_ms, 1, &client, &request, &self.ground);
    }

    fn step(&mut self) {
        self.drive.lockstep.step();
        if self.drive.lockstep.now().ns().is_multiple_of(TICK_NS) {
            self.talk();
        }
    }

    /// One tick of the dispatcher, at once.
    pub(crate) fn tick(&mut self) {
        let steps = (TICK_NS - self.drive.lockstep.now().ns() % TICK_NS) / STEP_NS;
        self.drive.lockstep.run(steps, &Sequential);
        self.talk();
    }

    /// What robots and dispatcher say to each other.
    fn talk(&mut self) {
        let now_ms = self.now_ms();
        let mut index = 0;
        while let Some(state) = self.drive.lockstep.state(index) {
            let goal = state.goal.iter().map(|goal| (goal.id, goal.status));
            let ended = state.ended_goals.iter().map(|end| (end.id, end.status));
            let reached = goal.chain(ended).filter(|(_, status)| *status == GoalStatus::Reached);
            self.reached.extend(reached.map(|(id, _)| id));
            if !self.is_lost() {
                self.dispatcher.state(now_ms, &state);
            }
            index += 1;
        }
        self.dispatcher.step(now_ms, &self.ground);
        while let Some(effect) = self.dispatcher.next_effect() {
            match effect {
                Effect::Write(write) => {
                    self.writes += 1;
                    let killed = self.kill_each > 0 && self.writes.is_multiple_of(self.kill_each);
                    if !killed || self.writes.is_multiple_of(2 * self.kill_each) {
                        self.ledger.extend(write.entries);
                    }
                    if killed {
                        self.kills += 1;
                        self.dispatcher = dispatcher(now_ms, self.writes, self.ledger.clone());
                        self.tell_factsheets();
                    } else {
                        self.dispatcher.written(now_ms, write.id).unwrap();
                    }
                }
                Effect::Ask { robot, request } => self.ask(&robot, &request),
                Effect::Reply { .. } | Effect::Event(_) => {}
            }
        }
    }

    fn ask(&mut self, name: &Name, request: &Request) {
        let number: usize = name.as_str().trim_start_matches("xtb-").parse().unwrap();
        if self.is_lost() {
            return;
        }
        self.arrivals += 1;
        let (now, arrival) = (self.drive.lockstep.now(), self.arrivals);
        let robot = self.drive.lockstep.robot_mut(number - 1).unwrap();
        if let Some(lease) = request.lease {
            robot.agent_mut().heard(now, lease);
        }
        let reply = robot.request(now, arrival, &me(), request);
        if !self.is_lost() {
            let now_ms = self.now_ms();
            self.dispatcher.replied(now_ms, name, &reply);
        }
    }

    pub(crate) fn contacts(&self) -> u64 {
        self.drive.lockstep.simulation().trucks().iter().map(|truck| truck.truth().contacts).sum()
    }

    /// Until all is done.
    fn work(&mut self, tasks: usize, within_s: u64) {
        let end_ms = self.now_ms() + within_s * 1000;
        let over = |shift: &Self| {
            let book = shift.dispatcher.store();
            book.next_task() > tasks as u64 && book.open_count() == 0
        };
        while !over(self) && self.now_ms() < end_ms {
            self.step();
        }
    }

    /// Every task is done, and each of its drives was driven once.
    fn check(&self, tasks: usize) {
        let book = self.dispatcher.store();
        for task in book.tasks() {
            let history = task.history();
            assert_eq!(task.state, TaskState::Done, "{:?} {:#?}", task.id, history.steps);
        }
        assert_eq!(book.tasks().count(), tasks);
        assert_eq!(self.contacts(), 0);
        let of_seq: BTreeMap<u64, TaskId> = self
            .ledger
            .iter()
            .filter_map(|entry| match &entry.record {
                Record::Assigned { task, seq, .. } => Some((*seq, *task)),
                _ => None,
            })
            .collect();
        let mut drives: BTreeMap<(TaskId, u32), usize> = BTreeMap::new();
        for goal in &self.reached {
            let (seq, leg) = Assignment::of_goal(LEDGER, *goal).unwrap();
            *drives.entry((of_seq[&seq], leg)).or_default() += 1;
        }
        let expected: usize = book.tasks().filter_map(|task| task.legs()).map(|legs| legs as usize).sum();
        assert_eq!(drives.len(), expected);
        assert!(drives.values().all(|times| *times == 1), "{drives:?}");
    }
}

/// Places of their own, so that nobody parks where another one shall go.
fn tasks(draw: &mut Draw, count: usize) -> Vec<TaskSpec> {
    let mut places: Vec<Waypoint> = (0..5)
        .flat_map(|i| (0..3).map(move |j| (f64::from(i) * 1.5 - 3.0, f64::from(j) * 1.6 - 0.8)))
        .map(|(x_m, y_m)| Waypoint { x_m, y_m, yaw_rad: None })
        .collect();
    let mut next = || {
        let at = draw.whole(0, places.len() as i64 - 1) as usize;
        places.swap_remove(at)
    };
    let one = |i: usize| match i % 4 {
        3 => {
            let dwell_s = if i == 3 { 1.0 } else { 0.0 };
            TaskKind::Route { points: vec![next(), next()], loops: 1, dwell_s }
        }
        _ => TaskKind::Goto { to: next() },
    };
    (0..count).map(one).map(TaskSpec::new).collect()
}

fn day(world: &str, seed: u64, loss: f64, kill_each: u64) -> Shift {
    const TASKS: usize = 12;
    let mut shift = Shift { loss: 0.0, ..Shift::new(world, 4, seed) };
    let tasks = tasks(&mut Draw::new(seed), TASKS);
    while shift.dispatcher.store().next_task() == 1 {
        shift.submit(tasks.clone());
        shift.step();
    }
    (shift.loss, shift.kill_each) = (loss, kill_each);
    shift.work(TASKS, 900);
    shift.check(TASKS);
    shift
}

/// A route of four points for one robot: it drives over each of them and stands at none before the last.
fn passes_three_points(mut shift: Shift) {
    let points = [(-2.25, -1.0), (-1.5, 0.5), (0.0, 1.5), (2.0, 1.2)].map(|(x_m, y_m)| Waypoint {
        x_m,
        y_m,
        yaw_rad: None,
    });
    let route = TaskKind::Route { points: points.to_vec(), loops: 1, dwell_s: 0.0 };
    while shift.dispatcher.store().next_task() == 1 {
        shift.submit(vec![TaskSpec::new(route.clone())]);
        shift.step();
    }
    let (mut slowest_mps, mut nearest_m) = (f64::MAX, [f64::MAX; 4]);
    while shift.reached.len() < 4 && shift.now_ms() < EPOCH_MS + 120_000 {
        shift.step();
        let truth = shift.drive.lockstep.simulation().trucks()[0].truth();
        for (nearest_m, point) in nearest_m.iter_mut().zip(&points) {
            *nearest_m = nearest_m.min((truth.x_m - point.x_m).hypot(truth.y_m - point.y_m));
        }
        // From the first point until it comes to the last one.
        if nearest_m[0] < 0.1 && nearest_m[3] > 0.5 {
            slowest_mps = slowest_mps.min(truth.speed_mps.abs());
        }
    }
    shift.work(1, 5);
    shift.check(1);
    assert!(slowest_mps > 0.1, "it slowed down to {slowest_mps} m/s");
    assert!(nearest_m.iter().all(|m| *m < 0.06), "{nearest_m:?}");
}

#[test]
fn a_robot_that_goes_alone_passes_the_points_of_a_route_without_a_stop() {
    let mut shift = Shift::new(OPEN, 1, 7);
    shift.drive.lockstep.set_traffic(None);
    passes_three_points(shift);
}

#[test]
fn a_robot_that_is_led_passes_the_points_of_a_route_without_a_stop() {
    passes_three_points(Shift::new(OPEN, 1, 8));
}

#[test]
fn a_day_in_an_open_room() {
    day(OPEN, 1, 0.0, 0);
}

#[test]
fn a_day_in_a_room_with_a_door_with_messages_lost_and_the_dispatcher_killed_at_every_fourth_write() {
    let shift = day(DOOR, 2, 0.05, 4);
    assert!(shift.kills >= 5, "{}", shift.kills);
}

#[test]
fn a_day_in_an_open_room_with_the_dispatcher_killed_at_every_second_write() {
    let shift = day(OPEN, 3, 0.05, 2);
    assert!(shift.kills >= 10, "{}", shift.kills);
}
