//! A fleet that nobody attends to: it drives to goals and patrols, goes to docks by itself and comes back. What came
//! of it, by ground truth.

use crate::dispatched::Shift;
use crate::meetings::fleet_of;
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::frames::MapPose;
use xtb_dispatch::{HomeRules, HomeSettings};
use xtb_nav::rooms::Draw;
use xtb_protocol::messages::{
    BatteryLevel, GoalStatus, HomeStatus, PlaceKind, TaskId, TaskKind, TaskSpec, TaskState, TruthRobot,
    Waypoint,
};
use xtb_sim::{TruckParameters, World};

pub(crate) const ROBOTS: usize = 5;
/// Three docks and three parking places for five robots, two tables in the way.
const HALL: &str = r#"
name = "hall"
[room]
width_m = 12.0
depth_m = 10.0
[[boxes]]
x_m = -2.0
y_m = 0.5
width_m = 1.2
depth_m = 0.6
[[boxes]]
x_m = 2.6
y_m = -0.8
width_m = 0.6
depth_m = 1.2
[[places]]
name = "dock-1"
kind = "dock"
x_m = -3.5
y_m = 4.1
yaw_rad = 1.5707963267948966
[[places]]
name = "dock-2"
kind = "dock"
x_m = 0.0
y_m = 4.1
yaw_rad = 1.5707963267948966
[[places]]
name = "dock-3"
kind = "dock"
x_m = 3.5
y_m = 4.1
yaw_rad = 1.5707963267948966
[[places]]
name = "parking-1"
kind = "parking"
x_m = -4.5
y_m = -4.0
[[places]]
name = "parking-2"
kind = "parking"
x_m = 0.0
y_m = -4.0
[[places]]
name = "parking-3"
kind = "parking"
x_m = 4.5
y_m = -4.0
"#;

/// A robot that has a goal comes so far within [`STUCK_S`], in m, or it is stuck.
const WAY_M: f64 = 0.3;
const STUCK_S: f64 = 300.0;
/// A goal is reached so soon after it was submitted, in s, whatever robots it waits for.
const GOAL_S: f64 = 1800.0;
/// Two robots never stand nearer to one dock than this, in m.
const ALONE_M: f64 = 0.6;
/// Goals that are open at a time.
const GOALS: usize = 4;
/// Each hour ends with so many minutes in which there is nothing to do.
const QUIET_MIN: u64 = 10;

/// How the day goes.
pub(crate) struct Day {
    pub(crate) minutes: u64,
    pub(crate) seed: u64,
    /// Of the packs; a real one has 3,000.
    pub(crate) capacity_mah: f64,
    /// The dispatcher is killed at each so many writes; 0 = never.
    pub(crate) kill_each: u64,
    /// Told of it each minute.
    pub(crate) show: fn(&Figures),
}

/// What came of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Figures {
    pub(crate) at_min: u64,
    pub(crate) goals: u64,
    pub(crate) patrols: u64,
    pub(crate) failed: Vec<String>,
    pub(crate) contacts: u64,
    /// Visits to docks that charged, by robot.
    pub(crate) charges: [u64; ROBOTS],
    pub(crate) parked: u64,
    /// The least charge that each robot had, 0..=1.
    pub(crate) least: [f64; ROBOTS],
    /// Seconds in which a robot's battery was too low to begin anything.
    pub(crate) too_low_s: u64,
    pub(crate) stuck: Vec<String>,
    /// Seconds in which two robots stood at one dock.
    pub(crate) shared_s: u64,
    pub(crate) driven_m: [f64; ROBOTS],
    pub(crate) kills: u64,
    pub(crate) longest_goal_s: f64,
}

impl Figures {
    /// Nobody flat, nobody stuck, no contact, no task failed.
    pub(crate) fn check(&self) {
        assert_eq!((self.contacts, self.too_low_s, self.shared_s), (0, 0, 0), "{self:#?}");
        assert!(self.failed.is_empty() && self.stuck.is_empty(), "{self:#?}");
        assert!(self.least.iter().all(|least| *least > 0.1), "{self:#?}");
        assert!(self.longest_goal_s < GOAL_S, "{self:#?}");
    }
}

