//! The plot of docs/first-level.md, docs/levelling.svg: both platform controllers on a slope.
//! Prints the settle times as a table. `cargo run -p xtb-sim --example level_plot`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/levelling.rs"]
mod levelling;

use levelling::{LEVEL_DEG, Levelling, on_slope};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use std::f64::consts::PI;
use std::path::Path;
use xtb_control::vehicle::Platform;

const SLOPE_DEG: f64 = 4.0;
/// The slope of the plot rises ahead and a little to the left: both axes have work to do.
const BEARING_RAD: f64 = PI / 6.0;
const TRUCKS: u64 = 25;
/// With the colour, dash and gap in pixels of their lines; the first one's dash never ends.
const CONTROLLERS: [(Platform, &str, RGBColor, [i32; 2]); 2] = [
    (Platform::Balance, "balance controller (§4.8.3)", RGBColor(0x1f, 0x5f, 0xbf), [10_000, 0]),
    (Platform::Pid, "platform PID (§4.8.2)", RGBColor(0xc4, 0x56, 0x0a), [7, 3]),
];
const LEVEL: RGBAColor = RGBAColor(0x2a, 0x8a, 0x2a, 0.18);
const GRID: RGBColor = RGBColor(0xcc, 0xcc, 0xcc);
/// What the plot shows.
const LONGEST_S: f64 = 1.5;
const LEAST_DEG: f64 = -4.5;
const MOST_DEG: f64 = 1.5;

fn main() {
    println!(
        "| controller | runs | settled after: least | median | most | left: most | pushed an end stop |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (controller, name, ..) in CONTROLLERS {
        row(controller, name);
    }
    let courses = CONTROLLERS
        .map(|(controller, ..)| Levelling::watch(on_slope(controller, SLOPE_DEG, BEARING_RAD, 2), 6.0));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/levelling.svg");
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    draw(&path, &courses).unwrap();
    println!("\n{}", path.canonicalize().unwrap().display());
}

/// Each truck in eight directions.
fn row(controller: Platform, name: &str) {
    let (mut settled, mut runs, mut left_deg, mut pushes) = (Vec::new(), 0, 0.0_f64, 0);
    for (seed, i) in (0..TRUCKS).flat_map(|seed| (0..8).map(move |i| (seed, i))) {
        let bench = on_slope(controller, SLOPE_DEG, f64::from(i) * PI / 4.0, seed);
        let levelling = Levelling::watch(bench, 15.0);
        let (_, x_deg, y_deg) = *levelling.course.last().unwrap();
        runs += 1;
        left_deg = left_deg.max(x_deg.abs()).max(y_deg.abs());
        pushes += levelling.end_stop_pushes;
        settled.extend(levelling.settled_s());
    }
    settled.sort_by(f64::total_cmp);
    assert_eq!(settled.len(), runs, "all settle");
    let at = |part: usize| settled[part * (settled.len() - 1) / 2];
    println!(
        "| {name} | {runs} | {:.2} s | {:.2} s | {:.2} s | {left_deg:.2}° | {pushes} times |",
        at(0),
        at(1),
        at(2)
    );
}

/// Pitch above, roll below.
fn draw(file: &Path, courses: &[Levelling; 2]) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    let root = SVGBackend::new(file, (900, 640)).into_drawing_area();
    root.fill(&WHITE)?;
    for (axis, panel) in root.split_evenly((2, 1)).iter().enumerate() {
        let mut chart = ChartBuilder::on(panel)
            .margin(12)
            .x_label_area_size(46)
            .y_label_area_size(56)
            .build_cartesian_2d(0.0..LONGEST_S, LEAST_DEG..MOST_DEG)?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .label_style(("sans-serif", 16))
            .x_labels(8)
            .y_labels(7)
            .x_label_formatter(&|s: &f64| format!("{s:.1}"))
            .y_label_formatter(&|deg: &f64| (deg.round() as i32).to_string().replace('-', "−"))
            .x_desc("time since the first reading in s")
            .y_desc(["pitch Φx in °", "roll Φy in °"][axis])
            .draw()?;
        let band = Rectangle::new([(0.0, -LEVEL_DEG), (LONGEST_S, LEVEL_DEG)], LEVEL.filled());
        chart
            .draw_series([band])?
            .label(format!("level: ±{LEVEL_DEG}° (both axes)"))
            .legend(|(x, y)| Rectangle::new([(x, y - 6), (x + 24, y + 6)], LEVEL.filled()));
        for (course, (_, name, colour, [dash, gap])) in courses.iter().zip(CONTROLLERS) {
            let shown = course.course.iter().take_while(|(s, ..)| *s <= LONGEST_S);
            let line: Vec<(f64, f64)> = shown.map(|&(s, x_deg, y_deg)| (s, [x_deg, y_deg][axis])).collect();
            let (thick, thin) = (colour.stroke_width(2), colour.stroke_width(1));
            let settled_s = course.settled_s().unwrap();
            chart
                .draw_series(DashedLineSeries::new(line, dash, gap, thick))?
                .label(format!("{name}, settled: {settled_s:.2} s"))
                .legend(move |(x, y)| DashedPathElement::new(vec![(x, y), (x + 24, y)], dash, gap, thick));
            let upright = [(settled_s, LEAST_DEG), (settled_s, MOST_DEG)];
            chart.draw_series(DashedLineSeries::new(upright, dash, gap, thin))?;
        }
        if axis == 0 {
            let mut legend = chart.configure_series_labels();
            legend.position(SeriesLabelPosition::LowerRight).label_font(("sans-serif", 16)).draw()?;
        }
    }
    root.present()
}
