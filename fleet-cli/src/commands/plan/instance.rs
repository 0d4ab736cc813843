//! What is to be planned, as files have it.
//!
//! The public CL-MAPF instances (L. Wen et al.): cars of 3 × 2 units, discs of radius 0.8, time in
//! steps of at most 2.118 units, yaw clockwise from +x. And ours: trucks in a world, in m, s and rad,
//! counter-clockwise:
//!
//! ```yaml
//! world: lab.toml             # beside this file
//! agents:
//!   - {name: xtb-1, start: [0.0, 0.0, 1.57], goal: [0.0, 5.0, 1.57]}
//!   - {name: xtb-2, start: …, goal: …, vehicle: long.toml}  # beside this file; default: an XTB
//! speed_m_s: 0.35             # default
//! clearance_m: 0.05           # default; kept between robots, and from walls
//! look_out_m: 0.27            # default; kept free before both bumpers: nearer things stop a truck
//! ```
//!
//! The world's zones hold as on its map: keep-outs are walls, one-way zones are driven one way.

use crate::commands::sim::read_world;
use crate::output::Output;
use crate::vehicle_file;
use robot_agent::files;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::VehicleConfig;
use xtb_nav::map::raster;
use xtb_nav::planner::space::OneWay;
use xtb_nav::{Car, Cell, Gears, Grid, Map, MapPose};
use xtb_sim::{MAP_RESOLUTION_M, World};
use xtb_traffic::solver::{CarTask, FloorBounds, Obstacle, Problem, ProblemError, Tolerance, obstacles_of};

/// The public instances' car, see their checker's header.
const PUBLIC_CAR: Car =
    Car { front_m: 2.0, rear_m: 1.0, half_width_m: 1.0, radius_m: 3.0, gears: Gears::BOTH };
const PUBLIC_DISC: f64 = 0.8;
const PUBLIC_STEP: f64 = 2.118;
/// Kept from everything where starts and goals allow it.
const PUBLIC_CLEARANCE: f64 = 0.02;
/// Their starts and goals are rounded to whole units, some onto an obstacle; this far off still counts.
const PUBLIC_TOLERANCE: Tolerance = Tolerance { position_m: 0.1, yaw_rad: 0.05 };

/// Turn of our trucks in one step, in rad.
const TURN_RAD: f64 = 0.7;
/// Free floor around the contents of a world without a room, in m.
const OPEN_MARGIN_M: f64 = 5.0;
/// Of the walls around a room, in m.
const ROOM_WALL_M: f64 = 0.1;

/// A problem, and how its file counts.
#[derive(Debug, Clone)]
pub(crate) struct Instance {
    pub(crate) problem: Problem,
    /// The file's y points down from here; `None`: it points up.
    flipped_at: Option<f64>,
    /// Time of one step, in the file's unit.
    step_time: f64,
}

