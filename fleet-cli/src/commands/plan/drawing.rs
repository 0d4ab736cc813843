//! A drawing of a schedule: obstacles, each robot's way in a colour of its own, where it begins
//! (outline) and where it ends (filled).

use std::fmt::Write;
use xtb_nav::{Car, MapPose};
use xtb_traffic::solver::{Obstacle, Problem, Schedule, Way};

/// Longer side of the drawing, in pixels.
const SIDE: f64 = 900.0;
const BORDER: f64 = 12.0;
/// Points of one step.
const POINTS: usize = 6;
/// Between two robots' colours; the golden angle never comes round to the same one.
const HUE_DEG: f64 = 137.508;

struct Canvas {
    west: f64,
    north: f64,
    scale: f64,
    svg: String,
}

/// The drawing as SVG.
pub(super) fn svg(problem: &Problem, schedule: &Schedule) -> String {
    let bounds = &problem.bounds;
    let (wide, deep) = (bounds.east_m - bounds.west_m, bounds.north_m - bounds.south_m);
    let scale = SIDE / wide.max(deep);
    let (width, height) = (wide * scale + 2.0 * BORDER, deep * scale + 2.0 * BORDER);
    let mut canvas = Canvas { west: bounds.west_m, north: bounds.north_m, scale, svg: String::new() };
    canvas.add(format_args!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\">"
    ));
    canvas.add(format_args!("<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>"));
    canvas.add(format_args!(
        "<rect x=\"{BORDER}\" y=\"{BORDER}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"#f6f7f9\" stroke=\"#9aa3ad\"/>",
        wide * scale,
        deep * scale
    ));
    for obstacle in &problem.obstacles {
        canvas.obstacle(obstacle);
    }
    for (index, (way, task)) in schedule.ways.iter().zip(&problem.cars).enumerate() {
        canvas.way(way, &task.car, &color(index));
    }
    canvas.add(format_args!("</svg>"));
    canvas.svg
}

impl Canvas {
    fn add(&mut self, line: std::fmt::Arguments<'_>) {
        // Writing into a string never fails.
        let _ = writeln!(self.svg, "{line}");
    }

    fn at(&self, [x, y]: [f64; 2]) -> (f64, f64) {
        (BORDER + (x - self.west) * self.scale, BORDER + (self.north - y) * self.scale)
    }

    fn points(&self, points: impl IntoIterator<Item = [f64; 2]>) -> String {
        let text = points.into_iter().map(|point| {
            let (x, y) = self.at(point);
            format!("{x:.1},{y:.1}")
        });
        text.collect::<Vec<_>>().join(" ")
    }

    fn obstacle(&mut self, obstacle: &Obstacle) {
        match *obstacle {
            Obstacle::Disc { x_m, y_m, radius_m } => {
                let ((x, y), r) = (self.at([x_m, y_m]), radius_m * self.scale);
                self.add(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{r:.1}\" fill=\"#5b6570\"/>"));
            }
            Obstacle::Box { middle, half_length_m, half_width_m } => {
                let shape = Car {
                    front_m: half_length_m,
                    rear_m: half_length_m,
                    half_width_m,
                    radius_m: f64::INFINITY,
                };
                let points = self.points(shape.corners(&middle));
                self.add(format_args!("<polygon points=\"{points}\" fill=\"#5b6570\"/>"));
            }
        }
    }

    fn way(&mut self, way: &Way, car: &Car, color: &str) {
        let (Some(first), Some(last)) = (way.rows.first(), way.rows.last()) else { return };
        let along = way.rows.iter().flat_map(|row| {
            (0..POINTS).map(|point| {
                let pose = row.piece.after(&row.pose, row.piece.length_m * point as f64 / POINTS as f64);
                [pose.x_m, pose.y_m]
            })
        });
        let points = self.points(along);
        self.add(format_args!(
            "<polyline points=\"{points}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"2\" stroke-linejoin=\"round\"/>"
        ));
        self.car(car, &first.pose, color, "0.12");
        self.car(car, &last.pose, color, "0.75");
        let (x, y) = self.at([last.pose.x_m, last.pose.y_m]);
        let name = escaped(&way.name);
        self.add(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" font-family=\"sans-serif\" font-size=\"11\" fill=\"#101418\">{name}</text>"
        ));
    }

    /// The body, with a line across its front.
    fn car(&mut self, car: &Car, pose: &MapPose, color: &str, opacity: &str) {
        let corners = car.corners(pose);
        let (outline, front) = (self.points(corners), self.points([corners[0], corners[3]]));
        self.add(format_args!(
            "<polygon points=\"{outline}\" fill=\"{color}\" fill-opacity=\"{opacity}\" stroke=\"{color}\"/>"
        ));
        self.add(format_args!("<polyline points=\"{front}\" stroke=\"#101418\" stroke-width=\"2\"/>"));
    }
}

/// A strong colour of its own for each robot, as #rrggbb: not every viewer knows hsl().
fn color(index: usize) -> String {
    let turns = (index as f64 * HUE_DEG / 360.0).fract();
    let part = |shift: f64| {
        let away = ((turns + shift).fract() * 6.0 - 3.0).abs();
        (40.0 + 160.0 * (away - 1.0).clamp(0.0, 1.0)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", part(0.0), part(2.0 / 3.0), part(1.0 / 3.0))
}

fn escaped(name: &str) -> String {
    name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
