//! Parking with the whole vehicle: goals that need changes of gear, driven by the second level's follower
//! along Reeds–Shepp paths. The test in `parking.rs` and the example `parking` measure with this.

use crate::agent::Bench;
use crate::draw::{Draw, in_parallel};
use crate::pillars::{Margins, pillars};
use std::f64::consts::PI;
use xtb_control::VehicleConfig;
use xtb_control::frames::{MapFromOdom, MapPose};
use xtb_control::odometry::OdomPose;
use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::geometry::reeds_shepp::shortest;
use xtb_nav::path_follower::GoalTolerance;
use xtb_nav::{Car, DriveCommand, DriveLimits, FollowerStatus, NavSettings, Path, PathFollower};
use xtb_protocol::messages::Fault;
use xtb_robot::Guards;
use xtb_robot::monitor::{Driven, Monitors};
use xtb_sim::{VehicleFile, World};

/// Steps of the simulation between two gyro samples.
const GYRO_STEPS: u64 = 2;
/// Gyro samples between two fixes.
const FIX_STEPS: u64 = 50;
/// A way takes no longer than this many times what it would take at cruise …
const PATIENCE: f64 = 5.0;
/// … and this much for each stop.
const PATIENCE_S: f64 = 8.0;
const ROOM: &str = "[room]\nwidth_m = 14.0\ndepth_m = 14.0";
/// Nothing stands near.
const CLEARANCE_M: f64 = 1.0;

/// Whose pose is followed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Eyes {
    /// Ground truth.
    Truth,
    /// The truck's own odometry, with its drift.
    Odometry,
    /// Ground truth, wrong by what a filter leaves of poor fixes: 2 cm and 1° (one standard deviation)
    /// that jump twice a second.
    Fixes,
}

/// How parkings are driven.
#[derive(Debug, Clone)]
pub(crate) struct Course {
    pub(crate) eyes: Eyes,
    pub(crate) cruise_mps: f64,
    /// Radius of the planned arcs over the truck's smallest.
    pub(crate) radius_factor: f64,
    /// Goals lie up to so far away along x and y each.
    pub(crate) reach_m: f64,
    /// What is driven.
    pub(crate) file: VehicleFile,
    /// Things stand around the path, as near as a planner with these margins would pass them.
    pub(crate) margins: Option<Margins>,
}

impl Course {
    pub(crate) fn new(cruise_mps: f64, radius_factor: f64) -> Self {
        Self {
            eyes: Eyes::Truth,
            cruise_mps,
            radius_factor,
            reach_m: 1.0,
            file: VehicleFile::default(),
            margins: None,
        }
    }

    /// Path of this number that changes its gear: from somewhere in the middle of the room to a goal
    /// within reach, turned anyhow.
    pub(crate) fn path(&self, seed: u64, car: &Car) -> Path {
        let mut draw = Draw::new(seed);
        loop {
            let (x_m, y_m) = (draw.uniform(-1.0, 1.0), draw.uniform(-1.0, 1.0));
            let mut away_m = || draw.uniform(-self.reach_m, self.reach_m);
            let (goal_x_m, goal_y_m) = (x_m + away_m(), y_m + away_m());
            let start = MapPose { x_m, y_m, yaw_rad: draw.uniform(-PI, PI) };
            let goal = MapPose { x_m: goal_x_m, y_m: goal_y_m, yaw_rad: draw.uniform(-PI, PI) };
            let path = shortest(&start, &goal, car.radius_m * self.radius_factor);
            if path.cusps() > 0 {
                return path;
            }
        }
    }
}

