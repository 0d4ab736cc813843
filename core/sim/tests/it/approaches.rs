//! Approaches to something that stands in the way: the real controller on the simulated truck with
//! all its deviations, in every mode, ahead and astern. The tests in `walls.rs` and the
//! example `wall_table` measure with this.
//!
//! ```text
//!            ___wall, turned by up to 60°          box, turned anyhow, anywhere in
//!     ___----                                      ┌──┐ front of the middle of the truck
//!            │ gap 0.4..1.5 m                      └──┘
//!         ┌──┴──┐                                ┌─────┐
//!         │truck│                                │truck│
//! ```
//! What no sensor's ray can meet is left out, since no controller could know of it: the outer 2.5 cm
//! of either side, and what lies beside a truck that turns.

use crate::agent::{Bench, steps};
use crate::draw::{Draw, in_parallel};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};
use std::ops::Range;
use xtb_control::frames::MapPose;
use xtb_control::goto::GotoGoal;
use xtb_control::{Command, Steering, VehicleConfig, WheelRpm};
use xtb_sim::{BoxSpec, Transmitter, TruckParameters, World};

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Driver {
    /// To a goal beyond, so far to the right of the middle line, in m.
    Goto(f64),
    Wander,
    /// With this steering.
    Teleop(f64),
    /// By the transmitter, with this steering.
    Manual(f64),
}

/// One approach; all of it comes from its number.
#[derive(Debug, Clone)]
pub(crate) struct Approach {
    seed: u64,
    driver: Driver,
    /// + = ahead.
    mps: f64,
    /// Free way from the bumper along the middle line.
    gap_m: f64,
    obstacle: BoxSpec,
    /// The obstacle reaches farther than the truck can.
    wall: bool,
}

/// What came of it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Outcome {
    /// The obstacle rule has seen something in the driving direction.
    pub(crate) seen: bool,
    pub(crate) touched: bool,
    /// Touched before it had come to a stand.
    pub(crate) touched_rolling: bool,
    /// Least distance between body and wall, in m; `None` for boxes.
    pub(crate) nearest_m: Option<f64>,
}

const HALF_LENGTH_M: f64 = 0.25;
const HALF_WIDTH_M: f64 = 0.2;
const WALL_M: f64 = 0.2;
/// Slower than this a truck stands.
const STANDING_MPS: f64 = 0.01;
/// A trip goes on for so long after the time that its way would take.
const AFTERWARDS_S: f64 = 4.0;

impl Approach {
    /// Number `seed` of those at up to `most_mps`; every second one is as fast as that.
    pub(crate) fn any(seed: u64, most_mps: f64) -> Self {
        let mut draw = Draw::new(seed);
        let driver = draw.below(4);
        let mps = most_mps * if draw.below(2) == 0 { 1.0 } else { draw.uniform(0.25, 1.0) };
        let astern = driver != 1 && draw.below(2) == 0;
        let wall = draw.below(2) == 0;
        // A curve adds to the angle at which a wall is met, and may miss a box.
        let curved = wall && draw.below(2) == 0;
        let most_rad = if curved { FRAC_PI_3 / 2.0 } else { FRAC_PI_3 };
        let (gap_m, part) = (draw.uniform(0.4, 1.5), draw.uniform(-1.0, 1.0));
        let aside = if curved { part } else { 0.0 };
        let driver = match driver {
            0 => Driver::Goto(aside),
            1 => Driver::Wander,
            2 => Driver::Teleop(0.1 * aside),
            _ => Driver::Manual(0.1 * aside),
        };
        let (x_m, width_m, depth_m, yaw_rad) = if wall {
            (0.0, 12.0, WALL_M, draw.uniform(-most_rad, most_rad))
        } else {
            let (width_m, depth_m) = (draw.uniform(0.1, 0.6), draw.uniform(0.1, 0.6));
            (draw.uniform(-0.1, 0.1), width_m, depth_m, draw.uniform(-PI, PI))
        };
        // Half of what the obstacle takes up of the middle line, or a little more.
        let (sin, cos) = libm::sincos(yaw_rad);
        let reach_m =
            if wall { depth_m / 2.0 / cos } else { (depth_m * cos.abs() + width_m * sin.abs()) / 2.0 };
        let sign = if astern { -1.0 } else { 1.0 };
        let y_m = sign * (HALF_LENGTH_M + gap_m + reach_m);
        let obstacle = BoxSpec { x_m, y_m, width_m, depth_m, yaw_rad };
        Self { seed, driver, mps: sign * mps, gap_m, obstacle, wall }
    }

