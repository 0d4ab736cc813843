//! A calibration as a picture: points, line, axes with units, and R, as SVG.
//!
//! What Annex A shows in its figures A.1 to A.7, with the two branches told apart.

use plotters::coord::Shift;
use plotters::data::fitting_range;
use plotters::element::ComposedElement;
use plotters::prelude::*;
use std::ops::Range;
use xtb_control::calibration::{Actuator, ActuatorKind, Branch, Fit, Point};
use xtb_control::vehicle::Line;

/// In pixels.
const SIZE: (u32, u32) = (860, 560);
/// Room around what is shown, as a part of its spread.
const ROOM: f64 = 0.06;
const FONT: &str = "sans-serif";
const INK: RGBColor = RGBColor(0x1f, 0x29, 0x33);
const GREY: RGBColor = RGBColor(0x7b, 0x87, 0x94);
const PALE: RGBColor = RGBColor(0xe4, 0xe7, 0xeb);
const UP: RGBColor = RGBColor(0x18, 0x64, 0xab);
const DOWN: RGBColor = RGBColor(0xc2, 0x41, 0x0c);
const REFUSED: RGBColor = RGBColor(0xb9, 0x1c, 0x1c);

type Pixels = (i32, i32);

/// The picture. `verdict` stands under the title, in red if the fit is refused.
pub(crate) fn svg(
    what: Actuator,
    points: &[Point],
    fit: Option<&Fit>,
    verdict: Result<&str, &str>,
) -> String {
    let mut svg = String::new();
    // Into a string, and with no fonts to load, nothing can fail.
    let _ = draw(&SVGBackend::with_string(&mut svg, SIZE).into_drawing_area(), what, points, fit, verdict);
    svg
}

fn draw(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    what: Actuator,
    points: &[Point],
    fit: Option<&Fit>,
    verdict: Result<&str, &str>,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    root.fill(&WHITE)?;
    let title = (FONT, 25, FontStyle::Bold).into_font().color(&INK);
    root.draw_text(&format!("Calibration of {what}"), &title, (100, 16))?;
    let (verdict, colour) = verdict.map_or_else(|text| (text, REFUSED), |text| (text, INK));
    root.draw_text(verdict, &(FONT, 17).into_font().color(&colour), (100, 48))?;

    let branches: Vec<Line> = fit.and_then(|fit| fit.branches).into_iter().flatten().collect();
    let x = around(points.iter().map(|point| point.count.as_f64()));
    let ends = |line: Line| [x.start, x.end].map(|count| (count, line.at(count)));
    let drawn = branches.iter().copied().chain(fit.map(|fit| fit.line)).flat_map(ends);
    let y = around(points.iter().map(|point| point.quantity).chain(drawn.map(|(_, quantity)| quantity)));
    let mut chart = ChartBuilder::on(root)
        .margin(16)
        .margin_top(84)
        .x_label_area_size(50)
        .y_label_area_size(84)
        .build_cartesian_2d(x.clone(), y.clone())?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(PALE)
        .axis_style(GREY)
        .x_labels(10)
        .y_labels(8)
        .x_label_formatter(&tick)
        .y_label_formatter(&tick)
        .label_style((FONT, 17, &INK))
        .x_desc("pulse [counts of 0.4 µs]")
        .y_desc(quantity(what))
        .draw()?;
    if y.contains(&0.0) {
        chart.draw_series(LineSeries::new([(x.start, 0.0), (x.end, 0.0)], GREY))?;
    }

    for (line, colour) in branches.iter().zip([UP, DOWN]) {
        let style = colour.mix(0.55).stroke_width(1);
        chart.draw_series(DashedLineSeries::new(ends(*line), 5, 4, style))?;
    }
    if let Some(fit) = fit {
        let name = if fit.branches.is_some() { "line: mean of both" } else { "line" };
        chart
            .draw_series(LineSeries::new(ends(fit.line), INK.stroke_width(2)))?
            .label(name)
            .legend(|(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], INK.stroke_width(2)));
    }
    let names = match what.kind() {
        ActuatorKind::Piston(_) => ["lifting", "lowering", "did not move"],
        _ => ["pulses getting longer", "pulses getting shorter", "did not move"],
    };
    for (branch, name) in [Branch::Up, Branch::Down, Branch::Still].into_iter().zip(names) {
        let mut marks = points
            .iter()
            .filter(|point| point.branch == branch)
            .map(|point| mark((point.count.as_f64(), point.quantity), branch))
            .peekable();
        if marks.peek().is_some() {
            chart.draw_series(marks)?.label(name).legend(move |(x, y)| mark((x + 8, y), branch));
        }
    }
    // In the corner that the line leaves free.
    let corner = match fit {
        Some(fit) if fit.line.slope <= 0.0 => SeriesLabelPosition::UpperRight,
        _ => SeriesLabelPosition::UpperLeft,
    };
    chart.configure_series_labels().position(corner).legend_area_size(24).label_font((FONT, 17, &INK)).draw()
}

