//! How long one round of assignment takes, and how near it is to the best: the table and the plot of
//! docs/dispatch.md. `cargo run -p xtb-dispatch --example assigning [SVG]`
//!
//! Exit code 1 if a round took longer than [`LIMIT_MS`].

#![allow(clippy::print_stdout)]

use std::fmt::Write as _;
use std::process::ExitCode;
use std::time::Instant;
use xtb_dispatch::OpenTravelCost;
use xtb_dispatch::assign::{Candidate, Demand, assign};
use xtb_nav::MapPose;
use xtb_nav::rooms::Draw;
use xtb_protocol::messages::{TaskId, Waypoint};

const TRAVEL_COST: OpenTravelCost = OpenTravelCost { radius_m: 0.4 };
const ROBOTS: [usize; 7] = [10, 20, 50, 100, 200, 500, 1000];
const TASKS: [usize; 3] = [100, 1000, 10_000];
const COLOURS: [&str; 3] = ["#0072b2", "#e69f00", "#d55e00"];

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
            Candidate { pose: MapPose { x_m, y_m, yaw_rad: draw.uniform(-3.0, 3.0) }, extra_m: 0.0 }
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
        let pairs = assign(&tasks, &robots, &TRAVEL_COST, &|_, _| Some(0.0));
        assert_eq!(pairs.len(), tasks.len().min(robots.len()));
        start.elapsed().as_secs_f64() * 1000.0
    });
    best.fold(f64::INFINITY, f64::min)
}

fn main() -> std::io::Result<ExitCode> {
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
        std::fs::write(path, plot(&lines))?;
    }
    let longest_ms = lines.iter().flat_map(|(_, _, took)| took).map(|(_, ms)| *ms).fold(0.0, f64::max);
    println!("\nlongest: {longest_ms:.1} ms of at most {LIMIT_MS}");
    Ok(if longest_ms < LIMIT_MS { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Both axes logarithmic: robots 10 to 1000, 0.1 to 10,000 ms.
fn plot(lines: &[Line]) -> String {
    let x = |robots: f64| 60.0 + 260.0 * (robots.log10() - 1.0);
    let y = |ms: f64| 340.0 - 60.0 * (ms.max(0.1).log10() + 1.0);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"720\" height=\"390\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"720\" height=\"390\" fill=\"white\"/>\n",
    );
    for power in -1..=4 {
        let ms = 10_f64.powi(power);
        let _ = writeln!(
            svg,
            "<path d=\"M60 {0} H580\" stroke=\"#ddd\"/><text x=\"54\" y=\"{1}\" text-anchor=\"end\">{ms} ms</text>",
            y(ms),
            y(ms) + 4.0
        );
    }
    for robots in [10, 100, 1000] {
        let at = x(f64::from(robots));
        let _ = writeln!(svg, "<text x=\"{at}\" y=\"360\" text-anchor=\"middle\">{robots} robots</text>");
    }
    for (i, depot, points) in lines {
        let path: Vec<String> =
            points.iter().map(|(robots, ms)| format!("{:.1} {:.1}", x(*robots as f64), y(*ms))).collect();
        let dash = if *depot { " stroke-dasharray=\"5 4\"" } else { "" };
        let _ = writeln!(
            svg,
            "<path d=\"M{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"{dash}/>",
            path.join(" L"),
            COLOURS[*i]
        );
        if let (Some((_, ms)), false) = (points.last(), depot) {
            let _ = writeln!(
                svg,
                "<text x=\"590\" y=\"{:.1}\" fill=\"{}\">{} tasks</text>",
                y(*ms) + 4.0,
                COLOURS[*i],
                TASKS[*i]
            );
        }
    }
    svg + "<text x=\"60\" y=\"382\">one round of assignment; dashed: all robots in one place</text>\n</svg>\n"
}
