//! The filter's state and its two steps: predict and correct.
//!
//! x' = x + (1 + s) · R(ψ') · d and ψ' = ψ + turn + b · t, with the drift b, the wheels' scale s and the
//! fixes' delay τ kept. A fix shows where the truck was τ before its stamp: x − v τ and ψ − ω τ.
//! Corrections are in Joseph's form, and the covariance is made symmetric after each step.

use super::fix::Measurement;
use super::motion_increment::{MotionIncrement, Twist};
use super::tuning::FilterTuning;
use crate::MapPose;
use nalgebra::{SMatrix, SVector, Vector6};
use xtb_control::frames::wrap_rad;

type Matrix6 = SMatrix<f64, 6, 6>;

/// Places in the state.
pub(crate) const X: usize = 0;
pub(crate) const Y: usize = 1;
pub(crate) const YAW: usize = 2;
/// rad/s that have to be added to what the gyro says, counter-clockwise.
pub(crate) const DRIFT: usize = 3;
/// By this part the way is longer than the encoder says.
pub(crate) const SCALE: usize = 4;
/// s by which a fix is older than it says.
pub(crate) const DELAY: usize = 5;
const STATES: usize = 6;

/// χ² with one degree of freedom that 1 in 1000 exceeds: the gate of fixes, for the drift (tables).
const ONE_LIMIT: f64 = 10.828;
/// A variance that is larger says no more than this one: the square of the farthest coordinate, 10 km.
const MOST_VARIANCE: f64 = 1.0e8;
/// No encoder and no tyre is farther from its settings: half as far, or twice; chosen, not measured.
const SCALES: std::ops::RangeInclusive<f64> = -0.5..=1.0;
/// No fix comes later than this against what it says, in s, as an older one is not used (`filter.late_s`),
/// nor earlier; the earliest is chosen, not measured.
const DELAYS_S: std::ops::RangeInclusive<f64> = -0.1..=0.5;

/// Mean and covariance of x, y, yaw, drift, scale and delay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct State {
    pub(crate) mean: Vector6<f64>,
    pub(crate) covariance: Matrix6,
}

/// How a measurement fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Test {
    pub(crate) mahalanobis: f64,
    pub(crate) limit: f64,
}

impl Test {
    pub(crate) fn passed(self) -> bool {
        self.mahalanobis <= self.limit
    }
}

fn square(v: f64) -> f64 {
    v * v
}

/// A row of [`State::carry`].
type Row = (usize, [(usize, f64); 3]);

/// What a step's turn adds to the heading.
fn heading_row(step: &MotionIncrement) -> Row {
    (YAW, [(DRIFT, step.dt_s), (DELAY, 0.0), (DELAY, 0.0)])
}

impl State {
    pub(crate) fn at(pose: &MapPose, tuning: &FilterTuning) -> Self {
        let FilterTuning { start_m, start_rad, drift_radps, wheel_scale, delay_s, .. } = *tuning;
        let sigmas = [start_m, start_m, start_rad, drift_radps, wheel_scale, delay_s];
        let covariance = Matrix6::from_diagonal(&Vector6::from(sigmas.map(square)));
        Self { mean: Vector6::new(pose.x_m, pose.y_m, pose.yaw_rad, 0.0, 0.0, 0.0), covariance }
    }

    pub(crate) fn pose(&self) -> MapPose {
        MapPose { x_m: self.mean[X], y_m: self.mean[Y], yaw_rad: self.mean[YAW] }
    }

    /// Another mean, with the same doubts.
    pub(crate) fn set_pose(&mut self, pose: &MapPose) {
        (self.mean[X], self.mean[Y], self.mean[YAW]) = (pose.x_m, pose.y_m, pose.yaw_rad);
    }

    /// A new pose that knows nothing of the old one; drift, scale and delay stay.
    pub(crate) fn restart(&mut self, pose: &MapPose, sigma_m: f64, sigma_rad: f64) {
        self.set_pose(pose);
        for (place, sigma) in [(X, sigma_m), (Y, sigma_m), (YAW, sigma_rad)] {
            self.covariance.row_mut(place).fill(0.0);
            self.covariance.column_mut(place).fill(0.0);
            self.covariance[(place, place)] = square(sigma);
        }
    }

    /// Who was lost may have learnt nonsense: drift, scale and delay are open again. The scale only as far as
    /// tyres differ: if these fixes are wrong after all, they must not teach it much.
    pub(crate) fn reopen_learnt(&mut self, tuning: &FilterTuning) {
        let open = [(DRIFT, tuning.drift_radps), (DELAY, tuning.delay_s)];
        for (place, sigma) in open {
            self.mean[place] = self.mean[place].clamp(-2.0 * sigma, 2.0 * sigma);
            self.covariance.row_mut(place).fill(0.0);
            self.covariance.column_mut(place).fill(0.0);
            self.covariance[(place, place)] = square(sigma);
        }
        let sigma2 = self.covariance[(SCALE, SCALE)].max(square(tuning.wheel_scale));
        self.covariance.row_mut(SCALE).fill(0.0);
        self.covariance.column_mut(SCALE).fill(0.0);
        self.covariance[(SCALE, SCALE)] = sigma2;
    }

