//! A toy fleet in virtual time: each robot follows its guide exactly, at a bounded speed, with pauses
//! and lost messages, and stops for what its infrared sensors would see.

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::collections::BTreeMap;
use std::sync::Arc;
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::geometry::rect::Rect;
use xtb_nav::{Car, Cell, Grid, MapPose, Path};
use xtb_traffic::coordinator::{
    Coordinator, CoordinatorCounters, GridRoom, Guide, JointResult, PlannedGoal, ReportedRobot, RoomGeometry,
    RouteReport,
};

/// Turn of the world, in ms; the coordinator ticks every second one.
const TURN_MS: u64 = 100;
/// Slowing down and speeding up, in m/s².
const ACCELERATION: f64 = 0.5;
/// The infrared rule, in m ahead of the bumper and to each side.
const INFRARED_M: (f64, f64) = (0.25, 0.175);
/// A goal counts as reached so near, in m.
const NEAR_M: f64 = 0.05;

/// Numbers from a seed.
pub(crate) struct Draw(Pcg32);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg32::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15), seed))
    }

    /// Uniform in [min, max).
    pub(crate) fn uniform(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    /// Whether something of this probability happens.
    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }
}

/// What can go wrong.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trouble {
    /// Probability that a guide or a report is lost.
    pub(crate) loss: f64,
    /// Probability in each second that a robot pauses.
    pub(crate) pause: f64,
    /// It pauses for 1 s to so long.
    pub(crate) pause_s: f64,
    /// A joint plan takes up to so long, in s …
    pub(crate) planning_s: f64,
    /// … and so long for each node that it expands …
    pub(crate) expansion_s: f64,
    /// … and for each truck for which it finds a way or none, in s.
    pub(crate) truck_s: f64,
}

impl Trouble {
    pub(crate) const SOME: Self =
        Self { loss: 0.1, pause: 0.02, pause_s: 4.0, planning_s: 1.0, expansion_s: 0.0, truck_s: 0.0 };
    /// Robots fall asleep for longer than traffic control waits for them.
    pub(crate) const SLEEPY: Self = Self { pause: 0.015, pause_s: 15.0, ..Self::SOME };
}

pub(crate) struct Toy {
    pub(crate) name: String,
    pub(crate) car: Car,
    pub(crate) pose: MapPose,
    pub(crate) alive: bool,
    pub(crate) goal: Option<PlannedGoal>,
    /// The route that it follows.
    pub(crate) guide: Option<Guide>,
    /// What it heard last.
    pub(crate) says: Option<Guide>,
    pub(crate) arrived: u32,
    speed_mps: f64,
    /// So far on its path.
    pub(crate) done_m: f64,
    /// It drives so far to the left of its path.
    beside_m: f64,
    /// It stops so far before its release's end.
    short_m: f64,
    pause_until: Stamp,
    heard: Stamp,
    /// Taken over: it stands, and traffic control may not lead it.
    pub(crate) taken_over: bool,
    /// Since when it stands.
    pub(crate) still_since: Stamp,
    /// Since when it stands and is not told for whom.
    lost_since: Stamp,
    pub(crate) trace: Vec<MapPose>,
    pub(crate) driven: Vec<Path>,
}

impl Toy {
    fn view(&self, age_ms: u64) -> ReportedRobot {
        let of = |guide: &Guide| {
            let goal = self.goal.filter(|goal| guide.goal == Some((1, goal.id)))?;
            let _ = goal;
            let path = guide.path.clone()?;
            Some(RouteReport { plan: guide.plan, path, done_m: self.done_m, release_m: guide.release_m })
        };
        ReportedRobot {
            name: self.name.clone(),
            epoch: 1,
            car: Some(self.car),
            pose: self.pose,
            sigma_m: 0.01,
            speed_mps: self.speed_mps,
            goal: self.goal,
            route: self.guide.as_ref().and_then(of),
            blocked_at_m: None,
            drives: !self.taken_over,
            age_ms,
        }
    }

    fn hear(&mut self, now: Stamp, guide: &Guide, keeps: bool) {
        self.heard = now;
        self.says = Some(guide.clone());
        if guide.goal != self.goal.map(|goal| (1, goal.id)) || guide.path.is_none() {
            return;
        }
        let before = self.guide.as_ref().and_then(|guide| guide.path.as_ref());
        let same_start =
            before.is_some_and(|path| Some(path.start) == guide.path.as_ref().map(|path| path.start));
        if !same_start {
            let start = guide.path.as_ref().map_or(self.pose, |path| path.start);
            let off_m = libm::hypot(start.x_m - self.pose.x_m, start.y_m - self.pose.y_m);
            if off_m > 0.1 || self.speed_mps != 0.0 {
                return;
            }
            self.done_m = 0.0;
        } else if let Some(old) = &self.guide {
            assert!(guide.plan >= old.plan, "{}: plan {} after {}", self.name, guide.plan, old.plan);
            assert!(guide.release_m >= old.release_m - 1e-9, "{}: the release shrank", self.name);
        }
        if keeps && self.guide.as_ref().is_none_or(|old| old.plan != guide.plan) {
            self.driven.extend(guide.path.clone());
        }
        self.guide = Some(guide.clone());
    }

