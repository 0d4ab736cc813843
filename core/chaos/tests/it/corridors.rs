//! Narrow rooms: nobody touches anybody, and under traffic control no room stands still for long.

use crate::lifelong::{Failed, Fleet, Life};
use crate::rooms::{Room, l};
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::frames::MapPose;

/// Longest standstill of a whole room, in s.
const STOOD_MAX_S: f64 = 30.0;

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

#[test]
fn in_an_l_corridor_four_that_want_past_each_other_arrive_or_name_one_that_has() {
    let starts = [
        pose(0.75, 3.0, FRAC_PI_2),
        pose(0.75, 10.0, -FRAC_PI_2),
        pose(6.0, 0.75, 0.0),
        pose(14.0, 0.75, PI),
    ];
    let goals = [[1.72, 0.66], [7.03, 0.66], [0.51, 6.39], [0.88, 8.04]];
    let mut fleet = Fleet::at(&l(1.5, 16.0, 12.0), &starts, 1, true);
    for (index, goal) in goals.into_iter().enumerate() {
        assert!(fleet.send(index, goal));
    }
    fleet.run(215.0, false, &mut |_, _| ());
    let life = &fleet.life;
    let ended = life.reached as usize + life.failed.len();
    assert!(life.contacts == 0 && life.reached > 0 && ended == 4, "{life:#?}");
    let named = |failed: &Failed| failed.reason.starts_with("blocked by xtb-");
    assert!(life.failed.iter().all(named), "{life:#?}");
    assert!(life.stood_s <= STOOD_MAX_S, "nobody moved for {:.0} s", life.stood_s);
}

#[test]
fn in_narrow_rooms_at_random_nobody_is_touched_and_no_room_stands_still() {
    let seed = 900;
    let room = Room::of(seed);
    let mut fleet = Fleet::new(&room.world, room.robots, seed, true);
    fleet.run(45.0, true, &mut |_, _| ());
    let Life { contacts, stood_s, reached, .. } = fleet.life;
    assert_eq!(contacts, 0, "seed {seed}: {:#?}", fleet.life);
    assert!(stood_s <= STOOD_MAX_S, "seed {seed}: nobody moved for {stood_s:.0} s");
    assert!(reached > 0, "seed {seed}: nobody arrived");
}

#[test]
fn alone_in_a_narrow_room_nobody_squeezes_past_another_one() {
    // One has to pass a robot that stands crosswise, with 46 cm beside it.
    let room = Room::of(5102);
    let mut fleet = Fleet::new(&room.world, room.robots, 5102, false);
    fleet.run(24.0, true, &mut |_, _| ());
    assert_eq!(fleet.life.contacts, 0, "{:#?}", fleet.life);
}