    /// Number `seed` of those straight at a wall at this speed.
    pub(crate) fn straight(seed: u64, mps: f64) -> Self {
        let mut draw = Draw::new(seed);
        let driver = [Driver::Goto(0.0), Driver::Teleop(0.0), Driver::Manual(0.0)][draw.below(3)];
        let (gap_m, yaw_rad) = (draw.uniform(0.7, 1.5), draw.uniform(-0.05, 0.05));
        let y_m = HALF_LENGTH_M + gap_m + WALL_M / 2.0;
        let obstacle = BoxSpec { x_m: 0.0, y_m, width_m: 12.0, depth_m: WALL_M, yaw_rad };
        Self { seed, driver, mps, gap_m, obstacle, wall: true }
    }

    /// Drives it to its end, and some seconds on.
    pub(crate) fn run(&self, config: &VehicleConfig, parameters: &TruckParameters) -> Outcome {
        let mut config = config.clone();
        let rpm = self.mps / config.mps_per_rpm();
        (config.goto.reference_rpm, config.wander.reference_rpm) = (rpm.abs(), rpm.abs());
        let mut world = World::from_toml("").unwrap();
        world.put_box("obstacle", self.obstacle).unwrap();
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_2 };
        let mut bench = Bench::with_config(world, parameters, start, self.seed, config);
        bench.run_s(0.3);
        self.begin(&mut bench, rpm);
        let (mut nearest_m, mut stood) = (f64::MAX, false);
        let mut outcome = Outcome { seen: false, touched: false, touched_rolling: false, nearest_m: None };
        for _ in 0..steps(self.gap_m / self.mps.abs() + AFTERWARDS_S) {
            bench.step();
            let obstacle = bench.agent.outputs.obstacle;
            let truth = bench.simulation.trucks()[0].truth();
            outcome.seen |= obstacle.blocks(self.mps);
            outcome.touched |= truth.contacts > 0;
            stood |= outcome.seen && !outcome.touched && truth.speed_mps.abs() < STANDING_MPS;
            outcome.touched_rolling |= outcome.touched && !stood;
            if self.wall {
                nearest_m = nearest_m.min(self.distance_m(truth.x_m, truth.y_m, truth.yaw_rad));
                outcome.nearest_m = Some(nearest_m);
            }
        }
        outcome
    }

    fn begin(&self, bench: &mut Bench, rpm: f64) {
        match self.driver {
            Driver::Goto(x_m) => {
                let goal = GotoGoal::new(x_m, 4.0 * self.mps.signum()).unwrap();
                bench.command(Command::Goto(goal));
            }
            Driver::Wander => bench.command(Command::Wander),
            Driver::Teleop(steering) => {
                let (rpm, steering) =
                    (WheelRpm::try_from(rpm).unwrap(), Steering::try_from(steering).unwrap());
                bench.command(Command::Teleop { rpm, steering });
            }
            Driver::Manual(steering) => {
                let speed = stick(self.mps);
                bench.truck().set_transmitter(Transmitter {
                    on: true,
                    speed,
                    steering,
                    selector_manual: true,
                });
            }
        }
    }

    /// From the wall's face to the nearest corner of the body.
    fn distance_m(&self, x_m: f64, y_m: f64, yaw_rad: f64) -> f64 {
        let (sin, cos) = libm::sincos(yaw_rad);
        let (wall_sin, wall_cos) = libm::sincos(self.obstacle.yaw_rad);
        let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)].map(|(ahead, left)| {
            let (ahead_m, left_m) = (ahead * HALF_LENGTH_M, left * HALF_WIDTH_M);
            let dx_m = self.obstacle.x_m - x_m - cos * ahead_m + sin * left_m;
            let dy_m = self.obstacle.y_m - y_m - sin * ahead_m - cos * left_m;
            (wall_cos * dy_m - wall_sin * dx_m) * self.mps.signum() - WALL_M / 2.0
        });
        corners.into_iter().fold(f64::MAX, f64::min)
    }
}

/// The speed stick for this speed on the level with a full battery.
fn stick(mps: f64) -> f64 {
    let (dead_counts, stroke_counts) = (75.0, 1250.0);
    let range_counts = if mps > 0.0 { 5272.0 - 3750.0 } else { 3750.0 - 2331.0 } - dead_counts;
    (dead_counts + mps.abs() / 3.0 * range_counts) / stroke_counts * mps.signum()
}

/// A truck that coasts for 0.3 s longer than `obstacle.reaction_s` knows: more mass, a slope.
pub(crate) fn late() -> TruckParameters {
    let mut parameters = TruckParameters::default();
    parameters.drive.lag_s = 0.55;
    parameters
}

/// Runs these numbers of one kind of approach, in their order.
pub(crate) fn run_all(
    seeds: Range<u64>,
    config: &VehicleConfig,
    parameters: &TruckParameters,
    approach: impl Fn(u64) -> Approach + Sync,
) -> Vec<(Approach, Outcome)> {
    in_parallel(seeds, |seed| {
        let approach = approach(seed);
        let outcome = approach.run(config, parameters);
        (approach, outcome)
    })
}
