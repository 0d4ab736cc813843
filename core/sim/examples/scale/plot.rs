//! Core time of a robot-second over the number of robots.

use crate::Row;
use plotters::prelude::*;
use std::path::Path;

const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
const GRID: RGBColor = RGBColor(0xcc, 0xcc, 0xcc);
const MEASURED: RGBColor = RGBColor(0x1f, 0x5f, 0xbf);
const WANTED: RGBColor = RGBColor(0x2a, 0x7d, 0x2a);
/// The size in pixels, times 1.24.
const FONT: (&str, i32) = ("sans-serif", 18);
/// The most that a robot-second shall cost, in µs.
const WANTED_US: f64 = 150.0;

pub(crate) fn draw(file: &Path, rows: &[Row]) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let root = SVGBackend::new(file, (720, 400)).into_drawing_area();
    root.fill(&WHITE)?;
    let most_us = rows.iter().map(|row| row.us[2]).fold(WANTED_US, f64::max) * 1.2;
    let (first, last) = (rows[0].robots as f64, rows[rows.len() - 1].robots as f64);
    let mut chart = ChartBuilder::on(&root)
        .margin(16)
        .x_label_area_size(48)
        .y_label_area_size(70)
        .build_cartesian_2d((first * 0.8..last * 1.25).log_scale(), 0.0..most_us)?;
    chart
        .configure_mesh()
        .x_desc("robots")
        .y_desc("core-µs a robot-second")
        .x_label_formatter(&|robots| format!("{robots:.0}"))
        .y_label_formatter(&|us| format!("{us:.0}"))
        .label_style(FONT)
        .light_line_style(TRANSPARENT)
        .bold_line_style(GRID)
        .axis_style(INK)
        .draw()?;
    let wanted = [first * 0.8, last * 1.25].map(|robots| (robots, WANTED_US));
    chart.draw_series(LineSeries::new(wanted, WANTED.stroke_width(2)))?;
    let at = |of: usize| rows.iter().map(move |row| (row.robots as f64, row.us[of]));
    chart.draw_series(LineSeries::new(at(1), MEASURED.stroke_width(3)))?;
    let spans = rows.iter().map(|row| {
        let at = |us: f64| (row.robots as f64, us);
        PathElement::new(vec![at(row.us[0]), at(row.us[2])], MEASURED.stroke_width(2))
    });
    chart.draw_series(spans)?;
    chart.draw_series(at(1).map(|at| Circle::new(at, 4, MEASURED.filled())))?;
    root.present()
}