    /// One turn along the path; `clear` says whether its infrared sensors let it.
    fn drive(&mut self, now: Stamp, clear: impl Fn(&MapPose, f64) -> bool) {
        let turn_s = TURN_MS as f64 / 1000.0;
        let Some((guide, path)) = self.guide.as_ref().and_then(|guide| Some((guide, guide.path.as_ref()?)))
        else {
            self.speed_mps = 0.0;
            return;
        };
        let short_m = if guide.release_m < path.length_m() - 1e-6 { self.short_m } else { 0.0 };
        let end_m = guide.release_m.min(path.length_m()) - short_m;
        let (_, piece) = path.at(self.done_m + 1e-6);
        let gear = piece.map_or(1.0, |piece| piece.gear());
        let left_m = (end_m - self.done_m).max(0.0);
        let stop = now < self.pause_until
            || self.taken_over
            || now.since_ms(self.heard) > 3000
            || !clear(&self.pose, gear);
        let most = if stop { 0.0 } else { guide.cruise_mps.min(libm::sqrt(2.0 * ACCELERATION * left_m)) };
        let speed = (self.speed_mps.abs() + ACCELERATION * turn_s).min(most);
        let step_m = (speed * turn_s).min(left_m);
        self.done_m += step_m;
        self.speed_mps = gear * if step_m > 1e-4 { step_m / turn_s } else { 0.0 };
        let (on, yaw_rad) = (path.at(self.done_m).0, path.at(self.done_m).0.yaw_rad);
        let beside_m = self.beside_m * (self.done_m / 0.5).min(1.0);
        let (sin, cos) = libm::sincos(yaw_rad);
        self.pose = MapPose { x_m: on.x_m - beside_m * sin, y_m: on.y_m + beside_m * cos, yaw_rad };
    }

    fn is_there(&self) -> bool {
        let Some(goal) = self.goal else { return false };
        let near = libm::hypot(goal.x_m - self.pose.x_m, goal.y_m - self.pose.y_m) < NEAR_M;
        let turned = goal.yaw_rad.is_none_or(|yaw| libm::cos(yaw - self.pose.yaw_rad) > 0.97);
        near && turned && self.speed_mps.abs() < 0.05
    }
}

pub(crate) struct World {
    pub(crate) room: Arc<GridRoom>,
    pub(crate) toys: Vec<Toy>,
    pub(crate) coordinator: Option<Coordinator>,
    pub(crate) now: Stamp,
    /// Wall time that jobs took, in ms, by the caller's clock.
    pub(crate) jobs_ms: Vec<f64>,
    /// Nodes that each of them expanded.
    pub(crate) expansions: Vec<u32>,
    /// Wall time that turns of the coordinator took, in ms: all that is not done in jobs.
    pub(crate) turns_ms: Vec<f64>,
    /// Longest stand of one that was not told for whom it waits, in s.
    pub(crate) longest_still_s: f64,
    /// Longest stand of all, in s.
    pub(crate) longest_wait_s: f64,
    clock_ms: fn() -> f64,
    draw: Draw,
    trouble: Trouble,
    jobs: Vec<(JointResult, Stamp)>,
    seed: u64,
    /// Whether everybody's way is kept for drawings and looked at after each plan.
    pub(crate) looks_back: bool,
    /// Turns in which two touched, by pairs, if that is to be counted and no error.
    pub(crate) contacts: u64,
    pub(crate) counts_contacts: bool,
}

