//! A calibration as a picture: points, line, axes with units, and R, as SVG.
//!
//! What Annex A shows in its figures A.1 to A.7, with the two branches told apart.

use std::fmt::Write;
use xtb_control::calibration::{Actuator, Branch, Fit, Kind, Point};
use xtb_control::vehicle::Line;

const WIDTH: f64 = 860.0;
const HEIGHT: f64 = 560.0;
/// The plotting area.
const LEFT: f64 = 104.0;
const RIGHT: f64 = WIDTH - 30.0;
const TOP: f64 = 84.0;
const BOTTOM: f64 = HEIGHT - 66.0;
/// Room around the points, as a part of their spread.
const ROOM: f64 = 0.06;
const INK: &str = "#1f2933";
const GREY: &str = "#7b8794";
const UP: &str = "#1864ab";
const DOWN: &str = "#c2410c";

/// An axis: which values it shows, and where.
struct Axis {
    min: f64,
    max: f64,
    /// Pixels of both.
    from: f64,
    to: f64,
    step: f64,
}

impl Axis {
    /// Around all values, with about `ticks` round numbers.
    fn around(values: impl Iterator<Item = f64> + Clone, (from, to): (f64, f64), ticks: f64) -> Self {
        let min = values.clone().fold(f64::INFINITY, f64::min);
        let max = values.fold(f64::NEG_INFINITY, f64::max);
        let middle = if min.is_finite() { min } else { 0.0 };
        let (min, max) = if min < max { (min, max) } else { (middle - 1.0, middle + 1.0) };
        let room = ROOM * (max - min);
        let (min, max) = (min - room, max + room);
        Self { min, max, from, to, step: round_step((max - min) / ticks) }
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value - self.min) / (self.max - self.min) * (self.to - self.from)
    }

    /// Round values, with as many decimals as they need.
    fn ticks(&self) -> impl Iterator<Item = (f64, String)> + '_ {
        let first = (self.min / self.step).ceil() as i64;
        let last = (self.max / self.step).floor() as i64;
        let decimals = (-self.step.log10().floor()).max(0.0) as usize;
        (first..=last).map(move |i| {
            let value = i as f64 * self.step;
            (value, format!("{value:.decimals$}").replace('-', "\u{2212}"))
        })
    }
}

/// The nearest of 1, 2 and 5 times a power of ten that is no smaller.
fn round_step(step: f64) -> f64 {
    let power = 10_f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|s| *s >= step * 0.999)
        .unwrap_or(step)
}

/// The picture. `verdict` stands under the title, in red if the fit is refused.
pub(crate) fn svg(
    what: Actuator,
    points: &[Point],
    fit: Option<&Fit>,
    verdict: Result<&str, &str>,
) -> String {
    let x = Axis::around(points.iter().map(|p| p.count.as_f64()), (LEFT, RIGHT), 10.0);
    let y = Axis::around(points.iter().map(|p| p.quantity), (BOTTOM, TOP), 7.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" \
         height=\"{HEIGHT}\" font-family=\"'DejaVu Sans', Verdana, Arial, sans-serif\" font-size=\"14\" \
         fill=\"{INK}\">\n\
         <title>Calibration of {what}</title>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <clipPath id=\"area\"><rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\"/></clipPath>\n",
        RIGHT - LEFT,
        BOTTOM - TOP
    );
    // To write to a String cannot fail.
    let _ = head(&mut svg, what, verdict);
    let _ = axes(&mut svg, &x, &y, quantity(what));
    if let Some(fit) = fit {
        let _ = lines(&mut svg, &x, &y, fit);
    }
    for point in points {
        let _ = mark(&mut svg, x.at(point.count.as_f64()), y.at(point.quantity), point.branch);
    }
    let rising = fit.is_none_or(|fit| fit.line.slope > 0.0);
    let _ = legend(&mut svg, what, points, fit, rising);
    svg.push_str("</svg>\n");
    svg
}

