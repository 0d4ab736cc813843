//! A step of the pose filter allocates nothing, whatever becomes of the fix.

#![allow(clippy::unwrap_used)]

use allocation_counter::measure;
use xtb_control::odometry::OdomPose;
use xtb_control::{Heading, Stamp, VehicleConfig};
use xtb_nav::localization::{FilterTuning, FixOutcome, FixSource, StampedFix};
use xtb_nav::{MapPose, PoseFilter};

#[test]
fn steps_and_fixes_of_every_kind_allocate_nothing() {
    let (vehicle, start) = (VehicleConfig::default(), MapPose::default());
    let mut filter =
        PoseFilter::new(&vehicle, FilterTuning::default(), Stamp::ZERO, &OdomPose::default(), &start);
    let (mut accepted, mut rejected, mut restarted, mut old) = (0, 0, 0, 0);
    let counted = measure(|| {
        for i in 0..2000_u32 {
            let now = Stamp::from_ms(u64::from(i) * 10);
            let y_m = f64::from(i) * 2e-3;
            // A bend: without one, fixes of another place are not believed.
            let right_deg = f64::from(i) * 0.06 + f64::from(i % 7) * 0.01;
            let odom = OdomPose { x_m: 0.0, y_m, yaw: Heading::from_deg(right_deg) };
            filter.odometry(now, &odom).unwrap();
            let carried_m = if i > 1000 { 9.0 } else { 0.0 };
            let fix = StampedFix {
                stamp: Stamp::from_ms((u64::from(i) * 10).saturating_sub(if i % 200 == 50 {
                    900
                } else {
                    300
                })),
                x_m: carried_m,
                y_m,
                yaw_rad: (i % 100 == 0).then_some(start.yaw_rad - right_deg.to_radians()),
                covariance: StampedFix::independent(0.05, 0.05),
                source: FixSource::Uwb,
            };
            if i % 50 == 0 {
                match filter.fix(now, &fix).unwrap() {
                    FixOutcome::Accepted { .. } => accepted += 1,
                    FixOutcome::Rejected { .. } | FixOutcome::Relocalizing { .. } | FixOutcome::Repeated => {
                        rejected += 1
                    }
                    FixOutcome::Restarted { .. } => restarted += 1,
                    FixOutcome::TooOld { .. } => old += 1,
                }
            }
            std::hint::black_box(filter.estimate(now));
        }
    });
    assert_eq!(counted.count_total, 0, "{counted:?}");
    assert!(
        accepted > 5 && rejected > 3 && restarted > 0 && old > 3,
        "{accepted} {rejected} {restarted} {old}"
    );
}