impl World {
    pub(crate) fn new(
        room: GridRoom,
        starts: &[MapPose],
        seed: u64,
        trouble: Trouble,
        clock_ms: fn() -> f64,
    ) -> Self {
        let car = Car::of(&VehicleConfig::default());
        let mut draw = Draw::new(seed);
        let toy = |(index, pose): (usize, &MapPose)| Toy {
            name: format!("xtb-{}", index + 1),
            car,
            pose: *pose,
            alive: true,
            goal: None,
            guide: None,
            says: None,
            arrived: 0,
            speed_mps: 0.0,
            done_m: 0.0,
            beside_m: draw.uniform(-0.025, 0.025),
            short_m: draw.uniform(0.0, 0.03),
            taken_over: false,
            lost_since: Stamp::ZERO,
            pause_until: Stamp::ZERO,
            heard: Stamp::ZERO,
            still_since: Stamp::ZERO,
            trace: vec![*pose],
            driven: Vec::new(),
        };
        let room = Arc::new(room);
        let shared: Arc<dyn RoomGeometry> = Arc::<GridRoom>::clone(&room);
        Self {
            coordinator: Some(Coordinator::new(shared, seed)),
            room,
            toys: starts.iter().enumerate().map(toy).collect(),
            now: Stamp::from_ms(1000),
            jobs_ms: Vec::new(),
            expansions: Vec::new(),
            turns_ms: Vec::new(),
            longest_still_s: 0.0,
            longest_wait_s: 0.0,
            clock_ms,
            draw,
            trouble,
            jobs: Vec::new(),
            seed,
            looks_back: true,
            contacts: 0,
            counts_contacts: false,
        }
    }

    pub(crate) fn send(&mut self, index: usize, to: MapPose) {
        self.send_to(index, [to.x_m, to.y_m], Some(to.yaw_rad));
    }

    /// Sends one there, to stand in this direction or in any.
    pub(crate) fn send_to(&mut self, index: usize, [x_m, y_m]: [f64; 2], yaw_rad: Option<f64>) {
        let id = u128::from(self.now.ns()) * 100 + index as u128;
        let toy = &mut self.toys[index];
        toy.goal = Some(PlannedGoal { id, x_m, y_m, yaw_rad });
        toy.guide = None;
        toy.taken_over = false;
        toy.speed_mps = 0.0;
        (toy.still_since, toy.lost_since) = (self.now, self.now);
    }

    /// Somebody takes a robot over: its goal is gone, and it stands.
    pub(crate) fn take_over(&mut self, index: usize) {
        let toy = &mut self.toys[index];
        (toy.goal, toy.guide, toy.taken_over, toy.speed_mps) = (None, None, true, 0.0);
    }

    pub(crate) fn kill_coordinator(&mut self) {
        self.coordinator = None;
        self.jobs.clear();
    }

    pub(crate) fn start_coordinator(&mut self) {
        let shared: Arc<dyn RoomGeometry> = Arc::<GridRoom>::clone(&self.room);
        self.coordinator = Some(Coordinator::new(shared, self.seed + 77));
    }

    pub(crate) fn counters(&self) -> CoordinatorCounters {
        self.coordinator.as_ref().map(Coordinator::counters).unwrap_or_default()
    }

    pub(crate) fn all_there(&self) -> bool {
        self.toys.iter().all(|toy| toy.goal.is_none() || !toy.alive)
    }

    /// One turn of everything; panics when an invariant breaks.
    pub(crate) fn turn(&mut self) {
        self.now = self.now.plus_ms(TURN_MS);
        self.drive();
        self.check();
        if (self.now.ms() / TURN_MS).is_multiple_of(2) {
            self.control();
        }
    }

    fn drive(&mut self) {
        let bodies: Vec<Rect> = self.toys.iter().map(|toy| Rect::body(&toy.car, &toy.pose)).collect();
        for index in 0..self.toys.len() {
            if self.draw.chance(self.trouble.pause * TURN_MS as f64 / 1000.0) {
                let pause_s = self.draw.uniform(1.0, self.trouble.pause_s);
                self.toys[index].pause_until = self.now.plus_ms((pause_s * 1000.0) as u64);
            }
            if !self.toys[index].alive {
                continue;
            }
            let room = &self.room;
            let seen = Car { half_width_m: INFRARED_M.1, ..self.toys[index].car };
            let clear = |pose: &MapPose, gear: f64| {
                let beam = if gear < 0.0 {
                    Car { front_m: -seen.rear_m, rear_m: seen.rear_m + INFRARED_M.0, ..seen }
                } else {
                    Car { rear_m: -seen.front_m, front_m: seen.front_m + INFRARED_M.0, ..seen }
                };
                let strip = Rect::body(&beam, pose);
                let mut others = bodies.iter().enumerate().filter(|(other, _)| *other != index);
                room.is_free(&strip, 0.0) && !others.any(|(_, body)| strip.overlaps(body, 0.0))
            };
            let toy = &mut self.toys[index];
            toy.drive(self.now, clear);
            if toy.speed_mps != 0.0 {
                toy.still_since = self.now;
                if self.looks_back {
                    toy.trace.push(toy.pose);
                }
            }
            if toy.is_there() {
                toy.goal = None;
                toy.guide = None;
                toy.speed_mps = 0.0;
                toy.arrived += 1;
            }
        }
    }