fn quantity(what: Actuator) -> &'static str {
    match what.kind() {
        Kind::Steering(_) => "wheel angle [deg], + = right",
        Kind::Bumper(_) => "bumper angle [deg], + = up",
        Kind::Piston(_) => "piston speed [m/s], + = up",
    }
}

fn head(svg: &mut String, what: Actuator, verdict: Result<&str, &str>) -> std::fmt::Result {
    let (text, colour) = match verdict {
        Ok(text) => (text, INK),
        Err(text) => (text, "#b91c1c"),
    };
    writeln!(
        svg,
        "<text x=\"{LEFT}\" y=\"36\" font-size=\"20\" font-weight=\"bold\">Calibration of {what}</text>"
    )?;
    writeln!(svg, "<text x=\"{LEFT}\" y=\"62\" fill=\"{colour}\">{}</text>", escaped(text))
}

fn axes(svg: &mut String, x: &Axis, y: &Axis, quantity: &str) -> std::fmt::Result {
    for (value, label) in x.ticks() {
        let at = x.at(value);
        writeln!(svg, "<path d=\"M{at:.1} {TOP}V{BOTTOM}\" stroke=\"#e4e7eb\"/>")?;
        writeln!(
            svg,
            "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            BOTTOM + 22.0
        )?;
    }
    for (value, label) in y.ticks() {
        let at = y.at(value);
        let stroke = if value == 0.0 { "#9aa5b1" } else { "#e4e7eb" };
        writeln!(svg, "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"{stroke}\"/>")?;
        writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            LEFT - 8.0,
            at + 5.0
        )?;
    }
    writeln!(
        svg,
        "<rect x=\"{LEFT}\" y=\"{TOP}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{GREY}\"/>",
        RIGHT - LEFT,
        BOTTOM - TOP
    )?;
    let (middle_x, middle_y) = ((LEFT + RIGHT) / 2.0, (TOP + BOTTOM) / 2.0);
    writeln!(
        svg,
        "<text x=\"{middle_x}\" y=\"{}\" text-anchor=\"middle\">pulse [counts of 0.4 µs]</text>",
        HEIGHT - 18.0
    )?;
    writeln!(
        svg,
        "<text transform=\"translate(26 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{quantity}</text>"
    )
}

/// The line from edge to edge, and both branches' own ones behind it.
fn lines(svg: &mut String, x: &Axis, y: &Axis, fit: &Fit) -> std::fmt::Result {
    let mut draw = |line: Line, style: &str| {
        let (left, right) = (y.at(line.at(x.min)), y.at(line.at(x.max)));
        writeln!(
            svg,
            "<path d=\"M{LEFT} {left:.1}L{RIGHT} {right:.1}\" fill=\"none\" clip-path=\"url(#area)\" \
             {style}/>"
        )
    };
    if let Some([up, down]) = fit.branches {
        draw(up, &format!("stroke=\"{UP}\" stroke-dasharray=\"5 4\" opacity=\"0.55\""))?;
        draw(down, &format!("stroke=\"{DOWN}\" stroke-dasharray=\"5 4\" opacity=\"0.55\""))?;
    }
    draw(fit.line, &format!("stroke=\"{INK}\" stroke-width=\"1.6\""))
}

/// Up: a filled triangle; down: an open one on its tip; still: a cross.
fn mark(svg: &mut String, x: f64, y: f64, branch: Branch) -> std::fmt::Result {
    match branch {
        Branch::Up => writeln!(svg, "<path d=\"M{x:.1} {:.1}l5.5 9.5h-11z\" fill=\"{UP}\"/>", y - 6.3),
        Branch::Down => writeln!(
            svg,
            "<path d=\"M{x:.1} {:.1}l5.5 -9.5h-11z\" fill=\"#ffffff\" stroke=\"{DOWN}\" \
             stroke-width=\"1.6\"/>",
            y + 6.3
        ),
        Branch::Still => writeln!(
            svg,
            "<path d=\"M{:.1} {:.1}l8 8m0 -8l-8 8\" stroke=\"{GREY}\" stroke-width=\"1.8\"/>",
            x - 4.0,
            y - 4.0
        ),
    }
}

