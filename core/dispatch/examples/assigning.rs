//! How long one round of assignment takes, and how near it is to the best: the table and the plot of
//! docs/dispatch.md. `cargo run -p xtb-dispatch --example assigning [SVG]`
//!
//! Exit code 1 if a round took longer than [`LIMIT_MS`].

#![allow(clippy::print_stdout)]

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;
use xtb_dispatch::OpenTravelCost;
use xtb_dispatch::assign::{Candidate, Demand, assign};
use xtb_nav::rooms::Draw;
use xtb_nav::{Car, Gears, MapPose};
use xtb_protocol::messages::{TaskId, Waypoint};

const CAR: Car = Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.4, gears: Gears::BOTH };
const ROBOTS: [usize; 7] = [10, 20, 50, 100, 200, 500, 1000];
const TASKS: [usize; 3] = [100, 1000, 10_000];
const COLOURS: [RGBColor; 3] = [RGBColor(0, 0x72, 0xb2), RGBColor(0xe6, 0x9f, 0), RGBColor(0xd5, 0x5e, 0)];

/// Ten thousand tasks and a thousand robots take less than a second.
const LIMIT_MS: f64 = 1000.0;

/// Which number of tasks, whether from one depot, and ms by robots.
type Line = (usize, bool, Vec<(usize, f64)>);

/// Robots over a field of 100 × 100 m, or all in one corner of it; one level of tasks.
fn round_ms(robots: usize, tasks: usize, depot: bool) -> f64 {
    let mut draw = Draw::new(1);
    let reach_m = if depot { 2.0 } else { 50.0 };
    let robots: Vec<Candidate> = (0..robots)
        .map(|_| {
            let (x_m, y_m) = (draw.uniform(-reach_m, reach_m), draw.uniform(-reach_m, reach_m));
            Candidate { pose: MapPose { x_m, y_m, yaw_rad: draw.uniform(-3.0, 3.0) }, car: CAR, extra_m: 0.0 }
        })
        .collect();
    let tasks: Vec<Demand> = (0..tasks)
        .map(|i| {
            let (x_m, y_m) = (draw.uniform(-50.0, 50.0), draw.uniform(-50.0, 50.0));
            Demand { id: TaskId::new(i as u64), level: 5, first: Some(Waypoint { x_m, y_m, yaw_rad: None }) }
        })
        .collect();
    let best = (0..3).map(|_| {
        let start = Instant::now();
        let pairs = assign(&tasks, &robots, &OpenTravelCost, &|_, _| Some(0.0));
        assert_eq!(pairs.len(), tasks.len().min(robots.len()));
        start.elapsed().as_secs_f64() * 1000.0
    });
    best.fold(f64::INFINITY, f64::min)
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    println!("| robots | tasks | spread, ms | one depot, ms |\n| ---: | ---: | ---: | ---: |");
    let mut lines: Vec<Line> = Vec::new();
    for (i, tasks) in TASKS.into_iter().enumerate() {
        let (mut spread, mut depot) = (Vec::new(), Vec::new());
        for robots in ROBOTS {
            let took = [false, true].map(|depot| round_ms(robots, tasks, depot));
            println!("| {robots} | {tasks} | {:.1} | {:.1} |", took[0], took[1]);
            spread.push((robots, took[0]));
            depot.push((robots, took[1]));
        }
        lines.extend([(i, false, spread), (i, true, depot)]);
    }
    if let Some(path) = std::env::args().nth(1) {
        plot(&path, &lines)?;
    }
    let longest_ms = lines.iter().flat_map(|(_, _, took)| took).map(|(_, ms)| *ms).fold(0.0, f64::max);
    println!("\nlongest: {longest_ms:.1} ms of at most {LIMIT_MS}");
    Ok(if longest_ms < LIMIT_MS { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Both axes logarithmic: robots 10 to 1000, 0.1 to 10,000 ms.
fn plot(file: &str, lines: &[Line]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::new(file, (720, 390)).into_drawing_area();
    root.fill(&WHITE)?;
    let robots = (10.0..1000.0_f64).log_scale().with_key_points(vec![10.0, 100.0, 1000.0]);
    let ms = (0.1..10_000.0_f64).log_scale();
    let ms = ms.with_key_points(vec![0.1, 1.0, 10.0, 100.0, 1000.0, 10_000.0]);
    let mut chart = ChartBuilder::on(&root)
        .margin(10)
        .margin_right(120)
        .x_label_area_size(50)
        .y_label_area_size(70)
        .build_cartesian_2d(robots, ms)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .bold_line_style(RGBColor(0xdd, 0xdd, 0xdd))
        .label_style(("sans-serif", 15))
        .x_label_formatter(&|robots: &f64| format!("{robots} robots"))
        .y_label_formatter(&|ms: &f64| format!("{ms} ms"))
        .x_desc("one round of assignment; dashed: all robots in one place")
        .draw()?;
    for (i, depot, took) in lines {
        let points: Vec<(f64, f64)> = took.iter().map(|(n, ms)| (*n as f64, ms.max(0.1))).collect();
        let style = COLOURS[*i].stroke_width(2);
        if *depot {
            chart.draw_series(DashedLineSeries::new(points, 5, 4, style))?;
        } else {
            if let Some(last) = points.last() {
                let (x, y) = chart.backend_coord(last);
                let font = ("sans-serif", 15).into_font().color(&COLOURS[*i]);
                let font = font.pos(Pos::new(HPos::Left, VPos::Center));
                root.draw_text(&format!("{} tasks", TASKS[*i]), &font, (x + 10, y))?;
            }
            chart.draw_series(LineSeries::new(points, style))?;
        }
    }
    root.present()?;
    Ok(())
}
