//! Approaches to something that stands in the way, one after another: the real controller, the
//! simulated truck with all its deviations, in every mode, ahead and astern.

use crate::agent::{Bench, steps};
use crate::draw::Draw;
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::controller::Outputs;
use xtb_control::frames::MapPose;
use xtb_control::goto::Goal;
use xtb_control::{Command, Steering, VehicleConfig, WheelRpm};
use xtb_sim::{BoxSpec, Transmitter, TruckParameters, World};

/// What the truck is doing when it meets the obstacle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum By {
    Goto,
    Wander,
    Teleop,
    Manual,
}

/// One approach; all of it comes from the number.
#[derive(Debug, Clone)]
pub(crate) struct Approach {
    pub(crate) seed: u64,
    pub(crate) by: By,
    /// + = ahead.
    pub(crate) mps: f64,
    /// Free way from the bumper along the middle line, in m.
    pub(crate) gap_m: f64,
    pub(crate) obstacle: BoxSpec,
    /// A wall that reaches farther than the truck can.
    pub(crate) wall: bool,
}

/// What came of it.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Outcome {
    pub(crate) contacts: u64,
    /// The obstacle rule saw something in the driving direction.
    pub(crate) seen: bool,
    /// Least distance between body and obstacle, in m; only for walls.
    pub(crate) nearest_m: f64,
    /// Fastest that the truck really was, in m/s.
    pub(crate) fastest_mps: f64,
}

const THICK_M: f64 = 0.2;

impl Approach {
    /// Number `seed` of those up to a speed.
    pub(crate) fn draw(seed: u64, most_mps: f64) -> Self {
        let mut draw = Draw::new(seed);
        let by = [By::Goto, By::Wander, By::Teleop, By::Manual][draw.below(4)];
        // Every second one as fast as the configuration admits.
        let mps = most_mps * if draw.below(2) == 0 { 1.0 } else { draw.uniform(0.25, 1.0) };
        let astern = by != By::Wander && draw.below(2) == 0;
        let gap_m = draw.uniform(0.4, 1.5);
        let wall = draw.below(2) == 0;
        // Middle of what is met, seen from the truck's middle, and how it is turned.
        let (depth_m, width_m, aside_m, turned_rad) = if wall {
            (THICK_M, 12.0, 0.0, draw.uniform(-PI / 3.0, PI / 3.0))
        } else {
            let (depth_m, width_m) = (draw.uniform(0.1, 0.6), draw.uniform(0.1, 0.6));
            (depth_m, width_m, draw.uniform(-0.1, 0.1), draw.uniform(-PI, PI))
        };
        // The point of the middle line that is met first, so that `gap_m` is what is free.
        let reach_m = if wall {
            THICK_M / 2.0 / turned_rad.cos()
        } else {
            (depth_m * turned_rad.cos().abs() + width_m * turned_rad.sin().abs()) / 2.0
        };
        let ahead_m = (0.25 + gap_m + reach_m) * if astern { -1.0 } else { 1.0 };
        let obstacle = BoxSpec { x_m: aside_m, y_m: ahead_m, width_m, depth_m, yaw_rad: turned_rad };
        Self { seed, by, mps: if astern { -mps } else { mps }, gap_m, obstacle, wall }
    }

    fn config(&self, config: &VehicleConfig) -> VehicleConfig {
        let mut config = config.clone();
        let rpm = self.mps.abs() / config.mps_per_rpm();
        (config.goto.reference_rpm, config.wander.reference_rpm) = (rpm, rpm);
        config
    }

    fn begin(&self, bench: &mut Bench, config: &VehicleConfig) {
        let rpm = self.mps / config.mps_per_rpm();
        match self.by {
            By::Goto => {
                let goal = Goal::new(0.0, 4.0 * self.mps.signum()).unwrap();
                bench.command(Command::Goto(goal));
            }
            By::Wander => bench.command(Command::Wander),
            By::Teleop => {
                let rpm = WheelRpm::try_from(rpm).unwrap();
                bench.command(Command::Teleop { rpm, steering: Steering::CENTRED });
            }
            By::Manual => bench.truck().set_transmitter(Transmitter {
                on: true,
                speed: stick(self.mps),
                steering: 0.0,
                selector_manual: true,
            }),
        }
    }

    /// Drives it to its end, and three seconds on.
    pub(crate) fn run(&self, config: &VehicleConfig) -> Outcome {
        let config = self.config(config);
        let mut world = World::from_toml("").unwrap();
        world.put_box("obstacle", self.obstacle).unwrap();
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_2 };
        let mut bench =
            Bench::with_config(world, &TruckParameters::default(), start, self.seed, config.clone());
        bench.run_s(0.3);
        self.begin(&mut bench, &config);
        let mut outcome = Outcome { nearest_m: f64::MAX, ..Outcome::default() };
        for _ in 0..steps(self.gap_m / self.mps.abs() + 4.0) {
            bench.step();
            let Outputs { obstacle, .. } = bench.agent.outputs;
            outcome.seen |= if self.mps > 0.0 { obstacle.front } else { obstacle.rear };
            let truth = bench.simulation.trucks()[0].truth();
            outcome.fastest_mps = outcome.fastest_mps.max(truth.speed_mps.abs());
            if self.wall {
                outcome.nearest_m = outcome.nearest_m.min(self.distance_m(truth.x_m, truth.y_m, truth.yaw_rad));
            }
            outcome.contacts = truth.contacts;
        }
        outcome
    }

    /// From the wall's face to the nearest corner of the body.
    fn distance_m(&self, x_m: f64, y_m: f64, yaw_rad: f64) -> f64 {
        let (sin, cos) = yaw_rad.sin_cos();
        let (wall_sin, wall_cos) = self.obstacle.yaw_rad.sin_cos();
        let corners = [(0.25, 0.2), (0.25, -0.2), (-0.25, 0.2), (-0.25, -0.2)].map(|(ahead, left)| {
            let (dx, dy) = (
                x_m + cos * ahead - sin * left - self.obstacle.x_m,
                y_m + sin * ahead + cos * left - self.obstacle.y_m,
            );
            // Along the wall's own y axis, which points away from a truck that comes ahead.
            (wall_cos * dy - wall_sin * dx) * -self.mps.signum()
        });
        corners.into_iter().fold(f64::MAX, f64::min) - THICK_M / 2.0
    }
}

/// The speed stick for this speed on the level with a full battery.
fn stick(mps: f64) -> f64 {
    let range = if mps > 0.0 { 5272.0 - 3750.0 - 75.0 } else { 3750.0 - 2331.0 - 75.0 };
    (75.0 + mps.abs() / 3.0 * range) / 1250.0 * mps.signum()
}

/// Runs those of these numbers, on all cores.
pub(crate) fn run_all(
    seeds: std::ops::Range<u64>,
    most_mps: f64,
    config: &VehicleConfig,
) -> Vec<(Approach, Outcome)> {
    crate::draw::in_parallel(seeds, |seed| {
        let approach = Approach::draw(seed, most_mps);
        let outcome = approach.run(config);
        (approach, outcome)
    })
}
