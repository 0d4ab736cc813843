//! Speed PID and direction interlock (§4.7).

use crate::any::{config, teleop};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::pid::{Gains, Pid};
use xtb_control::speed::{AssumedDirection, SpeedPid, wheel_rpm};
use xtb_control::vehicle::Speed;
use xtb_control::{Command, Controller, PwmCount, Sample, Stamp, VehicleConfig};

fn gains() -> impl Strategy<Value = Gains> {
    (0.0..=1000.0, 0.0..=1000.0, 0.0..=100.0).prop_map(|(kp, ki, kd)| Gains { kp, ki, kd })
}

proptest! {
    #[test]
    fn wheel_speed_is_the_printed_formula_for_every_count(config in config(), pulses: u32) {
        let encoder = &config.encoder;
        let turns = f64::from(pulses) / encoder.pulses_per_rev / encoder.gear_ratio;
        let rpm = wheel_rpm(encoder, pulses);
        prop_assert!(rpm.is_finite() && rpm >= 0.0);
        prop_assert!((rpm - turns / encoder.window_s * 60.0).abs() <= 1e-9 * rpm);
    }

    #[test]
    fn the_law_is_the_printed_one_for_every_history(
        gains in gains(), t_s in 0.001..=1.0, errors in vec(-500.0..=500.0, 1..50),
    ) {
        let (mut pid, mut sum, mut before) = (Pid::default(), 0.0, 0.0);
        let a = gains.kp + 0.5 * gains.ki * t_s + gains.kd / t_s;
        let b = 0.5 * gains.ki * t_s - gains.kd / t_s;
        for error in errors {
            sum += 0.5 * (error + before) * t_s;
            let printed: f64 = a * error + b * before + gains.ki * sum;
            let got = pid.step(gains, t_s, error, |_| false);
            prop_assert!((got - printed).abs() <= 1e-9 * (1.0 + printed.abs()));
            before = error;
        }
    }

    #[test]
    fn no_reference_no_speed_and_no_gain_makes_the_motor_leave_its_limits(
        config in config(), windows in vec((-353.0..=353.0, -1.0e15..=1.0e15), 1..100),
    ) {
        let mut pid = SpeedPid::default();
        for (reference, rpm) in windows {
            let motor = pid.step(&config.speed, config.encoder.window_s, reference, rpm).get();
            prop_assert!((2331..=5272).contains(&motor));
        }
    }

    #[test]
    fn while_saturated_in_the_errors_direction_the_sum_stands_still(
        gains in gains(), t_s in 0.01..=0.1, error in 1.0..=353.0, sign in prop_oneof![Just(-1.0), Just(1.0)],
    ) {
        let mut pid = Pid::default();
        let mut step = || pid.step(gains, t_s, sign * error, |_| true);
        // e[n−1] is another one in the first window only.
        let (_, second, third) = (step(), step(), step());
        prop_assert_eq!(second, third);
    }

    #[test]
    fn the_interlock_lets_no_sign_through_before_the_wheels_stand(
        windows in vec((-50.0..=50.0, 0_u32..10), 1..100), interlock_pulses in 0_u32..5,
    ) {
        let config = Speed { interlock_pulses, ..Speed::default() };
        let mut direction = AssumedDirection::default();
        for (reference, pulses) in windows {
            let before = direction.sign();
            direction.demand(&config, reference);
            prop_assert_eq!(direction.sign(), before, "a demand alone changes nothing");
            let may_drive = direction.admit(&config, reference, pulses);
            prop_assert!(direction.sign() == before || pulses <= interlock_pulses);
            prop_assert_eq!(may_drive, reference == 0.0 || reference.signum() == direction.sign());
            prop_assert_eq!(direction.must_wait(&config, reference), !may_drive);
        }
    }

    #[test]
    fn published_the_sign_follows_every_reference_at_once(references in vec(-50.0..=50.0, 1..50)) {
        let config = Speed { direction_interlock: false, ..Speed::default() };
        let (mut direction, mut last) = (AssumedDirection::default(), 1.0);
        for reference in references {
            direction.demand(&config, reference);
            last = if reference == 0.0 { last } else { f64::signum(reference) };
            prop_assert_eq!(direction.sign(), last);
            prop_assert!(!direction.must_wait(&config, reference));
        }
    }

    #[test]
    fn a_reversed_reference_holds_the_motor_at_once_and_until_the_wheels_stand(
        rpm in 1.0..353.0, reversed in 1.0..353.0, astern: bool, rolling in vec(2_u32..100, 0..20),
    ) {
        let sign = if astern { -1.0 } else { 1.0 };
        let ahead = |motor: PwmCount| (motor.as_f64() - PwmCount::NEUTRAL.as_f64()) * sign;
        let mut controller = Controller::new(VehicleConfig::default());
        let mut t = Stamp::ZERO;
        let mut step = |sample: Sample| {
            t = t.plus_ms(50);
            controller.step(t, &sample).pwm.motor
        };
        let window = |pulses| Sample::Encoder { pulses };
        let ask = |rpm: f64| Sample::Command(teleop(rpm, 0.0));
        step(ask(sign * rpm));
        step(window(0));
        prop_assert!(ahead(step(window(0))) > 0.0);
        prop_assert_eq!(step(ask(-sign * reversed)), PwmCount::NEUTRAL);
        for pulses in rolling {
            prop_assert_eq!(step(window(pulses)), PwmCount::NEUTRAL);
        }
        prop_assert!(ahead(step(window(1))) < 0.0);
    }

    #[test]
    fn a_standing_reference_gives_neutral_whatever_the_wheels_do(
        config in config(), before in -353.0..=353.0, pulses in vec(any::<u32>(), 1..20),
    ) {
        let mut controller = Controller::new(config);
        controller.step(Stamp::ZERO, &Sample::Command(teleop(before, 0.0)));
        for (i, pulses) in pulses.iter().enumerate() {
            if i == 1 {
                let out = controller.step(Stamp::from_ms(100), &Sample::Command(Command::Idle));
                prop_assert_eq!(out.pwm.motor, PwmCount::NEUTRAL);
            }
            let t = Stamp::from_ms(50 + 100 * i as u64);
            let out = controller.step(t, &Sample::Encoder { pulses: *pulses });
            prop_assert!(i == 0 || out.pwm.motor == PwmCount::NEUTRAL);
        }
    }
}
