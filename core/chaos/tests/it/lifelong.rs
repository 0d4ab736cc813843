//! Robots that always have a goal: whoever has reached or failed one gets the next. What came of it, by
//! ground truth.

use crate::draw::Draw;
use crate::drive::Drive;
use xtb_control::speed::STANDS_MPS;
use xtb_nav::geometry::rect::Rect;
use xtb_nav::{Car, Map, MapPose};
use xtb_protocol::messages::{GoalStatus, Outcome, TruthRobot};
use xtb_sim::lockstep::Traffic;
use xtb_sim::{VehicleFile, World};
use xtb_traffic::coordinator::{GridRoom, RoomGeometry as _};

/// Between two looks, in s.
const LOOK_S: f64 = 0.2;
/// The middles of two goals, or of two robots at the start, are so far apart at least, in m.
const APART_M: f64 = 1.0;
/// Nearer to itself no robot gets a goal, in m.
const FAR_M: f64 = 1.5;
/// Goals keep so far from walls, in m.
const WALL_M: f64 = 0.5;

/// A goal that failed, and what the room looked like then.
#[derive(Debug, Clone)]
#[allow(dead_code)] // for the example
pub(crate) struct Failed {
    pub(crate) at_s: f64,
    pub(crate) robot: usize,
    pub(crate) reason: String,
    /// Where everybody stood.
    pub(crate) poses: Vec<MapPose>,
    /// Where everybody was to go, (x, y) in m.
    pub(crate) goals: Vec<[f64; 2]>,
}

/// What came of it.
#[derive(Debug, Clone, Default)]
#[allow(dead_code)] // for the example
pub(crate) struct Life {
    pub(crate) reached: u32,
    pub(crate) failed: Vec<Failed>,
    pub(crate) contacts: u64,
    /// Longest time in which nobody moved and no goal ended, in s.
    pub(crate) stood_s: f64,
    /// And when that ended, in s.
    pub(crate) stood_at_s: f64,
    /// Who touched what.
    pub(crate) touched: Vec<String>,
}

/// A fleet in a room.
pub(crate) struct Fleet {
    pub(crate) drive: Drive,
    floor: GridRoom,
    /// Where each is to go.
    pub(crate) goals: Vec<[f64; 2]>,
    draws: Vec<Draw>,
    contacts: Vec<u64>,
    pub(crate) life: Life,
    quiet_s: f64,
    at_s: f64,
}

impl Fleet {
    /// So many robots at random places in a room.
    pub(crate) fn new(world: &str, robots: usize, seed: u64, led: bool) -> Self {
        Self::of_kinds(world, &vec![VehicleFile::default(); robots], seed, led)
    }

    /// A robot of each of these files, at random places in a room.
    pub(crate) fn of_kinds(world: &str, files: &[VehicleFile], seed: u64, led: bool) -> Self {
        let map = World::from_toml(world).unwrap().to_map(0.05).unwrap();
        let floor = GridRoom::of(&map);
        let mut draw = Draw::new(seed ^ 0x00C0_221D);
        let mut starts: Vec<MapPose> = Vec::new();
        for _ in 0..100_000 {
            let Some(file) = files.get(starts.len()) else { break };
            let car = Car::of(&file.vehicle);
            let [x_m, y_m] = anywhere(&floor, &mut draw);
            let yaw_rad = (draw.below(4) as f64 - 1.0) * std::f64::consts::FRAC_PI_2;
            let pose = MapPose { x_m, y_m, yaw_rad };
            let apart = starts.iter().all(|other| (other.x_m - x_m).hypot(other.y_m - y_m) > APART_M);
            if apart && floor.is_free(&Rect::body(&car, &pose), 0.1) {
                starts.push(pose);
            }
        }
        let mut fleet = Self::of_kinds_at(world, &starts, &files[..starts.len()], seed, led);
        for index in 0..starts.len() {
            fleet.send_on(index);
        }
        fleet
    }

    /// Robots at these places that nobody has sent yet.
    pub(crate) fn at(world: &str, starts: &[MapPose], seed: u64, led: bool) -> Self {
        Self::of_kinds_at(world, starts, &vec![VehicleFile::default(); starts.len()], seed, led)
    }

