//! A truck at the origin that looks east.

use super::*;
use xtb_control::VehicleConfig;
use xtb_control::range_curve::RangeCurve;
use xtb_control::vehicle::{BumperFinders, RangeFinder};

const HERE: MapPose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
const NOTHING: BumperRanges = [None; SLOTS];

fn car() -> Car {
    Car::of(&VehicleConfig::default())
}

/// The channels from the left on, and nothing on the others.
fn widened<const N: usize>(cm: [Option<f64>; N]) -> BumperRanges {
    std::array::from_fn(|slot| cm.get(slot).copied().flatten())
}

fn scan<const N: usize>(front: [Option<f64>; N]) -> BumperScan {
    let front_cm = widened(front);
    BumperScan { pose: HERE, sigma_m: 0.02, front_cm, rear_cm: NOTHING }
}

/// The third beam from the left reads this.
fn third(cm: f64) -> BumperRanges {
    widened([None, None, Some(cm), None, None, None])
}

fn room() -> Grid {
    Grid::free(0.05, [-2.0, -2.0], 80, 80).unwrap()
}

/// The same scan so often, 40 ms apart, from `from_ms` on; when the last one was.
fn look(layer: &mut ObstacleLayer, from_ms: u64, times: u64, scan: &BumperScan, map: Option<&Grid>) -> Stamp {
    let mut now = Stamp::ZERO;
    for i in 0..times {
        now = Stamp::from_ms(from_ms + 40 * i);
        layer.see(now, scan, map, &[]);
    }
    now
}

fn places(layer: &ObstacleLayer, now: Stamp) -> Vec<[f64; 2]> {
    layer.obstacles(now).map(|o| [o.x_m, o.y_m]).collect()
}

#[test]
fn a_hit_marks_the_cell_where_the_beam_ends_once_it_was_seen_twice() {
    let mut layer = ObstacleLayer::new(car(), Some(&room()));
    let now = look(&mut layer, 0, 1, &scan(third(31.0)), Some(&room()));
    assert_eq!(places(&layer, now), Vec::<[f64; 2]>::new(), "a single reading is a disturbance");
    let now = look(&mut layer, 40, 1, &scan(third(31.0)), Some(&room()));
    // 0.25 m to the bumper, 0.31 m on (0.335 by the data sheet), 3.5 cm to the left.
    let found = places(&layer, now);
    assert!(found.len() == 1 && libm::hypot(found[0][0] - 0.575, found[0][1] - 0.025) < 1e-9, "{found:?}");
    assert!(layer.occupied_near(now, [0.56, 0.035], 0.01) && !layer.occupied_near(now, [0.0, 0.5], 0.3));
    assert_eq!(layer.nearest(now, [1.0, 1.0]).map(|o| o.seen), Some(now));
}

#[test]
fn beams_leave_their_bumpers_where_the_sensors_sit() {
    for (front, yaw_rad, expected) in [
        (true, 0.0, [0.574, 0.175]),
        (false, 0.0, [-0.574, 0.175]),
        (true, std::f64::consts::FRAC_PI_2, [-0.175, 0.574]),
    ] {
        let mut layer = ObstacleLayer::new(car(), None);
        let ranges = widened([Some(30.0)]);
        let (front_cm, rear_cm) = if front { (ranges, NOTHING) } else { (NOTHING, ranges) };
        let scan = BumperScan { pose: MapPose { yaw_rad, ..HERE }, sigma_m: 0.0, front_cm, rear_cm };
        let now = look(&mut layer, 0, 2, &scan, None);
        let found = places(&layer, now);
        let off_m = libm::hypot(found[0][0] - expected[0], found[0][1] - expected[1]);
        assert!(found.len() == 1 && off_m < 0.036, "{found:?} for {expected:?}");
    }
}

#[test]
fn a_mark_fades_unless_it_is_seen_again() {
    let mut layer = ObstacleLayer::new(car(), None);
    let now = look(&mut layer, 0, 2, &scan(third(30.0)), None);
    let faded = now.plus_ms(ObstacleLayer::FADES_MS + 1);
    assert_eq!(layer.obstacles(now.plus_ms(ObstacleLayer::FADES_MS)).count(), 1);
    assert_eq!(layer.obstacles(faded).count(), 0);
    let again = look(&mut layer, 10_000, 1, &scan(third(30.0)), None);
    assert_eq!(layer.obstacles(again.plus_ms(ObstacleLayer::FADES_MS)).count(), 1);
}

