//! The line through a calibration's points, what it is worth, and when it is refused.
//!
//! Annex A draws one regression line and gives its correlation factor R. R here is the same, over all
//! points. The line written is the *mean of two*: one through the points of each branch. For a
//! steering with play that is the middle between there and back; with the same pulses both ways it
//! is exactly Annex A's. A piston has a dead band around zero movement, and weight makes it slower
//! upwards: one line through all of its points would be too flat and miss the dead band's middle,
//! where a piston has to stand. So lifting and lowering have a line each, and what did not move
//! belongs to neither.

use crate::units::{PwmCount, Stamp};
use crate::vehicle::Line;
use thiserror::Error;

/// A fit with a smaller R is refused.
pub const MIN_R: f64 = 0.98;
/// Fewer points are no calibration.
pub const MIN_POINTS: usize = 5;
/// A branch with fewer points has no line of its own.
const BRANCH_POINTS: usize = 3;
/// The least slope that [`VehicleConfig::validate`](crate::VehicleConfig::validate) takes, per count.
const MIN_SLOPE: f64 = 1.0e-6;

/// Which of an actuator's two lines a point belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// Pulses getting longer; a piston that lifts.
    Up,
    /// Pulses getting shorter; a piston that lowers.
    Down,
    /// A piston that did not move.
    Still,
}

/// One measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The pulse.
    pub count: PwmCount,
    /// What it gave, in degrees or m/s.
    pub quantity: f64,
    /// How it was reached.
    pub branch: Branch,
}

/// A line through measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    /// Quantity over PWM count.
    pub line: Line,
    /// Annex A's correlation factor of all points: its magnitude, 0..=1.
    pub r: f64,
    /// Standard error of the slope, per count.
    pub slope_error: f64,
    /// Standard error of the intercept. Count 0 is far outside the sweep, so this is large and goes
    /// with the slope's: the zero count is the better known one.
    pub intercept_error: f64,
    /// The pulse at which the line is zero: straight ahead, level, or standing.
    pub zero_count: f64,
    /// Standard error of it, in counts.
    pub zero_error: f64,
    /// Standard deviation of the points around their own branch's line.
    pub scatter: f64,
    /// The lines of both branches, up first, if both have enough points.
    pub branches: Option<[Line; 2]>,
    /// How many points.
    pub points: usize,
}

/// Why measurements give no line that may be used.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum FitError {
    /// Too few to tell a line from chance.
    #[error("{got} points are not enough, at least {MIN_POINTS} are needed")]
    TooFewPoints {
        /// How many there are.
        got: usize,
    },
    /// All points at one pulse.
    #[error("all points are at one pulse, so they have no slope")]
    NoSpread,
    /// A measurement, or what follows from it, is not a number.
    #[error("a measurement is not a number, or too large")]
    NotFinite,
    /// Nothing moved.
    #[error("slope {slope:e} per count: the measurement does not change with the pulse")]
    SlopeZero {
        /// As fitted.
        slope: f64,
    },
    /// The points do not lie on a line.
    #[error(
        "R = {r:.4} is below {MIN_R}: the points are not on a line (play, an end stop, or a wrong reading)"
    )]
    WeakCorrelation {
        /// Its magnitude.
        r: f64,
    },
    /// Zero would need a pulse that no servo gets.
    #[error("zero would need pulse {count:.0}, servos accept {min} to {max}")]
    CentreOutOfLimits {
        /// Counts as fitted.
        count: f64,
        /// Shortest pulse.
        min: u16,
        /// Longest pulse.
        max: u16,
    },
}

/// A least-squares line.
#[derive(Debug, Clone, Copy)]
struct Regression {
    n: f64,
    mean_x: f64,
    mean_y: f64,
    sxx: f64,
    slope: f64,
    /// Signed.
    r: f64,
    /// Sum of the squared residuals.
    rest: f64,
}

impl Regression {
    /// `None` without two different x.
    fn of(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let n = points.clone().count() as f64;
        let mean_x = points.clone().map(|(x, _)| x).sum::<f64>() / n;
        let mean_y = points.clone().map(|(_, y)| y).sum::<f64>() / n;
        let (mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0);
        for (x, y) in points.clone() {
            let (dx, dy) = (x - mean_x, y - mean_y);
            (sxx, sxy, syy) = (sxx + dx * dx, sxy + dx * dy, syy + dy * dy);
        }
        if sxx <= 0.0 || n < 2.0 {
            return None;
        }
        let slope = sxy / sxx;
        let residual = |(x, y): (f64, f64)| y - mean_y - slope * (x - mean_x);
        let rest = points.map(residual).map(|residual| residual * residual).sum();
        let r = if syy > 0.0 { (sxy / libm::sqrt(sxx) / libm::sqrt(syy)).clamp(-1.0, 1.0) } else { 0.0 };
        Some(Self { n, mean_x, mean_y, sxx, slope, r, rest })
    }

    fn line(&self) -> Line {
        Line { slope: self.slope, intercept: self.mean_y - self.slope * self.mean_x }
    }

    /// Variance of a point; 0 if two points leave nothing over to judge by.
    fn variance(&self) -> f64 {
        if self.n > 2.0 { self.rest / (self.n - 2.0) } else { 0.0 }
    }

    /// Variance of the slope.
    fn slope_variance(&self) -> f64 {
        self.variance() / self.sxx
    }

