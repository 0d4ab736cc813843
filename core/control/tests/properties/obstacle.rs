//! The obstacle rule (§4.6) and the fold-back latch.

use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::infrared::BumperRanges;
use xtb_control::obstacle::{Bumper, ObstacleState};
use xtb_control::units::Stamp;
use xtb_control::vehicle::{BumperFinders, Obstacle, SLOTS, USUAL_SLOTS};

fn range() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![2 => Just(None), 4 => (0.0..=60.0).prop_map(Some), 1 => Just(Some(25.0))]
}

/// Scans every 38 ms with the way driven towards the bumper, in m.
fn scans() -> impl Strategy<Value = Vec<(BumperRanges, f64)>> {
    vec((prop::array::uniform8(range()), -0.05..=0.05), 1..60)
}

/// By those that are fitted: what is on the other channels does not count.
fn nearer_than_25_cm(ranges: &BumperRanges) -> bool {
    ranges[..USUAL_SLOTS].iter().flatten().any(|cm| *cm < 25.0)
}

fn clear_range() -> impl Strategy<Value = Option<f64>> {
    prop_oneof![Just(None), (25.0..=60.0).prop_map(Some)]
}

proptest! {
    #[test]
    fn published_it_is_any_of_the_six_strictly_below_25_cm(scans in scans()) {
        let config = Obstacle { foldback_latch: false, ..Obstacle::default() };
        let mut bumper = Bumper::default();
        for (i, (ranges, travel_m)) in scans.iter().enumerate() {
            let seen = bumper.update(&config, &BumperFinders::default(), Stamp::from_ms(38 * i as u64), ranges, *travel_m);
            prop_assert_eq!(seen, nearer_than_25_cm(ranges));
        }
    }

    #[test]
    fn the_latch_only_ever_adds_to_the_published_rule(scans in scans()) {
        let (config, mut bumper, mut travel_m) = (Obstacle::default(), Bumper::default(), 0.0);
        for (i, (ranges, way_m)) in scans.iter().enumerate() {
            travel_m += way_m;
            let seen = bumper.update(&config, &BumperFinders::default(), Stamp::from_ms(38 * i as u64), ranges, travel_m);
            prop_assert!(seen || !nearer_than_25_cm(ranges));
        }
    }

    #[test]
    fn a_sensor_that_was_near_stays_near_whatever_it_then_says(
        near_cm in 9.74..14.0, sensor in 0_usize..6, later in vec((0_u64..4000, clear_range(), -0.04..0.04), 1..12),
    ) {
        let (config, mut bumper) = (Obstacle::default(), Bumper::default());
        let mut ranges = [None; SLOTS];
        ranges[sensor] = Some(near_cm);
        prop_assert!(bumper.update(&config, &BumperFinders::default(), Stamp::ZERO, &ranges, 0.0));
        let mut t = Stamp::from_ms(1);
        for (pause_ms, range, travel_m) in later {
            ranges[sensor] = range;
            prop_assert!(bumper.update(&config, &BumperFinders::default(), t, &ranges, travel_m), "at {} ms", t.ms());
            t = t.plus_ms(pause_ms);
        }
    }

    #[test]
    fn backing_off_or_the_time_that_is_configured_releases_it(
        near_cm in 9.74..14.0, range in clear_range(), backs_off: bool,
    ) {
        let config = Obstacle { foldback_clear_s: 0.5, ..Obstacle::default() };
        let mut bumper = Bumper::default();
        bumper.update(&config, &BumperFinders::default(), Stamp::ZERO, &[Some(near_cm); SLOTS], 1.0);
        prop_assert!(bumper.update(&config, &BumperFinders::default(), Stamp::from_ms(40), &[range; SLOTS], 1.0));
        let (ms, travel_m) = if backs_off { (80, 0.949) } else { (540, 1.0) };
        prop_assert!(!bumper.update(&config, &BumperFinders::default(), Stamp::from_ms(ms), &[range; SLOTS], travel_m));
        prop_assert!(!bumper.update(&config, &BumperFinders::default(), Stamp::from_ms(ms + 40), &[range; SLOTS], travel_m));
    }

    #[test]
    fn an_obstacle_blocks_its_own_direction_alone(front: bool, rear: bool, reference in -353.0..=353.0) {
        let seen = ObstacleState { front, rear };
        prop_assert_eq!(seen.blocks(reference), (front && reference > 0.0) || (rear && reference < 0.0));
        prop_assert!(!seen.blocks(0.0));
    }
}
