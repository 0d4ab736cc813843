//! The follower on a toy car: servos with rate and lag, a motor with lag, nothing else. The whole vehicle
//! drives it in `core/sim/tests/it/parking.rs`.

#![allow(clippy::unwrap_used)]

use allocation_counter::measure;
use proptest::prelude::*;
use std::f64::consts::PI;
use std::hint::black_box;
use xtb_control::{Command, Stamp, VehicleConfig};
use xtb_nav::geometry::path::wrap_rad;
use xtb_nav::geometry::reeds_shepp::shortest;
use xtb_nav::path_follower::{FollowerError, GoalTolerance, Stuck};
use xtb_nav::{
    Car, DriveCommand, DriveLimits, FollowerSettings, FollowerStatus, MapPose, Path, PathFollower, Piece,
};

const DT_S: f64 = 0.01;
const ORIGIN: MapPose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };
const ALL: DriveLimits =
    DriveLimits { way_m: f64::INFINITY, cruise_mps: 0.35, clearance_m: 1.0, swing_rad: 0.0 };

fn car() -> Car {
    Car::of(&VehicleConfig::default())
}

fn follower(path: &Path) -> PathFollower {
    PathFollower::new(path, &car(), FollowerSettings::default(), GoalTolerance::default()).unwrap()
}

fn straight(length_m: f64) -> Path {
    Path { start: ORIGIN, pieces: vec![Piece { length_m, curvature_per_m: 0.0 }] }
}

/// Ahead 0.6 m to the left, astern 0.5 m to the right.
fn with_a_cusp() -> Path {
    let pieces =
        [(0.6, 2.0), (-0.5, -2.0)].map(|(length_m, curvature_per_m)| Piece { length_m, curvature_per_m });
    Path { start: ORIGIN, pieces: pieces.to_vec() }
}

/// A car with wheels that need their time.
struct Toy {
    follower: PathFollower,
    pose: MapPose,
    speed_mps: f64,
    wheels_per_m: f64,
    steps: u64,
}

impl Toy {
    fn new(path: &Path) -> Self {
        Self { follower: follower(path), pose: path.start, speed_mps: 0.0, wheels_per_m: 0.0, steps: 0 }
    }

    fn decide(&mut self, limits: &DriveLimits) -> DriveCommand {
        self.steps += 1;
        let now = Stamp::from_ms(10 * self.steps);
        self.follower.step(now, &self.pose, self.speed_mps, limits)
    }

    fn roll(&mut self, drive: &DriveCommand) {
        let most_per_m = 1.0 / car().radius_m;
        let missing = (drive.curvature_per_m - self.wheels_per_m) * (1.0 - libm::exp(-DT_S / 0.03));
        self.wheels_per_m += missing.clamp(-most_per_m * 0.1, most_per_m * 0.1);
        // The speed controller is faster than the coasting motor.
        let lag_s = if drive.speed_mps == 0.0 { 0.25 } else { 0.1 };
        self.speed_mps += (drive.speed_mps - self.speed_mps) * (1.0 - libm::exp(-DT_S / lag_s));
        if drive.speed_mps == 0.0 && self.speed_mps.abs() < 1e-3 {
            self.speed_mps = 0.0;
        }
        let piece = Piece { length_m: self.speed_mps * DT_S, curvature_per_m: self.wheels_per_m };
        self.pose = piece.end(&self.pose);
    }

    fn step(&mut self, limits: &DriveLimits) -> DriveCommand {
        let drive = self.decide(limits);
        self.roll(&drive);
        drive
    }

    /// Steps until the status is such, at most for a minute; `each` sees every step.
    fn until(
        &mut self,
        limits: &DriveLimits,
        holds: fn(FollowerStatus) -> bool,
        mut each: impl FnMut(&Self, &DriveCommand),
    ) -> DriveCommand {
        for _ in 0..6000 {
            let drive = self.decide(limits);
            each(self, &drive);
            if holds(drive.status) {
                return drive;
            }
            self.roll(&drive);
        }
        panic!("still under way at {:?}", self.pose);
    }
}

fn is_reached(status: FollowerStatus) -> bool {
    status == FollowerStatus::Reached
}

fn is_at_release_end(status: FollowerStatus) -> bool {
    status == FollowerStatus::AtReleaseEnd
}