    /// Variance of the line at `x`.
    fn variance_at(&self, x: f64) -> f64 {
        self.variance() * (1.0 / self.n + (x - self.mean_x) * (x - self.mean_x) / self.sxx)
    }
}

/// The line of an actuator, from its points in any order.
///
/// # Errors
/// [`FitError::TooFewPoints`], [`FitError::NotFinite`], [`FitError::NoSpread`] and
/// [`FitError::SlopeZero`]: there is no line. Whether it may be used says [`Fit::check`].
pub fn fit(points: &[Point]) -> Result<Fit, FitError> {
    if points.iter().any(|point| !point.quantity.is_finite()) {
        return Err(FitError::NotFinite);
    }
    if points.len() < MIN_POINTS {
        return Err(FitError::TooFewPoints { got: points.len() });
    }
    let all = Regression::of(points.iter().map(coordinates)).ok_or(FitError::NoSpread)?;
    let branch = |branch: Branch| {
        let own = points.iter().filter(move |point| point.branch == branch).map(coordinates);
        Regression::of(own).filter(|regression| regression.n >= BRANCH_POINTS as f64)
    };
    let moving = points.iter().filter(|point| point.branch != Branch::Still).map(coordinates);
    let lines = match (branch(Branch::Up), branch(Branch::Down)) {
        (Some(up), Some(down)) => vec![up, down],
        _ => vec![Regression::of(moving).ok_or(FitError::SlopeZero { slope: 0.0 })?],
    };
    let fit = mean_of(&lines, all.r.abs(), points.len());
    if !fit.is_finite() {
        return Err(FitError::NotFinite);
    }
    if fit.line.slope.abs() < MIN_SLOPE {
        return Err(FitError::SlopeZero { slope: fit.line.slope });
    }
    Ok(fit)
}

fn coordinates(point: &Point) -> (f64, f64) {
    (point.count.as_f64(), point.quantity)
}

/// The line in the middle of one line or two, with their errors, which are independent.
fn mean_of(lines: &[Regression], r: f64, points: usize) -> Fit {
    let n = lines.len() as f64;
    let mean = |of: &dyn Fn(&Regression) -> f64| lines.iter().map(of).sum::<f64>() / n;
    let error = |of: &dyn Fn(&Regression) -> f64| libm::sqrt(lines.iter().map(of).sum::<f64>()) / n;
    let line = Line { slope: mean(&|l| l.slope), intercept: mean(&|l| l.line().intercept) };
    let zero_count = line.count(0.0);
    Fit {
        line,
        r,
        slope_error: error(&Regression::slope_variance),
        intercept_error: error(&|l| l.variance_at(0.0)),
        zero_count,
        zero_error: error(&|l| l.variance_at(zero_count)) / line.slope.abs(),
        scatter: libm::sqrt(mean(&Regression::variance)),
        branches: if let [up, down] = lines { Some([up.line(), down.line()]) } else { None },
        points,
    }
}

impl Fit {
    /// Whether the fit may be used.
    ///
    /// # Errors
    /// [`FitError::WeakCorrelation`] and [`FitError::CentreOutOfLimits`].
    pub fn check(&self) -> Result<(), FitError> {
        if self.r < MIN_R {
            return Err(FitError::WeakCorrelation { r: self.r });
        }
        let (min, max) = (PwmCount::MIN, PwmCount::MAX);
        if !(min.as_f64()..=max.as_f64()).contains(&self.zero_count) {
            let (min, max) = (min.get(), max.get());
            return Err(FitError::CentreOutOfLimits { count: self.zero_count, min, max });
        }
        Ok(())
    }

    /// How far a point lies from the line, in the quantity's unit.
    #[must_use]
    pub fn residual(&self, point: &Point) -> f64 {
        point.quantity - self.line.at(point.count.as_f64())
    }

    /// How far apart both branches are at the zero count, in the quantity's unit: a steering's play
    /// from stop to stop.
    #[must_use]
    pub fn hysteresis(&self) -> Option<f64> {
        let apart = self.branches.map(|[up, down]| (up.at(self.zero_count) - down.at(self.zero_count)).abs());
        apart.filter(|apart| apart.is_finite())
    }

    /// How far apart the counts are at which both branches reach zero: a piston's dead band.
    #[must_use]
    pub fn dead_band(&self) -> Option<f64> {
        let width = self.branches.map(|[up, down]| (up.count(0.0) - down.count(0.0)).abs());
        width.filter(|counts| counts.is_finite())
    }

    fn is_finite(&self) -> bool {
        let own = [self.line.slope, self.line.intercept, self.r, self.slope_error, self.intercept_error];
        // A slope of exactly zero has no zero count; it has a refusal of its own.
        let zero = [self.zero_count, self.zero_error];
        let zero_is_finite = self.line.slope == 0.0 || zero.iter().all(|value| value.is_finite());
        own.iter().all(|value| value.is_finite()) && self.scatter.is_finite() && zero_is_finite
    }
}

/// Speed of a piston in m/s from its heights in m over time: their least-squares slope. `None`
/// without two different moments, or if a height is not a number.
#[must_use]
pub fn speed_mps(heights: &[(Stamp, f64)]) -> Option<f64> {
    let start = heights.first()?.0;
    let points = heights.iter().map(|&(at, height_m)| (at.since_s(start), height_m));
    Regression::of(points).map(|line| line.slope).filter(|speed| speed.is_finite())
}

#[cfg(test)]
mod tests;