    /// The wheels may have slipped: the place grows unsure by `walk_m` in √s, up to `most_m`.
    pub(crate) fn slip(&mut self, walk_m: f64, most_m: f64, dt_s: f64) {
        for place in [X, Y] {
            let room = (square(most_m) - self.covariance[(place, place)]).max(0.0);
            self.covariance[(place, place)] += (square(walk_m) * dt_s).min(room);
        }
    }

    /// From the first fix on the scale can be learnt, however wrong the settings are.
    pub(crate) fn open_scale(&mut self, sigma: f64) {
        let more = (square(sigma) - self.covariance[(SCALE, SCALE)]).max(0.0);
        self.covariance[(SCALE, SCALE)] += more;
    }

    pub(crate) fn sigma_yaw_rad(&self) -> f64 {
        self.covariance[(YAW, YAW)].max(0.0).sqrt()
    }

    /// One step of the odometry.
    pub(crate) fn predict(&mut self, step: &MotionIncrement, tuning: &FilterTuning) {
        self.mean[YAW] = wrap_rad(self.mean[YAW] + step.turn_rad + self.mean[DRIFT] * step.dt_s);
        if step.ahead_m != 0.0 || step.left_m != 0.0 {
            self.move_place(step, tuning);
        } else {
            self.carry(&[heading_row(step)]); // all else would add 0
        }
        self.covariance[(YAW, YAW)] += square(tuning.yaw_walk) * step.dt_s;
        self.covariance[(DRIFT, DRIFT)] += square(tuning.drift_walk) * step.dt_s;
        self.covariance[(DELAY, DELAY)] += square(tuning.delay_walk) * step.dt_s;
        self.symmetrize();
        if let Some((rate_radps, sigma_radps)) = step.stood_radps {
            self.correct_drift(rate_radps, sigma_radps);
        }
    }

    /// The part of a step that is not its turn; its heading is the one at the step's end.
    fn move_place(&mut self, step: &MotionIncrement, tuning: &FilterTuning) {
        let (sin, cos) = libm::sincos(self.mean[YAW]);
        let (dx, dy) = (step.ahead_m * cos - step.left_m * sin, step.ahead_m * sin + step.left_m * cos);
        let stretch = 1.0 + self.mean[SCALE];
        self.mean[X] += stretch * dx;
        self.mean[Y] += stretch * dy;

        self.carry(&[
            (X, [(YAW, -stretch * dy), (DRIFT, -stretch * dy * step.dt_s), (SCALE, dx)]),
            (Y, [(YAW, stretch * dx), (DRIFT, stretch * dx * step.dt_s), (SCALE, dy)]),
            heading_row(step),
        ]);

        let way_m = libm::hypot(dx, dy);
        let (along, across) = (square(tuning.along_walk) * way_m, square(tuning.across_walk) * way_m);
        self.covariance[(X, X)] += along * cos * cos + across * sin * sin;
        self.covariance[(Y, Y)] += along * sin * sin + across * cos * cos;
        self.covariance[(X, Y)] += (along - across) * sin * cos;
        self.covariance[(Y, X)] += (along - across) * sin * cos;
        self.shorten_by_heading(way_m);
    }

    /// The covariance after a step whose derivative is the identity but for these rows: `F P Fᵀ`, of which only
    /// what is not 0 is computed. A row may use only rows that come after it.
    fn carry(&mut self, rows: &[Row]) {
        let columns = &mut self.covariance.data.0; // arrays, which the compiler turns into wide instructions
        for (row, parts) in rows {
            for column in columns.iter_mut() {
                for (from, part) in parts {
                    column[*row] += part * column[*from];
                }
            }
        }
        for (column, parts) in rows {
            for (from, part) in parts {
                let source = columns[*from];
                for (value, source) in columns[*column].iter_mut().zip(source) {
                    *value += part * source;
                }
            }
        }
    }

    pub(crate) fn wheel_scale(&self) -> (f64, f64) {
        (self.mean[SCALE], self.covariance[(SCALE, SCALE)].max(0.0).sqrt())
    }

    /// A wrong heading does not only shift the way aside, it shortens it: by 1 − cos of its error, which the
    /// linear steps do not know. These errors add up; a quarter of them, as the truck drives to and fro.
    fn shorten_by_heading(&mut self, way_m: f64) {
        let short_m = -way_m * libm::expm1(-self.covariance[(YAW, YAW)] / 2.0) / 4.0;
        for place in [X, Y] {
            let sigma_m = self.covariance[(place, place)].max(0.0).sqrt();
            self.covariance[(place, place)] += (2.0 * sigma_m + short_m) * short_m;
        }
    }