/// What is watched of a robot.
#[derive(Debug, Clone, Copy, Default)]
struct Watched {
    /// Where it was when it last had come on, and when, in s.
    from: (f64, f64),
    since_s: f64,
    last: (f64, f64),
    is_charging: bool,
    is_parked: bool,
}

struct Watch {
    shift: Shift,
    draw: Draw,
    figures: Figures,
    robots: [Watched; ROBOTS],
    /// Tasks that have ended and were counted.
    counted: BTreeSet<TaskId>,
}

/// Drives through it.
pub(crate) fn spend(day: &Day) -> Figures {
    let mut truck = TruckParameters::default();
    truck.battery.capacity_mah = day.capacity_mah;
    let starts: Vec<MapPose> =
        (0..ROBOTS).map(|n| MapPose { x_m: n as f64 * 2.0 - 4.0, y_m: -2.5, yaw_rad: 1.6 }).collect();
    let mut shift = Shift::of(HALL, fleet_of(HALL, &starts, &truck, day.seed), day.seed);
    let places = World::from_toml(HALL).unwrap().places().to_vec();
    let settings = HomeSettings { park_after_s: 60.0, ..HomeSettings::default() };
    shift.home = Some((HomeRules { settings, ..HomeRules::default() }, places));
    shift.tell_factsheets();
    shift.kill_each = day.kill_each;
    // Not all at the same time.
    for (n, truck) in shift.drive.lockstep.simulation_mut().trucks_mut().iter_mut().enumerate() {
        truck.set_battery_left(1.0 - 0.1 * n as f64);
    }
    let mut watch = Watch {
        shift,
        draw: Draw::new(day.seed ^ 0xDA7),
        figures: Figures { least: [1.0; ROBOTS], ..Figures::default() },
        robots: [Watched::default(); ROBOTS],
        counted: BTreeSet::new(),
    };
    for second in 0..day.minutes * 60 {
        if second % 5 == 0 {
            watch.give_work(second);
        }
        for _ in 0..20 {
            watch.shift.tick();
        }
        watch.look(second as f64);
        if second % 60 == 59 {
            watch.figures.at_min = second / 60 + 1;
            (day.show)(&watch.figures);
        }
    }
    watch.figures
}

impl Watch {
    /// Goals for anybody, one after the other, and two patrols.
    fn give_work(&mut self, second: u64) {
        if second / 60 % 60 >= 60 - QUIET_MIN {
            return;
        }
        let store = self.shift.dispatcher.store();
        let of_people = || store.open().filter(|task| task.by.as_str() != "dispatch");
        let is_patrol = |kind: &TaskKind| matches!(kind, TaskKind::Patrol { .. });
        let patrols = of_people().filter(|task| is_patrol(&task.spec.kind)).count();
        let goals = of_people().count() - patrols;
        let left_s = (60 - QUIET_MIN) * 60 - second % 3600;
        let mut tasks = Vec::new();
        for n in patrols..2 {
            let points = (0..3).map(|_| self.anywhere()).collect();
            let for_s = Some((600.0 * (n + 1) as f64).min(left_s as f64));
            tasks.push(TaskSpec::new(TaskKind::Patrol { points, dwell_s: 5.0, for_s }));
        }
        for _ in goals..GOALS {
            tasks.push(TaskSpec::new(TaskKind::Goto { to: self.anywhere() }));
        }
        if !tasks.is_empty() {
            self.shift.submit_more(tasks);
        }
    }

    /// Somewhere in the hall between docks and parking places.
    fn anywhere(&mut self) -> Waypoint {
        loop {
            let (x_m, y_m) = (self.draw.uniform(-5.0, 5.0), self.draw.uniform(-2.8, 2.6));
            let boxes = [(-2.0, 0.5), (2.6, -0.8)];
            if boxes.iter().all(|(x, y)| (x_m - x).hypot(y_m - y) > 1.3) {
                return Waypoint { x_m, y_m, yaw_rad: None };
            }
        }
    }

