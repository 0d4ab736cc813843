//! The filter's state and its two steps: predict and correct.
//!
//! x' = x + (1 + s) · R(ψ') · d and ψ' = ψ + turn + b · t, with the drift b and the wheels' scale s kept.
//! Corrections are in Joseph's form, and the covariance is made symmetric after each step.

use super::fix::Measurement;
use super::travel::Increment;
use super::tuning::Filter;
use crate::MapPose;
use nalgebra::{SMatrix, SVector, Vector5};
use xtb_control::frames::wrap_rad;

type Matrix5 = SMatrix<f64, 5, 5>;

/// Places in the state.
pub(crate) const X: usize = 0;
pub(crate) const Y: usize = 1;
pub(crate) const YAW: usize = 2;
/// rad/s that have to be added to what the gyro says, counter-clockwise.
pub(crate) const DRIFT: usize = 3;
/// By this part the way is longer than the encoder says.
pub(crate) const SCALE: usize = 4;

/// χ² with one degree of freedom that 1 in 1000 exceeds.
const ONE_LIMIT: f64 = 10.828;
/// A variance that is larger says no more than this one.
const MOST_VARIANCE: f64 = 1.0e8;

/// Mean and covariance of x, y, yaw, drift and scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct State {
    pub(crate) mean: Vector5<f64>,
    pub(crate) covariance: Matrix5,
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

impl State {
    pub(crate) fn at(pose: &MapPose, tuning: &Filter) -> Self {
        let sigmas =
            [tuning.start_m, tuning.start_m, tuning.start_rad, tuning.drift_radps, tuning.wheel_scale];
        let covariance = Matrix5::from_diagonal(&Vector5::from(sigmas.map(square)));
        Self { mean: Vector5::new(pose.x_m, pose.y_m, pose.yaw_rad, 0.0, 0.0), covariance }
    }

    pub(crate) fn pose(&self) -> MapPose {
        MapPose { x_m: self.mean[X], y_m: self.mean[Y], yaw_rad: self.mean[YAW] }
    }

    /// Another mean, with the same doubts.
    pub(crate) fn set_pose(&mut self, pose: &MapPose) {
        (self.mean[X], self.mean[Y], self.mean[YAW]) = (pose.x_m, pose.y_m, pose.yaw_rad);
    }

    /// A new pose that knows nothing of the old one; drift and scale stay.
    pub(crate) fn restart(&mut self, pose: &MapPose, sigma_m: f64, sigma_rad: f64) {
        self.set_pose(pose);
        for (place, sigma) in [(X, sigma_m), (Y, sigma_m), (YAW, sigma_rad)] {
            self.covariance.row_mut(place).fill(0.0);
            self.covariance.column_mut(place).fill(0.0);
            self.covariance[(place, place)] = square(sigma);
        }
    }

    /// Who was lost may have learnt nonsense: drift and scale are open again.
    pub(crate) fn doubt_learnt(&mut self, tuning: &Filter) {
        for (place, sigma) in [(DRIFT, tuning.drift_radps), (SCALE, tuning.wheel_scale)] {
            self.mean[place] = self.mean[place].clamp(-2.0 * sigma, 2.0 * sigma);
            self.covariance.row_mut(place).fill(0.0);
            self.covariance.column_mut(place).fill(0.0);
            self.covariance[(place, place)] = square(sigma);
        }
    }

    pub(crate) fn sigma_yaw_rad(&self) -> f64 {
        self.covariance[(YAW, YAW)].max(0.0).sqrt()
    }

