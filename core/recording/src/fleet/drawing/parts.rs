//! What moves: a truck, its way, and what its range finders see.

use super::{Time, entity};
use crate::fleet::well_known::{
    ArrowPrimitive, Color, KeyValuePair, LinePrimitive, Point3, Pose, SceneEntity, SolidPrimitive, Span,
    TextPrimitive, Vector3,
};
use xtb_client::scene::CarBody;
use xtb_client::text::reasons;
use xtb_nav::Path;
use xtb_protocol::Name;
use xtb_protocol::messages::{GoalState, PoseState, RobotState, RouteState, Sensors};

/// The memorandum's truck: bumper to bumper, tyre to tyre, and as high as it looks.
const HEIGHT_M: f64 = 0.30;
/// Half of what a range finder's beam is drawn wide, in m.
const BEAM_M: f64 = 0.03;
/// Height of lines above the floor, in m.
const ABOVE_M: f64 = 0.02;
/// Between two points of a path, in m.
const STEP_M: f64 = 0.05;
/// Points of a path at most; a longer one gets wider steps.
const MOST_POINTS: f64 = 2000.0;

const DRIVES: Color = rgb(0.15, 0.65, 0.35);
const STANDS: Color = rgb(0.45, 0.5, 0.55);
const LATCHED: Color = rgb(0.85, 0.2, 0.15);
const AIM: Color = rgb(0.95, 0.75, 0.1);
const RELEASED: Color = rgb(0.15, 0.55, 0.9);
const BEYOND: Color = Color { a: 0.35, ..RELEASED };
const SEEN: Color = rgb(0.95, 0.4, 0.1);
const LETTERS: Color = rgb(0.9, 0.9, 0.9);

pub(super) const fn rgb(r: f64, g: f64, b: f64) -> Color {
    Color { r, g, b, a: 1.0 }
}

pub(super) fn truck_id(name: &Name) -> String {
    format!("{name} truck")
}

pub(super) fn way_id(name: &Name) -> String {
    format!("{name} way")
}

pub(super) fn sight_id(name: &Name) -> String {
    format!("{name} sight")
}

/// A box with an arrow ahead, its name, and why it stands.
pub(super) fn truck(at: Time, name: &Name, body: &CarBody, state: &RobotState) -> SceneEntity {
    let PoseState { x_m, y_m, yaw_rad, .. } = state.pose;
    let (sin, cos) = yaw_rad.sin_cos();
    let color = match () {
        () if !state.latches.is_empty() => LATCHED,
        () if state.stopped_because.is_empty() => DRIVES,
        () => STANDS,
    };
    let why = state.stopped_because.first().map_or_else(|| reasons::name(&state.mode), reasons::name);
    let mut truck = entity(at, truck_id(name));
    truck.cubes.push(SolidPrimitive {
        pose: Pose::flat(x_m + body.ahead_m * cos, y_m + body.ahead_m * sin, HEIGHT_M / 2.0, yaw_rad),
        size: Vector3 { x: body.length_m, y: body.width_m, z: HEIGHT_M },
        color: Color { a: 0.8, ..color },
    });
    truck.arrows.push(arrow(Pose::flat(x_m, y_m, HEIGHT_M + ABOVE_M, yaw_rad), color));
    truck.texts.push(text(Pose::flat(x_m, y_m, 2.0 * HEIGHT_M, 0.0), format!("{name}\n{why}")));
    let known = |value: Option<f64>| value.map_or_else(|| "unknown".to_owned(), |value| value.to_string());
    truck.metadata = vec![
        pair("mode", reasons::name(&state.mode)),
        pair("speed_mps", known(state.speed_mps)),
        pair("battery_v", known(state.battery_v)),
        pair("sigma_m", state.pose.sigma_m.to_string()),
    ];
    truck
}

