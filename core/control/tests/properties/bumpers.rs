//! Bumper servos (§4.5, Annex A.1).

use crate::any::{config, published, samples};
use proptest::prelude::*;
use xtb_control::bumper::bumper_servos;
use xtb_control::vehicle::Bumpers;
use xtb_control::{Controller, PwmCount, VehicleConfig};

proptest! {
    #[test]
    fn the_angle_is_that_of_the_pulse_and_the_pulse_the_nearest_to_the_angle_that_is_wanted(config in config()) {
        let lines = config.calibration.bumpers();
        let wanted = [config.bumpers.front_deg, config.bumpers.rear_deg];
        let servos = bumper_servos(&config.bumpers, &config.calibration);
        for ((servo, line), wanted_deg) in servos.iter().zip(lines).zip(wanted) {
            prop_assert!((line.at(servo.pulse.as_f64()) - servo.angle_deg).abs() < 1e-9);
            let off_deg = (servo.angle_deg - wanted_deg).abs();
            prop_assert!(off_deg <= line.slope.abs() / 2.0 + 1e-6, "{servo:?} {line:?} {wanted_deg}");
        }
    }

    #[test]
    fn an_angle_beyond_the_servo_ends_at_its_limit(front_deg in -500.0..=500.0, rear_deg in -500.0..=500.0) {
        let calibration = VehicleConfig::default().calibration;
        for servo in bumper_servos(&Bumpers { front_deg, rear_deg }, &calibration) {
            prop_assert!((PwmCount::MIN..=PwmCount::MAX).contains(&servo.pulse));
            prop_assert!(servo.angle_deg.abs() < 55.0);
        }
    }

    #[test]
    fn nothing_that_happens_moves_them(samples in samples(60)) {
        let mut controller = Controller::new(published());
        for (t, sample) in samples {
            let pwm = controller.step(t, &sample).pwm;
            prop_assert_eq!((pwm.bumper_front.get(), pwm.bumper_rear.get()), (3750, 3750));
        }
    }
}