#[derive(Debug, Deserialize)]
struct Kinds {
    world: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
struct Agent {
    name: String,
    start: [f64; 3],
    goal: [f64; 3],
    vehicle: Option<PathBuf>,
}

#[derive(Debug, Deserialize)]
struct Public {
    agents: Vec<Agent>,
    map: PublicMap,
}

#[derive(Debug, Deserialize)]
struct PublicMap {
    dimensions: [f64; 2],
    obstacles: Option<Vec<[f64; 2]>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Ours {
    world: PathBuf,
    agents: Vec<Agent>,
    #[serde(default = "speed_m_s")]
    speed_m_s: f64,
    #[serde(default = "clearance_m")]
    clearance_m: f64,
    #[serde(default = "look_out_m")]
    look_out_m: f64,
}

fn speed_m_s() -> f64 {
    0.35
}

fn clearance_m() -> f64 {
    0.05
}

fn look_out_m() -> f64 {
    0.27
}

impl Instance {
    /// Reads a file of either kind.
    ///
    /// # Errors
    /// [`ErrorKind::Config`]: it cannot be read, or is neither.
    pub(crate) fn read(out: &Output, path: &Path) -> Result<Self> {
        let hint = "an instance needs `agents` (name, start, goal) and a `map` or a `world`";
        let invalid = |error: String| {
            Error::new(ErrorKind::Config, format!("{}: {}", path.display(), error.trim_end())).hint(hint)
        };
        let text = files::text(path, files::MAX_TEXT).map_err(|error| {
            Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display())).hint(hint)
        })?;
        let kind: Kinds = serde_saphyr::from_str(&text).map_err(|error| invalid(error.to_string()))?;
        if kind.world.is_none() {
            return serde_saphyr::from_str(&text)
                .map(Self::public)
                .map_err(|error| invalid(error.to_string()));
        }
        let ours: Ours = serde_saphyr::from_str(&text).map_err(|error| invalid(error.to_string()))?;
        if !(ours.speed_m_s > 0.0 && ours.look_out_m >= 0.0 && ours.clearance_m >= 0.0) {
            let wrong = "speed_m_s must be above 0, clearance_m and look_out_m must not be negative";
            return Err(invalid(wrong.to_owned()));
        }
        let beside = path.parent().unwrap_or(Path::new(""));
        let world = read_world(out, &beside.join(&ours.world))?;
        let chart = world.to_map(MAP_RESOLUTION_M).map_err(|error| invalid(error.to_string()))?;
        let truck = |agent: &Agent| match &agent.vehicle {
            Some(file) => vehicle_file::read(&beside.join(file)).map(|file| Car::of(&file.vehicle)),
            None => Ok(Car::of(&VehicleConfig::default())),
        };
        let trucks: Vec<Car> = ours.agents.iter().map(truck).collect::<Result<_>>()?;
        Ok(Self::ours(&ours, &trucks, &world, &chart))
    }

    fn public(file: Public) -> Self {
        let [width, depth] = file.map.dimensions;
        let disc = |[x, y]: [f64; 2]| Obstacle::Disc { x_m: x, y_m: depth - y, radius_m: PUBLIC_DISC };
        let pose = |[x, y, yaw_rad]: [f64; 3]| MapPose { x_m: x, y_m: depth - y, yaw_rad };
        let task = |agent: Agent| CarTask {
            name: agent.name,
            car: PUBLIC_CAR,
            start: pose(agent.start),
            goal: pose(agent.goal),
        };
        let problem = Problem {
            bounds: FloorBounds { west_m: 0.0, south_m: 0.0, east_m: width, north_m: depth },
            obstacles: file.map.obstacles.unwrap_or_default().into_iter().map(disc).collect(),
            one_way: None,
            cars: file.agents.into_iter().map(task).collect(),
            step_m: PUBLIC_STEP,
            clearance_m: PUBLIC_CLEARANCE,
            tolerance: PUBLIC_TOLERANCE,
            by_order: false,
        };
        Self { problem, flipped_at: Some(depth), step_time: 1.0 }
    }

    fn ours(file: &Ours, trucks: &[Car], world: &World, chart: &Map) -> Self {
        let pose = |[x_m, y_m, yaw_rad]: [f64; 3]| MapPose { x_m, y_m, yaw_rad };
        let look_out_m = file.look_out_m;
        let task = |(agent, truck): (&Agent, &Car)| CarTask {
            name: agent.name.clone(),
            car: Car { front_m: truck.front_m + look_out_m, rear_m: truck.rear_m + look_out_m, ..*truck },
            start: pose(agent.start),
            goal: pose(agent.goal),
        };
        let cars: Vec<CarTask> = file.agents.iter().zip(trucks).map(task).collect();
        let mut obstacles = solids(world);
        let bounds = bounds(world, &obstacles, &cars);
        obstacles.extend(keep_outs(chart));
        let radius_m = trucks.iter().map(|truck| truck.radius_m).reduce(f64::min).unwrap_or(1.0);
        let step_m = radius_m * TURN_RAD;
        let problem = Problem {
            bounds,
            obstacles,
            one_way: OneWay::of(chart).map(Arc::new),
            cars,
            step_m,
            clearance_m: file.clearance_m,
            tolerance: Tolerance::default(),
            by_order: true,
        };
        Self { problem, flipped_at: None, step_time: step_m / file.speed_m_s }
    }

    /// A count of steps in the file's unit of time.
    pub(crate) fn time(&self, steps: usize) -> f64 {
        steps as f64 * self.step_time
    }