    fn look(&mut self, at_s: f64) {
        let homes = self.shift.dispatcher.homes(self.shift.now_ms());
        let states: BTreeMap<String, HomeStatus> =
            homes.robots.iter().map(|home| (home.robot.to_string(), home.status)).collect();
        let truths: Vec<TruthRobot> = self.shift.drive.lockstep.simulation().truths().collect();
        for (n, truth) in truths.iter().enumerate() {
            let state = self.shift.drive.lockstep.state(n).unwrap();
            let truck = &self.shift.drive.lockstep.simulation().trucks()[n];
            let least = &mut self.figures.least[n];
            *least = least.min(truck.battery_left());
            self.figures.too_low_s += u64::from(state.battery_level > BatteryLevel::Warn);
            let at = (truth.x_m, truth.y_m);
            let way = |from: (f64, f64)| (at.0 - from.0).hypot(at.1 - from.1);
            let robot = &mut self.robots[n];
            if at_s > 0.0 {
                self.figures.driven_m[n] += way(robot.last);
            }
            robot.last = at;
            let drives = state
                .goal
                .as_ref()
                .is_some_and(|goal| matches!(goal.status, GoalStatus::Running | GoalStatus::Blocked));
            if !drives || way(robot.from) > WAY_M {
                (robot.from, robot.since_s) = (at, at_s);
            } else if at_s - robot.since_s > STUCK_S {
                let reason = state.goal.and_then(|goal| goal.reason);
                self.figures.stuck.push(format!("{at_s:.0} s: {} at {at:?}: {reason:?}", state.robot));
                robot.since_s = at_s;
            }
            let status = states.get(state.robot.as_str());
            let charging = status == Some(&HomeStatus::Charging);
            self.figures.charges[n] += u64::from(charging && !robot.is_charging);
            robot.is_charging = charging;
            let parked = status == Some(&HomeStatus::Parked);
            self.figures.parked += u64::from(parked && !robot.is_parked);
            robot.is_parked = parked;
        }
        let docks = self.shift.home.iter().flat_map(|(_, places)| places);
        for dock in docks.filter(|place| place.kind == PlaceKind::Dock) {
            let near = |truth: &&TruthRobot| {
                (truth.x_m - dock.x_m).hypot(truth.y_m - dock.y_m) < ALONE_M && truth.speed_mps == 0.0
            };
            self.figures.shared_s += u64::from(truths.iter().filter(near).count() > 1);
        }
        self.figures.contacts = self.shift.contacts();
        self.figures.kills = self.shift.kills;
        self.count_tasks();
    }

    fn count_tasks(&mut self) {
        for task in self.shift.dispatcher.store().tasks() {
            let lasted_s = (task.since_ms - task.submitted_ms) as f64 / 1000.0;
            let is_own = task.by.as_str() == "dispatch";
            let is_goal = matches!(task.spec.kind, TaskKind::Goto { .. }) && !is_own;
            if is_goal && !task.state.is_final() {
                let open_s = (self.shift.now_ms() - task.submitted_ms) as f64 / 1000.0;
                self.figures.longest_goal_s = self.figures.longest_goal_s.max(open_s);
            }
            if !task.state.is_final() || !self.counted.insert(task.id) {
                continue;
            }
            match task.state {
                TaskState::Failed => self.figures.failed.push(format!(
                    "{} {:?} by {} after {lasted_s:.0} s: {:?}",
                    task.id, task.spec.kind, task.by, task.reason
                )),
                TaskState::Done if is_goal => self.figures.goals += 1,
                TaskState::Done if !is_own => self.figures.patrols += 1,
                _ => {}
            }
        }
    }
}

/// Packs of a fifth of the charge: five times as many visits to docks as in a real hour.
#[test]
fn a_fleet_that_nobody_attends_to_works_charges_and_comes_back() {
    let figures = spend(&Day { minutes: 60, seed: 22, capacity_mah: 600.0, kill_each: 41, show: |_| {} });
    figures.check();
    assert!(figures.charges.iter().all(|charges| *charges >= 2), "{figures:#?}");
    assert!(figures.goals >= 60 && figures.patrols >= 2 && figures.parked >= 1, "{figures:#?}");
    assert!(figures.kills >= 5, "{figures:#?}");
}
