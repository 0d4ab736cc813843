//! The drawing: on the left one drive from above, on the right how far all of them are off over time.

use crate::fixed::{Drive, Moment};
use std::fmt::Write;
use xtb_control::frames::MapPose;

const WIDTH: f64 = 940.0;
const HEIGHT: f64 = 470.0;
const TRUE: &str = "stroke=\"#222\" stroke-width=\"3.5\" stroke-opacity=\"0.35\"";
const WITH: &str = "stroke=\"#1f5fbf\" stroke-width=\"1.4\"";
const WITHOUT: &str = "stroke=\"#c4560a\" stroke-width=\"1.4\"";

/// The drive that is shown from above, and how much of it.
const SHOWN: usize = 4;
const SHOWN_S: f64 = 150.0;

/// The panel on the right: one time bin of 2 s for each point.
const LEFT: f64 = 535.0;
const RIGHT: f64 = 920.0;
const TOP: f64 = 66.0;
const BOTTOM: f64 = 410.0;
const BIN_S: f64 = 2.0;
const DECADES: (f64, f64) = (-2.3, 1.5);

pub(crate) fn svg(drives: &[Drive]) -> String {
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" \
         height=\"{HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n\
         <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"#fff\"/>\n"
    );
    for (i, (name, style)) in
        [("true way", TRUE), ("filter with 2 fixes a second", WITH), ("odometry alone", WITHOUT)]
            .into_iter()
            .enumerate()
    {
        let x = 20.0 + [0.0, 115.0, 340.0][i];
        writeln!(svg, "<line x1=\"{x}\" y1=\"26\" x2=\"{}\" y2=\"26\" {style}/>", x + 34.0).unwrap();
        text(&mut svg, (x + 40.0, 30.0), "", name);
    }
    from_above(&mut svg, &drives[SHOWN]);
    over_time(&mut svg, drives);
    svg + "</svg>\n"
}

fn from_above(svg: &mut String, drive: &Drive) {
    let moments: Vec<&Moment> = drive.moments.iter().take_while(|m| m.t_s <= SHOWN_S).step_by(4).collect();
    let ways: [Vec<MapPose>; 3] = [
        moments.iter().map(|m| m.truth).collect(),
        moments.iter().map(|m| m.odometry).collect(),
        moments.iter().map(|m| m.estimate.pose).collect(),
    ];
    let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
    for pose in ways.iter().flatten() {
        for (axis, v) in [pose.x_m, pose.y_m].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(v), high[axis].max(v));
        }
    }
    let scale = (450.0 / (high[0] - low[0])).min((BOTTOM - TOP - 10.0) / (high[1] - low[1]));
    let px = |p: &MapPose| (24.0 + (p.x_m - low[0]) * scale, TOP + 5.0 + (high[1] - p.y_m) * scale);
    for (way, style) in ways.iter().zip([TRUE, WITHOUT, WITH]) {
        polyline(svg, &way.iter().map(px).collect::<Vec<_>>(), style);
    }
    for (way, colour) in ways.iter().zip(["#222", "#c4560a", "#1f5fbf"]) {
        let Some((x, y)) = way.last().map(px) else { continue };
        writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{colour}\"/>").unwrap();
    }
    let (x, y) = px(&ways[0][0]);
    writeln!(svg, "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"#fff\" stroke=\"#222\"/>").unwrap();
    let foot = BOTTOM + 30.0;
    let style = "stroke=\"#222\" stroke-width=\"1.5\"";
    polyline(
        svg,
        &[(24.0, foot - 4.0), (24.0, foot), (24.0 + scale, foot), (24.0 + scale, foot - 4.0)],
        style,
    );
    text(svg, (32.0 + scale, foot + 3.0), "", &format!("1 m; {SHOWN_S} s of one drive, ○ start, ● end"));
}