#[test]
fn goals_all_around_are_reached_and_the_gear_changes_at_a_standstill_with_turned_wheels() {
    for number in 0..60 {
        let turn = f64::from(number);
        let goal = MapPose {
            x_m: 0.9 * libm::cos(turn * 2.4) * (turn / 60.0),
            y_m: 0.9 * libm::sin(turn * 2.4) * (turn / 60.0),
            yaw_rad: wrap_rad(turn * 0.7),
        };
        let path = shortest(&ORIGIN, &goal, car().radius_m * 1.15);
        let (mut toy, mut gear, mut stood) = (Toy::new(&path), 1.0, true);
        toy.until(&ALL, is_reached, |toy, drive| {
            assert!(drive.cross_m.abs() < 0.015, "goal {number}: {drive:?}");
            assert!(drive.left_m > -0.01, "goal {number}: {drive:?}");
            let changes = drive.speed_mps * gear < 0.0;
            assert!(!changes || toy.speed_mps.abs() < 0.01, "goal {number}: rolls at {}", toy.speed_mps);
            if stood && drive.speed_mps != 0.0 {
                let turned = (toy.wheels_per_m - drive.curvature_per_m).abs() * car().radius_m;
                assert!(turned < 0.05, "goal {number}: {turned} of full lock are missing");
            }
            stood = drive.speed_mps == 0.0 && toy.speed_mps.abs() < 0.01;
            if drive.speed_mps != 0.0 {
                gear = drive.speed_mps.signum();
            }
        });
        let off_m = libm::hypot(toy.pose.x_m - goal.x_m, toy.pose.y_m - goal.y_m);
        let off_deg = wrap_rad(toy.pose.yaw_rad - goal.yaw_rad).to_degrees().abs();
        assert!(off_m < 0.015 && off_deg < 2.5, "goal {number}: {off_m} m, {off_deg}°");
    }
}

#[test]
fn an_error_at_the_start_fades_in_either_gear() {
    for length_m in [1.5, -1.5] {
        let mut toy = Toy::new(&straight(length_m));
        (toy.pose.y_m, toy.pose.yaw_rad) = (0.06, -0.15);
        toy.until(&ALL, is_reached, |_, _| {});
        assert!(toy.pose.y_m.abs() < 0.003 && toy.pose.yaw_rad.abs() < 0.01, "{:?}", toy.pose);
    }
}

#[test]
fn it_drives_at_cruise_and_no_faster_than_the_clearance_allows() {
    for (cruise_mps, clearance_m, most_mps) in
        [(0.35, 1.0, 0.35), (0.2, 1.0, 0.2), (0.35, 0.1, 0.2), (0.35, 0.0, 0.1)]
    {
        let limits = DriveLimits { cruise_mps, clearance_m, ..ALL };
        let mut fastest_mps: f64 = 0.0;
        Toy::new(&straight(1.5))
            .until(&limits, is_reached, |_, drive| fastest_mps = fastest_mps.max(drive.speed_mps));
        assert!((fastest_mps - most_mps).abs() < 1e-9, "{fastest_mps} of {most_mps}");
    }
    let mut toy = Toy::new(&straight(1.5));
    let stand = DriveLimits { cruise_mps: 0.0, ..ALL };
    (0..800).for_each(|_| assert_eq!(toy.step(&stand).speed_mps, 0.0));
    assert_eq!(toy.step(&stand).status, FollowerStatus::Following, "told to stand it is not stuck");
}

#[test]
fn the_end_of_what_is_released_is_a_stop_that_moves_on_with_it() {
    let mut toy = Toy::new(&straight(2.0));
    let waits = toy.until(&DriveLimits { way_m: 0.8, ..ALL }, is_at_release_end, |_, _| {});
    assert!((waits.way_m - 0.8).abs() < 0.01, "{waits:?}");
    // A lease that is renewed in time never makes it stand.
    let mut slowest_mps: f64 = 1.0;
    while toy.follower.way_m() < 1.5 {
        let ahead = DriveLimits { way_m: toy.follower.way_m() + 0.4, ..ALL };
        toy.step(&ahead);
        if toy.follower.way_m() > 1.0 {
            slowest_mps = slowest_mps.min(toy.speed_mps);
        }
    }
    assert!(slowest_mps > 0.3, "{slowest_mps}");
    // Taken back under its wheels: it stops where it can.
    let took_back_m = toy.follower.way_m();
    let waits = toy.until(&DriveLimits { way_m: 1.2, ..ALL }, is_at_release_end, |_, drive| {
        assert_eq!(drive.speed_mps, 0.0)
    });
    assert!(waits.way_m < took_back_m + 0.35 * 0.3, "{waits:?}");
}

