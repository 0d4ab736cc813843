//! Infrared ranging (§4.5): too near is never clear.

use crate::any::{adc, adc_count, config, sample};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::controller::AdcSample;
use xtb_control::gp2d12::fit_cm;
use xtb_control::infrared::{bumper_ranges, hypotenuse_cm};
use xtb_control::vehicle::{BumperFinders, Infrared, SLOTS, USUAL_SLOTS};
use xtb_control::{AdcCount, Controller, Sample, Stamp};

/// Counts above 2.35 V.
fn too_near() -> impl Strategy<Value = AdcCount> {
    (482_u16..=1023).prop_map(|counts| adc(counts.into()))
}

proptest! {
    #[test]
    fn above_2_35_volts_a_reading_is_an_obstacle_in_every_configuration(
        config in config(), counts in too_near(), angle_deg in -60.0..=60.0,
    ) {
        prop_assert!(counts.volts() > 2.35);
        let ranges = bumper_ranges(&config.infrared, &BumperFinders::default(), angle_deg, &[counts; SLOTS]);
        for range in &ranges[..USUAL_SLOTS] {
            prop_assert!(range.is_some_and(|cm| cm <= config.infrared.near_cm), "{range:?}");
            prop_assert!(range.is_some_and(|cm| cm < config.obstacle.threshold_cm), "{range:?}");
        }
    }

    #[test]
    fn one_sensor_above_2_35_volts_makes_an_obstacle_whatever_came_before_and_the_others_read(
        config in config(), before in vec(sample(), 0..30), counts in too_near(), sensor in 0_usize..12,
        others in adc_count(),
    ) {
        let mut controller = Controller::new(config);
        for (i, sample) in before.iter().enumerate() {
            controller.step(Stamp::from_ms(20 * i as u64), sample);
        }
        let mut sides = [[others; SLOTS]; 2];
        sides[sensor / 6][sensor % 6] = counts;
        let [ir_front, ir_rear] = sides;
        let scan = AdcSample { ir_front, ir_rear, tilt: [others; 2], pistons: [others; 4] };
        let out = controller.step(Stamp::from_ms(1000), &Sample::Adc(scan));
        prop_assert!(if sensor < 6 { out.obstacle.front } else { out.obstacle.rear }, "{out:?}");
    }

    #[test]
    fn every_distance_is_finite_positive_and_never_longer_than_the_hypotenuse(
        config in config(), counts in adc_count(), angle_deg in -60.0..=60.0,
    ) {
        let hyp = hypotenuse_cm(&config.infrared, counts);
        prop_assert_eq!(hyp.is_none(), counts.volts() < config.infrared.far_v);
        let way = bumper_ranges(&config.infrared, &BumperFinders::default(), angle_deg, &[counts; SLOTS])[0];
        prop_assert_eq!(hyp.is_some(), way.is_some());
        if let Some((hyp, way)) = hyp.zip(way) {
            prop_assert!(hyp.is_finite() && way > 0.0 && way <= hyp && hyp < 75.0, "{hyp} {way}");
        }
    }

    #[test]
    fn within_the_fits_validity_a_higher_voltage_is_never_farther(a in 0.42..=2.35, b in 0.42..=2.35) {
        prop_assert!(fit_cm(f64::max(a, b)) <= fit_cm(f64::min(a, b)));
    }

    #[test]
    fn below_0_42_volts_nothing_is_in_range(counts in 0_u16..=86) {
        prop_assert_eq!(hypotenuse_cm(&Infrared::default(), adc(counts.into())), None);
    }
}
