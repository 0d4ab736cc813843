//! What came of a calibration: as a table for people, as JSON for programs.

use crate::commands::columns;
use serde::Serialize;
use std::path::Path;
use xtb_control::calibration::{Actuator, ActuatorKind, Branch, Fit, FitError, Point};
use xtb_control::vehicle::Line;

/// A calibration and what became of it.
pub(crate) struct Report<'a> {
    pub(crate) what: Actuator,
    /// As configured before.
    pub(crate) old: Line,
    /// The steering's centre as configured before.
    pub(crate) old_centre: Option<f64>,
    pub(crate) points: &'a [Point],
    /// The line, if there is any, also if it is refused.
    pub(crate) fit: Option<&'a Fit>,
    pub(crate) refused: Option<FitError>,
}

/// The same for programs.
#[derive(Debug, Serialize)]
struct Json {
    what: &'static str,
    unit: &'static str,
    fit: Option<JsonFit>,
    old: JsonLine,
    refused: Option<String>,
    plot: Option<String>,
    written: Option<String>,
    points: Vec<JsonPoint>,
}

#[derive(Debug, Serialize)]
struct JsonFit {
    slope: f64,
    intercept: f64,
    r: f64,
    slope_error: f64,
    intercept_error: f64,
    zero_count: f64,
    zero_error: f64,
    scatter: f64,
    hysteresis: Option<f64>,
    dead_band: Option<f64>,
    points: usize,
}

#[derive(Debug, Serialize)]
struct JsonLine {
    slope: f64,
    intercept: f64,
}

#[derive(Debug, Serialize)]
struct JsonPoint {
    count: u16,
    quantity: f64,
    branch: &'static str,
}

impl Report<'_> {
    fn is_piston(&self) -> bool {
        matches!(self.what.kind(), ActuatorKind::Piston(_))
    }

    /// The fit in one line, for plot and person.
    pub(crate) fn summary(&self) -> Option<String> {
        let fit = self.fit?;
        let quantity = if self.is_piston() { "speed" } else { "angle" };
        Some(format!(
            "{quantity} = {} · count {} {} {}, R = {:.4}, {} points",
            number(fit.line.slope),
            if fit.line.intercept < 0.0 { "−" } else { "+" },
            number(fit.line.intercept.abs()),
            self.what.unit(),
            fit.r,
            fit.points
        ))
    }

    /// Old and new values with their errors.
    pub(crate) fn table(&self) -> String {
        let (Some(fit), Some(summary)) = (self.fit, self.summary()) else { return String::new() };
        let unit = self.what.unit();
        let row = |name: &str, old: String, new: String, error: f64, unit: &str| {
            [name, &old, &new, &format!("± {}", digits(error, 2)), unit].map(str::to_owned).to_vec()
        };
        let old_zero = self.old_centre.unwrap_or_else(|| self.old.count(0.0));
        let zero = match self.what.kind() {
            ActuatorKind::Steering(_) => "centre",
            ActuatorKind::Bumper(_) => "level",
            ActuatorKind::Piston(_) => "standing",
        };
        let rows = [
            ["", "OLD", "NEW", "STANDARD ERROR", ""].map(str::to_owned).to_vec(),
            row(
                "slope",
                number(self.old.slope),
                number(fit.line.slope),
                fit.slope_error,
                &format!("{unit}/count"),
            ),
            row(
                "intercept",
                number(self.old.intercept),
                number(fit.line.intercept),
                fit.intercept_error,
                &format!("{unit}, at count 0"),
            ),
            row(zero, format!("{old_zero:.1}"), format!("{:.1}", fit.zero_count), fit.zero_error, "counts"),
        ];
        let apart = match (self.is_piston(), fit.dead_band(), fit.hysteresis()) {
            (true, Some(counts), _) => format!("dead band {counts:.0} counts wide\n"),
            (false, _, Some(deg)) => format!("hysteresis {deg:.2} deg between both directions\n"),
            _ => String::new(),
        };
        let scatter = format!("scatter {} {unit} around the line of each branch\n", digits(fit.scatter, 2));
        format!("{}: {summary}\n{}{apart}{scatter}", self.what, columns(&rows))
    }

    /// For programs.
    pub(crate) fn json(&self, plot: Option<&Path>, written: Option<&Path>) -> impl Serialize + use<> {
        let path = |path: Option<&Path>| path.map(|path| path.display().to_string());
        Json {
            what: self.what.name(),
            unit: self.what.unit(),
            fit: self.fit.map(|fit| JsonFit {
                slope: fit.line.slope,
                intercept: fit.line.intercept,
                r: fit.r,
                slope_error: fit.slope_error,
                intercept_error: fit.intercept_error,
                zero_count: fit.zero_count,
                zero_error: fit.zero_error,
                scatter: fit.scatter,
                hysteresis: fit.hysteresis().filter(|_| !self.is_piston()),
                dead_band: fit.dead_band().filter(|_| self.is_piston()),
                points: fit.points,
            }),
            old: JsonLine { slope: self.old.slope, intercept: self.old.intercept },
            refused: self.refused.map(|refused| refused.to_string()),
            plot: path(plot),
            written: path(written),
            points: self.points.iter().map(json_point).collect(),
        }
    }
}

fn json_point(point: &Point) -> JsonPoint {
    let branch = match point.branch {
        Branch::Up => "up",
        Branch::Down => "down",
        Branch::Still => "still",
    };
    JsonPoint { count: point.count.get(), quantity: point.quantity, branch }
}

/// Five significant digits.
fn number(value: f64) -> String {
    digits(value, 5)
}

/// So many significant digits, without an exponent, with a proper minus.
fn digits(value: f64, digits: i32) -> String {
    let power = value.abs().log10().floor();
    let places = if power.is_finite() { (digits - 1 - power as i32).clamp(0, 12) } else { 0 };
    format!("{value:.*}", places as usize).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::PwmCount;
    use xtb_control::calibration::fit;

    #[test]
    fn the_table_shows_old_new_and_errors() {
        let points: Vec<Point> = (0..6)
            .map(|i| {
                let count = PwmCount::saturating(3000.0 + 300.0 * f64::from(i));
                Point { count, quantity: -0.02 * (count.as_f64() - 3700.0), branch: Branch::Up }
            })
            .collect();
        let fit = fit(&points).unwrap();
        let old = Line { slope: -0.0205, intercept: 76.1 };
        let report = Report {
            what: Actuator::SteeringFront,
            old,
            old_centre: Some(3710.0),
            points: &points,
            fit: Some(&fit),
            refused: None,
        };
        let table = report.table();
        assert!(
            table.starts_with(
                "steering-front: angle = −0.020000 · count + 74.000 deg, R = 1.0000, 6 points\n"
            ),
            "{table}"
        );
        for part in ["slope      −0.020500  −0.020000", "centre     3710.0     3700.0", "deg, at count 0"]
        {
            assert!(table.contains(part), "{part} is missing from\n{table}");
        }
    }

    #[test]
    fn numbers_have_five_digits_and_a_proper_minus() {
        assert_eq!(number(-0.0205128), "−0.020513");
        assert_eq!(number(5.0123e-5), "0.000050123");
        assert_eq!((number(0.0), digits(8.1e-8, 2)), ("0".to_owned(), "0.000000081".to_owned()));
        assert_eq!((number(76.1026), number(-0.18751)), ("76.103".to_owned(), "−0.18751".to_owned()));
    }
}
