//! One planned path.

use crate::drawing::{BLUE, DASHED, Floor, INK, ORANGE, RED, SOLID};
use plotters::style::{Color, RGBColor};
use std::path::Path;
use xtb_control::VehicleConfig;
use xtb_nav::planner::space::{GridLayers, LookOut};
use xtb_nav::rooms::{Draw, RoomKind};
use xtb_nav::{Car, GridSpace, Plan, Planner, PlannerGoal, PlannerSettings};

/// Of the room, and of the poses in it.
const SEED: u64 = 5;
/// As a robot plans first: kept free beside the body, and the room to correct in a bend.
const MARGIN_M: f64 = 0.06;
const RADIUS_FACTOR: f64 = 1.15;
/// Between two bodies, in m.
const EVERY_M: f64 = 0.5;

/// The first path of those drawn that is long and changes gear more than once.
pub(crate) fn draw(file: &Path) {
    let grid = RoomKind::Cluttered.grid(SEED);
    let car = Car::of(&VehicleConfig::default());
    let planned = Car { radius_m: car.radius_m * RADIUS_FACTOR, ..car.grown(MARGIN_M) };
    let look_out = LookOut { ahead_m: 0.32 - MARGIN_M, half_width_m: 0.2 };
    let space = GridSpace::new(&GridLayers::map(&grid), planned, look_out).unwrap();
    let (mut draw, mut planner, settings) = (Draw::new(SEED), Planner::new(), PlannerSettings::default());
    let Plan { path, expansions, .. } = loop {
        let (start, goal) = (draw.free_pose(&space).unwrap(), draw.free_pose(&space).unwrap());
        let plan =
            planner.plan_on_grid(&space, &start, &PlannerGoal::exactly(&goal), &settings, &mut || true);
        if let Ok(plan) = plan
            && plan.path.length_m() > 9.0
            && plan.path.cusps() >= 2
        {
            break plan;
        }
    };
    let mut floor = Floor::new(file, [0.0; 2], [10.0; 2], 128.0, 2);
    floor.grid(&grid);
    let mut way_m = EVERY_M;
    while way_m < path.length_m() {
        floor.body(&path.at(way_m).0, RGBColor(0x8a, 0x93, 0xa0).stroke_width(2), SOLID);
        way_m += EVERY_M;
    }
    floor.body(&path.start, INK.stroke_width(4), DASHED);
    floor.body(&path.end(), BLUE.stroke_width(4).filled(), SOLID);
    floor.path(&path, BLUE.stroke_width(6), ORANGE.stroke_width(6), SOLID);
    floor.cusps(&path, RED);
    floor.words(&format!(
        "A plan of {:.1} m in 10 × 10 m, {} changes of gear (red dots), {expansions} nodes looked at.",
        path.length_m(),
        path.cusps(),
    ));
    floor.words("Blue: ahead, orange: astern; dashed: start, filled: goal, thin: the body each 0.5 m.");
    floor.end();
}
