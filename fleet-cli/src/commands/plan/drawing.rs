//! A drawing of a schedule: obstacles, each robot's way in a colour of its own, where it begins
//! (outline) and where it ends (filled).

use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use xtb_nav::{Car, Gears, MapPose};
use xtb_traffic::solver::{Obstacle, Problem, Schedule, Way};

/// Longer side of the drawing, in pixels; large, since each point is put onto a whole one.
const SIDE: f64 = 1800.0;
/// Points of one step.
const POINTS: usize = 6;
/// Between two robots' colours, in turns; the golden angle never comes round to the same one.
const HUE: f64 = 0.381_966;
const FLOOR: RGBColor = RGBColor(0xf6, 0xf7, 0xf9);
const EDGE: RGBColor = RGBColor(0x9a, 0xa3, 0xad);
const THING: RGBColor = RGBColor(0x5b, 0x65, 0x70);
const INK: RGBColor = RGBColor(0x10, 0x14, 0x18);

type Floor<'a> = DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
type Drawn = Result<(), DrawingAreaErrorKind<std::io::Error>>;

/// The drawing as SVG.
pub(super) fn svg(problem: &Problem, schedule: &Schedule) -> String {
    let mut svg = String::new();
    // Into a string, and with no fonts to load, nothing can fail.
    let _ = draw(&mut svg, problem, schedule);
    svg
}

fn draw(svg: &mut String, problem: &Problem, schedule: &Schedule) -> Drawn {
    let bounds = &problem.bounds;
    // No reference point leaves the bounds, but a body may stand out of them.
    let reach_m = |car: &Car| car.front_m.max(car.rear_m).hypot(car.half_width_m);
    let room_m = problem.cars.iter().map(|task| reach_m(&task.car)).fold(0.0, f64::max);
    let x = bounds.west_m - room_m..bounds.east_m + room_m;
    let y = bounds.south_m - room_m..bounds.north_m + room_m;
    let (wide_m, deep_m) = (x.end - x.start, y.end - y.start);
    let scale = SIDE / wide_m.max(deep_m);
    let size = ((wide_m * scale) as u32, (deep_m * scale) as u32);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let chart = ChartBuilder::on(&root).build_cartesian_2d(x, y)?;
    let floor = chart.plotting_area();
    let corners = [(bounds.west_m, bounds.south_m), (bounds.east_m, bounds.north_m)];
    floor.draw(&Rectangle::new(corners, FLOOR.filled()))?;
    floor.draw(&Rectangle::new(corners, EDGE))?;
    for obstacle in &problem.obstacles {
        match *obstacle {
            Obstacle::Disc { x_m, y_m, radius_m } => {
                floor.draw(&Circle::new((x_m, y_m), (radius_m * scale).round(), THING.filled()))?;
            }
            Obstacle::Box { middle, half_length_m, half_width_m } => {
                let (front_m, rear_m) = (half_length_m, half_length_m);
                let shape =
                    Car { front_m, rear_m, half_width_m, radius_m: f64::INFINITY, gears: Gears::BOTH };
                floor.draw(&Polygon::new(shape.corners(&middle).map(<(f64, f64)>::from), THING))?;
            }
        }
    }
    for (index, (way, task)) in schedule.ways.iter().zip(&problem.cars).enumerate() {
        let colour = HSLColor((index as f64 * HUE).fract(), 0.67, 0.47);
        draw_way(floor, way, &task.car, colour)?;
    }
    Ok(())
}

fn draw_way(floor: &Floor<'_>, way: &Way, car: &Car, colour: HSLColor) -> Drawn {
    let (Some(first), Some(last)) = (way.rows.first(), way.rows.last()) else { return Ok(()) };
    let along = way.rows.iter().flat_map(|row| {
        (0..POINTS).map(|point| {
            let pose = row.piece.after(&row.pose, row.piece.length_m * point as f64 / POINTS as f64);
            (pose.x_m, pose.y_m)
        })
    });
    floor.draw(&PathElement::new(along.collect::<Vec<_>>(), colour.stroke_width(4)))?;
    draw_car(floor, car, &first.pose, colour, 0.12)?;
    draw_car(floor, car, &last.pose, colour, 0.75)?;
    let font = ("sans-serif", 27).into_font().color(&INK);
    floor.draw(&Text::new(way.name.as_str(), (last.pose.x_m, last.pose.y_m), font))
}

/// The body, with a line across its front.
fn draw_car(floor: &Floor<'_>, car: &Car, pose: &MapPose, colour: HSLColor, opacity: f64) -> Drawn {
    let [a, b, c, d] = car.corners(pose).map(<(f64, f64)>::from);
    floor.draw(&Polygon::new(vec![a, b, c, d], colour.mix(opacity)))?;
    floor.draw(&PathElement::new(vec![a, b, c, d, a], colour.stroke_width(2)))?;
    floor.draw(&PathElement::new(vec![a, d], INK.stroke_width(4)))
}