#[test]
fn more_that_is_released_while_it_rolls_out_lets_it_go_on_without_standing() {
    let mut toy = Toy::new(&straight(2.0));
    let part = DriveLimits { way_m: 0.8, ..ALL };
    while toy.step(&part).speed_mps != 0.0 || toy.follower.way_m() < 0.5 {}
    let slow_mps = toy.speed_mps;
    assert!(slow_mps > 0.03);
    for _ in 0..100 {
        toy.step(&ALL);
        assert!(toy.speed_mps > slow_mps * 0.5);
    }
    assert!(toy.speed_mps > 0.25);
}

#[test]
fn a_release_that_ends_at_the_cusp_is_waited_for_there() {
    let mut toy = Toy::new(&with_a_cusp());
    let first = DriveLimits { way_m: 0.6, ..ALL };
    toy.until(&first, is_at_release_end, |_, drive| assert!(drive.speed_mps >= 0.0));
    (0..300).for_each(|_| assert_eq!(toy.step(&first).status, FollowerStatus::AtReleaseEnd));
    let mut cusp = false;
    toy.until(&ALL, is_reached, |_, drive| cusp |= drive.status == FollowerStatus::AtCusp);
    let end = with_a_cusp().end();
    assert!(libm::hypot(toy.pose.x_m - end.x_m, toy.pose.y_m - end.y_m) < 0.015);
}

#[test]
fn at_the_cusp_it_says_so_while_it_turns_its_wheels() {
    let (mut toy, mut at_cusp) = (Toy::new(&with_a_cusp()), 0);
    toy.until(&ALL, is_reached, |toy, drive| {
        if drive.status == FollowerStatus::AtCusp {
            assert!(toy.speed_mps.abs() < 0.01 && (drive.way_m - 0.6).abs() < 0.01);
            at_cusp += 1;
        }
    });
    assert!((20..70).contains(&at_cusp), "{at_cusp} steps of 10 ms from lock to lock");
}

#[test]
fn a_car_off_its_path_stops_and_says_so_and_one_turned_away_too() {
    let mut toy = Toy::new(&straight(2.0));
    (0..200).for_each(|_| _ = toy.step(&ALL));
    toy.pose.y_m = 0.13;
    let drive = toy.step(&ALL);
    assert!(
        matches!(drive.status, FollowerStatus::Deviated { m, .. } if (m - 0.13).abs() < 0.01),
        "{drive:?}"
    );
    assert_eq!(drive.speed_mps, 0.0);
    (toy.pose.y_m, toy.pose.yaw_rad) = (0.0, 0.8);
    assert!(matches!(toy.step(&ALL).status, FollowerStatus::Deviated { .. }));
    toy.pose.yaw_rad = 0.0;
    toy.until(&ALL, is_reached, |_, _| {});
}

#[test]
fn a_goal_outside_the_tolerance_is_missed_not_reached() {
    let exact = GoalTolerance { position_m: 0.05, yaw_rad: Some(0.05) };
    let settings = FollowerSettings { deviation_m: 0.5, ..FollowerSettings::default() };
    for (y_m, yaw_rad, missed) in [(0.0, 0.0, false), (0.06, 0.0, true), (0.0, 0.06, true)] {
        let mut follower = PathFollower::new(&straight(1.0), &car(), settings.clone(), exact).unwrap();
        let pose = MapPose { x_m: 1.0, y_m, yaw_rad };
        let mut last = follower.step(Stamp::ZERO, &ORIGIN, 0.0, &ALL);
        // Carried to its goal.
        for step in 1..200 {
            let part = f64::from(step).min(100.0) / 100.0;
            let now = MapPose { x_m: part, y_m: pose.y_m, yaw_rad: pose.yaw_rad };
            let speed_mps = if step < 100 { 1.0 } else { 0.0 };
            last = follower.step(Stamp::from_ms(step as u64 * 10), &now, speed_mps, &ALL);
        }
        let wanted = if missed { FollowerStatus::Stuck(Stuck::Missed) } else { FollowerStatus::Reached };
        assert_eq!(last.status, wanted, "{pose:?}");
    }
}

