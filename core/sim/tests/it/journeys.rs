//! Journeys: planned goals at random in known rooms, the whole robot on the whole vehicle, poses from fixes;
//! on request something that is not on the map is put into the way. The tests in `planned.rs` and the
//! example `journeys` measure with this.

use crate::draw::{Draw, in_parallel};
use crate::drive::Drive;
use std::f64::consts::{PI, SQRT_2};
use xtb_control::VehicleConfig;
use xtb_nav::map::{Map, ZoneLayers};
use xtb_nav::navigator::RADIUS_FACTOR;
use xtb_nav::planner::space::{GridLayers, GridSpace, LookOut, Space};
use xtb_nav::planner::{Planner, PlannerGoal, PlannerSettings};
use xtb_nav::{Car, MapPose, Path};
use xtb_protocol::messages::{GoalStatus, Outcome};
use xtb_sim::BoxSpec;
use xtb_sim::World;

/// A room without anything in it.
const EMPTY: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\n";
/// A thing comes into being at least so far from the body: the obstacle rule's 25 cm, what it takes to notice
/// and to stop, and as much again. Nearer, no driver could be blamed.
const FAIR_M: f64 = 0.45;
/// Longer than any way in these rooms takes.
const PATIENCE_S: f64 = 400.0;

/// What came of one.
#[derive(Debug, Clone)]
#[allow(dead_code)] // shown when a test fails, and by the example
pub(crate) struct Journey {
    pub(crate) seed: u64,
    pub(crate) start: MapPose,
    pub(crate) goal: MapPose,
    pub(crate) with_yaw: bool,
    pub(crate) status: Option<GoalStatus>,
    pub(crate) reason: Option<String>,
    pub(crate) contacts: u64,
    /// By the truth.
    pub(crate) off_m: f64,
    pub(crate) took_s: f64,
    /// Length of the shortest path that the planner knew of at the start, in m.
    pub(crate) planned_m: f64,
    /// Paths that it took.
    pub(crate) plans: u32,
    /// Longest standstill, in s.
    pub(crate) stood_s: f64,
    /// Something was put into the way, and where.
    pub(crate) hindered: Vec<[f64; 2]>,
    /// Where it says that the way is blocked, from the nearest of them, in m.
    pub(crate) said_off_m: Option<f64>,
    /// Whether a path exists that knows everything: at full lock, with 5 mm to spare.
    pub(crate) possible: bool,
    /// The same with what the robot needs to steer: a seventh of its lock and 3 cm beside the body.
    pub(crate) drivable: bool,
}

impl Journey {
    /// Arrived, or failed and says what is so: there is no way that it can drive, and what it names is there.
    pub(crate) fn is_honest(&self) -> bool {
        self.is_true(self.drivable)
    }

    /// The same, where no driver at all finds a way.
    #[allow(dead_code)] // for the example
    pub(crate) fn is_honest_to_the_last(&self) -> bool {
        self.is_true(self.possible)
    }

    fn is_true(&self, possible: bool) -> bool {
        match self.status {
            Some(GoalStatus::Reached) => self.off_m < 0.35,
            Some(GoalStatus::Failed) => !possible && self.said_off_m.is_some_and(|off_m| off_m < 0.6),
            _ => false,
        }
    }
}

/// What is put into the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hinder {
    /// Nothing.
    Nothing,
    /// A box that stays.
    Box,
    /// Two, one after the other.
    TwoBoxes,
    /// Somebody who goes away after 3 to 8 s.
    Person,
}

impl Hinder {
    #[allow(dead_code)] // for the example
    pub(crate) const ALL: [Self; 4] = [Self::Nothing, Self::Box, Self::TwoBoxes, Self::Person];

    fn times(self) -> usize {
        match self {
            Self::Nothing => 0,
            Self::Box | Self::Person => 1,
            Self::TwoBoxes => 2,
        }
    }
}

/// A room as the planner sees it.
pub(crate) struct Room {
    pub(crate) world: World,
    space: GridSpace,
}

impl Room {
    /// As the robot plans first.
    pub(crate) fn of(world: World) -> Self {
        let grid = world.to_map(0.05).unwrap();
        Self::with(world, &grid, 0.06, RADIUS_FACTOR)
    }

    /// With everything that stands there, by the rules of the map (what was put there has none).
    pub(crate) fn knowing(world: &World, margin_m: f64, radius_factor: f64) -> Self {
        let grid = world.to_map(0.05).unwrap();
        Self::with(world.clone(), &grid, margin_m, radius_factor)
    }

