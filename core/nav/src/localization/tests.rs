//! A truck without a body: exact arcs, an odometry with a drift and a wheel scale, and fixes on demand.

use super::*;
use nalgebra::SMatrix;
use proptest::prelude::*;
use rand_core::Rng;
use rand_pcg::Pcg32;
use xtb_control::frames::wrap_rad;
use xtb_control::odometry::{GYRO_DEG_PER_COUNT, Odometry};

const STEP_NS: u64 = 10_000_000;
const EAST: MapPose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };

struct Truck {
    now: Stamp,
    truth: MapPose,
    drift_radps: f64,
    scale: f64,
    odometry: Odometry,
    filter: PoseFilter,
    rng: Pcg32,
}

impl Truck {
    fn new(drift_radps: f64, scale: f64) -> Self {
        let vehicle = VehicleConfig::default();
        let mut odometry = Odometry::default();
        odometry.yaw(0);
        let filter = PoseFilter::new(&vehicle, FilterTuning::default(), Stamp::ZERO, &odometry.pose(), &EAST);
        let rng = Pcg32::new(7, 7);
        Self { now: Stamp::ZERO, truth: EAST, drift_radps, scale, odometry, filter, rng }
    }

    /// One gyro reading and one encoder window of 10 ms.
    fn step(&mut self, mps: f64, curvature_per_m: f64) {
        self.now = self.now.plus_ns(STEP_NS);
        let way_m = mps * 0.01;
        let piece = crate::geometry::Piece { length_m: way_m, curvature_per_m };
        self.truth = piece.end(&self.truth);
        let clockwise_rad = -self.truth.yaw_rad + self.drift_radps * self.now.s();
        let counts = libm::round(clockwise_rad.to_degrees() / GYRO_DEG_PER_COUNT) as i64 as i16;
        self.odometry.yaw(counts);
        // The encoder counts the wheels, which roll by 1 / cos δ more than the middle.
        let tan = curvature_per_m * VehicleConfig::default().geometry.wheelbase_m / 2.0;
        let wheels_m = way_m * (1.0 + tan * tan).sqrt() / (1.0 + self.scale);
        if way_m != 0.0 {
            self.odometry.advance(wheels_m * 60.0, 1.0, std::f64::consts::FRAC_1_PI);
        }
        self.filter.odometry(self.now, &self.odometry.pose()).unwrap();
    }

    fn drive(&mut self, seconds: f64, mps: f64, curvature_per_m: f64) {
        for _ in 0..libm::round(seconds * 100.0) as u32 {
            self.step(mps, curvature_per_m);
        }
    }

    fn noise(&mut self, sigma: f64) -> f64 {
        let mut uniform = || f64::from(self.rng.next_u32()) / f64::from(u32::MAX) - 0.5;
        (uniform() + uniform() + uniform() + uniform()) * 3.0_f64.sqrt() * sigma
    }

    fn exact_fix(&self, yaw: bool) -> StampedFix {
        StampedFix {
            stamp: self.now,
            x_m: self.truth.x_m,
            y_m: self.truth.y_m,
            yaw_rad: yaw.then_some(self.truth.yaw_rad),
            covariance: StampedFix::independent(0.05, 0.05),
            source: FixSource::MotionCapture,
        }
    }

    /// A fix with 5 cm and 0.05 rad of noise.
    fn noisy_fix(&mut self, yaw: bool) -> StampedFix {
        let mut fix = self.exact_fix(yaw);
        (fix.x_m, fix.y_m) = (fix.x_m + self.noise(0.05), fix.y_m + self.noise(0.05));
        fix.yaw_rad = fix.yaw_rad.map(|yaw_rad| yaw_rad + self.noise(0.05));
        fix
    }

    fn fixed(&mut self, fix: &StampedFix) -> FixOutcome {
        self.filter.fix(self.now, fix).unwrap()
    }

    /// Drives about with two fixes a second; what became of each.
    fn tour(&mut self, seconds: u32, yaw: bool) -> Vec<FixOutcome> {
        (0..seconds * 2)
            .map(|half_s| {
                self.drive(0.5, if half_s / 8 % 3 == 2 { -0.2 } else { 0.3 }, f64::from(half_s % 5) - 1.5);
                let fix = self.noisy_fix(yaw);
                self.fixed(&fix)
            })
            .collect()
    }