    /// One step of the odometry.
    pub(crate) fn predict(&mut self, step: &Increment, tuning: &Filter) {
        let yaw_rad = wrap_rad(self.mean[YAW] + step.turn_rad + self.mean[DRIFT] * step.dt_s);
        let (sin, cos) = libm::sincos(yaw_rad);
        let (dx, dy) = (step.ahead_m * cos - step.left_m * sin, step.ahead_m * sin + step.left_m * cos);
        let stretch = 1.0 + self.mean[SCALE];
        self.mean[YAW] = yaw_rad;
        self.mean[X] += stretch * dx;
        self.mean[Y] += stretch * dy;

        let mut f = Matrix5::identity();
        f[(X, YAW)] = -stretch * dy;
        f[(Y, YAW)] = stretch * dx;
        f[(X, DRIFT)] = -stretch * dy * step.dt_s;
        f[(Y, DRIFT)] = stretch * dx * step.dt_s;
        f[(X, SCALE)] = dx;
        f[(Y, SCALE)] = dy;
        f[(YAW, DRIFT)] = step.dt_s;
        self.covariance = f * self.covariance * f.transpose();

        let way_m = libm::hypot(dx, dy);
        let (along, across) = (square(tuning.along_walk) * way_m, square(tuning.across_walk) * way_m);
        self.covariance[(X, X)] += along * cos * cos + across * sin * sin;
        self.covariance[(Y, Y)] += along * sin * sin + across * cos * cos;
        self.covariance[(X, Y)] += (along - across) * sin * cos;
        self.covariance[(Y, X)] += (along - across) * sin * cos;
        self.bend(way_m);
        self.covariance[(YAW, YAW)] += square(tuning.yaw_walk) * step.dt_s;
        self.covariance[(DRIFT, DRIFT)] += square(tuning.drift_walk) * step.dt_s;
        self.tidy();
        if let Some((rate_radps, sigma_radps)) = step.stood_radps {
            self.stood(rate_radps, sigma_radps);
        }
    }

    /// A wrong heading does not only shift the way aside, it shortens it: by 1 − cos of its error, which the
    /// linear steps do not know. These errors add up; a quarter of them, as the truck drives to and fro.
    fn bend(&mut self, way_m: f64) {
        let short_m = -way_m * libm::expm1(-self.covariance[(YAW, YAW)] / 2.0) / 4.0;
        for place in [X, Y] {
            let sigma_m = self.covariance[(place, place)].max(0.0).sqrt();
            self.covariance[(place, place)] += (2.0 * sigma_m + short_m) * short_m;
        }
    }

    /// The truck stood while its gyro turned at this rate: that is its drift.
    fn stood(&mut self, rate_radps: f64, sigma_radps: f64) {
        let mut h = SMatrix::<f64, 1, 5>::zeros();
        h[DRIFT] = 1.0;
        let innovation = SVector::<f64, 1>::new(-rate_radps - self.mean[DRIFT]);
        let noise = SMatrix::<f64, 1, 1>::new(square(sigma_radps));
        self.update(&h, &innovation, &noise, ONE_LIMIT);
    }

    /// Corrects by a fix, if it is no outlier for this gate; otherwise nothing changes.
    pub(crate) fn correct(&mut self, fix: &Measurement, gate: f64) -> Test {
        let [x_m, y_m] = fix.place_m;
        let (dx, dy, limit) = (x_m - self.mean[X], y_m - self.mean[Y], fix.limit(gate));
        match fix.yaw_rad {
            Some(yaw_rad) => {
                let turn = wrap_rad(yaw_rad - self.mean[YAW]);
                let h = SMatrix::<f64, 3, 5>::identity();
                self.update(&h, &SVector::<f64, 3>::new(dx, dy, turn), &fix.noise(), limit)
            }
            None => {
                let h = SMatrix::<f64, 2, 5>::identity();
                self.update(&h, &SVector::<f64, 2>::new(dx, dy), &fix.noise(), limit)
            }
        }
    }

    fn update<const D: usize>(
        &mut self,
        h: &SMatrix<f64, D, 5>,
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
        let rest = Matrix5::identity() - gain * h;
        self.covariance = rest * self.covariance * rest.transpose() + gain * noise * gain.transpose();
        self.tidy();
        test
    }

    /// Symmetric, and bounded however long nobody gave a fix.
    fn tidy(&mut self) {
        self.covariance = (self.covariance + self.covariance.transpose()) * 0.5;
        for place in 0..5 {
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