/// What came of one; everything by ground truth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Parked {
    /// The follower says so, and it is so: within 20 cm along x and y each, and 15°.
    pub(crate) reached: bool,
    pub(crate) took_s: f64,
    /// From the goal.
    pub(crate) missed_m: f64,
    pub(crate) missed_deg: f64,
    /// Farthest beside the path.
    pub(crate) beside_m: f64,
    /// Farthest that a corner was outside the body at the path's pose: the margin that a planner needs.
    pub(crate) outside_m: f64,
    /// Farthest rolled past a stop.
    pub(crate) overshoot_m: f64,
    pub(crate) cusps: usize,
    pub(crate) contacts: u64,
    /// For how long the obstacle rule held the truck.
    pub(crate) blocked_s: f64,
    /// The robot's monitors took something for a runaway or a stall.
    pub(crate) alarmed: bool,
}

/// What fixes leave of an error of the pose.
struct Wrong {
    draw: Draw,
    error: [f64; 3],
}

impl Wrong {
    /// One standard deviation in m, m and rad.
    const SPREAD: [f64; 3] = [0.02, 0.02, 0.0175];
    /// So much of an error is left after a fix.
    const KEPT: f64 = 0.8;

    fn new(seed: u64) -> Self {
        let mut wrong = Self { draw: Draw::new(seed ^ 0xF1CE5), error: [0.0; 3] };
        (0..20).for_each(|_| wrong.fix());
        wrong
    }

    fn fix(&mut self) {
        for (error, spread) in self.error.iter_mut().zip(Self::SPREAD) {
            // Twelve of them have a standard deviation of 1.
            let bell: f64 = (0..12).map(|_| self.draw.uniform(-0.5, 0.5)).sum();
            *error = *error * Self::KEPT + bell * spread * (1.0 - Self::KEPT * Self::KEPT).sqrt();
        }
    }

    fn pose(&self, truth: &MapPose) -> MapPose {
        let [x_m, y_m, yaw_rad] = self.error;
        MapPose { x_m: truth.x_m + x_m, y_m: truth.y_m + y_m, yaw_rad: wrap_rad(truth.yaw_rad + yaw_rad) }
    }
}

/// A truck with a follower.
pub(crate) struct Pilot {
    pub(crate) bench: Bench,
    pub(crate) follower: PathFollower,
    map: MapFromOdom,
    eyes: Eyes,
    wrong: Wrong,
    monitors: Monitors,
    alarmed: bool,
    steps: u64,
}

impl Pilot {
    /// Stands at the path's start, its lines up.
    pub(crate) fn new(course: &Course, path: &Path, car: &Car, seed: u64) -> Self {
        let mut room = World::from_toml(ROOM).unwrap();
        for (number, spec) in
            course.margins.iter().flat_map(|margins| pillars(seed, path, car, margins)).enumerate()
        {
            room.put_box(&format!("pillar {number}"), spec).unwrap();
        }
        let VehicleFile { vehicle, truth } = &course.file;
        let mut bench = Bench::with_config(room, truth, path.start, seed, vehicle.clone());
        bench.run_s(0.2);
        let settings = NavSettings::default().follower_of(vehicle);
        Self {
            bench,
            follower: PathFollower::new(path, car, settings, GoalTolerance::default()).unwrap(),
            map: MapFromOdom::aligning(&OdomPose::default(), &path.start),
            eyes: course.eyes,
            wrong: Wrong::new(seed),
            monitors: Monitors::default(),
            alarmed: false,
            steps: 0,
        }
    }