    fn off_m(&self) -> f64 {
        let pose = self.filter.estimate(self.now).pose;
        libm::hypot(pose.x_m - self.truth.x_m, pose.y_m - self.truth.y_m)
    }

    fn turned_rad(&self) -> f64 {
        wrap_rad(self.filter.estimate(self.now).pose.yaw_rad - self.truth.yaw_rad).abs()
    }
}

fn bits(pose: &MapPose) -> [u64; 3] {
    [pose.x_m, pose.y_m, pose.yaw_rad].map(f64::to_bits)
}

#[test]
fn without_fixes_the_pose_is_the_odometry_to_the_bit() {
    let mut truck = Truck::new(0.002, 0.013);
    let mut align = MapFromOdom::aligning(&OdomPose::default(), &EAST);
    for round in 0..40 {
        truck.drive(1.7, 0.3 - 0.02 * f64::from(round), f64::from(round % 5) - 2.0);
        if round % 7 == 3 {
            let before = truck.odometry.pose();
            truck.odometry.rezero();
            align = MapFromOdom::aligning(&truck.odometry.pose(), &align.pose(&before));
            truck.filter.rezeroed(&before, &truck.odometry.pose());
        }
        if round == 20 {
            let set = MapPose { x_m: 3.3, y_m: -0.7, yaw_rad: -3.0 };
            align = MapFromOdom::aligning(&truck.odometry.pose(), &set);
            truck.filter.set_pose(truck.now, &truck.odometry.pose(), &set);
        }
        let estimate = truck.filter.estimate(truck.now);
        assert_eq!(bits(&estimate.pose), bits(&align.pose(&truck.odometry.pose())));
        assert_eq!((estimate.drift_radps, estimate.wheel_scale, estimate.fix_age_ms), (0.0, 0.0, None));
    }
    let estimate = truck.filter.estimate(truck.now);
    assert!(estimate.sigma_m > 0.1 && estimate.sigma_yaw_rad > 0.05, "{estimate:?}");
}

#[test]
fn a_rejected_fix_leaves_the_odometry_alone() {
    let mut truck = Truck::new(0.002, 0.0);
    truck.drive(3.0, 0.3, 0.5);
    let before = truck.filter.estimate(truck.now);
    let fix = StampedFix { x_m: truck.truth.x_m + 1.0, ..truck.exact_fix(false) };
    assert!(matches!(truck.fixed(&fix), FixOutcome::Rejected { mahalanobis, limit } if mahalanobis > limit));
    let after = truck.filter.estimate(truck.now);
    assert_eq!(bits(&after.pose), bits(&before.pose));
    assert_eq!(after.covariance, before.covariance);
    assert_eq!((after.fixes.rejected, after.fix_age_ms), (1, None));
}

#[test]
fn a_fix_and_the_odometry_are_weighed_by_how_sure_they_are() {
    let mut truck = Truck::new(0.0, 0.0);
    let fix = StampedFix { x_m: 0.1, ..truck.exact_fix(true) };
    truck.fixed(&fix);
    let estimate = truck.filter.estimate(truck.now);
    let both = |a: f64, b: f64| 1.0 / (1.0 / (a * a) + 1.0 / (b * b));
    let (m2, rad2) = (both(0.02, 0.05), both(0.02, 0.05));
    assert!((estimate.pose.x_m - 0.1 * m2 / 0.0025).abs() < 1e-9, "{estimate:?}");
    assert!((estimate.covariance[0][0] - m2).abs() < 1e-12, "{estimate:?}");
    assert!((estimate.covariance[2][2] - rad2).abs() < 1e-12, "{estimate:?}");
    assert!((estimate.sigma_m - m2.sqrt()).abs() < 1e-12);
}

#[test]
fn drift_and_wheels_are_learnt_and_serve_when_the_fixes_drop_out() {
    for yaw in [false, true] {
        let mut truck = Truck::new(0.003, -0.02);
        truck.tour(180, yaw);
        let learnt = truck.filter.estimate(truck.now);
        assert!((learnt.drift_radps - 0.003).abs() < 4.0 * learnt.drift_sigma_radps, "{learnt:?}");
        assert!((learnt.wheel_scale + 0.02).abs() < 4.0 * learnt.wheel_scale_sigma, "{learnt:?}");
        assert!(learnt.drift_sigma_radps < 3e-4 && learnt.wheel_scale_sigma < 6e-3, "{learnt:?}");
        truck.drive(30.0, 0.3, 0.4);
        assert!(truck.off_m() < 0.25, "{} m after 9 m without", truck.off_m());
        assert_eq!(truck.filter.estimate(truck.now).fix_age_ms, Some(30_000));
    }
}