/// In the corner that the line leaves free.
fn legend(
    svg: &mut String,
    what: Actuator,
    points: &[Point],
    fit: Option<&Fit>,
    rising: bool,
) -> std::fmt::Result {
    let names = match what.kind() {
        Kind::Piston(_) => ["lifting", "lowering", "did not move"],
        _ => ["pulses getting longer", "pulses getting shorter", "did not move"],
    };
    let x = if rising { LEFT + 24.0 } else { RIGHT - 210.0 };
    let mut y = TOP + 26.0;
    for (branch, name) in [Branch::Up, Branch::Down, Branch::Still].into_iter().zip(names) {
        if points.iter().any(|point| point.branch == branch) {
            mark(svg, x, y, branch)?;
            writeln!(svg, "<text x=\"{}\" y=\"{}\">{name}</text>", x + 16.0, y + 5.0)?;
            y += 24.0;
        }
    }
    if let Some(fit) = fit {
        let name = if fit.branches.is_some() { "line: mean of both" } else { "line" };
        writeln!(svg, "<path d=\"M{} {y}h16\" stroke=\"{INK}\" stroke-width=\"1.6\"/>", x - 8.0)?;
        writeln!(svg, "<text x=\"{}\" y=\"{}\">{name}</text>", x + 16.0, y + 5.0)?;
    }
    Ok(())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::PwmCount;
    use xtb_control::calibration::fit;

    fn points(quantity: impl Fn(f64) -> f64) -> Vec<Point> {
        (0..10)
            .map(|i| {
                let count = PwmCount::saturating(3000.0 + 100.0 * f64::from(i));
                let branch = if i % 2 == 0 { Branch::Up } else { Branch::Down };
                Point { count, quantity: quantity(count.as_f64()), branch }
            })
            .collect()
    }

    #[test]
    fn every_point_the_line_and_the_verdict_are_in_the_picture() {
        let points = points(|count| 0.02 * (count - 3500.0));
        let fit = fit(&points).unwrap();
        let picture = svg(Actuator::BumperFront, &points, Some(&fit), Ok("R = 1 & more"));
        assert_eq!(picture.matches("l5.5 9.5h-11z").count(), 5 + 1, "with the legend's");
        assert_eq!(picture.matches("l5.5 -9.5h-11z").count(), 5 + 1);
        for part in
            ["Calibration of bumper-front", "R = 1 &amp; more", "[counts of 0.4 µs]", "+ = up", "3400"]
        {
            assert!(picture.contains(part), "{part}");
        }
        assert!(!picture.contains("NaN") && !picture.contains("inf"), "{picture}");
    }

    #[test]
    fn without_a_line_or_a_spread_there_is_still_a_picture() {
        for points in [points(|_| 0.0), points(|_| 0.0)[..1].to_vec(), Vec::new()] {
            let picture = svg(Actuator::PistonRr, &points, None, Err("slope < 1"));
            assert!(picture.contains("slope &lt; 1") && picture.ends_with("</svg>\n"));
            assert!(!picture.contains("NaN"), "{picture}");
        }
    }

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        let axis = Axis::around([2881.0, 4539.0].into_iter(), (0.0, 100.0), 5.0);
        let labels: Vec<String> = axis.ticks().map(|(_, label)| label).collect();
        assert_eq!(labels, ["3000", "3500", "4000", "4500"]);
        let axis = Axis::around([-0.02, 0.02].into_iter(), (0.0, 100.0), 7.0);
        let labels: Vec<String> = axis.ticks().map(|(_, label)| label).collect();
        assert_eq!(labels, ["−0.02", "−0.01", "0.00", "0.01", "0.02"]);
    }
}
