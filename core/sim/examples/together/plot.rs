//! The drawing: the true ways of all trucks from above, with the bodies every few seconds.

use crate::meetings::Meeting;
use std::fmt::Write;
use xtb_control::frames::MapPose;

/// Pixels a metre, and around the room.
const SCALE: f64 = 80.0;
const EDGE: f64 = 20.0;
/// Room, in m.
const SIDE_M: f64 = 8.0;
/// Half of the body, in m.
const HALF_M: (f64, f64) = (0.25, 0.20);
/// Bodies are drawn at each 25th moment: each 5 s.
const EVERY: usize = 25;

/// Of the trucks.
const COLOURS: [&str; 10] = [
    "#1f5fbf", "#c4560a", "#2a8a3a", "#b3261e", "#7a4fb5", "#7a5230", "#c03a92", "#5f6b73", "#8f8f00",
    "#0a8f9c",
];

/// One room of [`SIDE_M`] around the origin.
pub(crate) fn svg(made: &Meeting) -> String {
    let size = SIDE_M * SCALE + 2.0 * EDGE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {size} {height}\" width=\"{size}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n\
         <rect width=\"{size}\" height=\"{height}\" fill=\"#fff\"/>\n\
         <rect x=\"{EDGE}\" y=\"{EDGE}\" width=\"{side}\" height=\"{side}\" fill=\"none\" stroke=\"#222\" \
         stroke-width=\"3\"/>\n",
        height = size + 24.0,
        side = SIDE_M * SCALE,
    );
    let trucks = made.tracks.len();
    for (index, track) in made.tracks.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let points: String =
            track.iter().map(|pose| px(pose, 0.0, 0.0)).fold(String::new(), |mut all, (x, y)| {
                write!(all, "{x:.1},{y:.1} ").unwrap();
                all
            });
        let style = format!("fill=\"none\" stroke=\"{colour}\"");
        writeln!(svg, "<polyline points=\"{points}\" {style} stroke-width=\"2\"/>").unwrap();
        for pose in track.iter().step_by(EVERY) {
            body(&mut svg, pose, &format!("{style} stroke-width=\"1\" stroke-opacity=\"0.45\""));
        }
        let (first, last) = (track[0], track[track.len() - 1]);
        body(&mut svg, &first, &format!("{style} stroke-width=\"2\" stroke-dasharray=\"4 3\""));
        body(
            &mut svg,
            &last,
            &format!("fill=\"{colour}\" fill-opacity=\"0.35\" stroke=\"{colour}\" stroke-width=\"2\""),
        );
        let (x, y) = px(&last, 0.0, 0.0);
        writeln!(svg, "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>", y + 5.0, index + 1)
            .unwrap();
    }
    writeln!(
        svg,
        "<text x=\"{EDGE}\" y=\"{:.1}\">{trucks} trucks in {SIDE_M} × {SIDE_M} m swap places in {:.0} s, {} contacts; \
         dashed: start, filled: end, thin: each 5 s</text>",
        size + 8.0,
        made.took_s,
        made.contacts,
    )
    .unwrap();
    svg + "</svg>\n"
}

/// A point ahead of and to the left of a pose, on the drawing.
fn px(pose: &MapPose, ahead_m: f64, left_m: f64) -> (f64, f64) {
    let (sin, cos) = pose.yaw_rad.sin_cos();
    let (x_m, y_m) = (pose.x_m + ahead_m * cos - left_m * sin, pose.y_m + ahead_m * sin + left_m * cos);
    (EDGE + (x_m + SIDE_M / 2.0) * SCALE, EDGE + (SIDE_M / 2.0 - y_m) * SCALE)
}

/// The body, with a nose.
fn body(svg: &mut String, pose: &MapPose, style: &str) {
    let (length, width) = HALF_M;
    let corners = [(length, width), (-length, width), (-length, -width), (length, -width)];
    let mut points = String::new();
    for (ahead, left) in corners {
        let (x, y) = px(pose, ahead, left);
        write!(points, "{x:.1},{y:.1} ").unwrap();
    }
    writeln!(svg, "<polygon points=\"{points}\" {style}/>").unwrap();
    let ((x1, y1), (x2, y2)) = (px(pose, 0.15, 0.0), px(pose, 0.25, 0.0));
    writeln!(svg, "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}/>").unwrap();
}