#[test]
fn a_truck_that_stands_learns_its_drift_from_standing() {
    let mut truck = Truck::new(0.0025, 0.0);
    let fix = truck.exact_fix(true);
    assert!(matches!(truck.fixed(&fix), FixOutcome::Accepted { .. }));
    truck.drive(60.0, 0.0, 0.0);
    let learnt = truck.filter.estimate(truck.now);
    assert!((learnt.drift_radps - 0.0025).abs() < 2e-4, "{learnt:?}");
    assert!(truck.turned_rad() < 0.01, "{}", truck.turned_rad());
}

#[test]
fn a_late_fix_counts_where_it_was_measured() {
    let drive = |late: bool| {
        let mut truck = Truck::new(0.002, 0.01);
        truck.tour(10, false);
        let fix = truck.noisy_fix(true);
        if !late {
            truck.fixed(&fix);
        }
        truck.drive(0.3, 0.3, 1.0);
        if late {
            assert!(matches!(truck.fixed(&fix), FixOutcome::Accepted { .. }));
        }
        truck.filter.estimate(truck.now)
    };
    assert_eq!(drive(true), drive(false));
}

#[test]
fn fixes_that_overtake_each_other_count_as_if_they_had_not() {
    let drive = |overtakes: bool| {
        let mut truck = Truck::new(0.002, 0.01);
        truck.tour(10, false);
        let first = truck.noisy_fix(true);
        truck.drive(0.1, 0.3, 1.0);
        let second = truck.noisy_fix(false);
        truck.drive(0.1, 0.3, 1.0);
        let both = if overtakes { [second, first] } else { [first, second] };
        for fix in &both {
            assert!(matches!(truck.fixed(fix), FixOutcome::Accepted { .. }));
        }
        truck.filter.estimate(truck.now)
    };
    assert_eq!(drive(true), drive(false));
}

#[test]
fn a_fix_from_too_long_ago_or_from_before_the_pose_was_set_is_not_used() {
    let mut truck = Truck::new(0.0, 0.0);
    truck.drive(1.0, 0.3, 0.0);
    let old = truck.exact_fix(false);
    truck.drive(0.51, 0.3, 0.0);
    assert!(matches!(truck.fixed(&old), FixOutcome::TooOld { age_s, .. } if age_s > 0.5));
    let young = truck.exact_fix(false);
    truck.drive(0.1, 0.3, 0.0);
    truck.filter.set_pose(truck.now, &truck.odometry.pose(), &EAST);
    assert!(matches!(truck.fixed(&young), FixOutcome::TooOld { .. }));
    assert_eq!(
        bits(&truck.filter.estimate(truck.now).pose),
        bits(&MapFromOdom::aligning(&truck.odometry.pose(), &EAST).pose(&truck.odometry.pose()))
    );
    assert_eq!(truck.filter.estimate(truck.now).fixes.too_old, 2);
}

