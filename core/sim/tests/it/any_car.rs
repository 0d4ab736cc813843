//! Cars by file and cars drawn at random, whole: what the tests of `vehicles.rs` and the example `vehicles` drive.

use crate::draw::{Draw, in_parallel};
use crate::drive::Drive;
use std::f64::consts::PI;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::range_curve::RangeCurve;
use xtb_control::vehicle::{BumperFinders, Drivetrain, RangeFinder};
use xtb_nav::NavSettings;
use xtb_protocol::messages::{GoalStatus, Outcome};
use xtb_sim::{VehicleFile, World};

/// The cars of configs/vehicles that are driven: name and text.
pub(crate) const FILES: [(&str, &str); 4] = [
    ("xtb", include_str!("../../../../configs/vehicles/xtb.toml")),
    ("crawler", include_str!("../../../../configs/vehicles/crawler.toml")),
    ("small", include_str!("../../../../configs/vehicles/small.toml")),
    ("long", include_str!("../../../../configs/vehicles/long.toml")),
];
const LAB: &str = include_str!("../../../../worlds/lab.toml");
const ROOM: &str = "[room]\nwidth_m = 12.0\ndepth_m = 12.0\n";
/// Longer than any way in these rooms takes.
const PATIENCE_S: f64 = 400.0;
/// Between two looks at which way it drives, and what is driving.
const LOOK_S: f64 = 0.25;
const DRIVES_MPS: f64 = 0.02;

/// One of [`FILES`].
pub(crate) fn file((name, text): (&str, &str)) -> VehicleFile {
    VehicleFile::from_toml(text).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What came of a car and its goal.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Came {
    /// It arrived.
    Reached,
    /// It did not move: why.
    Refused(String),
    /// It moved, and did not arrive: why.
    Failed(String),
}

/// One car's way to one goal.
#[derive(Debug, Clone)]
#[allow(dead_code)] // shown when a test fails
pub(crate) struct Way {
    pub(crate) seed: u64,
    pub(crate) came: Came,
    pub(crate) contacts: u64,
    /// Whether it has driven in a direction in which it has no range finder.
    pub(crate) unseen: bool,
    /// From the goal to where the car really is at the end, in m.
    pub(crate) missed_m: f64,
}

/// A car with anything within the ranges of its settings, possible or not.
pub(crate) fn drawn(seed: u64) -> VehicleConfig {
    let mut draw = Draw::new(seed ^ 0xCA25);
    let mut car = VehicleConfig::default();
    if draw.below(2) == 0 {
        car.drivetrain = Drivetrain::FrontAxle;
    }
    let body = &mut car.geometry;
    body.body_length_m = draw.uniform(0.2, 0.8);
    body.wheelbase_m = body.body_length_m * draw.uniform(0.4, 1.02);
    body.body_ahead_m = draw.uniform(-0.05, 0.05) * body.body_length_m;
    body.body_width_m = draw.uniform(0.15, 0.5);
    body.track_m = body.body_width_m * draw.uniform(0.5, 1.02);
    body.wheel_diameter_m = draw.uniform(0.05, 0.2);
    car.steering.stop_deg = draw.uniform(12.0, 40.0);
    car.encoder.pulses_per_rev = draw.uniform(16.0, 64.0);
    car.encoder.gear_ratio = draw.uniform(15.0, 40.0);
    let width_m = body.body_width_m;
    car.range_finders.front = bumper(&mut draw, width_m);
    car.range_finders.rear = bumper(&mut draw, width_m);
    if draw.below(10) > 0 {
        car.guard.infrared_max_v = 3.5;
    }
    // Speeds and gains for a m/s as of an XTB.
    let rpm_per_mps = 1.0 / car.mps_per_rpm();
    (car.goto.reference_rpm, car.wander.reference_rpm) = (0.112 * rpm_per_mps, 0.112 * rpm_per_mps);
    car.teleop.max_rpm = 0.2 * rpm_per_mps;
    car.guard.top_rpm = (3.2 * rpm_per_mps).min(1000.0);
    (car.speed.kp, car.speed.ki, car.speed.kd) =
        (1157.0 / rpm_per_mps, 2314.0 / rpm_per_mps, 11.57 / rpm_per_mps);
    car
}

/// None to eight of a kind, evenly over most of the width.
fn bumper(draw: &mut Draw, width_m: f64) -> BumperFinders {
    let number = draw.below(9);
    let curve = [RangeCurve::Gp2d12, RangeCurve::Gp2y0a21, RangeCurve::Gp2y0a02][draw.below(3)];
    // The last of them is blind nearer than 20 cm: usually it stands back from the bumper.
    let is_back = curve == RangeCurve::Gp2y0a02 && draw.below(5) > 0;
    let outermost_m = width_m / 2.0 * draw.uniform(0.6, 1.02);
    let turned_deg = if draw.below(4) == 0 { draw.uniform(0.0, 10.0) } else { 0.0 };
    let finder = |i: usize| {
        let part = if number == 1 { 0.0 } else { 1.0 - 2.0 * i as f64 / (number - 1) as f64 };
        let ahead_m = if is_back { -0.1 } else { 0.0 };
        RangeFinder { ahead_m, turned_deg: part * turned_deg, curve, ..RangeFinder::at(outermost_m * part) }
    };
    BumperFinders((0..number).map(finder).collect())
}

/// The car of this seed drives to a goal in an empty room, or is refused.
pub(crate) fn anyone(seed: u64) -> Way {
    let vehicle = drawn(seed);
    let checked = vehicle.validate().and_then(|()| NavSettings::default().validate_for(&vehicle));
    if let Err(error) = checked {
        return Way {
            seed,
            came: Came::Refused(error.to_string()),
            contacts: 0,
            unseen: false,
            missed_m: 0.0,
        };
    }
    let mut draw = Draw::new(seed);
    let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-PI, PI) };
    let goal = [draw.uniform(-3.5, 3.5), draw.uniform(-3.5, 3.5)];
    way(ROOM, &vehicle.into(), seed, start, goal)
}