/// The goal, and the path there: what is released of it, and paler what is not.
pub(super) fn way(at: Time, name: &Name, goal: &GoalState, route: Option<&RouteState>) -> SceneEntity {
    let mut way = entity(at, way_id(name));
    // It is drawn again each second; else it goes with its robot.
    way.lifetime = Span { sec: 2, nsec: 0 };
    if let (Some(x_m), Some(y_m)) = (goal.x_m, goal.y_m) {
        let size = Vector3 { x: 0.15, y: 0.15, z: 0.15 };
        way.spheres.push(SolidPrimitive { pose: Pose::flat(x_m, y_m, ABOVE_M, 0.0), size, color: AIM });
        if let Some(yaw_rad) = goal.yaw_rad {
            way.arrows.push(arrow(Pose::flat(x_m, y_m, ABOVE_M, yaw_rad), AIM));
        }
        way.texts.push(text(Pose::flat(x_m, y_m, HEIGHT_M, 0.0), format!("{name}'s goal")));
    }
    if let Some((route, track)) = route.and_then(|route| Some((route, route.track.as_ref()?))) {
        let path = Path::from(track);
        let length_m = path.length_m();
        let release_m = route.release_m.clamp(0.0, length_m);
        for (from_m, to_m, color) in [(0.0, release_m, RELEASED), (release_m, length_m, BEYOND)] {
            if to_m > from_m {
                way.lines.push(line(0, stretch(&path, from_m, to_m), 0.04, color));
            }
        }
    }
    way
}

/// Points along a path, both ends among them.
fn stretch(path: &Path, from_m: f64, to_m: f64) -> Vec<Point3> {
    let steps = ((to_m - from_m) / STEP_M).ceil().clamp(1.0, MOST_POINTS);
    let point = |step: u32| {
        let (pose, _) = path.at(from_m + (to_m - from_m) * f64::from(step) / steps);
        Point3 { x: pose.x_m, y: pose.y_m, z: ABOVE_M }
    };
    (0..=steps as u32).map(point).collect()
}

/// A short stroke across the beam of each range finder that sees something.
pub(super) fn sight(
    at: Time,
    name: &Name,
    body: &CarBody,
    pose: &PoseState,
    sensors: &Sensors,
) -> SceneEntity {
    let (sin, cos) = pose.yaw_rad.sin_cos();
    let place = |(ahead_m, left_m): (f64, f64)| Point3 {
        x: pose.x_m + ahead_m * cos - left_m * sin,
        y: pose.y_m + ahead_m * sin + left_m * cos,
        z: HEIGHT_M / 2.0,
    };
    let mut points = Vec::new();
    for (beam, cm) in body.seen(sensors).into_iter().flatten() {
        let Some((ahead_m, left_m)) = cm.map(|cm| beam.at_cm(cm)) else { continue };
        let (sin, cos) = beam.yaw_rad.sin_cos();
        let beside = |m: f64| place((ahead_m - m * sin, left_m + m * cos));
        points.extend([beside(-BEAM_M), beside(BEAM_M)]);
    }
    let mut sight = entity(at, sight_id(name));
    sight.lines.push(line(2, points, 0.03, SEEN));
    sight
}

pub(super) fn line(kind: u8, points: Vec<Point3>, thickness: f64, color: Color) -> LinePrimitive {
    LinePrimitive {
        kind,
        pose: Pose::flat(0.0, 0.0, 0.0, 0.0),
        thickness,
        scale_invariant: false,
        points,
        color,
        colors: Vec::new(),
        indices: Vec::new(),
    }
}

fn arrow(pose: Pose, color: Color) -> ArrowPrimitive {
    ArrowPrimitive {
        pose,
        shaft_length: 0.25,
        shaft_diameter: 0.04,
        head_length: 0.12,
        head_diameter: 0.1,
        color,
    }
}

fn text(pose: Pose, text: String) -> TextPrimitive {
    TextPrimitive { pose, billboard: true, font_size: 0.15, scale_invariant: false, color: LETTERS, text }
}

fn pair(key: &str, value: String) -> KeyValuePair {
    KeyValuePair { key: key.to_owned(), value }
}