#[test]
fn a_beam_that_gets_through_frees_its_cells_and_only_these() {
    let mut layer = ObstacleLayer::new(car(), None);
    let both = [Some(30.0), None, Some(30.0), None, None, None];
    look(&mut layer, 0, 3, &scan(both), None);
    let now = look(&mut layer, 200, 1, &scan([Some(30.0), None, None, None, None, None]), None);
    let found = places(&layer, now);
    assert!(found.len() == 1 && (found[0][1] - 0.175).abs() < 0.03, "{found:?}");
    let now = look(&mut layer, 300, 1, &scan([Some(20.0), None, None, None, None, None]), None);
    assert_eq!(layer.obstacles(now).count(), 1, "a nearer hit hides what is behind");
}

#[test]
fn neighbours_that_hit_do_not_free_each_other() {
    let mut layer = ObstacleLayer::new(car(), None);
    let slanting = MapPose { yaw_rad: 0.7, ..HERE };
    let near_and_far = [Some(20.0), Some(38.0), Some(20.0), Some(38.0), Some(20.0), Some(38.0)];
    let scan = BumperScan { pose: slanting, ..scan(near_and_far) };
    let now = look(&mut layer, 0, 5, &scan, None);
    assert!(layer.obstacles(now).count() >= 5);
}

#[test]
fn what_the_map_explains_is_no_mark() {
    let mut map = room();
    let (column, row) = map.place(0.68, 0.035);
    map.set(column, row, Cell::Occupied);
    let marks_at = |cm: f64, sigma_m: f64| {
        let mut layer = ObstacleLayer::new(car(), Some(&map));
        let scan = BumperScan { sigma_m, ..scan(third(cm)) };
        let now = look(&mut layer, 0, 3, &scan, Some(&map));
        layer.obstacles(now).count()
    };
    assert_eq!(marks_at(38.0, 0.0), 0);
    assert_eq!(marks_at(31.0, 0.0), 0, "11 cm before it");
    assert_eq!(marks_at(22.0, 0.0), 1, "20 cm before it");
    assert_eq!(marks_at(22.0, 0.05), 0, "with a pose that may be 10 cm off");
    assert_eq!(marks_at(12.0, 9.0), 1, "however unsure the pose: 30 cm before it is something else");
}

#[test]
fn a_far_wall_that_reads_too_near_is_still_the_wall_of_the_map() {
    let mut map = room();
    for row in 0..80 {
        map.set(map.place(0.25 + 0.66, 0.0).0, row, Cell::Occupied);
    }
    let mut layer = ObstacleLayer::new(car(), Some(&map));
    // The fit makes 51.5 cm of 64.
    let now = look(&mut layer, 0, 5, &scan([Some(51.5); SLOTS]), Some(&map));
    assert_eq!(places(&layer, now), Vec::<[f64; 2]>::new());
    let now = look(&mut layer, 1000, 5, &scan([Some(51.5); SLOTS]), Some(&room()));
    assert!(layer.obstacles(now).count() >= 5, "and something new where the map has none");
}

#[test]
fn what_another_truck_explains_is_no_mark() {
    let mut layer = ObstacleLayer::new(car(), None);
    let now = look(&mut layer, 0, 3, &scan(third(30.0)), None);
    assert_eq!(layer.obstacles(now).count(), 1);
    let there = MapPose { x_m: 0.85, y_m: 0.1, yaw_rad: 0.3 };
    layer.see(now.plus_ms(40), &scan(third(30.0)), None, &[(there, car())]);
    assert_eq!(layer.obstacles(now.plus_ms(40)).count(), 0, "not even if it was one before");
}

#[test]
fn a_sensor_that_folds_back_keeps_its_mark_until_the_truck_backs_off() {
    let mut layer = ObstacleLayer::new(car(), None);
    let near = look(&mut layer, 0, 3, &scan(third(11.0)), None);
    let marked = places(&layer, near);
    // Nearer still it reads farther, and touching it reads nothing.
    look(&mut layer, 200, 5, &scan(third(22.0)), None);
    let now = look(&mut layer, 400, 1000, &scan(NOTHING), None);
    assert_eq!(places(&layer, now), marked, "for as long as it stands there");
    let back = BumperScan { pose: MapPose { x_m: -0.06, ..HERE }, ..scan(NOTHING) };
    let now = look(&mut layer, 50_000, 1, &back, None);
    assert_eq!(layer.obstacles(now).count(), 0);
}