/// These cars, in their order.
pub(crate) fn all_drawn(cars: u64) -> Vec<Way> {
    in_parallel(0..cars, anyone)
}

/// A car's ways to so many goals in the lab, each from its start.
pub(crate) fn in_the_lab(file: &VehicleFile, goals: u64) -> Vec<Way> {
    in_parallel(0..goals, |seed| {
        let mut draw = Draw::new(seed ^ 0x1AB);
        // South of the partition and north of it, away from walls, boxes and zones.
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-PI, PI) };
        let goal =
            [draw.uniform(-1.5, 1.5), [draw.uniform(-3.0, 2.0), draw.uniform(5.2, 5.8)][draw.below(2)]];
        way(LAB, file, seed, start, goal)
    })
}

fn way(world: &str, file: &VehicleFile, seed: u64, start: MapPose, [x_m, y_m]: [f64; 2]) -> Way {
    let mut drive = Drive::by_file(World::from_toml(world).unwrap(), start, file, seed);
    let here = |drive: &Drive| drive.lockstep.simulation().trucks()[0].truth();
    let asked = drive.goto(0, x_m, y_m, None);
    let gears = file.vehicle.range_finders.gears();
    let mut unseen = false;
    let came = match asked {
        Outcome::Error(error) => Came::Refused(error.message),
        Outcome::Ok(_) => {
            let state = (0..(PATIENCE_S / LOOK_S) as u32).find_map(|_| {
                drive.run_s(LOOK_S);
                let mps = here(&drive).speed_mps;
                unseen |= mps.abs() > DRIVES_MPS && !gears.allow(mps);
                let state = drive.lockstep.state(0).unwrap();
                state.goal.as_ref().is_none_or(|goal| goal.status.is_final()).then_some(state)
            });
            let state = state.unwrap_or_else(|| drive.lockstep.state(0).unwrap());
            let moved_m = libm::hypot(here(&drive).x_m - start.x_m, here(&drive).y_m - start.y_m);
            let goal = state.goal.as_ref();
            let reason = goal.and_then(|goal| goal.reason.clone()).unwrap_or_else(|| "no reason".to_owned());
            match goal.map(|goal| goal.status) {
                Some(GoalStatus::Reached) => Came::Reached,
                Some(GoalStatus::Failed) if moved_m < 0.01 => Came::Refused(reason),
                other => Came::Failed(format!("{other:?}: {reason}")),
            }
        }
    };
    let truth = here(&drive);
    let missed_m = libm::hypot(truth.x_m - x_m, truth.y_m - y_m);
    Way { seed, came, contacts: truth.contacts, unseen, missed_m }
}
