//! Robots in each other's way: the scenes that lockstep and live runs share, and a [`Judge`] who says what
//! came of them by ground truth.

mod judge;

pub use judge::{Judge, Meeting, ObservedRobot};

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use xtb_control::frames::MapPose;
use xtb_nav::geometry::path::wrap_rad;

const CORRIDOR: &str = include_str!("../../../worlds/corridor.toml");
const ROOM: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\n";
const ROOMS: &str = "[room]\nwidth_m = 8.0\ndepth_m = 8.0\ny_m = 4.0\n\
    [[walls]]\npoints = [[-4.0, 4.0], [-0.75, 4.0]]\n[[walls]]\npoints = [[0.75, 4.0], [4.0, 4.0]]\n";
/// Radius of the circle in [`Setting::circle`].
const CIRCLE_M: f64 = 3.0;

/// Where robots meet: everybody goes from its start to its goal, all at once.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// The world, as its file would have it.
    pub world: &'static str,
    /// Of each robot.
    pub starts: Vec<MapPose>,
    /// Of each robot.
    pub goals: Vec<MapPose>,
}

impl Setting {
    /// Robots on a circle in 8 × 8 m, each to the place opposite.
    #[must_use]
    pub fn circle(robots: usize) -> Self {
        let place = |n: usize, turned: f64, facing: f64| {
            let angle = TAU * n as f64 / robots as f64 + turned;
            let (sin, cos) = libm::sincos(angle);
            MapPose { x_m: CIRCLE_M * cos, y_m: CIRCLE_M * sin, yaw_rad: wrap_rad(angle + facing) }
        };
        Self {
            world: ROOM,
            starts: (0..robots).map(|n| place(n, 0.0, PI)).collect(),
            goals: (0..robots).map(|n| place(n, PI, 0.0)).collect(),
        }
    }

    /// Five swap places through a door of 1.5 m, three from one side, two from the other. Each round begins
    /// where the one before has ended; the first is round 1.
    #[must_use]
    pub fn door(round: usize) -> Self {
        let side = |n: usize, round: usize| {
            let x_m = (n as f64 - 2.0) * 1.3;
            match (n + round).is_multiple_of(2) {
                false => MapPose { x_m, y_m: 5.6, yaw_rad: -FRAC_PI_2 },
                true => MapPose { x_m, y_m: 2.4, yaw_rad: FRAC_PI_2 },
            }
        };
        Self {
            world: ROOMS,
            starts: (0..5).map(|n| side(n, round)).collect(),
            goals: (0..5).map(|n| side(n, round + 1)).collect(),
        }
    }

    /// Whether the middle of a robot is in the doorway of [`Setting::door`].
    #[must_use]
    pub fn is_in_doorway(x_m: f64, y_m: f64) -> bool {
        x_m.abs() < 0.75 && (y_m - 4.0).abs() < 0.2
    }

    /// Nose to nose in the corridor's narrow place, with a third one behind: one must back out.
    #[must_use]
    pub fn narrow() -> Self {
        let pose = |x_m, y_m, yaw_rad| MapPose { x_m, y_m, yaw_rad };
        Self {
            world: CORRIDOR,
            starts: vec![pose(0.6, 7.1, FRAC_PI_2), pose(0.6, 8.1, -FRAC_PI_2), pose(0.6, 5.8, FRAC_PI_2)],
            goals: vec![pose(0.3, 10.8, FRAC_PI_2), pose(0.0, 0.0, -FRAC_PI_2), pose(-0.4, 9.6, FRAC_PI_2)],
        }
    }
}
