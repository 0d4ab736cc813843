//! Hundreds of robots under traffic control in a hall of 60 × 60 m: throughput, standstills and time for planning.
//!
//! `cargo run --release -p xtb-traffic --example hall -- run ROBOTS[,ROBOTS…] MINUTES SEED [FILE.csv]`: so many
//! robots with goals drawn at random for so many minutes of virtual time, one after the other; a line of CSV for
//! each, also added to the file. `hall plot FILE.csv FILE.svg` draws them.

#![allow(clippy::unwrap_used, clippy::print_stdout, dead_code)]

#[path = "../tests/coordinator/hall.rs"]
mod hall;
#[path = "../tests/coordinator/toy.rs"]
mod toy;

use hall::Hall;
use plotters::prelude::*;
use std::error::Error;
use std::io::Write as _;
use std::sync::OnceLock;
use std::time::Instant;

/// Side of the hall, in m.
const SIDE_M: f64 = 60.0;
/// One robot alone drives for so long, in min: what all others are compared with.
const ALONE_MIN: f64 = 120.0;
const HEADER: &str = "robots,minutes,seed,goals_per_robot_hour,alone_per_robot_hour,rounds,round_ms_p50,round_ms_p99,\
                      round_ms_max,round_nodes_p50,round_nodes_p99,round_nodes_max,turn_ms_p50,turn_ms_p99,\
                      longest_still_s,contacts,failed,outdated,cyclic,deadlocks,wall_s";

fn clock_ms() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64() * 1000.0
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["run", robots, minutes, seed] => run(robots, minutes, seed, None),
        ["run", robots, minutes, seed, file] => run(robots, minutes, seed, Some(file)),
        ["plot", csv, svg] => plot(csv, svg),
        _ => Err("hall run ROBOTS[,ROBOTS…] MINUTES SEED [FILE.csv] | hall plot FILE.csv FILE.svg".into()),
    }
}

fn run(robots: &str, minutes: &str, seed: &str, file: Option<&str>) -> Result<(), Box<dyn Error>> {
    let (minutes, seed): (f64, u64) = (minutes.parse()?, seed.parse()?);
    let mut alone = Hall::new(1, SIDE_M, seed, clock_ms);
    alone.run(ALONE_MIN);
    let alone = f64::from(alone.reached()) / (ALONE_MIN / 60.0);
    println!("{HEADER}");
    for robots in robots.split(',') {
        let robots: usize = robots.parse()?;
        let before_ms = clock_ms();
        let mut hall = Hall::new(robots, SIDE_M, seed, clock_ms);
        hall.run(minutes);
        let line = told(&hall, robots, minutes, seed, alone, (clock_ms() - before_ms) / 1000.0);
        println!("{line}");
        hall.longest_story.iter().for_each(|line| println!("# {line}"));
        for (reason, count) in &hall.failed {
            println!("# {count} goals failed: {reason}");
        }
        if let Some(file) = file {
            let is_new = !std::path::Path::new(file).exists();
            let mut csv = std::fs::OpenOptions::new().create(true).append(true).open(file)?;
            if is_new {
                writeln!(csv, "{HEADER}")?;
            }
            writeln!(csv, "{line}")?;
        }
    }
    Ok(())
}

fn told(hall: &Hall, robots: usize, minutes: f64, seed: u64, alone: f64, wall_s: f64) -> String {
    let world = &hall.world;
    let nodes: Vec<f64> = world.expansions.iter().map(|nodes| f64::from(*nodes)).collect();
    let part = |values: &[f64], part: f64| {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.get((sorted.len() as f64 * part) as usize).or(sorted.last()).copied().unwrap_or(0.0)
    };
    let rate = f64::from(hall.reached()) / (robots as f64 * minutes / 60.0);
    let counters = world.counters();
    format!(
        "{robots},{minutes},{seed},{rate:.2},{alone:.2},{},{:.0},{:.0},{:.0},{:.0},{:.0},{:.0},{:.2},{:.2},{:.1},{},{},{},{},{},{wall_s:.0}",
        world.jobs_ms.len(),
        part(&world.jobs_ms, 0.5),
        part(&world.jobs_ms, 0.99),
        part(&world.jobs_ms, 1.0),
        part(&nodes, 0.5),
        part(&nodes, 0.99),
        part(&nodes, 1.0),
        part(&world.turns_ms, 0.5),
        part(&world.turns_ms, 0.99),
        hall.longest_still_s,
        world.contacts,
        hall.failed.values().sum::<u32>(),
        counters.outdated,
        counters.cyclic,
        counters.deadlocks,
    )
}

/// What it is, its points, and its colour.
type Line = (&'static str, Vec<(f64, f64)>, RGBColor);

/// Throughput and time of rounds over the number of robots.
fn plot(csv: &str, svg: &str) -> Result<(), Box<dyn Error>> {
    let text = std::fs::read_to_string(csv)?;
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let rows: Vec<Vec<f64>> = lines
        .map(|line| line.split(',').map(str::parse).collect::<Result<_, _>>())
        .collect::<Result<_, _>>()?;
    let column = |name: &str| -> Result<Vec<(f64, f64)>, Box<dyn Error>> {
        let index = names.iter().position(|known| *known == name).ok_or("a column is missing")?;
        let mut points: Vec<(f64, f64)> = rows.iter().map(|row| (row[0], row[index])).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(points)
    };
    let root = SVGBackend::new(svg, (900, 360)).into_drawing_area();
    root.fill(&WHITE)?;
    let sides = root.split_evenly((1, 2));
    let goals = [
        ("goals per robot-hour", "goals_per_robot_hour", BLUE),
        ("one robot alone", "alone_per_robot_hour", BLACK),
    ];
    let rounds = [("median", "round_ms_p50", BLUE), ("99 %", "round_ms_p99", RED)];
    // Where the curves are not: goals fall, times rise.
    let (low, high) = (SeriesLabelPosition::LowerLeft, SeriesLabelPosition::UpperLeft);
    for (side, caption, series, at) in [
        (&sides[0], "Goals per robot-hour", goals, low),
        (&sides[1], "Time of a joint plan, ms", rounds, high),
    ] {
        let lines: Vec<Line> = series
            .into_iter()
            .map(|(label, name, colour)| Ok((label, column(name)?, colour)))
            .collect::<Result<_, Box<dyn Error>>>()?;
        let points = || lines.iter().flat_map(|(_, points, _)| points);
        let most = |of: fn(&(f64, f64)) -> f64| points().map(of).fold(1.0, f64::max) * 1.1;
        let mut chart = ChartBuilder::on(side)
            .caption(caption, ("sans-serif", 16))
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(46)
            .build_cartesian_2d(0.0..most(|point| point.0), 0.0..most(|point| point.1))?;
        chart.configure_mesh().x_desc("robots").light_line_style(WHITE).draw()?;
        for (label, points, colour) in &lines {
            let marks = points.iter().map(|point| Circle::new(*point, 3, colour.filled()));
            chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?.label(*label).legend(
                {
                    let colour = *colour;
                    move |(x, y)| PathElement::new(vec![(x, y), (x + 14, y)], colour.stroke_width(2))
                },
            );
            chart.draw_series(marks)?;
        }
        chart.configure_series_labels().position(at).background_style(WHITE).border_style(BLACK).draw()?;
    }
    root.present()?;
    Ok(())
}