    fn of_kinds_at(world: &str, starts: &[MapPose], files: &[VehicleFile], seed: u64, led: bool) -> Self {
        let world = World::from_toml(world).unwrap();
        let map: Map = world.to_map(0.05).unwrap();
        let mut drive = Drive::by_files(world, starts, files, seed);
        if led {
            drive.lockstep.set_traffic(Some(Traffic::new(&map, seed)));
        }
        let draws = (0..starts.len()).map(|index| Draw::new(seed * 100 + index as u64)).collect();
        let goals = starts.iter().map(|pose| [pose.x_m, pose.y_m]).collect();
        let contacts = vec![0; starts.len()];
        let floor = GridRoom::of(&map);
        Self { drive, floor, goals, draws, contacts, life: Life::default(), quiet_s: 0.0, at_s: 0.0 }
    }

    /// Sends one there.
    pub(crate) fn send(&mut self, index: usize, goal: [f64; 2]) -> bool {
        self.goals[index] = goal;
        matches!(self.drive.goto(index, goal[0], goal[1], None), Outcome::Ok(_))
    }

    /// Sends one to a place at random. Each robot's draws are its own: how the others fare changes only which
    /// of them are passed over.
    pub(crate) fn send_on(&mut self, index: usize) {
        let here = self.truth(index);
        for _ in 0..1000 {
            let goal = anywhere(&self.floor, &mut self.draws[index]);
            let far = |[x_m, y_m]: [f64; 2]| (x_m - goal[0]).hypot(y_m - goal[1]);
            let taken = (0..self.goals.len()).any(|other| other != index && far(self.goals[other]) < APART_M);
            let near = far([here.x_m, here.y_m]) < FAR_M;
            if !taken && !near && self.floor.clearance_m(goal[0], goal[1]) >= WALL_M && self.send(index, goal)
            {
                return;
            }
        }
    }

    fn truth(&self, index: usize) -> TruthRobot {
        self.drive.lockstep.simulation().trucks()[index].truth()
    }

    /// So long. With `lifelong`, whoever has ended a goal gets another one; without, it ends when all have.
    pub(crate) fn run(&mut self, seconds: f64, lifelong: bool, show: &mut dyn FnMut(&mut Self, f64)) {
        let end_s = self.at_s + seconds;
        let mut open = vec![true; self.goals.len()];
        while self.at_s < end_s && open.contains(&true) {
            self.drive.run_s(LOOK_S);
            self.at_s += LOOK_S;
            let mut quiet = true;
            let truths: Vec<TruthRobot> = (0..self.goals.len()).map(|index| self.truth(index)).collect();
            for (index, truth) in truths.iter().enumerate() {
                let state = self.drive.lockstep.state(index).unwrap();
                quiet &= truth.speed_mps.abs() < STANDS_MPS;
                if truth.contacts > self.contacts[index] {
                    self.life.contacts += truth.contacts - self.contacts[index];
                    self.contacts[index] = truth.contacts;
                    self.life.touched.push(format!("{:.1} s {} at {truth:?}", self.at_s, state.robot));
                }
                let Some(goal) = state.goal.filter(|goal| open[index] && goal.status.is_final()) else {
                    continue;
                };
                quiet = false;
                match goal.status {
                    GoalStatus::Reached => self.life.reached += 1,
                    _ => self.life.failed.push(Failed {
                        at_s: self.at_s,
                        robot: index,
                        reason: goal.reason.unwrap_or_default(),
                        poses: truths.iter().map(pose).collect(),
                        goals: self.goals.clone(),
                    }),
                }
                if lifelong {
                    self.send_on(index);
                } else {
                    open[index] = false;
                }
            }
            self.quiet_s = if quiet { self.quiet_s + LOOK_S } else { 0.0 };
            if self.quiet_s > self.life.stood_s {
                (self.life.stood_s, self.life.stood_at_s) = (self.quiet_s, self.at_s);
            }
            show(self, self.at_s);
        }
    }
}

fn pose(truth: &TruthRobot) -> MapPose {
    MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad }
}

fn anywhere(floor: &GridRoom, draw: &mut Draw) -> [f64; 2] {
    let [low, high] = floor.corners_m();
    [draw.uniform(low[0], high[0]), draw.uniform(low[1], high[1])]
}