#[test]
fn a_wall_of_the_map_that_is_nearly_touched_is_no_mark_either() {
    let mut map = room();
    let column = map.place(0.38, 0.0).0;
    (0..80).for_each(|row| map.set(column, row, Cell::Occupied));
    let mut layer = ObstacleLayer::new(car(), Some(&map));
    look(&mut layer, 0, 3, &scan(third(11.0)), Some(&map));
    let now = look(&mut layer, 200, 5, &scan(NOTHING), Some(&map));
    assert_eq!(layer.obstacles(now).count(), 0);
}

#[test]
fn marks_are_bounded_and_the_oldest_goes() {
    let mut layer = ObstacleLayer::new(car(), None);
    for i in 0..ObstacleLayer::MOST_OBSTACLES as u64 + 5 {
        let pose = MapPose { x_m: 0.06 * i as f64, y_m: i as f64, yaw_rad: 0.0 };
        layer.see(Stamp::from_ms(i), &BumperScan { pose, ..scan(third(30.0)) }, None, &[]);
    }
    assert_eq!(layer.overflowed(), 5);
    layer.clear();
    assert_eq!(layer.obstacles(Stamp::ZERO).count(), 0);
}

#[test]
fn stamped_onto_a_grid_a_mark_covers_its_cells_and_no_more() {
    let map = room();
    let mut layer = ObstacleLayer::new(car(), Some(&map));
    let now = look(&mut layer, 0, 3, &scan(third(30.0)), Some(&map));
    let occupied = |grid: &Grid| grid.cells().iter().filter(|cell| **cell == Cell::Occupied).count();
    let mut same = room();
    layer.stamp_onto(now, &mut same);
    assert_eq!((occupied(&same), same.at(0.573, 0.035)), (1, Cell::Occupied));
    let mut fine = Grid::free(0.02, [-2.0, -2.0], 200, 200).unwrap();
    layer.stamp_onto(now, &mut fine);
    assert!((4..=9).contains(&occupied(&fine)), "{}", occupied(&fine));
    let mut elsewhere = Grid::free(0.05, [5.0, 5.0], 10, 10).unwrap();
    layer.stamp_onto(now, &mut elsewhere);
    assert_eq!(occupied(&elsewhere), 0);
}

#[test]
fn a_pose_or_a_range_that_is_none_marks_nothing() {
    let mut layer = ObstacleLayer::new(car(), None);
    let nowhere = BumperScan { pose: MapPose { x_m: f64::NAN, ..HERE }, ..scan(third(30.0)) };
    look(&mut layer, 0, 3, &nowhere, None);
    let now = look(&mut layer, 0, 3, &scan(third(f64::NAN)), None);
    assert_eq!(layer.obstacles(now).count(), 0);
}

#[test]
fn what_was_seen_may_go_on_beside_and_behind_but_not_where_beams_got_through() {
    let mut layer = ObstacleLayer::new(car(), Some(&room()));
    let now = look(&mut layer, 0, 3, &scan(third(30.0)), Some(&room()));
    let unseen = layer.unseen_around(now, 0.3);
    let holds = |x_m: f64, y_m: f64| {
        unseen.iter().any(|at| (at[0] - x_m).abs() < 0.026 && (at[1] - y_m).abs() < 0.026)
    };
    assert!(holds(0.775, 0.025), "behind it");
    assert!(!holds(0.425, 0.025), "before it");
    assert!(!holds(0.575, -0.125) && holds(0.675, -0.125), "beside it as far as the other beams say");
    assert!(layer.unseen_around(now, 0.04).is_empty());
}

