//! The second level's follower on the whole vehicle: lag, play, wheel scale, servos off their lines.
//! `cargo run -p xtb-sim --example parking` prints the same figures for 500 parkings.

use crate::parkings::{Course, Eyes, Parked, Pilot, measure};
use crate::pillars::Margins;
use crate::trips::quantile;
use xtb_control::VehicleConfig;
use xtb_nav::{Car, DriveLimits, FollowerStatus};
use xtb_sim::DriveFault;

/// Reserve for the steering that a planner leaves: its arcs over the truck's tightest circle.
const RADIUS_FACTOR: f64 = 1.15;
/// What a planner keeps free for what the follower leaves.
const MARGINS: Margins = Margins { body_m: 0.02, look_out_m: 0.28 };

fn course(cruise_mps: f64) -> Course {
    Course { margins: Some(MARGINS), ..Course::new(cruise_mps, RADIUS_FACTOR) }
}

fn most(all: &[Parked], of: impl Fn(&Parked) -> f64) -> f64 {
    quantile(all.iter().map(of).collect(), 1.0)
}

#[test]
fn forty_goals_that_need_a_change_of_gear_are_reached_far_inside_the_box() {
    for cruise_mps in [0.35, 0.2] {
        let all = measure(40, &course(cruise_mps));
        assert!(all.iter().all(|parked| parked.cusps > 0 && parked.reached), "{all:?}");
        assert!(!all.iter().any(|parked| parked.alarmed), "no runaway, no stall: {all:?}");
        let missed_m = most(&all, |parked| parked.missed_m);
        let missed_deg = most(&all, |parked| parked.missed_deg);
        assert!(missed_m < 0.02 && missed_deg < 4.0, "{missed_m} m, {missed_deg}° at {cruise_mps} m/s");
        let beside_m = most(&all, |parked| parked.beside_m);
        assert!(beside_m < 0.015, "{beside_m} m beside the path at {cruise_mps} m/s");
        let outside_m = most(&all, |parked| parked.outside_m);
        assert!(outside_m < MARGINS.body_m, "a corner {outside_m} m outside at {cruise_mps} m/s");
        let overshoot_m = most(&all, |parked| parked.overshoot_m);
        assert!(overshoot_m < 0.01, "{overshoot_m} m past a stop at {cruise_mps} m/s");
        let took_s = most(&all, |parked| parked.took_s);
        assert!(took_s < 16.0, "{took_s} s at {cruise_mps} m/s");
    }
}

#[test]
fn between_things_as_near_as_the_margins_allow_it_touches_nothing_and_is_never_held() {
    let all = measure(100, &course(0.35));
    assert_eq!(all.iter().map(|parked| parked.contacts).sum::<u64>(), 0);
    let held: Vec<&Parked> = all.iter().filter(|parked| parked.blocked_s > 0.0).collect();
    assert!(held.is_empty(), "{held:?}");
    let blind = Margins { look_out_m: 0.0, ..MARGINS };
    let all = measure(10, &Course { margins: Some(blind), ..course(0.35) });
    assert!(all.iter().any(|parked| parked.blocked_s > 0.0), "without a look-out the obstacle rule holds it");
}

#[test]
fn a_pose_that_jumps_by_centimetres_or_drifts_still_leads_into_the_box() {
    for (eyes, most_m, most_deg) in [(Eyes::Fixes, 0.10, 12.0), (Eyes::Odometry, 0.12, 8.0)] {
        let all = measure(40, &Course { eyes, margins: None, ..course(0.35) });
        assert!(all.iter().all(|parked| parked.reached), "{eyes:?}: {all:?}");
        let missed_m = most(&all, |parked| parked.missed_m);
        let missed_deg = most(&all, |parked| parked.missed_deg);
        assert!(missed_m < most_m && missed_deg < most_deg, "{eyes:?}: {missed_m} m, {missed_deg}°");
    }
}

/// A pilot on a path of this number, with all of it released at 0.35 m/s.
fn pilot(seed: u64) -> (Pilot, VehicleConfig, DriveLimits) {
    let (vehicle, course) = (VehicleConfig::default(), course(0.35));
    let car = Car::of(&vehicle);
    let pilot = Pilot::new(&course, &course.path(seed, &car), &car, seed);
    (pilot, vehicle, DriveLimits { way_m: f64::INFINITY, cruise_mps: 0.35, clearance_m: 1.0, swing_rad: 0.0 })
}

#[test]
fn it_waits_at_the_end_of_what_is_released_and_goes_on_when_more_is() {
    for seed in 0..10 {
        let (mut pilot, vehicle, all) = pilot(seed);
        let part = DriveLimits { way_m: pilot.follower.length_m() * 0.4, ..all };
        let mut drive = pilot.step(&vehicle, &part);
        while drive.status != FollowerStatus::AtReleaseEnd && pilot.seconds() < 60.0 {
            drive = pilot.step(&vehicle, &part);
        }
        assert_eq!(drive.status, FollowerStatus::AtReleaseEnd, "seed {seed}: {drive:?}");
        let waits_m = drive.way_m;
        assert!((waits_m - part.way_m).abs() < 0.012, "seed {seed}: {drive:?}");
        (0..200).for_each(|_| drive = pilot.step(&vehicle, &part));
        assert!((drive.way_m - waits_m).abs() < 1e-3 && drive.speed_mps == 0.0, "seed {seed}: {drive:?}");
        while drive.status != FollowerStatus::Reached && pilot.seconds() < 120.0 {
            drive = pilot.step(&vehicle, &all);
        }
        assert_eq!(drive.status, FollowerStatus::Reached, "seed {seed}: {drive:?}");
    }
}

#[test]
fn wheels_that_are_held_are_reported_as_no_motion() {
    let (mut pilot, vehicle, all) = pilot(3);
    pilot.bench.truck().set_drive_fault(DriveFault::Held);
    let stuck = (0..500).find(|_| matches!(pilot.step(&vehicle, &all).status, FollowerStatus::Stuck(_)));
    assert!((200..350).contains(&stuck.unwrap()), "{stuck:?} steps of 10 ms");
    assert!(pilot.alarmed(), "the drive's own monitor has seen it too");
}
