//! The rule by itself.

use super::*;
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::VehicleConfig;

fn car() -> Car {
    Car::of(&VehicleConfig::default())
}

fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad }
}

fn straight(start: MapPose, length_m: f64) -> Path {
    Path { start, pieces: vec![Piece { length_m, curvature_per_m: 0.0 }] }
}

/// One that goes alone, straight on for so long.
fn going(name: &str, pose: MapPose, length_m: f64) -> Neighbour {
    let path = straight(pose, length_m);
    let way = Some(RemainingPath { path, done_m: 0.0, release_m: f64::MAX });
    Neighbour { name: name.to_owned(), pose, speed_mps: 0.2, role: NearRole::Alone, way, waits_for: None }
}

fn parked(name: &str, pose: MapPose) -> Neighbour {
    Neighbour { role: NearRole::Parked, speed_mps: 0.0, way: None, ..going(name, pose, 0.0) }
}

fn now(said: &Neighbour) -> NeighbourNow<'_> {
    NeighbourNow { said, pose: said.pose, still_ms: 0, stood_ms: 0 }
}

/// Who drives north through (0, 0), asked at the start of its way.
fn northbound(me: &str, said: &Neighbour) -> Option<Hold> {
    hold(me, &car(), &straight(pose(0.0, -2.0, FRAC_PI_2), 4.0), 0.0, &[now(said)])
}

#[test]
fn numbers_count_as_numbers_in_the_order_of_names() {
    assert!(goes_before("xtb-2", "xtb-10") && !goes_before("xtb-10", "xtb-2"));
    assert!(goes_before("xtb-1", "xtb-2") && !goes_before("xtb-2", "xtb-2"));
}

#[test]
fn of_two_that_cross_exactly_one_is_held_and_stops_before_the_other_ones_way() {
    let first = going("xtb-2", pose(-2.0, 0.0, 0.0), 4.0);
    let held = northbound("xtb-10", &first).unwrap();
    assert_eq!((held.what, held.name.as_str()), (InTheWay::Path, "xtb-2"));
    // Its bumper is 0.25 m ahead, the other one's side 0.2 m from the middle of its way.
    assert!((1.0..2.0 - 0.25 - 0.2).contains(&held.way_m), "{held:?}");
    assert_eq!(northbound("xtb-1", &first), None);
}

#[test]
fn who_is_through_before_the_first_one_comes_goes_on() {
    let far = going("xtb-1", pose(-7.5, 0.0, 0.0), 15.0);
    let path = straight(pose(0.0, -1.0, FRAC_PI_2), 2.5);
    assert_eq!(hold("xtb-2", &car(), &path, 0.0, &[now(&far)]), None);
    let near = going("xtb-1", pose(-3.0, 0.0, 0.0), 15.0);
    assert_eq!(hold("xtb-2", &car(), &path, 0.0, &[now(&near)]).unwrap().what, InTheWay::Path);
}

#[test]
fn a_first_one_that_has_stood_for_long_has_lost_its_turn() {
    let first = going("xtb-1", pose(-2.0, 0.0, 0.0), 4.0);
    let others = |stood_ms| [NeighbourNow { stood_ms, ..now(&first) }];
    let path = straight(pose(0.0, -2.0, FRAC_PI_2), 4.0);
    assert!(hold("xtb-2", &car(), &path, 0.0, &others(LOST_TURN_MS - 1)).is_some());
    assert_eq!(hold("xtb-2", &car(), &path, 0.0, &others(LOST_TURN_MS)), None);
}

#[test]
fn nobody_drives_into_a_body_whoever_goes_first() {
    for me in ["xtb-1", "xtb-3"] {
        let held = northbound(me, &parked("xtb-2", pose(0.0, 0.5, 0.0))).unwrap();
        assert_eq!(held.what, InTheWay::Body);
        // 2.5 m to its middle: half of either body, and room to turn.
        assert!((1.2..1.6).contains(&held.way_m), "{held:?}");
    }
    assert_eq!(northbound("xtb-1", &parked("xtb-2", pose(0.6, 0.0, 0.0))), None, "it stands beside the way");
}

#[test]
fn a_moving_body_counts_where_it_comes_to_a_stop() {
    // Its bumper is 0.2 m beside the other one's way, and it does not stop within that.
    let mut second = going("xtb-2", pose(-0.65, 0.0, 0.0), 4.0);
    second.speed_mps = 0.35;
    assert_eq!(northbound("xtb-1", &second).unwrap().what, InTheWay::Body);
    second.speed_mps = 0.0;
    assert_eq!(northbound("xtb-1", &second), None);
}