#[test]
fn what_has_faded_stays_a_doubt_until_a_beam_gets_through() {
    let mut layer = ObstacleLayer::new(car(), Some(&room()));
    let seen = look(&mut layer, 0, 3, &scan(third(30.0)), Some(&room()));
    let elsewhere = BumperScan { pose: MapPose { x_m: -1.0, ..HERE }, ..scan(NOTHING) };
    let later = seen.plus_ms(ObstacleLayer::FADES_MS + 1_000);
    layer.see(later, &elsewhere, Some(&room()), &[]);
    let doubts =
        |layer: &ObstacleLayer, now| layer.doubts(now).map(|at| [at.x_m, at.y_m]).collect::<Vec<_>>();
    assert_eq!(layer.obstacles(later).count(), 0, "nothing is in the way any more");
    let [at] = doubts(&layer, later)[..] else { panic!("{:?}", doubts(&layer, later)) };
    let unobserved = layer.unobserved(later, 0.2, [0.0; 2], 2.0);
    assert!(unobserved.contains(&at) && unobserved.len() > 5, "it and what is around it");
    assert!(layer.unobserved(later, 0.2, [0.0, 9.0], 2.0).is_empty(), "far away it does not matter");
    layer.see(later.plus_ms(40), &scan(NOTHING), Some(&room()), &[]);
    assert_eq!(doubts(&layer, later.plus_ms(40)), Vec::<[f64; 2]>::new());
}

#[test]
fn a_doubt_ends_some_time() {
    let mut layer = ObstacleLayer::new(car(), Some(&room()));
    let seen = look(&mut layer, 0, 3, &scan(third(30.0)), Some(&room()));
    let elsewhere = BumperScan { pose: MapPose { x_m: -1.0, ..HERE }, ..scan(NOTHING) };
    let later = seen.plus_ms(ObstacleLayer::FADES_MS + ObstacleLayer::DOUBTFUL_MS + 1_000);
    layer.see(later, &elsewhere, Some(&room()), &[]);
    assert_eq!(layer.doubts(later).count(), 0);
}

#[test]
fn a_new_mark_beside_an_older_one_takes_nothing_back_that_was_seen_free_since() {
    let mut layer = ObstacleLayer::new(car(), Some(&room()));
    look(&mut layer, 0, 3, &scan(third(30.0)), Some(&room()));
    // From 7 cm farther left, one more beam hits; none gets to where the last one on the right was.
    let both = [None, None, None, Some(24.0), Some(24.0), None];
    let moved = BumperScan { pose: MapPose { x_m: 0.06, y_m: 0.07, yaw_rad: 0.0 }, ..scan(both) };
    let now = look(&mut layer, 1_000, 3, &moved, Some(&room()));
    assert_eq!(layer.obstacles(now).count(), 2);
    let unseen = layer.unseen_around(now, 0.3);
    assert!(!unseen.iter().any(|at| (at[0] - 0.525).abs() < 0.026 && (at[1] + 0.175).abs() < 0.026));
}

/// Two centimetres beside the third beam's middle stands a leg that only this beam has seen.
#[test]
fn a_beam_that_passes_beside_something_thin_does_not_take_it_away() {
    let mut layer = ObstacleLayer::new(car(), None);
    let now = look(&mut layer, 0, 3, &scan(third(30.0)), None);
    assert_eq!(layer.obstacles(now).count(), 1);
    let beside = |left_m: f64| BumperScan { pose: MapPose { y_m: left_m, ..HERE }, ..scan(NOTHING) };
    let now = look(&mut layer, 200, 5, &beside(0.02), None);
    assert_eq!(layer.obstacles(now).count(), 1, "no beam has looked where it was seen");
    let now = look(&mut layer, 600, 2, &beside(0.0), None);
    assert_eq!(layer.obstacles(now).count(), 0);
}

#[test]
fn something_broad_is_taken_away_by_any_beam_through_its_cells() {
    let mut layer = ObstacleLayer::new(car(), None);
    let broad = [None, None, Some(30.0), Some(30.0), None, None];
    let now = look(&mut layer, 0, 3, &scan(broad), None);
    assert_eq!(layer.obstacles(now).count(), 2);
    let beside = BumperScan { pose: MapPose { y_m: 0.012, ..HERE }, ..scan(NOTHING) };
    let now = look(&mut layer, 200, 2, &beside, None);
    assert_eq!(layer.obstacles(now).count(), 0);
}

