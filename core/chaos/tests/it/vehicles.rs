//! The vehicles of configs/vehicles all together in the lab under traffic control, each always under way to some
//! goal at random.

use crate::any_car::{FILES, file};
use crate::lifelong::{Fleet, Life};

const LAB: &str = include_str!("../../../../worlds/lab.toml");

/// One of each, for so long.
pub(crate) fn all_kinds(seed: u64, seconds: f64) -> Life {
    let mut fleet = Fleet::of_kinds(LAB, &FILES.map(file), seed, true);
    fleet.run(seconds, true, &mut |_, _| {});
    fleet.life
}

#[test]
fn four_kinds_together_reach_their_goals_and_touch_nothing() {
    for seed in 1..=2 {
        let life = all_kinds(seed, 120.0);
        assert!(life.touched.is_empty() && life.failed.is_empty(), "{life:?}");
        assert!(life.reached >= 8, "{life:?}");
    }
}