fn over_time(svg: &mut String, drives: &[Drive]) {
    let end_s = drives[0].moments.last().map_or(1.0, |m| m.t_s);
    let x_px = |s: f64| LEFT + s / end_s * (RIGHT - LEFT);
    let y_px = |m: f64| {
        let part = (libm::log10(m) - DECADES.0) / (DECADES.1 - DECADES.0);
        BOTTOM - part.clamp(0.0, 1.0) * (BOTTOM - TOP)
    };
    for (m, label) in [(0.01, "1 cm"), (0.1, "10 cm"), (1.0, "1 m"), (10.0, "10 m")] {
        let y = y_px(m);
        polyline(svg, &[(LEFT, y), (RIGHT, y)], "stroke=\"#ccc\" stroke-width=\"0.7\"");
        text(svg, (LEFT - 6.0, y + 4.0), "text-anchor=\"end\"", label);
    }
    for minute in 0..=libm::floor(end_s / 60.0 + 0.01) as u32 {
        let x = x_px(60.0 * f64::from(minute));
        polyline(svg, &[(x, TOP), (x, BOTTOM)], "stroke=\"#ccc\" stroke-width=\"0.7\"");
        text(svg, (x, BOTTOM + 16.0), "text-anchor=\"middle\"", &minute.to_string());
    }
    let asked = y_px(0.08);
    polyline(
        svg,
        &[(LEFT, asked), (RIGHT, asked)],
        "stroke=\"#2a7d2a\" stroke-width=\"1\" stroke-dasharray=\"6 4\"",
    );
    text(svg, (RIGHT - 4.0, asked - 5.0), "text-anchor=\"end\" fill=\"#2a7d2a\"", "8 cm");
    for (of, colour) in [
        (Moment::odometry_error_m as fn(&Moment) -> f64, "#c4560a"),
        (Moment::error_m as fn(&Moment) -> f64, "#1f5fbf"),
    ] {
        for (part, dash) in [(0.5, "none"), (0.95, "4 3")] {
            let points: Vec<(f64, f64)> =
                quantiles(drives, of, part, end_s).into_iter().map(|(s, m)| (x_px(s), y_px(m))).collect();
            let style = format!("stroke=\"{colour}\" stroke-width=\"1.6\" stroke-dasharray=\"{dash}\"");
            polyline(svg, &points, &style);
        }
    }
    let frame = [(LEFT, TOP), (RIGHT, TOP), (RIGHT, BOTTOM), (LEFT, BOTTOM), (LEFT, TOP)];
    polyline(svg, &frame, "stroke=\"#888\" stroke-width=\"1\"");
    let title = format!("pose off by, {} trucks: — median, ‑ ‑ 95 %", drives.len());
    text(svg, (LEFT, TOP - 8.0), "", &title);
    text(svg, ((LEFT + RIGHT) / 2.0, BOTTOM + 34.0), "text-anchor=\"middle\"", "minutes of driving");
}

/// In each time bin the value that this part of all trucks' moments does not exceed.
fn quantiles(drives: &[Drive], of: fn(&Moment) -> f64, part: f64, end_s: f64) -> Vec<(f64, f64)> {
    let bins = libm::floor(end_s / BIN_S) as usize;
    let mut values: Vec<Vec<f64>> = vec![Vec::new(); bins + 1];
    for moment in drives.iter().flat_map(|drive| &drive.moments) {
        values[(moment.t_s / BIN_S) as usize].push(of(moment));
    }
    let point = |(bin, mut all): (usize, Vec<f64>)| {
        all.sort_by(f64::total_cmp);
        let last = all.len().checked_sub(1)?;
        Some(((bin as f64 + 0.5) * BIN_S, all[(part * last as f64) as usize].max(1e-4)))
    };
    values.into_iter().take(bins).enumerate().filter_map(point).collect()
}

fn polyline(svg: &mut String, points: &[(f64, f64)], style: &str) {
    let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    writeln!(svg, "<polyline fill=\"none\" {style} points=\"{}\"/>", points.join(" ")).unwrap();
}

fn text(svg: &mut String, (x, y): (f64, f64), style: &str, words: &str) {
    writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{words}</text>").unwrap();
}