    fn with(world: World, map: &Map, margin_m: f64, radius_factor: f64) -> Self {
        let zones = ZoneLayers::of(map);
        let car = Car::of(&VehicleConfig::default());
        let car = Car { radius_m: car.radius_m * radius_factor, ..car.grown(margin_m) };
        let look_out = LookOut { ahead_m: 0.32 - margin_m, half_width_m: 0.2 };
        let layers = GridLayers {
            zones: Some(&zones.keep_outs),
            one_way: zones.one_way.as_deref(),
            ..GridLayers::map(map.grid())
        };
        let space = GridSpace::new(&layers, car, look_out).unwrap();
        Self { world, space }
    }

    /// A pose at which it can stand, with room to drive off.
    pub(crate) fn pose(&self, draw: &mut Draw) -> MapPose {
        let bounds = self.space.bounds();
        loop {
            let pose = MapPose {
                x_m: draw.uniform(bounds.low_m[0], bounds.high_m[0]),
                y_m: draw.uniform(bounds.low_m[1], bounds.high_m[1]),
                yaw_rad: draw.uniform(-PI, PI),
            };
            if self.space.standing(&pose).is_none() && self.space.clearance_m(pose.x_m, pose.y_m) > 0.4 {
                return pose;
            }
        }
    }

    pub(crate) fn path(&self, start: &MapPose, goal: &MapPose, with_yaw: bool) -> Option<Path> {
        let goal = PlannerGoal {
            x_m: goal.x_m,
            y_m: goal.y_m,
            yaw_rad: with_yaw.then_some(goal.yaw_rad),
            tolerance_m: 0.05,
            tolerance_rad: 0.05,
        };
        let settings = PlannerSettings::default();
        Planner::new().plan(&self.space, start, &goal, &settings, &mut || true).ok().map(|plan| plan.path)
    }
}

/// The journey of this seed.
pub(crate) fn journey(world: &str, seed: u64, hinder: Hinder) -> Journey {
    let draw = Draw::new(seed);
    let room = Room::of(World::from_toml(world).unwrap());
    travel(&room, draw, seed, hinder)
}

/// A journey in a room of 8 × 8 m with boxes that the map knows of.
pub(crate) fn journey_in_clutter(seed: u64, hinder: Hinder) -> Journey {
    let mut draw = Draw::new(seed ^ 0xC1);
    let mut world = World::from_toml(EMPTY).unwrap();
    for number in 0..14 {
        let (x_m, y_m) = (draw.uniform(-3.8, 3.8), draw.uniform(-3.8, 3.8));
        let (width_m, depth_m) = (draw.uniform(0.15, 0.7), draw.uniform(0.15, 0.7));
        let spec = BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad: draw.uniform(0.0, PI) };
        world.put_box(&format!("known-{number}"), spec).unwrap();
    }
    travel(&Room::of(world), draw, seed, hinder)
}

fn travel(room: &Room, mut draw: Draw, seed: u64, hinder: Hinder) -> Journey {
    let (start, goal, with_yaw, path) = loop {
        let (start, goal, with_yaw) =
            (room.pose(&mut draw), room.pose(&mut draw), draw.uniform(0.0, 1.0) < 0.5);
        if let Some(path) = room.path(&start, &goal, with_yaw).filter(|path| path.length_m() > 1.5) {
            break (start, goal, with_yaw, path);
        }
    };
    let mut drive = Drive::at(room.world.clone(), &[start], seed);
    let mut made = Journey {
        seed,
        start,
        goal,
        with_yaw,
        status: None,
        reason: None,
        contacts: 0,
        off_m: f64::NAN,
        took_s: 0.0,
        planned_m: path.length_m(),
        plans: 0,
        stood_s: 0.0,
        hindered: Vec::new(),
        said_off_m: None,
        possible: true,
        drivable: true,
    };
    if let Outcome::Error(error) = drive.goto(0, goal.x_m, goal.y_m, with_yaw.then_some(goal.yaw_rad)) {
        made.reason = Some(error.message);
        return made;
    }
    run(&mut drive, &mut draw, hinder, &mut made);
    let truth = drive.lockstep.simulation().trucks()[0].truth();
    made.contacts = truth.contacts;
    made.off_m = (truth.x_m - goal.x_m).abs().max((truth.y_m - goal.y_m).abs());
    if made.status == Some(GoalStatus::Failed) {
        let now = MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad };
        let world = drive.lockstep.simulation().world().clone();
        let said = drive.lockstep.state(0).unwrap().nav.route.and_then(|route| route.blocked_at_m);
        made.said_off_m = said.or_else(|| place_in(made.reason.as_deref()?)).map(|(x_m, y_m)| {
            let off_m = |[x, y]: &[f64; 2]| (x - x_m).hypot(y - y_m);
            made.hindered.iter().map(off_m).fold(f64::MAX, f64::min)
        });
        let leads_there = |margin_m, radius_factor| {
            Room::knowing(&world, margin_m, radius_factor).path(&now, &goal, with_yaw).is_some()
        };
        made.possible = leads_there(0.005, 1.0);
        made.drivable = leads_there(0.03, RADIUS_FACTOR);
    }
    made
}

