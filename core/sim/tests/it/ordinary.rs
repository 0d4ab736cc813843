//! Ordinary drives: starts, stops, reversals, slopes, walls, sticks. No guard may see a fault in them.
//! The tests in `guards.rs` and the example `guard_table` count with this.

use crate::draw::{Draw, in_parallel};
use crate::whole_robot::WholeRobot;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, Fault, LinkLoss};
use xtb_sim::{Transmitter, TruckParameters, World};

/// A kind of drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Ordinary {
    /// To a point 0.5 to 4 m away in any direction, in free space.
    Goto,
    /// About a room with boxes.
    Wander,
    /// Setpoints of any speed and steering, each for 0.1 to 3 s.
    Teleop,
    /// The same up and down a slope of up to 15°.
    Slope,
    /// The transmitter's sticks, moved as often.
    Sticks,
}

/// All kinds.
pub(crate) const KINDS: [Ordinary; 5] =
    [Ordinary::Goto, Ordinary::Wander, Ordinary::Teleop, Ordinary::Slope, Ordinary::Sticks];

/// Longest that a trip is watched.
const PATIENCE_S: f64 = 120.0;
/// How long the other drives last.
const DRIVE_S: f64 = 30.0;

impl Ordinary {
    /// Drives number `seed` of this kind.
    pub(crate) fn run(self, seed: u64, config: &VehicleConfig) -> WholeRobot {
        let mut draw = Draw::new(seed);
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-PI, PI) };
        let world = World::from_toml(&self.world(&mut draw)).unwrap();
        let mut whole = WholeRobot::new(world, &TruckParameters::default(), start, seed, config);
        match self {
            Self::Goto => {
                let (way_m, bearing_rad) = (draw.uniform(0.5, 4.0), draw.uniform(-PI, PI));
                assert!(whole.goto(way_m * bearing_rad.cos(), way_m * bearing_rad.sin()));
                let end_s = whole.simulation.now().s() + PATIENCE_S;
                while whole.goal_runs() && whole.simulation.now().s() < end_s {
                    whole.step();
                }
                whole.run_s(1.0);
            }
            Self::Wander => {
                whole.ask(Body::Wander { for_s: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 });
                whole.run_s(DRIVE_S);
            }
            Self::Teleop | Self::Slope => self.moved(&mut whole, &mut draw, |whole, draw| {
                let rpm = if draw.below(4) == 0 { 0.0 } else { draw.uniform(-23.0, 23.0) };
                whole.setpoint = Some((rpm, draw.uniform(-1.0, 1.0)));
            }),
            Self::Sticks => {
                let sticks =
                    |speed, steering| Transmitter { on: true, speed, steering, selector_manual: true };
                whole.truck().set_transmitter(sticks(0.0, 0.0));
                whole.run_s(0.3);
                self.moved(&mut whole, &mut draw, |whole, draw| {
                    let most = if draw.below(4) == 0 { 1.0 } else { 0.25 };
                    let speed = if draw.below(4) == 0 { 0.0 } else { draw.uniform(-most, most) };
                    whole.truck().set_transmitter(sticks(speed, draw.uniform(-1.0, 1.0)));
                });
            }
        }
        whole
    }

    fn moved(self, whole: &mut WholeRobot, draw: &mut Draw, change: impl Fn(&mut WholeRobot, &mut Draw)) {
        let end_s = whole.simulation.now().s() + DRIVE_S;
        while whole.simulation.now().s() < end_s {
            change(whole, draw);
            whole.run_s(if draw.below(2) == 0 { draw.uniform(0.1, 0.8) } else { draw.uniform(0.8, 3.0) });
        }
    }

    fn world(self, draw: &mut Draw) -> String {
        match self {
            Self::Goto | Self::Teleop | Self::Sticks => String::new(),
            Self::Wander => "[room]\nwidth_m = 6.0\ndepth_m = 6.0\n\
                 [[boxes]]\nx_m = 1.8\ny_m = 1.5\nwidth_m = 0.6\ndepth_m = 0.4\nyaw_rad = 0.5\n\
                 [[boxes]]\nx_m = -1.5\ny_m = -1.9\nwidth_m = 0.5\ndepth_m = 0.5\n"
                .to_owned(),
            Self::Slope => format!(
                "[[ramps]]\nx_m = 0.0\ny_m = 0.0\nlength_m = 30.0\nwidth_m = 30.0\nslope_deg = {:.2}\n\
                 uphill_rad = {:.3}\n",
                draw.uniform(2.0, 15.0),
                draw.uniform(-PI, PI)
            ),
        }
    }

    /// How many of the first so many drives saw which fault. One that touched something has really
    /// stalled: what stands beside a truck that turns no sensor sees.
    pub(crate) fn alarms(self, count: u64, config: &VehicleConfig) -> BTreeMap<Fault, usize> {
        let mut alarms = BTreeMap::new();
        let seen = |seed| {
            let mut whole = self.run(seed, config);
            let touched = whole.truck().truth().contacts > 0;
            whole.seen.retain(|fault| !(touched && *fault == Fault::Stalled));
            whole.seen
        };
        for seen in in_parallel(0..count, seen) {
            for fault in seen {
                *alarms.entry(fault).or_default() += 1;
            }
        }
        alarms
    }
}
