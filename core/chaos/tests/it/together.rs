//! Several robots and traffic control: everybody arrives, nobody touches anybody, nobody stands for long.

use crate::meetings::{Door, Meeting, Trouble, circle, narrow};

/// Nobody touched anything, and nobody stood for long.
fn is_orderly(made: &Meeting) {
    let ok = made.contacts == 0 && made.is_brisk();
    assert!(ok, "{:#?}", Meeting { tracks: Vec::new(), ..made.clone() });
}

fn all_arrive(made: &Meeting) {
    is_orderly(made);
    assert_eq!(made.reached, made.ends.len(), "{:#?}", made.ends);
}

/// The doorway is closed for good: who is not through says by whom.
fn all_arrive_or_tell(made: &Meeting) {
    is_orderly(made);
    assert_eq!(made.ends.len(), 4, "one is out");
    assert!(made.is_told(), "{:#?}", made.ends);
}

#[test]
fn four_swap_across_a_circle() {
    all_arrive(&circle(4, 1, &mut Trouble::None.meddle()));
}

#[test]
fn ten_swap_across_a_circle() {
    (1..=3).for_each(|seed| all_arrive(&circle(10, seed, &mut Trouble::None.meddle())));
}

#[test]
fn ten_swap_across_a_circle_while_traffic_control_dies_and_comes_back() {
    (1..=2).for_each(|seed| all_arrive(&circle(10, seed, &mut Trouble::Restart.meddle())));
}

#[test]
fn ten_swap_across_a_circle_with_one_message_of_ten_lost() {
    (1..=2).for_each(|seed| all_arrive(&circle(10, seed, &mut Trouble::Loss.meddle())));
}

#[test]
fn five_swap_through_a_door_twenty_times() {
    let mut door = Door::new(1);
    (0..20).for_each(|_| all_arrive(&door.round(&mut Trouble::None.meddle())));
}

#[test]
fn five_swap_through_a_door_while_traffic_control_dies_and_comes_back() {
    (1..=2).for_each(|seed| all_arrive(&Door::new(seed).round(&mut Trouble::Restart.meddle())));
}

#[test]
fn five_swap_through_a_door_with_one_message_of_ten_lost() {
    let mut door = Door::new(2);
    (0..3).for_each(|_| all_arrive(&door.round(&mut Trouble::Loss.meddle())));
}

#[test]
fn when_one_dies_in_the_doorway_the_rest_arrives_or_says_who_is_in_the_way() {
    all_arrive_or_tell(&Door::new(1).round(&mut Trouble::Death.meddle()));
}

#[test]
fn when_one_is_latched_in_the_doorway_the_rest_arrives_or_says_who_is_in_the_way() {
    all_arrive_or_tell(&Door::new(3).round(&mut Trouble::Latch.meddle()));
}

#[test]
fn nose_to_nose_in_a_narrow_place_one_backs_out() {
    let made = narrow(1, &mut Trouble::None.meddle());
    all_arrive(&made);
    let turned_back = made.tracks.iter().any(|track| {
        // Against its first heading it went out of the narrow place (y = 7.7 to 8.3 m).
        let (north, first) = (track[0].yaw_rad > 0.0, track[0].y_m);
        let back_m = |y_m: f64| if north { first - y_m } else { y_m - first };
        track.iter().any(|pose| back_m(pose.y_m) > 0.4)
    });
    assert!(turned_back, "nobody backed out");
    all_arrive(&narrow(2, &mut Trouble::Restart.meddle()));
    all_arrive(&narrow(3, &mut Trouble::Loss.meddle()));
}