#[test]
fn a_truck_that_was_carried_away_starts_again_once_its_own_motion_confirms_its_fixes() {
    for yaw in [true, false] {
        let mut truck = Truck::new(0.002, 0.01);
        truck.tour(30, yaw);
        truck.truth = MapPose { x_m: -4.0, y_m: 7.0, yaw_rad: truck.truth.yaw_rad };
        // Turned about as well, which the gyro does not see while it is switched off.
        let fix = |truck: &mut Truck| {
            truck.drive(0.5, 0.3, 1.0);
            let mut fix = truck.noisy_fix(yaw);
            let (sin, cos) = libm::sincos(2.0);
            let (dx, dy) = (fix.x_m + 4.0, fix.y_m - 7.0);
            (fix.x_m, fix.y_m) = (dx * cos - dy * sin - 4.0, dx * sin + dy * cos + 7.0);
            fix.yaw_rad = fix.yaw_rad.map(|yaw_rad| wrap_rad(yaw_rad + 2.0));
            truck.fixed(&fix)
        };
        let first: Vec<FixOutcome> = (0..6).map(|_| fix(&mut truck)).collect();
        assert!(first.iter().all(|o| matches!(o, FixOutcome::Rejected { .. })), "{first:?}");
        let unsure = truck.filter.estimate(truck.now);
        assert!(unsure.contradicted && 3.0 * unsure.sigma_m > 6.0, "{unsure:?}");
        assert_eq!(allowed(&unsure, 0.5), UncertaintySpeed::Stop);
        let next: Vec<FixOutcome> = (0..12).map(|_| fix(&mut truck)).collect();
        let restarts = next.iter().filter(|o| matches!(o, FixOutcome::Restarted { .. }));
        let turns: Vec<(f64, f64)> = restarts
            .filter_map(|o| match o {
                FixOutcome::Restarted { moved_m, turned_rad } => Some((*moved_m, *turned_rad)),
                _ => None,
            })
            .collect();
        assert!(turns.len() == 1 && turns[0].0 > 1.0 && (turns[0].1 - 2.0).abs() < 0.4, "{next:?}");
        let after: Vec<FixOutcome> = (0..20).map(|_| fix(&mut truck)).collect();
        assert!(after.iter().all(|o| matches!(o, FixOutcome::Accepted { .. })), "{after:?}");
        let found = truck.filter.estimate(truck.now);
        assert!(found.fixes.restarts == 1 && !found.contradicted, "{found:?}");
    }
}

#[test]
fn fixes_alone_do_not_move_a_truck_that_stands_but_its_pose_is_uncertain_until_it_drives() {
    let mut truck = Truck::new(0.002, 0.0);
    truck.tour(30, false);
    truck.truth = MapPose { x_m: -4.0, y_m: 7.0, yaw_rad: truck.truth.yaw_rad };
    let stand = |truck: &mut Truck| {
        truck.drive(0.5, 0.0, 0.0);
        let fix = truck.noisy_fix(false);
        truck.fixed(&fix)
    };
    let outcomes: Vec<FixOutcome> = (0..100).map(|_| stand(&mut truck)).collect();
    assert!(outcomes.iter().all(|o| matches!(o, FixOutcome::Rejected { .. })), "{outcomes:?}");
    let estimate = truck.filter.estimate(truck.now);
    assert!(estimate.contradicted && truck.off_m() < 3.0 * estimate.sigma_m + 0.05, "{estimate:?}");
    assert_eq!(allowed(&estimate, 0.5), UncertaintySpeed::Stop);
    truck.tour(20, false);
    let found = truck.filter.estimate(truck.now);
    assert!(!found.contradicted && found.fixes.restarts == 1, "{found:?}");
    assert!(truck.off_m() < 0.15 && truck.turned_rad() < 0.2, "{}", truck.turned_rad());
}

#[test]
fn wheels_that_slipped_a_little_are_forgiven_once_the_truck_stands() {
    for yaw in [false, true] {
        let mut truck = Truck::new(0.001, 0.0);
        truck.tour(30, yaw);
        let here = truck.truth;
        truck.drive(1.4, 0.2, 0.0);
        truck.truth = here;
        let mut outcomes = Vec::new();
        for _ in 0..20 {
            truck.drive(0.5, 0.0, 0.0);
            let fix = truck.noisy_fix(yaw);
            outcomes.push(truck.fixed(&fix));
        }
        let rejected = outcomes.iter().filter(|o| matches!(o, FixOutcome::Rejected { .. })).count();
        assert!((3..15).contains(&rejected), "{outcomes:?}");
        let sure = truck.filter.estimate(truck.now);
        assert!(!sure.contradicted && truck.off_m() < 0.1, "{} m: {sure:?}", truck.off_m());
    }
}

#[test]
fn a_pose_that_is_set_ends_a_contradiction() {
    let mut truck = Truck::new(0.0, 0.0);
    truck.tour(10, false);
    truck.truth = MapPose { x_m: -4.0, y_m: 7.0, yaw_rad: 0.3 };
    for _ in 0..5 {
        truck.drive(0.5, 0.0, 0.0);
        let fix = truck.noisy_fix(false);
        truck.fixed(&fix);
    }
    assert!(truck.filter.estimate(truck.now).contradicted);
    truck.filter.set_pose(truck.now, &truck.odometry.pose(), &truck.truth);
    assert!(!truck.filter.estimate(truck.now).contradicted);
    truck.drive(0.5, 0.3, 0.0);
    let fix = truck.noisy_fix(false);
    assert!(matches!(truck.fixed(&fix), FixOutcome::Accepted { .. }));
}

