//! Robots that traffic control leads and that something right ahead of the bumper keeps standing: another robot that
//! has gone since, or a thing that is on no map.

use crate::drive::Drive;
use crate::meetings::fleet;
use std::f64::consts::FRAC_PI_2;
use xtb_nav::MapPose;
use xtb_protocol::messages::{GoalStatus, Outcome};
use xtb_sim::lockstep::Traffic;
use xtb_sim::{TruckParameters, World};

const HALL: &str = "[room]\nwidth_m = 8.0\ndepth_m = 6.0";
/// From a truck's middle to its bumper, in m.
const FRONT_M: f64 = 0.25;
/// And to its side, in m.
const SIDE_M: f64 = 0.2;
/// A range finder that has read less than 14 cm is not believed before it has backed off.
const CLOSE_M: f64 = 0.12;
/// The robot that is kept standing faces east here, and has to go 3 m further.
const STARTS: MapPose = MapPose { x_m: -1.5, y_m: 0.0, yaw_rad: 0.0 };
/// Time for 3 m and a detour, with the 8 s after which traffic control counts a robot as stalled.
const WITHIN_S: f64 = 90.0;

fn goes(drive: &mut Drive, index: usize, [x_m, y_m]: [f64; 2]) -> (Option<GoalStatus>, Option<String>) {
    let asked = drive.goto(index, x_m, y_m, None);
    assert!(matches!(asked, Outcome::Ok(_)), "{asked:?}");
    let goal = drive.wait(index, WITHIN_S).goal;
    (goal.as_ref().map(|goal| goal.status), goal.and_then(|goal| goal.reason))
}

fn untouched(drive: &Drive) {
    for truck in drive.lockstep.simulation().trucks() {
        assert_eq!(truck.truth().contacts, 0);
    }
}

/// Another one stands right before it, so far to its left, and drives away first.
fn after_another_one(seed: u64, beside_m: f64) {
    let x_m = STARTS.x_m + FRONT_M + CLOSE_M + SIDE_M;
    let before = MapPose { x_m, y_m: beside_m, yaw_rad: FRAC_PI_2 };
    let mut drive = fleet(HALL, &[STARTS, before], seed);
    assert_eq!(goes(&mut drive, 1, [x_m, 2.2]).0, Some(GoalStatus::Reached), "seed {seed}");
    let end = goes(&mut drive, 0, [STARTS.x_m + 3.0, 0.0]);
    assert_eq!(end.0, Some(GoalStatus::Reached), "seed {seed}: {end:?}");
    untouched(&drive);
}

/// A box stands so far before it.
fn around_a_box(seed: u64, off_m: f64) {
    let x_m = STARTS.x_m + FRONT_M + off_m + 0.15;
    let thing = format!("{HALL}\n[[boxes]]\nx_m = {x_m}\ny_m = 0.0\nwidth_m = 0.3\ndepth_m = 0.3");
    let world = World::from_toml(&thing).unwrap();
    let mut drive = Drive::of(world, &[STARTS], &TruckParameters::default(), seed);
    let map = World::from_toml(HALL).unwrap().to_map(0.05).unwrap();
    drive.lockstep.set_map(&map);
    drive.lockstep.set_traffic(Some(Traffic::new(&map, seed)));
    let end = goes(&mut drive, 0, [STARTS.x_m + 3.0, 0.0]);
    assert_eq!(end.0, Some(GoalStatus::Reached), "seed {seed}, {off_m} m: {end:?}");
    untouched(&drive);
}

#[test]
fn a_led_robot_gets_away_from_where_another_one_has_stood_close_before_it() {
    for (seed, beside_m) in [(1, -0.09), (2, -0.03), (3, 0.03), (4, 0.09)] {
        after_another_one(seed, beside_m);
    }
}

#[test]
fn a_led_robot_goes_around_a_thing_that_stands_close_before_it_and_is_on_no_map() {
    for (seed, off_m) in [(1, 0.11), (2, 0.15), (3, 0.2), (4, 0.24)] {
        around_a_box(seed, off_m);
    }
}