    pub(crate) fn truth(&self) -> MapPose {
        let truth = self.bench.simulation.trucks()[0].truth();
        MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad }
    }

    /// To the next gyro sample.
    pub(crate) fn step(&mut self, vehicle: &VehicleConfig, limits: &DriveLimits) -> DriveCommand {
        let outputs = &self.bench.agent.outputs;
        let pose = match self.eyes {
            Eyes::Truth => self.truth(),
            Eyes::Odometry => self.map.pose(&outputs.pose),
            Eyes::Fixes => self.wrong.pose(&self.truth()),
        };
        let speed_mps = outputs.rpm * vehicle.mps_per_rpm();
        let drive = self.follower.step(self.bench.simulation.now(), &pose, speed_mps, limits);
        self.bench.command(drive.command(vehicle));
        for _ in 0..GYRO_STEPS {
            self.bench.step();
            self.watch(vehicle);
        }
        self.steps += 1;
        if self.steps.is_multiple_of(FIX_STEPS) {
            self.wrong.fix();
        }
        drive
    }

    /// What `robot-agent` has watching the drive.
    fn watch(&mut self, vehicle: &VehicleConfig) {
        let Self { bench, monitors, .. } = self;
        let outputs = &bench.agent.outputs;
        let (motor, reference_rpm) = (outputs.pwm.motor, outputs.reference_rpm);
        monitors.drive(Driven { by_hand: false, motor, reference_rpm });
        if let Some(pulses) = bench.agent.window.take() {
            monitors.window(vehicle, bench.simulation.now(), pulses, || vehicle.admitted_mps());
            let mut faults = monitors.faults(Guards::default());
            self.alarmed |= faults.any(|(fault, _)| matches!(fault, Fault::Runaway | Fault::Stalled));
        }
    }

    pub(crate) fn alarmed(&self) -> bool {
        self.alarmed
    }

    pub(crate) fn seconds(&self) -> f64 {
        self.steps as f64 * 0.01
    }
}

fn park(seed: u64, course: &Course) -> Parked {
    let vehicle = &course.file.vehicle;
    let car = Car::of(vehicle);
    let path = course.path(seed, &car);
    let mut pilot = Pilot::new(course, &path, &car, seed);
    let limits = DriveLimits {
        way_m: f64::INFINITY,
        cruise_mps: course.cruise_mps,
        clearance_m: CLEARANCE_M,
        swing_rad: 0.0,
    };
    let stops = path.cusps() + 1;
    let most_s = PATIENCE * path.length_m() / course.cruise_mps + PATIENCE_S * stops as f64;
    let (mut beside_m, mut outside_m, mut overshoot_m): (f64, f64, f64) = (0.0, 0.0, 0.0);
    let (mut status, mut blocked_s) = (FollowerStatus::Following, 0.0);
    while !matches!(status, FollowerStatus::Reached | FollowerStatus::Deviated { .. })
        && pilot.seconds() < most_s
    {
        let pose = pilot.truth();
        let drive = pilot.step(vehicle, &limits);
        let (foot, _) = path.at(drive.way_m);
        let corners = car.corners(&pose);
        outside_m = corners.iter().map(|corner| car.distance_m(&foot, *corner)).fold(outside_m, f64::max);
        let (sin, cos) = libm::sincos(foot.yaw_rad);
        beside_m = beside_m.max(((pose.y_m - foot.y_m) * cos - (pose.x_m - foot.x_m) * sin).abs());
        overshoot_m = overshoot_m.max(-drive.left_m);
        blocked_s += if pilot.bench.agent.outputs.blocked { 0.01 } else { 0.0 };
        status = drive.status;
    }
    let (truth, goal) = (pilot.truth(), path.end());
    let (dx, dy) = (truth.x_m - goal.x_m, truth.y_m - goal.y_m);
    let missed_deg = wrap_rad(truth.yaw_rad - goal.yaw_rad).to_degrees().abs();
    let there = dx.abs() <= 0.2 && dy.abs() <= 0.2 && missed_deg <= 15.0;
    Parked {
        reached: status == FollowerStatus::Reached && there,
        took_s: pilot.seconds(),
        missed_m: libm::hypot(dx, dy),
        missed_deg,
        beside_m,
        outside_m,
        overshoot_m,
        cusps: path.cusps(),
        contacts: pilot.bench.simulation.trucks()[0].truth().contacts,
        blocked_s,
        alarmed: pilot.alarmed(),
    }
}

/// The first so many parkings.
pub(crate) fn measure(parkings: u64, course: &Course) -> Vec<Parked> {
    in_parallel(0..parkings, |seed| park(seed, course))
}
