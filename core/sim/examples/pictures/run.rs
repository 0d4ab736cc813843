//! One goal, driven: through the lab's door, with boxes in the way that the map does not have.

use crate::drawing::{BLUE, DASHED, Floor, INK, ORANGE, RED, SOLID};
use crate::drive::Drive;
use plotters::style::{Color, RGBColor};
use std::collections::BTreeMap;
use xtb_nav::{Car, Gears, MapPose, Path};
use xtb_protocol::messages::{GoalStatus, Outcome};
use xtb_sim::{BoxSpec, World};

const LAB: &str = include_str!("../../../../worlds/lab.toml");
const GOAL: MapPose = MapPose { x_m: 3.0, y_m: 5.4, yaw_rad: 0.0 };
/// Not on the map: x, y and side, in m, and how they are turned.
const STRANGERS: [(f64, f64, f64, f64); 3] =
    [(0.1, 2.0, 0.45, 0.4), (0.45, 4.3, 0.35, 0.2), (1.9, 5.3, 0.4, 0.9)];
/// Longest run, in s.
const PATIENCE_S: f64 = 300.0;
/// Between two bodies, in s.
const EVERY_S: f64 = 5.0;

/// What a witness of the run sees.
#[derive(Default)]
struct Seen {
    /// Every path that it began to follow.
    paths: Vec<Path>,
    /// Where it was, by the truth, each 0.1 s.
    trail: Vec<MapPose>,
    /// Marks of its range finders, by place in cm.
    marks: BTreeMap<(i64, i64), [f64; 2]>,
    contacts: u64,
    status: Option<GoalStatus>,
}

pub(crate) fn draw(file: &std::path::Path) {
    let world = World::from_toml(LAB).unwrap();
    let start = world.starts()[0];
    let map = world.to_map(0.05).unwrap();
    let mut drive = Drive::at(world, &[start], 1);
    for (index, (x_m, y_m, side_m, yaw_rad)) in STRANGERS.into_iter().enumerate() {
        let spec = BoxSpec { x_m, y_m, width_m: side_m, depth_m: side_m, yaw_rad };
        drive.lockstep.simulation_mut().put_box(&format!("stranger-{index}"), spec).unwrap();
    }
    let asked = drive.goto(0, GOAL.x_m, GOAL.y_m, Some(GOAL.yaw_rad));
    assert!(matches!(asked, Outcome::Ok(_)), "{asked:?}");
    let seen = watch(&mut drive);
    println!("run: {:?}, {} contacts, {} paths", seen.status, seen.contacts, seen.paths.len());

    let mut floor = Floor::new(file, [-2.4, -1.0], [7.0, 7.8], 160.0, 3);
    floor.grid(map.grid());
    for (x_m, y_m, side_m, yaw_rad) in STRANGERS {
        let half_m = side_m / 2.0;
        let shape = Car {
            front_m: half_m,
            rear_m: half_m,
            half_width_m: half_m,
            radius_m: f64::INFINITY,
            gears: Gears::BOTH,
        };
        let corners = shape.corners(&MapPose { x_m, y_m, yaw_rad });
        floor.shape(corners, RGBColor(0xd9, 0xa8, 0).stroke_width(3).filled(), DASHED);
    }
    for (index, path) in seen.paths.iter().enumerate() {
        let style = ORANGE.mix(if index == 0 { 1.0 } else { 0.6 }).stroke_width(3);
        floor.path(path, style, style, DASHED);
        floor.dot([path.start.x_m, path.start.y_m], 7, ORANGE);
    }
    for pose in seen.trail.iter().step_by((EVERY_S * 10.0) as usize) {
        floor.body(pose, BLUE.mix(0.4).stroke_width(2), SOLID);
    }
    let trail = seen.trail.iter().step_by(2).map(|pose| [pose.x_m, pose.y_m]);
    floor.line(trail, BLUE.stroke_width(5), SOLID);
    for mark in seen.marks.values() {
        floor.dot(*mark, 4, RED);
    }
    floor.body(&start, INK.stroke_width(4), DASHED);
    floor.body(&seen.trail[seen.trail.len() - 1], BLUE.stroke_width(4).filled(), SOLID);
    floor.words(&format!(
        "A run of {:.0} s, {} contacts. Blue: what was driven, by the truth, with the body each 5 s.",
        seen.trail.len() as f64 * 0.1,
        seen.contacts,
    ));
    floor.words(&format!(
        "Orange: the {} paths, one after the other, each from its dot on.",
        seen.paths.len(),
    ));
    floor.words("Yellow: boxes that are not on the map; red: what the range finders marked of them.");
    floor.end();
}

fn watch(drive: &mut Drive) -> Seen {
    let mut seen = Seen::default();
    while (seen.trail.len() as f64) * 0.1 < PATIENCE_S {
        drive.run_s(0.1);
        let truth = drive.lockstep.simulation().trucks()[0].truth();
        seen.trail.push(MapPose { x_m: truth.x_m, y_m: truth.y_m, yaw_rad: truth.yaw_rad });
        seen.contacts = truth.contacts;
        let state = drive.lockstep.state(0).unwrap();
        if let Some(track) = state.nav.route.and_then(|route| route.track) {
            let path = Path::from(&track);
            if seen.paths.last() != Some(&path) {
                seen.paths.push(path);
            }
        }
        let now = drive.lockstep.now();
        for mark in drive.lockstep.robot_mut(0).unwrap().agent_mut().unknown_obstacles(now) {
            let cm = |m: f64| (m * 100.0).round() as i64;
            seen.marks.insert((cm(mark.x_m), cm(mark.y_m)), [mark.x_m, mark.y_m]);
        }
        seen.status = state.goal.map(|goal| goal.status);
        if seen.status.is_none_or(GoalStatus::is_final) {
            break;
        }
    }
    seen
}
