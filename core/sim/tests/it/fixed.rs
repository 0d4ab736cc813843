//! Drives of the whole vehicle whose pose filter gets fixes, beside what the odometry alone makes of them.
//! The tests in `poses.rs` and the example `pose_table` measure with this.

use crate::agent::Bench;
use crate::draw::Draw;
use crate::troubled::{Trouble, Troubled};
use std::f64::consts::PI;
use xtb_control::frames::{MapFromOdom, MapPose};
use xtb_control::odometry::OdomPose;
use xtb_control::units::Stamp;
use xtb_control::{Command, Steering, VehicleConfig, WheelRpm};
use xtb_nav::PoseFilter;
use xtb_nav::localization::{Estimate, FilterTuning, FixOutcome};
use xtb_sim::{FixMaker, FixTruth, TruckParameters, World};

/// Steps from one sample to the next: 50 ms.
const SAMPLE_STEPS: u64 = 10;

/// A moment of a drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment {
    pub(crate) t_s: f64,
    pub(crate) truth: MapPose,
    pub(crate) estimate: Estimate,
    pub(crate) odometry: MapPose,
    /// What no filter can know of it, in m.
    allowance_m: f64,
}

fn apart_m(a: &MapPose, b: &MapPose) -> f64 {
    libm::hypot(a.x_m - b.x_m, a.y_m - b.y_m)
}

impl Moment {
    /// From the filter's pose to the truth.
    pub(crate) fn error_m(&self) -> f64 {
        apart_m(&self.estimate.pose, &self.truth)
    }

    /// From the odometry's pose to the truth.
    pub(crate) fn odometry_error_m(&self) -> f64 {
        apart_m(&self.odometry, &self.truth)
    }

    pub(crate) fn yaw_error_rad(&self) -> f64 {
        xtb_control::frames::wrap_rad(self.estimate.pose.yaw_rad - self.truth.yaw_rad).abs()
    }

    /// Whether it is no farther off than three of its own standard deviations and 5 cm.
    pub(crate) fn is_consistent(&self) -> bool {
        self.error_m() <= 3.0 * self.estimate.sigma_m + 0.05 + self.allowance_m
    }

    /// Whether the truth lies within the ellipse that should hold it 95 % of the time.
    pub(crate) fn is_within_own_bounds(&self) -> bool {
        let [[xx, xy, _], [_, yy, _], _] = self.estimate.covariance;
        let dx = self.estimate.pose.x_m - self.truth.x_m;
        let dy = self.estimate.pose.y_m - self.truth.y_m;
        (yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy) <= 5.991
    }
}

/// One truck, its filter and what gives it fixes.
pub(crate) struct Drive {
    pub(crate) bench: Bench,
    pub(crate) filter: PoseFilter,
    pub(crate) maker: FixMaker,
    troubled: Troubled,
    align: MapFromOdom,
    draw: Draw,
    until: Stamp,
    pub(crate) moments: Vec<Moment>,
    /// Outliers that were taken, and all that there were.
    pub(crate) outliers: (u64, u64),
    /// When the filter started again.
    pub(crate) restarts: Vec<f64>,
}

impl Drive {
    pub(crate) fn new(seed: u64, fixes: FixTruth) -> Self {
        Self::of(seed, fixes, Trouble::Nothing, &TruckParameters::default())
    }

    /// With something that is wrong with its fixes, or with the truck.
    pub(crate) fn of(seed: u64, fixes: FixTruth, trouble: Trouble, truck: &TruckParameters) -> Self {
        let mut draw = Draw::new(seed);
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: draw.uniform(-PI, PI) };
        let config = VehicleConfig::default();
        let free = World::from_toml("").unwrap();
        let tuning = FilterTuning::default();
        Self {
            filter: PoseFilter::new(&config, tuning, Stamp::ZERO, &OdomPose::default(), &start),
            bench: Bench::with_config(free, truck, start, seed, config),
            maker: FixMaker::new(fixes, seed, 0),
            troubled: Troubled::new(trouble, seed),
            align: MapFromOdom::aligning(&OdomPose::default(), &start),
            draw,
            until: Stamp::from_ms(500),
            moments: Vec::new(),
            outliers: (0, 0),
            restarts: Vec::new(),
        }
    }

    pub(crate) fn run_s(mut self, seconds: f64) -> Self {
        let end = self.bench.simulation.now().plus_ns(Stamp::from_s(seconds).ns());
        while self.bench.simulation.now() < end {
            self.step();
        }
        self
    }

    /// As somebody would drive about: ahead mostly, at up to 0.35 m/s, with stands and changes of gear.
    fn steer(&mut self) {
        let now = self.bench.simulation.now();
        if now < self.until {
            return;
        }
        let draw = &mut self.draw;
        self.until = now.plus_ns(Stamp::from_s(draw.uniform(1.0, 5.0)).ns());
        let rpm = match draw.below(10) {
            0 => 0.0,
            1..=3 => -draw.uniform(8.0, 30.0),
            _ => draw.uniform(10.0, 40.0),
        };
        let steering = if draw.below(3) == 0 { 0.0 } else { draw.uniform(-1.0, 1.0) };
        let (rpm, steering) = (WheelRpm::try_from(rpm).unwrap(), Steering::try_from(steering).unwrap());
        self.bench.command(Command::Teleop { rpm, steering });
    }

    fn step(&mut self) {
        self.steer();
        self.bench.step();
        // What the agent has by now: the odometry of its last turn.
        let (now, truth) = (self.bench.simulation.now(), self.bench.simulation.trucks()[0].truth());
        let odom = self.bench.agent.outputs.pose;
        self.filter.odometry(now, &odom).unwrap();
        self.maker.step(now, &truth);
        let here = MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad };
        self.troubled.step(now, &here);
        while let Some(made) = self.maker.take(now) {
            let fix = self.troubled.spoil(now, made.fix, &here);
            let outcome = self.filter.fix(now, &fix).unwrap();
            let taken = matches!(outcome, FixOutcome::Accepted { .. });
            self.outliers.0 += u64::from(made.outlier && taken);
            self.outliers.1 += u64::from(made.outlier);
            if matches!(outcome, FixOutcome::Restarted { .. }) {
                self.restarts.push(now.s());
            }
        }
        if (now.ns() / xtb_sim::STEP_NS).is_multiple_of(SAMPLE_STEPS) {
            let (estimate, odometry) = (self.filter.estimate(now), self.align.pose(&odom));
            let allowance_m = self.troubled.allowance_m(&here);
            self.moments.push(Moment { t_s: now.s(), truth: here, estimate, odometry, allowance_m });
        }
    }
}

/// 2 Hz, 5 cm, 2 % outliers.
pub(crate) fn two_hertz() -> FixTruth {
    FixTruth { rate_hz: 2.0, noise_m: 0.05, outliers: 0.02, ..FixTruth::default() }
}