    fn control(&mut self) {
        let lost = self.trouble.loss;
        let Some(coordinator) = self.coordinator.as_mut() else { return };
        for toy in self.toys.iter().filter(|toy| toy.alive) {
            if !self.draw.chance(lost) {
                coordinator.robot(self.now, toy.view(50));
            }
        }
        let before = (self.clock_ms)();
        let guides: BTreeMap<String, Guide> = coordinator.tick(self.now);
        let mut turn_ms = (self.clock_ms)() - before;
        for toy in self.toys.iter_mut().filter(|toy| toy.alive) {
            if let Some(guide) = guides.get(&toy.name)
                && !self.draw.chance(lost)
            {
                toy.hear(self.now, guide, self.looks_back);
            }
        }
        let (due, later) = std::mem::take(&mut self.jobs).into_iter().partition(|(_, due)| *due <= self.now);
        self.jobs = later;
        for (result, _) in due {
            let before = (self.clock_ms)();
            coordinator.planned(self.now, result);
            turn_ms += (self.clock_ms)() - before;
            assert!(!self.looks_back || coordinator.is_acyclic(), "the passing order blocks itself");
        }
        loop {
            let before = (self.clock_ms)();
            let job = coordinator.job(self.now);
            turn_ms += (self.clock_ms)() - before;
            let Some(job) = job else { break };
            let before = (self.clock_ms)();
            let result = job.solve(&mut || true);
            self.jobs_ms.push((self.clock_ms)() - before);
            self.expansions.push(result.expansions);
            let (led, without) = result.counts();
            let late_s = self.draw.uniform(0.05, 0.1 + self.trouble.planning_s)
                + self.trouble.expansion_s * f64::from(result.expansions)
                + self.trouble.truck_s * (led + without) as f64;
            self.jobs.push((result, self.now.plus_ms((late_s * 1000.0) as u64)));
        }
        self.turns_ms.push(turn_ms);
    }

    fn check(&mut self) {
        for (index, one) in self.toys.iter().enumerate() {
            for other in &self.toys[index + 1..] {
                let apart_m = (one.pose.x_m - other.pose.x_m).hypot(one.pose.y_m - other.pose.y_m);
                let touch = apart_m < one.car.reach_m() + other.car.reach_m()
                    && one.car.overlaps(&one.pose, &other.car, &other.pose);
                self.contacts += u64::from(touch);
                assert!(
                    !touch || self.counts_contacts,
                    "{} at {:?} and {} at {:?} touch at {} s",
                    one.name,
                    one.pose,
                    other.name,
                    other.pose,
                    self.now.s()
                );
            }
            assert!(self.room.is_free(&Rect::body(&one.car, &one.pose), -0.01), "{} is in a wall", one.name);
        }
        for one in self.toys.iter_mut().filter(|toy| toy.goal.is_some() && toy.alive) {
            if one.still_since == self.now || one.says.as_ref().is_some_and(|guide| guide.waits_for.is_some())
            {
                one.lost_since = self.now;
            }
            self.longest_still_s = self.longest_still_s.max(self.now.since_s(one.lost_since));
            self.longest_wait_s = self.longest_wait_s.max(self.now.since_s(one.still_since));
        }
    }

    /// Turns until everybody is there; false if that takes longer than `most_s`.
    pub(crate) fn run(&mut self, most_s: f64) -> bool {
        let end = self.now.plus_ms((most_s * 1000.0) as u64);
        while self.now < end {
            self.turn();
            if self.all_there() {
                return true;
            }
        }
        false
    }
}

/// A room with walls around it and these boxes in it: x, y, width, depth in m.
pub(crate) fn room(width_m: f64, height_m: f64, boxes: &[[f64; 4]]) -> GridRoom {
    GridRoom::new(floor(width_m, height_m, boxes))
}

/// The same as a grid.
pub(crate) fn floor(width_m: f64, height_m: f64, boxes: &[[f64; 4]]) -> Grid {
    let cells = |length: f64| (length / 0.05).round() as usize;
    let mut grid = Grid::free(0.05, [0.0, 0.0], cells(width_m), cells(height_m)).unwrap();
    for row in 0..grid.height() as i64 {
        for column in 0..grid.width() as i64 {
            let [x, y] = grid.centre_m(column, row);
            if boxes.iter().any(|b| x > b[0] && x < b[0] + b[2] && y > b[1] && y < b[1] + b[3]) {
                grid.set(column, row, Cell::Occupied);
            }
        }
    }
    grid
}