#[test]
fn a_pose_or_a_limit_that_is_no_number_stops_it() {
    let mut toy = Toy::new(&straight(2.0));
    (0..200).for_each(|_| _ = toy.step(&ALL));
    let here = std::mem::replace(&mut toy.pose, MapPose { x_m: f64::NAN, ..ORIGIN });
    let drive = toy.decide(&ALL);
    assert_eq!((drive.status, drive.speed_mps), (FollowerStatus::Stuck(Stuck::NotANumber), 0.0));
    assert!(drive.curvature_per_m.is_finite());
    toy.pose = here;
    let nothing = f64::NAN;
    for limits in [
        DriveLimits { way_m: nothing, ..ALL },
        DriveLimits { cruise_mps: nothing, ..ALL },
        DriveLimits { clearance_m: nothing, ..ALL },
        DriveLimits { swing_rad: nothing, ..ALL },
    ] {
        let drive = toy.decide(&limits);
        assert_eq!(
            (drive.status, drive.speed_mps),
            (FollowerStatus::Stuck(Stuck::NotANumber), 0.0),
            "{limits:?}"
        );
    }
    toy.until(&ALL, is_reached, |_, _| {});
}

#[test]
fn held_wheels_and_slipping_wheels_are_told_apart() {
    let mut toy = Toy::new(&straight(2.0));
    let stuck = |toy: &mut Toy, speed_mps| {
        (0..1000).find_map(|_| {
            toy.speed_mps = speed_mps;
            match toy.decide(&ALL).status {
                FollowerStatus::Stuck(why) => Some(why),
                _ => None,
            }
        })
    };
    assert_eq!(stuck(&mut toy, 0.0), Some(Stuck::NoMotion));
    assert_eq!(stuck(&mut toy, 0.1), Some(Stuck::NoProgress));
}

#[test]
fn what_held_it_finds_it_asking_for_little_when_it_lets_go() {
    let mut toy = Toy::new(&straight(2.0));
    let mut most_mps: f64 = 0.0;
    for _ in 0..150 {
        most_mps = most_mps.max(toy.decide(&ALL).speed_mps);
    }
    assert!((0.1..=0.2).contains(&most_mps), "{most_mps}");
    toy.until(&ALL, is_reached, |_, _| {});
}

#[test]
fn a_new_path_for_a_rolling_car_goes_on_in_the_same_gear_and_stops_for_the_other() {
    let mut toy = Toy::new(&straight(2.0));
    toy.speed_mps = 0.3;
    let first = toy.step(&ALL);
    assert!(first.speed_mps > 0.25, "{first:?}");
    let mut toy = Toy::new(&straight(-1.0));
    toy.speed_mps = 0.3;
    toy.until(&ALL, is_reached, |toy, drive| assert!(drive.speed_mps == 0.0 || toy.speed_mps < 0.01));
    assert!((toy.pose.x_m + 1.0).abs() < 0.015, "{:?}", toy.pose);
}

#[test]
fn a_trembling_pose_does_not_keep_it_from_starting() {
    let mut toy = Toy::new(&straight(1.0));
    let started = (0..300).find(|step| {
        toy.pose.y_m = if step % 2 == 0 { 0.01 } else { -0.01 };
        toy.decide(&ALL).speed_mps > 0.0
    });
    assert!(started.is_some_and(|step| step < 120), "{started:?}");
}

#[test]
fn what_cannot_be_driven_is_refused() {
    let refused = |path: &Path| {
        PathFollower::new(path, &car(), FollowerSettings::default(), GoalTolerance::default()).unwrap_err()
    };
    let mut path = straight(1.0);
    path.pieces.push(Piece { length_m: 0.5, curvature_per_m: 3.0 });
    let error = refused(&path);
    assert!(matches!(error, FollowerError::TooTight { piece: 2, .. }));
    assert_eq!(error.to_string(), "piece 2 of the path has a radius of 0.333 m, the vehicle needs 0.393 m");
    path.pieces[0].length_m = f64::NAN;
    assert_eq!(refused(&path), FollowerError::NotFinite { piece: 1 });
    path.start.x_m = f64::INFINITY;
    assert_eq!(refused(&path), FollowerError::NotFinite { piece: 0 });
}