/// Drives until the goal has ended, and puts things into the way.
fn run(drive: &mut Drive, draw: &mut Draw, hinder: Hinder, made: &mut Journey) {
    let begun = drive.lockstep.now();
    let mut hinder_at_s = draw.uniform(1.0, 0.6 * made.planned_m / 0.2);
    let (mut stood_s, mut goes_at_s): (f64, f64) = (0.0, f64::MAX);
    while made.took_s < PATIENCE_S {
        drive.run_s(0.1);
        made.took_s = drive.lockstep.now().since_s(begun);
        let truth = drive.lockstep.simulation().trucks()[0].truth();
        stood_s = if truth.speed_mps.abs() < 0.01 { stood_s + 0.1 } else { 0.0 };
        made.stood_s = made.stood_s.max(stood_s);
        if made.hindered.len() < hinder.times() && made.took_s >= hinder_at_s {
            let name = format!("stranger-{}", made.hindered.len());
            if let Some(at) = put_in_the_way(drive, draw, &name) {
                made.hindered.push(at);
                hinder_at_s = made.took_s + draw.uniform(1.0, 15.0);
                goes_at_s = made.took_s + draw.uniform(3.0, 8.0);
            }
        }
        if hinder == Hinder::Person && made.took_s >= goes_at_s {
            drive.lockstep.simulation_mut().remove_box("stranger-0").unwrap();
            goes_at_s = f64::MAX;
        }
        let state = drive.lockstep.state(0).unwrap();
        made.plans = state.nav.route.map_or(made.plans, |route| route.plans);
        let goal = state.goal.unwrap();
        (made.status, made.reason) = (Some(goal.status), goal.reason);
        if goal.status.is_final() {
            break;
        }
    }
}

/// The first "(x, y)" of a text.
fn place_in(text: &str) -> Option<(f64, f64)> {
    let (x, rest) = text.split_once('(')?.1.split_once(", ")?;
    Some((x.parse().ok()?, rest.split_once(')')?.0.parse().ok()?))
}

/// A box of 10 to 50 cm, turned anyhow, its middle on the way that is left, 0.9 to 2 m ahead; not now, if
/// some of it were nearer than [`FAIR_M`]. Whether a beam looks there is not asked.
fn put_in_the_way(drive: &mut Drive, draw: &mut Draw, name: &str) -> Option<[f64; 2]> {
    let route = drive.lockstep.state(0).unwrap().nav.route?;
    let track = route.track?;
    let mut path = Path::standing(track.start);
    for arc in &track.arcs {
        path.push(xtb_nav::Piece { length_m: arc.length_m, curvature_per_m: arc.curvature_per_m });
    }
    let (ahead_m, half_m) = (draw.uniform(0.9, 2.0), draw.uniform(0.05, 0.25));
    let (pose, piece) = path.at(route.done_m + ahead_m);
    piece?;
    let truth = drive.lockstep.simulation().trucks()[0].truth();
    let here = MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad };
    let car = Car::of(&VehicleConfig::default());
    if car.distance_m(&here, [pose.x_m, pose.y_m]) < FAIR_M + half_m * SQRT_2 {
        return None;
    }
    let side = 2.0 * half_m;
    let spec = BoxSpec {
        x_m: pose.x_m,
        y_m: pose.y_m,
        width_m: side,
        depth_m: side,
        yaw_rad: draw.uniform(0.0, PI),
    };
    drive.lockstep.simulation_mut().put_box(name, spec).ok()?;
    Some([pose.x_m, pose.y_m])
}

/// Journeys of all these seeds.
pub(crate) fn journeys(world: &str, seeds: std::ops::Range<u64>, hinder: Hinder) -> Vec<Journey> {
    in_parallel(seeds, |seed| journey(world, seed, hinder))
}

/// The same in rooms full of boxes.
pub(crate) fn journeys_in_clutter(seeds: std::ops::Range<u64>, hinder: Hinder) -> Vec<Journey> {
    in_parallel(seeds, |seed| journey_in_clutter(seed, hinder))
}