    /// The truck stood while its gyro turned at this rate: that is its drift.
    fn correct_drift(&mut self, rate_radps: f64, sigma_radps: f64) {
        let mut h = SMatrix::<f64, 1, STATES>::zeros();
        h[DRIFT] = 1.0;
        let innovation = SVector::<f64, 1>::new(-rate_radps - self.mean[DRIFT]);
        let noise = SMatrix::<f64, 1, 1>::new(square(sigma_radps));
        self.update(&h, &innovation, &noise, ONE_LIMIT);
    }

    /// Corrects by a fix, if it is no outlier for this gate; otherwise nothing changes.
    /// `twist` is how the truck went just before.
    pub(crate) fn correct(&mut self, fix: &Measurement, twist: &Twist, gate: f64) -> Test {
        let (seen, dx_m, dy_m, turn_rad) = self.innovation(fix, twist);
        let limit = fix.limit(gate);
        match turn_rad {
            Some(turn_rad) => {
                self.update(&seen, &SVector::<f64, 3>::new(dx_m, dy_m, turn_rad), &fix.noise(), limit)
            }
            None => {
                let seen = seen.fixed_rows::<2>(0).into_owned();
                self.update(&seen, &SVector::<f64, 2>::new(dx_m, dy_m), &fix.noise(), limit)
            }
        }
    }

    /// By how much a fix is off what is expected, along x, along y and in yaw.
    fn innovation(
        &self,
        fix: &Measurement,
        twist: &Twist,
    ) -> (SMatrix<f64, 3, STATES>, f64, f64, Option<f64>) {
        let (stretch, delay_s) = (1.0 + self.mean[SCALE], self.mean[DELAY]);
        let turn_radps = twist.turn_radps + self.mean[DRIFT];
        let (sin, cos) = libm::sincos(self.mean[YAW] - turn_radps * delay_s / 2.0);
        let vx_mps = stretch * (twist.ahead_mps * cos - twist.left_mps * sin);
        let vy_mps = stretch * (twist.ahead_mps * sin + twist.left_mps * cos);
        let mut seen = SMatrix::<f64, 3, STATES>::identity();
        (seen[(0, DELAY)], seen[(1, DELAY)], seen[(2, DELAY)]) = (-vx_mps, -vy_mps, -turn_radps);
        (seen[(0, YAW)], seen[(1, YAW)]) = (vy_mps * delay_s, -vx_mps * delay_s);
        let [x_m, y_m] = fix.place_m;
        let turn_rad = fix.yaw_rad.map(|yaw_rad| wrap_rad(yaw_rad - self.mean[YAW] + turn_radps * delay_s));
        (seen, x_m - self.mean[X] + vx_mps * delay_s, y_m - self.mean[Y] + vy_mps * delay_s, turn_rad)
    }

    /// How far a fix is off what is expected: in m, and in rad if it has a yaw.
    pub(crate) fn off(&self, fix: &Measurement, twist: &Twist) -> (f64, f64) {
        let (_, dx_m, dy_m, turn_rad) = self.innovation(fix, twist);
        (libm::hypot(dx_m, dy_m), turn_rad.unwrap_or(0.0).abs())
    }

    fn update<const D: usize>(
        &mut self,
        h: &SMatrix<f64, D, STATES>,
        innovation: &SVector<f64, D>,
        noise: &SMatrix<f64, D, D>,
        limit: f64,
    ) -> Test {
        let seen = h * self.covariance;
        let spread = seen * h.transpose() + noise;
        // Both parts are positive, so their sum has a root; without one nothing can be learnt.
        let Some(root) = spread.cholesky() else { return Test { mahalanobis: f64::INFINITY, limit } };
        let test = Test { mahalanobis: innovation.dot(&root.solve(innovation)), limit };
        if !test.passed() {
            return test;
        }
        let gain = root.solve(&seen).transpose();
        self.mean += gain * innovation;
        self.mean[YAW] = wrap_rad(self.mean[YAW]);
        self.mean[SCALE] = self.mean[SCALE].clamp(*SCALES.start(), *SCALES.end());
        self.mean[DELAY] = self.mean[DELAY].clamp(*DELAYS_S.start(), *DELAYS_S.end());
        let rest = Matrix6::identity() - gain * h;
        self.covariance = rest * self.covariance * rest.transpose() + gain * noise * gain.transpose();
        self.symmetrize();
        test
    }

    /// Symmetric, and bounded however long nobody gave a fix.
    fn symmetrize(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        for place in 0..STATES {
            let variance = self.covariance[(place, place)];
            if variance > MOST_VARIANCE {
                // Scaling row and column keeps it positive.
                let scale = (MOST_VARIANCE / variance).sqrt();
                self.covariance.row_mut(place).scale_mut(scale);
                self.covariance.column_mut(place).scale_mut(scale);
            }
        }
    }
}
