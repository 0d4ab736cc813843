//! A-to-B trips of the whole vehicle in free space: lag, stop before reverse, noise, drift, play,
//! wheel scale. The test in `goto.rs` and the example `goto_table` measure with this.

use crate::agent::Bench;
use crate::draw::{Draw, in_parallel};
use std::f64::consts::PI;
use xtb_control::frames::{MapFromOdom, MapPose};
use xtb_control::goto::GotoGoal;
use xtb_control::odometry::OdomPose;
use xtb_control::{Command, Mode, VehicleConfig};
use xtb_sim::{TruckParameters, VehicleFile, World};

/// Longest that a trip is watched: five times as long as the longest straight line takes.
const PATIENCE_S: f64 = 180.0;

/// One start and goal.
#[derive(Debug, Clone, Copy)]
struct Trip {
    seed: u64,
    start: MapPose,
    distance_m: f64,
    bearing_rad: f64,
}

/// What came of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrival {
    /// Time from the command to arrival over that of a straight line at V; `None` = still under way.
    pub(crate) ratio: Option<f64>,
    /// How often the direction changed that the law asks for.
    pub(crate) gear_changes: usize,
    /// From the goal to where the truck really is at the end, in m.
    pub(crate) missed_m: f64,
    pub(crate) contacts: u64,
}

impl Trip {
    /// Anywhere, facing anywhere; the goal 0.5 to 4 m away in any direction.
    fn draw(seed: u64) -> Self {
        let mut draw = Draw::new(seed);
        let (x_m, y_m) = (draw.uniform(-3.0, 3.0), draw.uniform(-3.0, 3.0));
        let start = MapPose { x_m, y_m, yaw_rad: draw.uniform(-PI, PI) };
        Self { seed, start, distance_m: draw.uniform(0.5, 4.0), bearing_rad: draw.uniform(-PI, PI) }
    }

    fn run(self, config: &VehicleConfig, truck: &TruckParameters) -> Arrival {
        let free = World::from_toml("").unwrap();
        let mut bench = Bench::with_config(free, truck, self.start, self.seed, config.clone());
        bench.run_s(0.2);
        let (sin, cos) = libm::sincos(self.bearing_rad);
        let goal_x_m = self.start.x_m + self.distance_m * cos;
        let goal_y_m = self.start.y_m + self.distance_m * sin;
        let map = MapFromOdom::aligning(&OdomPose::default(), &self.start);
        let (x_m, y_m) = map.point_to_odom(goal_x_m, goal_y_m);
        bench.command(Command::Goto(GotoGoal::new(x_m, y_m).unwrap()));
        let began_s = bench.simulation.now().s();
        let (mut gear_changes, mut gear) = (0, 0.0);
        while bench.agent.outputs.mode == Mode::Goto && bench.simulation.now().s() < began_s + PATIENCE_S {
            bench.step();
            let asked = bench.agent.outputs.reference_rpm;
            if asked != 0.0 {
                gear_changes += usize::from(asked * gear < 0.0);
                gear = asked;
            }
        }
        let took_s = bench.simulation.now().s() - began_s;
        let straight_s = self.distance_m / (config.goto.reference_rpm * config.mps_per_rpm());
        let arrived = bench.agent.outputs.mode == Mode::Idle;
        let truth = bench.simulation.trucks()[0].truth();
        Arrival {
            ratio: arrived.then_some(took_s / straight_s),
            gear_changes,
            missed_m: libm::hypot(truth.x_m - goal_x_m, truth.y_m - goal_y_m),
            contacts: truth.contacts,
        }
    }
}

/// Makes the first so many trips.
pub(crate) fn measure(trips: u64, config: &VehicleConfig) -> Vec<Arrival> {
    in_parallel(0..trips, |seed| Trip::draw(seed).run(config, &TruckParameters::default()))
}

/// The same with the car of a file.
pub(crate) fn measure_file(trips: u64, file: &VehicleFile) -> Vec<Arrival> {
    in_parallel(0..trips, |seed| Trip::draw(seed).run(&file.vehicle, &file.truth))
}

/// The value that this part of all values does not exceed.
pub(crate) fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    values.get(libm::round(part * last as f64) as usize).copied().unwrap_or(f64::NAN)
}