/// All values, and some room around them.
fn around(values: impl Iterator<Item = f64>) -> Range<f64> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let Range { start, end } = fitting_range(&values);
    let room = if start < end { ROOM * (end - start) } else { 1.0 };
    let range = start - room..end + room;
    // Readings that no instrument gives: plotters' ticks need finite ends.
    if (range.end - range.start).is_finite() { range } else { -1.0..1.0 }
}

/// A round number, without what a sum of steps adds to it.
fn tick(value: &f64) -> String {
    // Adding 0 makes 0 of -0.
    let round = (value * 1e6).round() / 1e6 + 0.0;
    round.to_string().replace('-', "\u{2212}")
}

fn quantity(what: Actuator) -> &'static str {
    match what.kind() {
        ActuatorKind::Steering(_) => "wheel angle [deg], + = right",
        ActuatorKind::Bumper(_) => "bumper angle [deg], + = up",
        ActuatorKind::Piston(_) => "piston speed [m/s], + = up",
    }
}

/// Up: a filled triangle; down: an open one on its tip; still: a cross.
fn mark<Place, DB: DrawingBackend>(
    place: Place,
    branch: Branch,
) -> ComposedElement<Place, DB, Polygon<Pixels>, PathElement<Pixels>> {
    let (corners, fill, line) = match branch {
        Branch::Up => (vec![(0, -6), (6, 4), (-6, 4), (0, -6)], UP.mix(1.0), UP.stroke_width(1)),
        Branch::Down => (vec![(0, 6), (6, -4), (-6, -4), (0, 6)], WHITE.mix(1.0), DOWN.stroke_width(2)),
        Branch::Still => {
            (vec![(-4, -4), (4, 4), (0, 0), (-4, 4), (4, -4)], TRANSPARENT, GREY.stroke_width(2))
        }
    };
    EmptyElement::at(place)
        + Polygon::<Pixels>::new(corners.clone(), fill)
        + PathElement::<Pixels>::new(corners, line)
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
        let up = "<polygon opacity=\"1\" fill=\"#1864AB\"";
        assert_eq!(picture.matches(up).count(), 5 + 1, "with the legend's");
        assert_eq!(picture.matches("stroke=\"#C2410C\" stroke-width=\"2\"").count(), 5 + 1);
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
        let points = points(|count| (count - 3450.0) / 22_500.0);
        let picture = svg(Actuator::PistonRr, &points, None, Ok(""));
        // Each text has a line of its own.
        let texts: Vec<&str> = picture.lines().filter(|line| !line.starts_with('<')).collect();
        for labels in [&["3300", "3400", "3500"][..], &["−0.02", "−0.01", "0", "0.01", "0.02"]] {
            assert!(texts.windows(labels.len()).any(|part| part == labels), "{texts:?}");
        }
        assert!(!texts.contains(&"2900") && !texts.contains(&"4000") && !texts.contains(&"0.03"));
    }
}