#[test]
fn a_path_without_pieces_is_reached_where_it_stands() {
    let drive = Toy::new(&Path::standing(ORIGIN))
        .until(&ALL, is_reached, |_, drive| assert_eq!(drive.speed_mps, 0.0));
    assert_eq!(drive.way_m, 0.0);
}

#[test]
fn a_drive_becomes_rpm_and_a_fraction_of_full_lock() {
    let vehicle = VehicleConfig::default();
    let mut drive = Toy::new(&straight(1.0)).step(&ALL);
    (drive.speed_mps, drive.curvature_per_m) = (-0.35, 1.0 / car().radius_m);
    let Command::Follow { rpm, steering } = drive.command(&vehicle) else { panic!("not followed") };
    assert!((rpm.get() + 40.49).abs() < 0.01, "{rpm:?}");
    assert!((steering.get() + 1.0).abs() < 1e-9, "full lock to the left: {steering:?}");
    drive.curvature_per_m = -9.0;
    let Command::Follow { steering, .. } = drive.command(&vehicle) else { panic!("not followed") };
    assert_eq!(steering.get(), 1.0);
}

#[test]
fn a_step_allocates_nothing() {
    let mut toy = Toy::new(&with_a_cusp());
    let mut seen = Vec::new();
    for step in 0..2000_u64 {
        let mut drive = None;
        let counted = measure(|| drive = Some(black_box(toy.decide(black_box(&ALL)))));
        assert_eq!(counted.count_total, 0, "step {step}");
        let drive = drive.unwrap();
        if seen.last() != Some(&drive.status) {
            seen.push(drive.status);
        }
        toy.roll(&drive);
    }
    assert_eq!(
        seen,
        [
            FollowerStatus::Following,
            FollowerStatus::AtCusp,
            FollowerStatus::Following,
            FollowerStatus::Reached
        ]
    );
}

/// Any path that the car can drive.
fn any_path() -> impl Strategy<Value = Path> {
    let piece = (-1.5..1.5, -1.0..=1.0)
        .prop_map(|(length_m, part)| Piece { length_m, curvature_per_m: part / car().radius_m });
    proptest::collection::vec(piece, 0..12).prop_map(|pieces| Path { start: ORIGIN, pieces })
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![8 => -2.0..=2.0, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => -1e6..=1e6, 1 => Just(0.0)]
}

proptest! {
    #[test]
    fn nothing_that_comes_in_makes_it_ask_for_more_than_it_may(
        path in any_path(),
        steps in proptest::collection::vec(
            ((any_number(), any_number(), -PI..PI, any_number()), (any_number(), 0.0..=0.35, any_number()), 0_u64..200),
            1..60,
        ),
    ) {
        let mut follower = follower(&path);
        let mut now = Stamp::ZERO;
        for ((x_m, y_m, yaw_rad, speed_mps), (way_m, cruise_mps, clearance_m), ms) in steps {
            now = now.plus_ms(ms);
            let limits = DriveLimits { way_m, cruise_mps, clearance_m, swing_rad: 0.0 };
            let drive = follower.step(now, &MapPose { x_m, y_m, yaw_rad }, speed_mps, &limits);
            prop_assert!(drive.speed_mps.abs() <= cruise_mps, "{:?}", drive);
            prop_assert!(drive.curvature_per_m.abs() * car().radius_m <= 1.0 + 1e-12, "{:?}", drive);
            prop_assert!(drive.way_m >= 0.0 && drive.way_m <= follower.length_m(), "{:?}", drive);
            prop_assert!(drive.way_m <= path.length_m() + 1e-9);
            prop_assert!(drive.cross_m.is_finite() && drive.heading_rad.is_finite());
        }
    }

    #[test]
    fn on_a_path_of_any_pieces_it_stays_near_and_arrives(path in any_path()) {
        // As much reserve as a planner leaves.
        let mut path = path;
        path.pieces.iter_mut().for_each(|piece| piece.curvature_per_m /= 1.15);
        let mut toy = Toy::new(&path);
        for _ in 0..12_000 {
            let drive = toy.step(&ALL);
            prop_assert!(drive.cross_m.abs() < 0.04, "{:?}", drive);
            if drive.status == FollowerStatus::Reached {
                break;
            }
        }
        let end = path.end();
        let off_m = libm::hypot(toy.pose.x_m - end.x_m, toy.pose.y_m - end.y_m);
        prop_assert!(off_m < 0.04, "{off_m} m from the end");
    }
}