    /// (x, y, yaw) as the file counts them.
    pub(crate) fn place(&self, pose: &MapPose) -> [f64; 3] {
        [pose.x_m, self.north(pose.y_m), pose.yaw_rad]
    }

    /// The same error with the places as the file counts them.
    pub(crate) fn placed(&self, mut error: ProblemError) -> ProblemError {
        if let ProblemError::Outside { y_m, .. } | ProblemError::Blocked { y_m, .. } = &mut error {
            *y_m = self.north(*y_m);
        }
        error
    }

    fn north(&self, y_m: f64) -> f64 {
        self.flipped_at.map_or(y_m, |depth| depth - y_m)
    }
}

/// Walls and boxes of a world.
fn solids(world: &World) -> Vec<Obstacle> {
    let wall = |from: [f64; 2], to: [f64; 2], thickness_m: f64| {
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        Obstacle::Box {
            middle: MapPose {
                x_m: (from[0] + to[0]) / 2.0,
                y_m: (from[1] + to[1]) / 2.0,
                yaw_rad: dy.atan2(dx),
            },
            // Half a thickness more at each end closes the corner to the next segment.
            half_length_m: (dx.hypot(dy) + thickness_m) / 2.0,
            half_width_m: thickness_m / 2.0,
        }
    };
    let mut solids = Vec::new();
    if let Some(room) = world.room() {
        let (wide, deep) = ((room.width_m + ROOM_WALL_M) / 2.0, (room.depth_m + ROOM_WALL_M) / 2.0);
        let corners = [[-wide, -deep], [wide, -deep], [wide, deep], [-wide, deep]]
            .map(|[x, y]| [room.x_m + x, room.y_m + y]);
        solids.extend((0..4).map(|side| wall(corners[side], corners[(side + 1) % 4], ROOM_WALL_M)));
    }
    for line in world.walls() {
        solids.extend(line.points.windows(2).map(|ends| wall(ends[0], ends[1], line.thickness_m)));
    }
    solids.extend(world.boxes().map(|(_, spec)| Obstacle::Box {
        middle: MapPose { x_m: spec.x_m, y_m: spec.y_m, yaw_rad: spec.yaw_rad },
        half_length_m: spec.width_m / 2.0,
        half_width_m: spec.depth_m / 2.0,
    }));
    solids
}

/// The squares under keep-outs: robots' look-outs stay off them too, which is more than is needed.
fn keep_outs(chart: &Map) -> Vec<Obstacle> {
    let grid = chart.grid();
    let blank = Grid::free(grid.resolution_m(), grid.origin_m(), grid.width(), grid.height());
    let Ok(mut drawn) = blank else { return Vec::new() };
    chart.keep_outs().for_each(|zone| raster::polygon(&mut drawn, zone.points(), Cell::Occupied));
    obstacles_of(&drawn)
}

/// The room; without one everything there is, and some floor around it.
fn bounds(world: &World, obstacles: &[Obstacle], cars: &[CarTask]) -> FloorBounds {
    if let Some(room) = world.room() {
        let (wide, deep) = (room.width_m / 2.0, room.depth_m / 2.0);
        return FloorBounds {
            west_m: room.x_m - wide,
            south_m: room.y_m - deep,
            east_m: room.x_m + wide,
            north_m: room.y_m + deep,
        };
    }
    let places =
        cars.iter().flat_map(|task| [&task.start, &task.goal]).map(|pose| ([pose.x_m, pose.y_m], 0.0));
    let things = obstacles.iter().map(|obstacle| (obstacle.middle_m(), obstacle.reach_m()));
    let none = FloorBounds { west_m: f64::MAX, south_m: f64::MAX, east_m: f64::MIN, north_m: f64::MIN };
    places.chain(things).fold(none, |bounds, ([x, y], reach)| {
        let around = reach + OPEN_MARGIN_M;
        FloorBounds {
            west_m: bounds.west_m.min(x - around),
            south_m: bounds.south_m.min(y - around),
            east_m: bounds.east_m.max(x + around),
            north_m: bounds.north_m.max(y + around),
        }
    })
}