#[test]
fn a_fix_that_repeats_while_the_wheels_turn_is_none() {
    for (rate_hz, noise_m) in [(2.0, 0.0), (10.0, 0.0), (20.0, 0.0), (10.0, 0.002)] {
        let mut truck = Truck::new(0.001, 0.01);
        truck.tour(20, true);
        let frozen = truck.noisy_fix(true);
        truck.fixed(&frozen);
        let mut outcomes = Vec::new();
        for _ in 0..libm::round(10.0 * rate_hz) as u32 {
            truck.drive(1.0 / rate_hz, 0.3, 1.0);
            let x_m = frozen.x_m + truck.noise(noise_m);
            outcomes.push(truck.fixed(&StampedFix { stamp: truck.now, x_m, ..frozen }));
        }
        let used = outcomes.iter().filter(|o| matches!(o, FixOutcome::Accepted { .. })).count();
        assert!(used <= 1, "{used} at {rate_hz} Hz");
        let estimate = truck.filter.estimate(truck.now);
        assert!(estimate.frozen && !estimate.contradicted, "{estimate:?}");
        assert!(truck.off_m() < 3.0 * estimate.sigma_m + 0.05, "{} m, {estimate:?}", truck.off_m());
        let fix = truck.noisy_fix(true);
        assert!(matches!(truck.fixed(&fix), FixOutcome::Accepted { .. }), "a source that works again counts");
        assert!(!truck.filter.estimate(truck.now).frozen);
    }
}

#[test]
fn fixes_that_repeat_while_the_truck_stands_are_as_good_as_any() {
    let mut truck = Truck::new(0.0, 0.0);
    let fix = truck.exact_fix(true);
    for _ in 0..20 {
        truck.drive(0.1, 0.0, 0.0);
        assert!(matches!(truck.fixed(&StampedFix { stamp: truck.now, ..fix }), FixOutcome::Accepted { .. }));
    }
}

#[test]
fn the_pose_of_another_robot_for_a_second_is_not_believed_at_any_rate() {
    for rate_hz in [2.0, 10.0, 20.0] {
        for yaw in [false, true] {
            let mut truck = Truck::new(0.001, 0.01);
            truck.tour(30, yaw);
            for _ in 0..libm::round(rate_hz) as u32 {
                truck.drive(1.0 / rate_hz, 0.3, 0.2);
                let mut fix = truck.noisy_fix(yaw);
                // It drives beside this one.
                fix.y_m += 1.2;
                assert!(matches!(truck.fixed(&fix), FixOutcome::Rejected { .. }));
            }
            let unsure = truck.filter.estimate(truck.now);
            assert!(unsure.contradicted || rate_hz < 3.0, "{unsure:?}");
            assert!(truck.off_m() < 0.1);
            for _ in 0..4 {
                truck.drive(1.0 / rate_hz, 0.3, 0.2);
                let fix = truck.noisy_fix(yaw);
                truck.fixed(&fix);
            }
            let sure = truck.filter.estimate(truck.now);
            assert!(!sure.contradicted && sure.fixes.restarts == 0 && truck.off_m() < 0.1, "{sure:?}");
        }
    }
}

#[test]
fn fixes_that_are_older_than_they_say_are_found_out() {
    for yaw in [false, true] {
        let mut truck = Truck::new(0.001, 0.01);
        for turn in 0..600_u32 {
            let fix = truck.noisy_fix(yaw);
            let ahead = if turn % 40 < 28 { 0.3 } else { -0.2 };
            truck.drive(0.2, ahead, f64::from(turn / 10 % 5) - 1.5);
            truck.fixed(&StampedFix { stamp: truck.now, ..fix });
        }
        let estimate = truck.filter.estimate(truck.now);
        assert!((estimate.delay_s - 0.2).abs() < 0.05, "{estimate:?}");
        assert!(truck.off_m() < 0.05, "{}", truck.off_m());
    }
}

