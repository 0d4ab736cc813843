//! Ways of one truck: what it may drive, where it may end, and how soon that is found.

use super::*;
use crate::coordinator::field::Field;
use crate::coordinator::occupancy::Occupancy;
use crate::coordinator::room::GridRoom;
use crate::coordinator::task::{Other, Target};
use xtb_control::VehicleConfig;
use xtb_nav::{Car, Gears};

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

/// Two rooms of 5 m × 6 m and a door of 1.2 m.
fn rooms() -> GridRoom {
    GridRoom::with(10.0, 6.0, &[[4.9, 0.0, 0.2, 2.4], [4.9, 3.6, 0.2, 2.4]])
}

fn find(
    room: &GridRoom,
    start: MapPose,
    goal: MapPose,
    lines: &[Occupancy],
) -> (Result<Vec<Leg>, Stuck>, u32) {
    find_for(&Car::of(&VehicleConfig::default()), room, start, goal, lines)
}

fn find_for(
    car: &Car,
    room: &GridRoom,
    start: MapPose,
    goal: MapPose,
    lines: &[Occupancy],
) -> (Result<Vec<Leg>, Stuck>, u32) {
    let target = Some(Target { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: Some(goal.yaw_rad) });
    let field = Field::new(room, car.half_width_m, &[], [goal.x_m, goal.y_m]);
    let others: Vec<Other<'_>> =
        lines.iter().map(|line| Other { line, separation_m: 0.08, is_thing: false }).collect();
    let (others, soft) = (&others[..], &[][..]);
    let task = Task { room, car, start, gear: 1.0, tick: 0, target, field: &field, others, soft };
    let mut left = 5000;
    let found = search(&task, left, &mut left);
    (found, 5000 - left)
}

#[test]
fn a_car_that_looks_one_way_only_is_sent_that_way_only() {
    let room = rooms();
    for gears in [Gears { ahead: true, astern: false }, Gears { ahead: false, astern: true }] {
        let car = Car { gears, ..Car::of(&VehicleConfig::default()) };
        for yaw_rad in [0.0, 1.5, 3.0, -1.5] {
            let (legs, _) = find_for(&car, &room, pose(1.5, 1.5, yaw_rad), pose(8.0, 4.0, 0.0), &[]);
            let legs = legs.unwrap_or_else(|stuck| panic!("{gears:?} from {yaw_rad}: {stuck:?}"));
            assert!(legs.iter().all(|leg| gears.allow(leg.piece.length_m)), "{legs:?}");
        }
    }
}

#[test]
fn who_may_end_in_any_heading_ends_where_it_can_drive_on() {
    let room = rooms();
    let car = Car { gears: Gears { ahead: true, astern: false }, ..Car::of(&VehicleConfig::default()) };
    // Straight on it would stand before the wall between the rooms, and could not back off.
    let start = pose(1.2, 1.2, 0.0);
    let field = Field::new(&room, car.half_width_m, &[], [4.4, 1.2]);
    let target = Some(Target { x_m: 4.4, y_m: 1.2, yaw_rad: None });
    let task = Task {
        room: &room,
        car: &car,
        start,
        gear: 1.0,
        tick: 0,
        target,
        field: &field,
        others: &[],
        soft: &[],
    };
    let mut left = 5000;
    let legs = search(&task, left, &mut left).unwrap();
    let end = legs.iter().fold(start, |pose, leg| leg.piece.end(&pose));
    let (back, _) = find_for(&car, &room, end, pose(1.5, 1.5, 3.0), &[]);
    assert!(back.is_ok(), "{end:?}: {back:?}");
}

#[test]
fn a_robot_refuses_at_once_the_goals_that_are_not_free_here() {
    let room = rooms();
    let map = xtb_nav::Map::new("rooms", room.grid().clone(), Vec::new()).unwrap();
    let floor = xtb_nav::navigator::PreparedMap::of(map);
    let car = Car::of(&VehicleConfig::default());
    let (mut refused, mut served) = (0, 0);
    for start in [pose(1.2, 1.0, 0.0), pose(4.66, 1.0, std::f64::consts::FRAC_PI_2)] {
        for n in 0..60_u32 {
            let goal = pose(4.0 + f64::from(n) * 0.015, 1.2, f64::from(n % 7));
            let target =
                xtb_nav::navigator::TargetPose { x_m: goal.x_m, y_m: goal.y_m, yaw_rad: Some(goal.yaw_rad) };
            let robot = floor.too_near_for_traffic(&car, &start, &target);
            let (here, _) = find(&room, start, goal, &[]);
            assert_eq!(
                robot.is_some(),
                here == Err(Stuck::Goal),
                "{start:?} → {goal:?}: {robot:?}, {here:?}"
            );
            *(if robot.is_some() { &mut refused } else { &mut served }) += 1;
        }
    }
    assert!(refused > 20 && served > 20, "{refused} refused, {served} served");
}

#[test]
fn alone_it_finds_the_way_through_the_door_at_once() {
    let room = rooms();
    for (yaw_from, yaw_to) in [(0.0, 0.0), (0.0, std::f64::consts::PI), (1.5, -1.5)] {
        let (legs, expanded) = find(&room, pose(1.2, 1.0, yaw_from), pose(8.8, 4.0, yaw_to), &[]);
        assert!(legs.is_ok() && expanded < 400, "{legs:?}, {expanded} expanded");
    }
}
