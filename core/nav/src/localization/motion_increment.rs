//! From two poses of the odometry to what the truck did between them.
//!
//! The encoder counts the motor that drives both axles; each wheel rolls along the arc of its own steering
//! angle δ, so the reference point moves on by a part of that only ([`Drivetrain::way_part`]): with both axles
//! steered by cos δ, 6 % less at full lock. δ follows from how far the truck turned meanwhile, tan δ = κ times
//! [`Drivetrain::lever_m`]. And a truck whose wheels stand does not turn: what the gyro
//! says then is its drift.

use std::f64::consts::FRAC_PI_2;
use xtb_control::VehicleConfig;
use xtb_control::frames::wrap_rad;
use xtb_control::odometry::OdomPose;
use xtb_control::units::Stamp;
use xtb_control::vehicle::Drivetrain;

/// A way within one window that is shorter says nothing of the curvature, in m: four pulses of the default
/// encoder, so that rounding is a quarter of it at most.
const SHORTEST_M: f64 = 1.0e-3;
/// Two windows of the encoder that lie farther apart do not belong to one drive, in s: three windows of 52.4
/// ms are just longer.
const WINDOWS_S: f64 = 0.15;
/// The tangent of a steering angle counts up to this at least, however little the vehicle steers: 24°, where
/// an XTB's stops are at 20° (`steering.stop_deg`, assumed); the rest is for noise of gyro and encoder.
const MOST_TAN: f64 = 0.45;
/// Wheels that have not turned for this long stand, in s: more than five windows of the encoder, and than the
/// motor takes to coast (0.26 s, `follower.coast_s`).
const STANDS_S: f64 = 0.3;
/// So long one reading of the drift takes, in s: the noise of two yaws (`filter.yaw_noise_rad`) leaves 0.0007
/// rad/s then, a quarter of what is not known before (`filter.drift_radps`).
const READING_S: f64 = 2.0;
/// No gyro drifts faster; somebody is turning the truck, in rad/s: 1°/s, where drift up to 0.3°/s is assumed.
const MOST_DRIFT_RADPS: f64 = 0.0175;

/// What the truck did in one step, in its own frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct MotionIncrement {
    pub(crate) ahead_m: f64,
    pub(crate) left_m: f64,
    /// Counter-clockwise, as the gyro says.
    pub(crate) turn_rad: f64,
    pub(crate) dt_s: f64,
    /// Rate of the gyro over a stretch of standing that ended now, with its standard deviation.
    pub(crate) stood_radps: Option<(f64, f64)>,
}

/// How fast the truck went of late, in its own frame, as odometry and gyro say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Twist {
    pub(crate) ahead_mps: f64,
    pub(crate) left_mps: f64,
    /// Counter-clockwise.
    pub(crate) turn_radps: f64,
}

impl Twist {
    /// The mean of these steps.
    pub(crate) fn over(steps: impl Iterator<Item = MotionIncrement>) -> Self {
        let mut sum = MotionIncrement::default();
        for step in steps {
            (sum.ahead_m, sum.left_m) = (sum.ahead_m + step.ahead_m, sum.left_m + step.left_m);
            (sum.turn_rad, sum.dt_s) = (sum.turn_rad + step.turn_rad, sum.dt_s + step.dt_s);
        }
        if sum.dt_s <= 0.0 {
            return Self::default();
        }
        let each = |value: f64| value / sum.dt_s;
        Self { ahead_mps: each(sum.ahead_m), left_mps: each(sum.left_m), turn_radps: each(sum.turn_rad) }
    }
}

/// The odometry's way, watched from step to step.
#[derive(Debug, Clone)]
pub(crate) struct MotionTracker {
    drivetrain: Drivetrain,
    lever_m: f64,
    /// No steering angle has a larger tangent.
    most_tan: f64,
    yaw_noise_rad: f64,
    /// When the wheels last turned, and how far the truck has turned since.
    rolled_at: Option<Stamp>,
    turned_rad: f64,
    /// Since when the drift is being read, and the yaw then.
    standing: Option<(Stamp, f64)>,
}

impl MotionTracker {
    pub(crate) fn new(vehicle: &VehicleConfig, yaw_noise_rad: f64) -> Self {
        let drivetrain = vehicle.drivetrain;
        let lever_m = drivetrain.lever_m(vehicle.geometry.wheelbase_m);
        let most_tan = libm::tan(vehicle.steering.stop_deg.to_radians()).max(MOST_TAN);
        Self {
            drivetrain,
            lever_m,
            most_tan,
            yaw_noise_rad,
            rolled_at: None,
            turned_rad: 0.0,
            standing: None,
        }
    }

    /// The odometry jumped, or the truck was moved: nothing follows from before.
    pub(crate) fn rezeroed(&mut self) {
        (self.rolled_at, self.turned_rad, self.standing) = (None, 0.0, None);
    }

    /// Whether the wheels have not turned for a moment.
    pub(crate) fn rests(&self, now: Stamp) -> bool {
        self.rolled_at.is_none_or(|at| now.since_s(at) >= STANDS_S)
    }

    pub(crate) fn step(&mut self, was: Stamp, now: Stamp, from: &OdomPose, to: &OdomPose) -> MotionIncrement {
        let yaw_rad = FRAC_PI_2 - to.yaw.rad();
        let (sin, cos) = libm::sincos(yaw_rad);
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (ahead_m, left_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
        let turn_rad = wrap_rad(from.yaw.rad() - to.yaw.rad());
        self.turned_rad += turn_rad;
        let rolled = dx != 0.0 || dy != 0.0;
        let part = if rolled { self.arc(now, ahead_m) } else { 1.0 };
        MotionIncrement {
            ahead_m: ahead_m * part,
            left_m: left_m * part,
            turn_rad,
            dt_s: now.since_s(was),
            stood_radps: self.stand(now, yaw_rad, rolled),
        }
    }

    /// The part of the wheels' way that the reference point makes.
    fn arc(&mut self, now: Stamp, ahead_m: f64) -> f64 {
        let turned_rad = std::mem::take(&mut self.turned_rad);
        let since_s = self.rolled_at.replace(now).map_or(f64::INFINITY, |at| now.since_s(at));
        if since_s > WINDOWS_S || ahead_m.abs() < SHORTEST_M {
            return 1.0;
        }
        let tan = turned_rad / ahead_m * self.lever_m;
        self.drivetrain.way_part(tan.clamp(-self.most_tan, self.most_tan))
    }

    fn stand(&mut self, now: Stamp, yaw_rad: f64, rolled: bool) -> Option<(f64, f64)> {
        if rolled || !self.rests(now) {
            self.standing = None;
            return None;
        }
        let (since, yaw_then_rad) = *self.standing.get_or_insert((now, yaw_rad));
        let took_s = now.since_s(since);
        if took_s < READING_S {
            return None;
        }
        self.standing = Some((now, yaw_rad));
        let rate_radps = wrap_rad(yaw_rad - yaw_then_rad) / took_s;
        let sigma_radps = self.yaw_noise_rad * std::f64::consts::SQRT_2 / took_s;
        (rate_radps.abs() <= MOST_DRIFT_RADPS).then_some((rate_radps, sigma_radps))
    }
}
