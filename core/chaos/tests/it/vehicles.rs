//! The vehicles of configs/vehicles all together in the lab under traffic control, each always under way to some
//! goal at random.

use crate::any_car::{FILES, file};
use crate::drive::Drive;
use crate::lifelong::{Failed, Fleet, Life};
use xtb_sim::World;

const LAB: &str = include_str!("../../../../worlds/lab.toml");
/// A robot has its path by then.
const PLANS_WITHIN_S: f64 = 1.0;

/// One of each, for so long.
pub(crate) fn all_kinds(seed: u64, seconds: f64) -> Life {
    let mut fleet = Fleet::of_kinds(LAB, &FILES.map(file), seed, true);
    fleet.run(seconds, true, &mut |_, _| {});
    fleet.life
}

/// Whether a goal failed because of the one-way lane alone: from there the car's own planner, which is another one,
/// finds no way either, and finds one at once where the lane is none.
pub(crate) fn is_held_by_the_lane(failed: &Failed) -> bool {
    let zones = LAB.split("\n\n").filter(|part| part.contains("one_way"));
    let open = zones.fold(LAB.to_owned(), |world, zone| world.replace(zone, ""));
    let finds_a_way = |world: &str| {
        let (world, here) = (World::from_toml(world).unwrap(), failed.poses[failed.robot]);
        let mut drive = Drive::by_file(world, here, &file(FILES[failed.robot]), 1);
        let [x_m, y_m] = failed.goals[failed.robot];
        drive.goto(0, x_m, y_m, None);
        drive.run_s(PLANS_WITHIN_S);
        drive.lockstep.state(0).unwrap().nav.route.is_some_and(|route| route.track.is_some())
    };
    !finds_a_way(LAB) && finds_a_way(&open)
}

#[test]
fn four_kinds_together_reach_their_goals_or_say_truly_why_not_and_touch_nothing() {
    for seed in 1..=2 {
        let life = all_kinds(seed, 120.0);
        assert!(life.touched.is_empty(), "{:?}", life.touched);
        for failed in &life.failed {
            assert_eq!(failed.reason, "no path on the map", "{failed:?}");
            assert!(is_held_by_the_lane(failed), "{failed:?}");
        }
        assert!(life.reached >= 12, "{life:?}");
    }
}

/// The crawler has reached a goal in the lane a little farther across and nearer to the wall than planned.
#[test]
fn a_car_that_the_look_out_leaves_no_way_is_led_on_with_less_of_it() {
    let life = all_kinds(118, 70.0);
    assert!(life.failed.is_empty() && life.touched.is_empty(), "{life:?}");
}