#[test]
fn wheels_that_are_not_what_the_settings_say_are_learnt_from_fixes() {
    for (scale, rate_hz) in [(1.0 / 3.0, 2.0), (1.0 / 3.0, 10.0), (-0.2, 2.0)] {
        let mut truck = Truck::new(0.001, scale);
        for turn in 0..libm::round(60.0 * rate_hz) as u32 {
            truck.drive(1.0 / rate_hz, 0.25, f64::from(turn / 10 % 5) - 1.5);
            let fix = truck.noisy_fix(false);
            truck.fixed(&fix);
        }
        let estimate = truck.filter.estimate(truck.now);
        assert!((estimate.wheel_scale - scale).abs() < 0.03, "{estimate:?}");
        assert!(estimate.wheel_scale_sigma < 0.03 && estimate.fixes.restarts == 0, "{estimate:?}");
    }
}

#[test]
fn wheels_that_spin_teach_it_no_impossible_tyres() {
    let mut truck = Truck::new(0.001, 0.0);
    truck.tour(20, true);
    for _ in 0..200 {
        let here = truck.truth;
        truck.drive(0.1, 0.1, 0.0);
        truck.truth = here;
        let fix = truck.noisy_fix(true);
        truck.fixed(&fix);
        assert!(truck.filter.estimate(truck.now).wheel_scale.abs() <= 0.1);
    }
    let unsure = truck.filter.estimate(truck.now);
    assert!(unsure.contradicted && truck.off_m() < 3.0 * unsure.sigma_m + 0.05, "{} m", truck.off_m());
    truck.tour(30, true);
    assert!(truck.off_m() < 0.08, "{}", truck.off_m());
}

#[test]
fn outliers_that_do_not_agree_never_start_it_again() {
    let mut truck = Truck::new(0.001, 0.0);
    for i in 0..200 {
        truck.drive(0.2, 0.2, 0.5);
        let mut fix = truck.exact_fix(false);
        let (sin, cos) = libm::sincos(f64::from(i) * 2.4);
        (fix.x_m, fix.y_m) = (fix.x_m + 2.0 * cos, fix.y_m + 2.0 * sin);
        assert!(matches!(truck.fixed(&fix), FixOutcome::Rejected { .. }), "{i}");
    }
    assert_eq!(truck.filter.estimate(truck.now).fixes.rejected, 200);
}

#[test]
fn after_minutes_without_fixes_single_ones_are_gathered_first() {
    let mut truck = Truck::new(0.005, 0.0);
    truck.drive(200.0, 0.0, 0.0);
    let fix = truck.exact_fix(true);
    assert_eq!(truck.fixed(&fix), FixOutcome::Relocalizing { have: 1, need: 6 });
    let outcomes = truck.tour(10, true);
    assert!(
        matches!(outcomes[4], FixOutcome::Restarted { turned_rad, .. } if turned_rad > 0.8),
        "{outcomes:?}"
    );
    assert!(truck.off_m() < 0.1 && truck.turned_rad() < 0.1);
}

#[test]
fn a_fix_that_cannot_be_is_refused_and_changes_nothing() {
    let mut truck = Truck::new(0.0, 0.0);
    truck.drive(1.0, 0.3, 0.0);
    let good = truck.exact_fix(true);
    let with = |row: usize, column: usize, value: f64| {
        let mut fix = good;
        fix.covariance[row][column] = value;
        fix
    };
    let both = |value: f64| {
        let mut fix = with(0, 1, value);
        fix.covariance[1][0] = value;
        fix
    };
    let bad = [
        StampedFix { x_m: f64::NAN, ..good },
        StampedFix { y_m: f64::INFINITY, ..good },
        StampedFix { x_m: 1e5, ..good },
        StampedFix { yaw_rad: Some(f64::NAN), ..good },
        StampedFix { stamp: truck.now.plus_ms(1), ..good },
        with(0, 0, 0.0),
        with(1, 1, -1.0),
        with(2, 2, f64::NAN),
        with(0, 2, 1e-3),
        with(0, 1, f64::NAN),
        both(0.01),
    ];
    let before = truck.filter.estimate(truck.now);
    for fix in bad {
        assert!(truck.filter.fix(truck.now, &fix).is_err(), "{fix:?}");
    }
    assert_eq!(truck.filter.estimate(truck.now), before);
    let unused = StampedFix { yaw_rad: None, ..with(2, 2, f64::NAN) };
    assert!(truck.filter.fix(truck.now, &unused).is_ok(), "without a yaw its variance says nothing");
    let lost = OdomPose { x_m: f64::NAN, ..truck.odometry.pose() };
    assert!(truck.filter.odometry(truck.now, &lost).is_err());
    assert!(truck.filter.estimate(truck.now).pose.x_m.is_finite());
}