#[test]
fn within_the_first_ones_way_it_drives_out_ahead_but_not_towards_it() {
    let first = going("xtb-1", pose(-2.0, 0.0, 0.0), 6.0);
    let held = |start, length_m| hold("xtb-2", &car(), &straight(start, length_m), 0.0, &[now(&first)]);
    assert_eq!(held(pose(0.0, 0.0, FRAC_PI_2), 2.0), None, "across");
    assert_eq!(held(pose(0.0, 0.0, 0.0), 5.0), None, "ahead of it");
    assert_eq!(held(pose(0.0, 0.0, PI), 3.0).unwrap().way_m, 0.0, "towards it");
}

#[test]
fn beside_a_body_everything_is_free_that_leads_away() {
    // 2 cm beside each other.
    let beside = parked("xtb-1", pose(0.0, 0.42, 0.0));
    let held = |path: Path| hold("xtb-2", &car(), &path, 0.0, &[now(&beside)]);
    assert_eq!(held(straight(pose(0.0, 0.0, 0.0), 3.0)), None);
    let path =
        Path { start: pose(0.0, 0.0, 0.0), pieces: vec![Piece { length_m: 0.6, curvature_per_m: 2.0 }] };
    assert!(held(path).is_some(), "towards it");
}

#[test]
fn who_is_driven_gives_way_to_nobody() {
    let mut driven = going("xtb-9", pose(-2.0, 0.0, 0.0), 4.0);
    assert_eq!(northbound("xtb-1", &driven), None);
    driven.role = NearRole::Driven;
    assert_eq!(northbound("xtb-1", &driven).unwrap().what, InTheWay::Path);
}

#[test]
fn both_of_a_pair_never_go_and_never_wait_for_ways_of_each_other() {
    let mut held = 0;
    for step in 0..600 {
        let step = f64::from(step);
        let place = |k: f64| pose(2.0 * libm::sin(step * k), 2.0 * libm::cos(step * k * 1.3), step * k * 0.7);
        let (one, two) = (going("xtb-1", place(1.0), 3.0), going("xtb-2", place(2.3), 3.0));
        let of = |me: &Neighbour, other: &Neighbour| {
            hold(&me.name, &car(), &me.way.as_ref().unwrap().path, 0.0, &[now(other)])
        };
        let ways = |hold: &Option<Hold>| hold.as_ref().is_some_and(|hold| hold.what == InTheWay::Path);
        let (first, second) = (of(&one, &two), of(&two, &one));
        assert!(!ways(&first), "the first one gives way: {first:?}");
        held += u32::from(ways(&second));
    }
    assert!((50..550).contains(&held), "{held}");
}

#[test]
fn what_was_not_heard_for_a_second_is_unknown_and_no_more_than_64_are_kept() {
    let at = |ms| Stamp::ZERO.plus_ms(ms);
    let mut book = Neighbours { me: "xtb-0".to_owned(), ..Neighbours::default() };
    book.hear(at(0), going("xtb-0", pose(0.0, 0.0, 0.0), 1.0).into());
    assert_eq!(book.others(at(0)).count(), 0, "itself");
    for n in 1..=70 {
        book.hear(at(100), going(&format!("xtb-{n}"), pose(f64::from(n), 0.0, 0.0), 1.0).into());
    }
    assert_eq!(book.others(at(100)).count(), MOST_NEIGHBOURS);
    assert_eq!(book.others(at(100 + HEARD_MS)).count(), MOST_NEIGHBOURS);
    assert_eq!(book.others(at(101 + HEARD_MS)).count(), 0);
    book.hear(at(101 + HEARD_MS), going("xtb-70", pose(0.0, 0.0, 0.0), 1.0).into());
    assert_eq!(book.others(at(101 + HEARD_MS)).count(), 1);
}

#[test]
fn how_long_one_has_stood_counts_from_when_it_got_its_role() {
    let at = |ms| Stamp::ZERO.plus_ms(ms);
    let mut book = Neighbours { me: "xtb-0".to_owned(), ..Neighbours::default() };
    let stands = |role| Neighbour { role, ..parked("xtb-1", pose(1.0, 0.0, 0.0)) };
    (0..20).for_each(|n| book.hear(at(n * 200), stands(NearRole::Parked).into()));
    book.hear(at(4_000), stands(NearRole::Alone).into());
    let other = book.find(at(4_200), "xtb-1").unwrap();
    assert_eq!((other.still_ms, other.stood_ms), (4_200, 200));
    book.hear(at(4_200), Neighbour { speed_mps: 0.1, ..stands(NearRole::Alone) }.into());
    assert_eq!(book.find(at(4_200), "xtb-1").unwrap().still_ms, 0);
}
