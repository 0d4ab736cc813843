//! One planned path.

use crate::drawing::Floor;
use xtb_control::VehicleConfig;
use xtb_nav::planner::space::{Layers, LookOut};
use xtb_nav::rooms::{Draw, Room};
use xtb_nav::{Car, Goal, GridSpace, Plan, Planner, PlannerSettings};

/// Of the room, and of the poses in it.
const SEED: u64 = 5;
/// As a robot plans first: kept free beside the body, and the room to correct in a bend.
const MARGIN_M: f64 = 0.06;
const RADIUS_FACTOR: f64 = 1.15;
/// Between two bodies, in m.
const EVERY_M: f64 = 0.5;

/// The first path of those drawn that is long and changes gear more than once.
pub(crate) fn svg() -> String {
    let grid = Room::Cluttered.grid(SEED);
    let car = Car::of(&VehicleConfig::default());
    let planned = Car { radius_m: car.radius_m * RADIUS_FACTOR, ..car.grown(MARGIN_M) };
    let look_out = LookOut { ahead_m: 0.32 - MARGIN_M, half_width_m: 0.2 };
    let space = GridSpace::new(&Layers::map(&grid), planned, look_out).unwrap();
    let (mut draw, mut planner, settings) = (Draw::new(SEED), Planner::new(), PlannerSettings::default());
    let Plan { path, expansions, .. } = loop {
        let (start, goal) = (draw.free_pose(&space).unwrap(), draw.free_pose(&space).unwrap());
        let plan = planner.plan_on_grid(&space, &start, &Goal::exactly(&goal), &settings, &mut || true);
        if let Ok(plan) = plan
            && plan.path.length_m() > 9.0
            && plan.path.cusps() >= 2
        {
            break plan;
        }
    };
    let mut floor = Floor::new([0.0; 2], [10.0; 2], 64.0, 2);
    floor.grid(&grid, "fill=\"#5b6570\"", "fill=\"#d5d9dd\"");
    let mut way_m = EVERY_M;
    while way_m < path.length_m() {
        floor.body(&path.at(way_m).0, "fill=\"none\" stroke=\"#8a93a0\" stroke-width=\"1\"");
        way_m += EVERY_M;
    }
    floor.body(&path.start, "fill=\"none\" stroke=\"#222\" stroke-width=\"2\" stroke-dasharray=\"4 3\"");
    floor.body(&path.end(), "fill=\"#1f5fbf\" fill-opacity=\"0.35\" stroke=\"#1f5fbf\" stroke-width=\"2\"");
    let line = |colour: &str| format!("stroke=\"{colour}\" stroke-width=\"3\" stroke-linejoin=\"round\"");
    floor.path(&path, &line("#1f5fbf"), &line("#c4560a"));
    floor.cusps(&path, "fill=\"#b3261e\" stroke=\"#fff\"");
    floor.words(&format!(
        "A plan of {:.1} m in 10 × 10 m, {} changes of gear (red dots), {expansions} nodes looked at.",
        path.length_m(),
        path.cusps(),
    ));
    floor.words("Blue: ahead, orange: astern; dashed: start, filled: goal, thin: the body each 0.5 m.");
    floor.end()
}
