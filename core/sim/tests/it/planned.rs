//! Planned goals with the full vehicle: around what the map knows of, through doors, to a yaw.

use crate::drive::Drive;
use crate::journeys::{Hinder, journeys, journeys_in_clutter};
use xtb_protocol::messages::{GoalStatus, Outcome};

const LAB: &str = include_str!("../../../../worlds/lab.toml");

#[test]
fn a_goal_behind_a_wall_is_reached_through_the_door() {
    let mut drive = Drive::new(LAB, 1, 3);
    assert!(matches!(drive.goto(0, 4.0, 5.0, Some(0.0)), Outcome::Ok(_)));
    let state = drive.wait(0, 120.0);
    let truth = drive.lockstep.simulation().trucks()[0].truth();
    assert_eq!(state.goal.as_ref().unwrap().status, GoalStatus::Reached, "{state:#?}\n{truth:?}");
    assert_eq!(truth.contacts, 0);
    assert!((truth.x_m - 4.0).abs() < 0.3 && (truth.y_m - 5.0).abs() < 0.3, "{truth:?}");
}

#[test]
fn goals_anywhere_in_the_lab_are_reached_without_touching_anything() {
    for journey in journeys(LAB, 0..6, Hinder::Nothing) {
        assert_eq!((journey.status, journey.contacts), (Some(GoalStatus::Reached), 0), "{journey:?}");
        assert!(journey.off_m < 0.25, "{journey:?}");
    }
}

#[test]
fn around_a_box_that_nobody_knew_of_or_an_honest_answer() {
    for journey in journeys(LAB, 20..26, Hinder::Box) {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!(journey.contacts, 0, "{journey:?}");
    }
}

/// In one it had looked at the box half a minute before, in the other it had seen one corner of it.
#[test]
fn a_box_beside_a_tight_bend_is_not_touched() {
    for journey in [journeys(LAB, 138..139, Hinder::Box), journeys(LAB, 143..144, Hinder::Box)].concat() {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!((journey.contacts, journey.hindered.len()), (0, 1), "{journey:?}");
    }
}

#[test]
fn where_the_body_stands_aslant_beside_a_wall_it_swings_no_farther_than_its_corners_may() {
    let corridor = include_str!("../../../../worlds/corridor.toml");
    for journey in journeys(corridor, 1085..1086, Hinder::Box) {
        assert!(journey.is_honest() && journey.contacts == 0, "{journey:?}");
    }
}

#[test]
fn somebody_who_steps_into_the_way_and_goes_again_keeps_it_from_nothing() {
    for journey in journeys(LAB, 40..44, Hinder::Person) {
        assert_eq!((journey.status, journey.contacts), (Some(GoalStatus::Reached), 0), "{journey:?}");
    }
}

#[test]
fn among_boxes_known_and_unknown_nothing_is_touched() {
    for journey in journeys_in_clutter(0..4, Hinder::TwoBoxes) {
        assert!(journey.is_honest(), "{journey:?}");
        assert_eq!(journey.contacts, 0, "{journey:?}");
    }
}

/// A fleet's map is published again every half minute.
#[test]
fn the_same_map_again_changes_nothing() {
    let mut drive = Drive::new(LAB, 1, 3);
    let map = drive.lockstep.simulation().world().to_map(0.05).unwrap();
    assert!(matches!(drive.goto(0, 4.0, 5.0, Some(0.0)), Outcome::Ok(_)));
    drive.run_s(5.0);
    let route = |drive: &mut Drive| drive.lockstep.state(0).unwrap().nav.route.unwrap();
    let before = route(&mut drive);
    drive.lockstep.set_map(&map);
    drive.run_s(1.0);
    let after = route(&mut drive);
    assert_eq!((after.plans, after.track), (before.plans, before.track));
    assert!(after.done_m > before.done_m + 0.1, "it drives on: {} m, {} m", before.done_m, after.done_m);
}
