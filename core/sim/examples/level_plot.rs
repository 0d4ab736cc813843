//! The plot of docs/first-level.md, docs/levelling.svg: both platform controllers on a slope.
//! Prints the settle times as a table. `cargo run -p xtb-sim --example level_plot`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../tests/it/agent.rs"]
mod agent;
#[path = "../tests/it/levelling.rs"]
mod levelling;

use levelling::{LEVEL_DEG, Levelling, on_slope};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;
use xtb_control::vehicle::Platform;

const SLOPE_DEG: f64 = 4.0;
/// The slope of the plot rises ahead and a little to the left: both axes have work to do.
const BEARING_RAD: f64 = PI / 6.0;
const TRUCKS: u64 = 25;
const CONTROLLERS: [(Platform, &str, &str); 2] = [
    (Platform::Balance, "balance controller (§4.8.3)", "stroke=\"#1f5fbf\""),
    (Platform::Pid, "platform PID (§4.8.2)", "stroke=\"#c4560a\" stroke-dasharray=\"7 3\""),
];

fn main() {
    println!(
        "| controller | runs | settled after: least | median | most | left: most | pushed an end stop |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (controller, name, _) in CONTROLLERS {
        row(controller, name);
    }
    let courses = CONTROLLERS
        .map(|(controller, ..)| Levelling::watch(on_slope(controller, SLOPE_DEG, BEARING_RAD, 2), 6.0));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/levelling.svg");
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, svg(&courses)).unwrap();
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

/// A panel's place and scales, in pixels.
const LEFT: f64 = 62.0;
const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 170.0;
const TOPS: [f64; 2] = [62.0, 252.0];
const LONGEST_S: f64 = 1.5;
const LEAST_DEG: f64 = -4.5;
const MOST_DEG: f64 = 1.5;

fn x_px(s: f64) -> f64 {
    LEFT + s / LONGEST_S * WIDTH
}

fn y_px(top: f64, deg: f64) -> f64 {
    top + (MOST_DEG - deg) / (MOST_DEG - LEAST_DEG) * HEIGHT
}

fn svg(courses: &[Levelling; 2]) -> String {
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 690 480\" width=\"690\" height=\"480\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n\
         <rect width=\"690\" height=\"480\" fill=\"#fff\"/>\n",
    );
    for (i, (_, name, stroke)) in CONTROLLERS.iter().enumerate() {
        let x = LEFT + 4.0 + 205.0 * i as f64;
        line(&mut svg, (x, 30.0), (x + 32.0, 30.0), &format!("{stroke} stroke-width=\"2\""));
        text(&mut svg, (x + 38.0, 34.0), "", name);
    }
    let x = LEFT + 4.0 + 410.0;
    rect(&mut svg, (x, 22.0), (32.0, 16.0), "fill=\"#d8ecd8\"");
    text(&mut svg, (x + 38.0, 34.0), "", &format!("level: ±{LEVEL_DEG}° (both axes)"));
    for (panel, top) in TOPS.into_iter().enumerate() {
        axes(&mut svg, top, ["pitch Φx in °", "roll Φy in °"][panel]);
        for (course, (_, _, stroke)) in courses.iter().zip(CONTROLLERS) {
            curve(&mut svg, top, course, panel, stroke);
        }
    }
    let foot = TOPS[1] + HEIGHT;
    for tick in 0..=6 {
        let s = 0.25 * f64::from(tick);
        text(&mut svg, (x_px(s), foot + 17.0), "text-anchor=\"middle\"", &format!("{s}"));
    }
    text(
        &mut svg,
        (LEFT + WIDTH / 2.0, foot + 36.0),
        "text-anchor=\"middle\"",
        "time since the first reading in s",
    );
    svg + "</svg>\n"
}

fn axes(svg: &mut String, top: f64, title: &str) {
    let band = (y_px(top, LEVEL_DEG), y_px(top, -LEVEL_DEG));
    rect(svg, (LEFT, band.0), (WIDTH, band.1 - band.0), "fill=\"#d8ecd8\"");
    for deg in -4..=1 {
        let y = y_px(top, f64::from(deg));
        line(svg, (LEFT, y), (LEFT + WIDTH, y), "stroke=\"#ccc\" stroke-width=\"0.5\"");
        text(svg, (LEFT - 7.0, y + 4.0), "text-anchor=\"end\"", &deg.to_string().replace('-', "−"));
    }
    for tick in 0..=6 {
        let x = x_px(0.25 * f64::from(tick));
        line(svg, (x, top), (x, top + HEIGHT), "stroke=\"#ccc\" stroke-width=\"0.5\"");
    }
    rect(svg, (LEFT, top), (WIDTH, HEIGHT), "fill=\"none\" stroke=\"#888\"");
    let place = (18.0, top + HEIGHT / 2.0);
    let turned = format!("text-anchor=\"middle\" transform=\"rotate(-90 {} {})\"", place.0, place.1);
    text(svg, place, &turned, title);
}

fn curve(svg: &mut String, top: f64, course: &Levelling, axis: usize, stroke: &str) {
    let mut points = Vec::new();
    for &(s, x_deg, y_deg) in course.course.iter().take_while(|(s, ..)| *s <= LONGEST_S) {
        points.push(format!("{:.1},{:.1}", x_px(s), y_px(top, [x_deg, y_deg][axis])));
    }
    let points = points.join(" ");
    writeln!(svg, "<polyline fill=\"none\" {stroke} stroke-width=\"2\" points=\"{points}\"/>").unwrap();
    if let Some(settled_s) = course.settled_s() {
        let x = x_px(settled_s);
        line(svg, (x, top), (x, top + HEIGHT), &format!("{stroke} stroke-width=\"1\""));
        if axis == 0 {
            let (side, anchor, who) =
                if stroke.contains("dash") { (6.0, "start", "PID") } else { (-6.0, "end", "balance") };
            let anchor = format!("text-anchor=\"{anchor}\"");
            text(svg, (x + side, top + HEIGHT - 10.0), &anchor, &format!("{who} settled: {settled_s:.2} s"));
        }
    }
}

fn line(svg: &mut String, from: (f64, f64), to: (f64, f64), style: &str) {
    let ((x1, y1), (x2, y2)) = (from, to);
    writeln!(svg, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}/>").unwrap();
}

fn rect(svg: &mut String, (x, y): (f64, f64), (width, height): (f64, f64), style: &str) {
    writeln!(svg, "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" {style}/>")
        .unwrap();
}

fn text(svg: &mut String, (x, y): (f64, f64), style: &str, words: &str) {
    writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{words}</text>").unwrap();
}