#[test]
fn allowed_falls_with_the_clearance() {
    let truck = Truck::new(0.0, 0.0);
    let mut estimate = truck.filter.estimate(truck.now);
    (estimate.sigma_m, estimate.sigma_yaw_rad) = (0.05, 0.0);
    assert!((UncertaintySpeed::uncertain_m(&estimate, 0.32) - 0.1).abs() < 1e-12);
    assert_eq!(allowed(&estimate, 0.21), UncertaintySpeed::Full);
    let UncertaintySpeed::Slow { mps } = allowed(&estimate, 0.1 / 0.75) else { panic!("slow") };
    assert!((mps - 0.225).abs() < 1e-9, "{mps}");
    for clearance_m in [0.099, 0.0, -1.0, f64::NAN] {
        assert_eq!(allowed(&estimate, clearance_m), UncertaintySpeed::Stop, "{clearance_m}");
    }
    estimate.sigma_m = f64::NAN;
    assert_eq!(allowed(&estimate, 1.0), UncertaintySpeed::Stop);
}

fn allowed(estimate: &Estimate, clearance_m: f64) -> UncertaintySpeed {
    UncertaintySpeed::of(estimate, clearance_m, &UncertaintyLimits::default())
}

#[test]
fn other_limits_trust_earlier_or_later() {
    let truck = Truck::new(0.0, 0.0);
    let mut estimate = truck.filter.estimate(truck.now);
    (estimate.sigma_m, estimate.sigma_yaw_rad) = (0.05, 0.0);
    let limits =
        UncertaintyLimits { slow_part: 0.2, stop_part: 0.4, cruise_mps: 0.3, least_mps: 0.1, reach_m: 0.32 };
    assert_eq!(UncertaintySpeed::of(&estimate, 0.51, &limits), UncertaintySpeed::Full);
    let UncertaintySpeed::Slow { mps } = UncertaintySpeed::of(&estimate, 0.1 / 0.3, &limits) else {
        panic!("slow")
    };
    assert!((mps - 0.2).abs() < 1e-9, "{mps}");
    assert_eq!(UncertaintySpeed::of(&estimate, 0.24, &limits), UncertaintySpeed::Stop);
}

#[test]
fn a_wider_gate_accepts_what_the_usual_one_does_not() {
    let outcome = |gate: f64| {
        let mut truck = Truck::new(0.0, 0.0);
        truck.filter.tuning.gate = gate;
        truck.drive(1.0, 0.2, 0.0);
        let mut fix = truck.exact_fix(true);
        fix.covariance = StampedFix::independent(0.05, 0.02);
        fix.x_m += 0.35;
        truck.fixed(&fix)
    };
    let FixOutcome::Rejected { mahalanobis, limit } = outcome(1.0) else { panic!("an outlier") };
    assert!(limit == 16.266 && mahalanobis < 4.0 * limit, "{mahalanobis}");
    assert!(matches!(outcome(2.0), FixOutcome::Accepted { limit, .. } if limit == 4.0 * 16.266));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever is driven and whatever comes in, the covariance stays one.
    #[test]
    fn the_covariance_stays_symmetric_and_positive(
        steps in prop::collection::vec((-2.0..2.0_f64, -2.5..2.5_f64, 0..40_u32, any::<bool>(), 0.001..1.0_f64), 1..60)
    ) {
        let mut truck = Truck::new(0.004, 0.02);
        for (mps, curvature, tenths, yaw, sigma) in steps {
            truck.drive(f64::from(tenths) / 10.0, mps, curvature);
            let mut fix = truck.exact_fix(yaw);
            fix.covariance = StampedFix::independent(sigma, sigma / 3.0);
            fix.x_m += mps * sigma;
            truck.fixed(&fix);
            let covariance = truck.filter.state.covariance;
            prop_assert_eq!(covariance, covariance.transpose());
            let jitter = SMatrix::<f64, 6, 6>::from_diagonal_element(1e-12);
            prop_assert!((covariance + jitter).cholesky().is_some(), "{}", covariance);
            prop_assert!(truck.filter.state.mean.iter().all(|v| v.is_finite()));
        }
    }
}