/// A leg at the third beam; the robot swings, so that the beam passes over it and then beside it.
#[test]
fn a_beam_that_swings_off_something_thin_leaves_its_mark() {
    let mut layer = ObstacleLayer::new(car(), None);
    let at = |left_m: f64, ranges| BumperScan { pose: MapPose { y_m: left_m, ..HERE }, ..scan(ranges) };
    let lefts_m = (0..10).map(|n| 0.012 - 0.003 * f64::from(n));
    for (n, left_m) in lefts_m.enumerate() {
        layer.see(Stamp::from_ms(40 * n as u64), &at(left_m, third(30.0)), None, &[]);
    }
    let now = look(&mut layer, 400, 5, &at(-0.021, NOTHING), None);
    assert_eq!(layer.obstacles(now).count(), 1, "it was seen 2 cm farther to the left, on average");
}

#[test]
fn what_one_beam_at_a_time_has_seen_is_thin_until_two_see_it() {
    let mut layer = ObstacleLayer::new(car(), None);
    look(&mut layer, 0, 3, &scan(third(30.0)), None);
    assert_eq!(layer.thin_obstacles().count(), 1);
    let both = [None, None, None, Some(30.0), Some(30.0), None];
    look(&mut layer, 200, 3, &scan(both), None);
    assert_eq!(layer.thin_obstacles().count(), 0, "the one beside something broad belongs to it");
}

#[test]
fn what_one_beam_sees_beside_another_truck_is_no_thin_thing() {
    let mut layer = ObstacleLayer::new(car(), None);
    let [x_m, y_m] = {
        let now = look(&mut layer, 0, 3, &scan(third(30.0)), None);
        places(&layer, now)[0]
    };
    assert_eq!(layer.thin_obstacles().count(), 1);
    let there = (MapPose { x_m: x_m + car().rear_m + 0.25, y_m, ..HERE }, car());
    layer.see(Stamp::from_ms(200), &scan(third(30.0)), None, &[there]);
    assert_eq!(
        (layer.thin_obstacles().count(), layer.obstacles(Stamp::from_ms(200)).count()),
        (0, 1),
        "only a mark"
    );
}

#[test]
fn a_place_beyond_all_cells_is_in_the_outermost_one() {
    let grid = CellGrid { resolution_m: 0.05, origin_m: [0.0; 2] };
    assert_eq!(grid.place([-1e300, 1e300]), (i64::MAX, i64::MIN));
    assert_eq!(grid.place([-0.01, 0.01]), (0, -1));
}

#[test]
fn a_channel_without_a_range_finder_neither_sees_nor_clears() {
    let mut vehicle = VehicleConfig::default();
    vehicle.range_finders.front.0.truncate(3);
    let mut layer = ObstacleLayer::new(car(), None).seeing(Sight::of(&vehicle));
    let fourth = [None, None, None, Some(30.0), None, None];
    (0..5).for_each(|i| layer.see(Stamp::from_ms(38 * i), &scan(fourth), None, &[]));
    assert_eq!(layer.obstacles(Stamp::from_ms(200)).count(), 0);
    // 3.5 cm to the right of the middle looks the fourth of an XTB, to the left its third.
    let (ahead_m, left_m) = (0.25 + 0.2, 0.035);
    assert!(layer.is_known_free([ahead_m, left_m]) && !layer.is_known_free([ahead_m, -left_m - 0.02]));
}

#[test]
fn a_beam_that_is_turned_aside_sees_things_there_and_a_part_that_sees_far_far_away() {
    let mut vehicle = VehicleConfig::default();
    let finder = RangeFinder { turned_deg: 30.0, curve: RangeCurve::Gp2y0a02, ..RangeFinder::at(0.1) };
    vehicle.range_finders.front = BumperFinders(vec![finder]);
    let mut layer = ObstacleLayer::new(car(), None).seeing(Sight::of(&vehicle));
    let first = [Some(100.0), None, None, None, None, None];
    (0..5).for_each(|i| layer.see(Stamp::from_ms(38 * i), &scan(first), None, &[]));
    let found: Vec<_> = layer.obstacles(Stamp::from_ms(200)).collect();
    assert_eq!(found.len(), 1, "{found:?}");
    let at = [0.25 + 30_f64.to_radians().cos(), 0.1 + 0.5];
    assert!(found[0].distance_m(at) < 0.05, "{found:?}");
}
