//! The whole controller under anything: its outputs stay numbers and pulses, it stops when it must,
//! and it is a function of its samples.

use crate::any::{config, follow, published, samples, teleop};
use proptest::prelude::*;
use xtb_control::controller::Outputs;
use xtb_control::units::WheelRpm;
use xtb_control::vehicle::Drivetrain;
use xtb_control::{Command, Controller, Mode, PwmCount, Sample, Stamp, VehicleConfig};

fn every_configuration() -> impl Strategy<Value = VehicleConfig> {
    prop_oneof![1 => Just(VehicleConfig::default()), 1 => Just(published()), 4 => config()]
}

fn check_pulses(out: &Outputs) -> Result<(), TestCaseError> {
    let pwm = &out.pwm;
    let mut pulses =
        vec![pwm.motor, pwm.steer_front, pwm.steer_rear, pwm.bumper_front, pwm.bumper_rear, pwm.spare];
    pulses.extend(pwm.pistons);
    prop_assert!(pulses.iter().all(|pulse| (2331..=5272).contains(&pulse.get())), "{pwm:?}");
    Ok(())
}

fn check_numbers(config: &VehicleConfig, out: &Outputs) -> Result<(), TestCaseError> {
    for number in [out.pose.x_m, out.pose.y_m, out.rpm, out.demanded] {
        prop_assert!(number.is_finite(), "{out:?}");
    }
    prop_assert!((-1.0..=1.0).contains(&out.steering), "{out:?}");
    prop_assert!(out.reference_rpm.abs() <= WheelRpm::MAX, "{out:?}");
    prop_assert!((0.0..360.0).contains(&out.pose.yaw.deg()), "{out:?}");
    for cm in out.ir_front_cm.iter().chain(&out.ir_rear_cm).flatten() {
        prop_assert!(*cm > 0.0 && *cm < 75.0, "{out:?}");
    }
    for deg in [out.tilt.x, out.tilt.y].into_iter().flatten() {
        prop_assert!((-90.0..=90.0).contains(&deg), "{out:?}");
    }
    let limits = config.remote.min_duty_pct / 100.0..=config.remote.max_duty_pct / 100.0;
    for duty in [out.duties.speed, out.duties.steering, out.duties.selector].into_iter().flatten() {
        prop_assert!(limits.contains(&duty), "{out:?}");
    }
    if let Some(goto) = out.goto {
        let numbers = [goto.alpha_deg, goto.beta_deg, goto.gamma_deg, goto.distance_m];
        prop_assert!(numbers.iter().all(|number| number.is_finite() && *number >= 0.0), "{goto:?}");
    }
    Ok(())
}

/// What holds after every step, whatever the sample was.
fn check_motor(out: &Outputs) -> Result<(), TestCaseError> {
    let stopped = out.pwm.motor == PwmCount::NEUTRAL;
    prop_assert!(stopped || !out.blocked, "never into an obstacle: {out:?}");
    prop_assert!(stopped || !matches!(out.mode, Mode::Idle | Mode::Fault), "{out:?}");
    prop_assert!(stopped || out.demanded != 0.0, "nothing is asked for: {out:?}");
    Ok(())
}

/// rear = its centre − (front − its centre), as far as both servos go; its centre where only the front steers.
fn check_mirror(config: &VehicleConfig, out: &Outputs) -> Result<(), TestCaseError> {
    let (front, rear) = (out.pwm.steer_front, out.pwm.steer_rear);
    let at_limit = |pulse: PwmCount| pulse == PwmCount::MIN || pulse == PwmCount::MAX;
    let offset = match config.drivetrain {
        Drivetrain::BothAxles => front.as_f64() - config.steering.front_centre,
        Drivetrain::FrontAxle => 0.0,
    };
    let mirrored = config.steering.rear_centre - offset;
    // Two roundings to whole counts.
    let alike = (rear.as_f64() - mirrored).abs() <= 1.0;
    prop_assert!(alike || at_limit(front) || at_limit(rear), "{front:?} {rear:?}");
    Ok(())
}

proptest! {
    #[test]
    fn no_samples_and_no_configuration_break_a_limit(config in every_configuration(), samples in samples(150)) {
        let mut controller = Controller::new(config.clone());
        for (t, sample) in samples {
            let out = controller.step(t, &sample);
            check_pulses(&out)?;
            check_numbers(&config, &out)?;
            check_motor(&out)?;
            check_mirror(&config, &out)?;
        }
    }

    #[test]
    fn stop_is_neutral_at_once_unless_the_transmitter_drives(
        config in every_configuration(), samples in samples(100), by in 0_usize..3,
    ) {
        let mut controller = Controller::new(config);
        let mut last = Stamp::ZERO;
        for (t, sample) in samples {
            controller.step(t, &sample);
            last = t;
        }
        let stop = [teleop(0.0, 0.3), follow(0.0, -0.3), Command::Idle][by];
        let out = controller.step(last, &Sample::Command(stop));
        prop_assert!(out.mode == Mode::Manual || out.pwm.motor == PwmCount::NEUTRAL, "{out:?}");
        prop_assert!(out.mode == Mode::Manual || out.reference_rpm == 0.0, "{out:?}");
        // It takes one encoder window and more than that to move again: a new command.
        let out = controller.step(last.plus_ms(52), &Sample::Encoder { pulses: 40 });
        prop_assert!(out.mode == Mode::Manual || out.pwm.motor == PwmCount::NEUTRAL, "{out:?}");
    }

    #[test]
    fn the_same_samples_give_the_same_bits_and_a_copy_goes_on_like_the_original(
        config in every_configuration(), samples in samples(100), copied_at in 0_usize..100,
    ) {
        let (mut first, mut second) = (Controller::new(config.clone()), Controller::new(config));
        for (i, (t, sample)) in samples.iter().enumerate() {
            if i == copied_at {
                second = first.clone();
            }
            let (a, b) = (first.step(*t, sample), second.step(*t, sample));
            prop_assert_eq!(bits(&a), bits(&b));
            prop_assert_eq!(bits(&first.outputs(*t)).len(), bits(&a).len());
        }
    }
}

/// Every number of the outputs, −0 apart from 0 (as `Debug` prints the shortest text that reads back).
fn bits(out: &Outputs) -> String {
    format!("{out:?}")
}
