//! Odometry (§4.9).

use proptest::collection::vec;
use proptest::prelude::*;
use std::f64::consts::PI;
use xtb_control::odometry::{OdomPose, Odometry};

const WINDOW_S: f64 = 0.052_428_8;
const DIAMETER_M: f64 = 0.1651;

/// Yaw readings and the wheel speed until the next one.
fn way() -> impl Strategy<Value = Vec<(i16, f64)>> {
    vec((any::<i16>(), -353.0..=353.0), 1..60)
}

fn drive(odometry: &mut Odometry, way: &[(i16, f64)]) {
    for (yaw, rpm) in way {
        odometry.yaw(*yaw);
        odometry.advance(*rpm, WINDOW_S, DIAMETER_M);
    }
}

fn apart_m(a: OdomPose, b: OdomPose) -> f64 {
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m)
}

fn step_m(rpm: f64) -> f64 {
    rpm / 60.0 * WINDOW_S * PI * DIAMETER_M
}

proptest! {
    #[test]
    fn no_way_leads_farther_than_the_wheels_turned_and_every_number_stays_finite(way in way()) {
        let mut odometry = Odometry::default();
        drive(&mut odometry, &way);
        let pose = odometry.pose();
        let rolled_m: f64 = way.iter().map(|(_, rpm)| step_m(rpm.abs())).sum();
        prop_assert!(pose.x_m.hypot(pose.y_m) <= rolled_m + 1e-9);
        prop_assert!((0.0..360.0).contains(&pose.yaw.deg()));
    }

    #[test]
    fn the_same_way_astern_and_in_reverse_order_leads_back(way in way()) {
        let mut odometry = Odometry::default();
        odometry.yaw(0);
        drive(&mut odometry, &way);
        let back: Vec<_> = way.iter().rev().map(|(yaw, rpm)| (*yaw, -rpm)).collect();
        drive(&mut odometry, &back);
        prop_assert!(apart_m(odometry.pose(), OdomPose::default()) < 1e-9);
    }

    #[test]
    fn where_north_lies_for_the_gyro_does_not_matter(way in way(), north: i16) {
        let driven = |north: i16| {
            let mut odometry = Odometry::default();
            odometry.yaw(north);
            let way: Vec<_> = way.iter().map(|(yaw, rpm)| (yaw.wrapping_add(north), *rpm)).collect();
            drive(&mut odometry, &way);
            odometry.pose()
        };
        prop_assert!(apart_m(driven(0), driven(north)) < 1e-9);
    }

    #[test]
    fn after_a_rezero_it_goes_on_like_a_new_one_that_starts_here(before in way(), after in way()) {
        let (mut old, mut new) = (Odometry::default(), Odometry::default());
        drive(&mut old, &before);
        old.rezero();
        prop_assert_eq!(old.pose(), OdomPose::default());
        new.yaw(before.last().unwrap().0);
        drive(&mut old, &after);
        drive(&mut new, &after);
        prop_assert_eq!(old.pose(), new.pose());
    }

    #[test]
    fn one_window_is_the_printed_step_along_the_newest_yaw(first: i16, yaw: i16, rpm in -353.0..=353.0) {
        let mut odometry = Odometry::default();
        odometry.yaw(first);
        drive(&mut odometry, &[(yaw, rpm)]);
        let alpha = (f64::from(yaw) - f64::from(first)) * 2.0 * PI / 65_536.0;
        let pose = odometry.pose();
        prop_assert!((pose.x_m - step_m(rpm) * alpha.sin()).abs() < 1e-9);
        prop_assert!((pose.y_m - step_m(rpm) * alpha.cos()).abs() < 1e-9);
    }
}
