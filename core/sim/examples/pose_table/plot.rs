//! The drawing: on the left one drive from above, on the right how far all of them are off over time.

use crate::fixed::{Drive, Moment};
use plotters::coord::Shift;
use plotters::data::fitting_range;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::path::Path;
use xtb_control::frames::MapPose;

const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
const GRID: RGBColor = RGBColor(0xcc, 0xcc, 0xcc);
const WITH: RGBColor = RGBColor(0x1f, 0x5f, 0xbf);
const WITHOUT: RGBColor = RGBColor(0xc4, 0x56, 0x0a);
const ASKED: RGBColor = RGBColor(0x2a, 0x7d, 0x2a);
/// Of all words; the size in pixels, times 1.24.
const FONT: (&str, i32) = ("sans-serif", 15);

/// The drive that is shown from above, and how much of it.
const SHOWN: usize = 4;
const SHOWN_S: f64 = 150.0;
/// The panel on the right: one time bin for each point, in s.
const BIN_S: f64 = 2.0;
/// What it shows, in m, and what is asked for.
const OFF_M: std::ops::Range<f64> = 0.005..30.0;
const ASKED_M: f64 = 0.08;

type Panel<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

pub(crate) fn draw(file: &Path, drives: &[Drive]) -> Drawn {
    let root = SVGBackend::new(file, (940, 470)).into_drawing_area();
    root.fill(&WHITE)?;
    let (left, right) = root.split_horizontally(480);
    from_above(&left, &drives[SHOWN])?;
    over_time(&right, drives)?;
    root.present()
}

fn from_above(panel: &Panel<'_>, drive: &Drive) -> Drawn {
    let way = |of: fn(&Moment) -> MapPose| -> Vec<(f64, f64)> {
        let moments = drive.moments.iter().take_while(|m| m.t_s <= SHOWN_S).step_by(4);
        moments.map(of).map(|pose| (pose.x_m, pose.y_m)).collect()
    };
    let ways = [
        ("true way", way(|m| m.truth), INK.mix(0.35).stroke_width(4)),
        ("odometry alone", way(|m| m.odometry), WITHOUT.stroke_width(2)),
        ("filter with 2 fixes a second", way(|m| m.estimate.pose), WITH.stroke_width(2)),
    ];
    let start = ways[0].1[0];
    let (x, y): (Vec<f64>, Vec<f64>) = ways.iter().flat_map(|(_, way, _)| way).copied().unzip();
    let (x, y) = (fitting_range(&x), fitting_range(&y));
    // The same scale on both axes; the legend has room above, the bar of one metre below.
    let (wide, high) = panel.dim_in_pixel();
    let (wide, high) = (f64::from(wide), f64::from(high));
    let px_m = ((x.end - x.start) / (wide - 50.0)).max((y.end - y.start) / (high - 150.0));
    let (west, north) = (x.start - 25.0 * px_m, y.end + 90.0 * px_m);
    let south = north - high * px_m;
    let mut chart = ChartBuilder::on(panel).build_cartesian_2d(west..west + wide * px_m, south..north)?;
    for (name, way, style) in ways {
        let end = way.last().copied();
        chart
            .draw_series(LineSeries::new(way, style))?
            .label(name)
            .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 24, y)], style));
        chart.draw_series(end.map(|end| Circle::new(end, 4, style.filled())))?;
    }
    for style in [WHITE.filled(), INK.stroke_width(1)] {
        chart.plotting_area().draw(&Circle::new(start, 4, style))?;
    }
    let (foot, tip, right) = (south + 20.0 * px_m, south + 25.0 * px_m, x.start + 1.0);
    let bar = vec![(x.start, tip), (x.start, foot), (right, foot), (right, tip)];
    chart.plotting_area().draw(&PathElement::new(bar, INK.stroke_width(2)))?;
    let words = format!("1 m; {SHOWN_S} s of one drive, ○ start, ● end");
    let style = FONT.into_font().color(&INK).pos(Pos::new(HPos::Left, VPos::Center));
    chart.plotting_area().draw(&Text::new(words, (right + 8.0 * px_m, foot), style))?;
    chart.configure_series_labels().position(SeriesLabelPosition::UpperLeft).label_font(FONT).draw()
}

fn over_time(panel: &Panel<'_>, drives: &[Drive]) -> Drawn {
    let end_s = drives[0].moments.last().map_or(1.0, |m| m.t_s);
    let minutes = end_s / 60.0;
    let mut chart = ChartBuilder::on(panel)
        .margin(16)
        .caption(format!("pose off by, {} trucks: — median, ‑ ‑ 95 %", drives.len()), FONT)
        .x_label_area_size(44)
        .y_label_area_size(54)
        .build_cartesian_2d(0.0..minutes, OFF_M.log_scale().with_key_points(vec![0.01, 0.1, 1.0, 10.0]))?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .label_style(FONT)
        .x_label_formatter(&|minute: &f64| format!("{minute:.0}"))
        .y_label_formatter(&|m: &f64| {
            if *m < 1.0 { format!("{:.0} cm", m * 100.0) } else { format!("{m} m") }
        })
        .x_desc("minutes of driving")
        .draw()?;
    let asked = [(0.0, ASKED_M), (minutes, ASKED_M)];
    chart.draw_series(DashedLineSeries::new(asked, 6, 4, ASKED.stroke_width(1)))?;
    let style = FONT.into_font().color(&ASKED).pos(Pos::new(HPos::Right, VPos::Bottom));
    chart.plotting_area().draw(&Text::new("8 cm", (minutes, ASKED_M), style))?;
    for (of, colour) in [
        (Moment::odometry_error_m as fn(&Moment) -> f64, WITHOUT),
        (Moment::error_m as fn(&Moment) -> f64, WITH),
    ] {
        let style = colour.stroke_width(2);
        chart.draw_series(LineSeries::new(quantiles(drives, of, 0.5, end_s), style))?;
        chart.draw_series(DashedLineSeries::new(quantiles(drives, of, 0.95, end_s), 4, 3, style))?;
    }
    Ok(())
}

/// In each time bin, by minutes, the value that this part of all trucks' moments does not exceed.
fn quantiles(drives: &[Drive], of: fn(&Moment) -> f64, part: f64, end_s: f64) -> Vec<(f64, f64)> {
    let bins = libm::floor(end_s / BIN_S) as usize;
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); bins + 1];
    for moment in drives.iter().flat_map(|drive| &drive.moments) {
        values[(moment.t_s / BIN_S) as usize].push(of(moment));
    }
    let point = |(bin, mut all): (usize, Vec<f64>)| {
        all.sort_by(f64::total_cmp);
        let last = all.len().checked_sub(1)?;
        Some(((bin as f64 + 0.5) * BIN_S / 60.0, all[(part * last as f64) as usize].max(1e-4)))
    };
    values.into_iter().take(bins).enumerate().filter_map(point).collect()
}
