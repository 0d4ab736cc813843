//! Whatever samples come, in whatever order: outputs stay finite and inside the servo limits.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use proptest::prelude::*;
use xtb_control::controller::{AdcSample, GyroSample};
use xtb_control::goto::Goal;
use xtb_control::vehicle::GotoLaw;
use xtb_control::{
    AdcCount, Command, Controller, PwmCount, Sample, Stamp, Steering, VehicleConfig, WheelRpm,
};

fn count() -> impl Strategy<Value = AdcCount> {
    (0_u16..=1023).prop_map(|count| AdcCount::try_from(count).unwrap())
}

fn sample() -> impl Strategy<Value = Sample> {
    let gyro = any::<(i16, i16, i16)>().prop_map(|(roll, pitch, yaw)| GyroSample { roll, pitch, yaw });
    let adc =
        (prop::array::uniform6(count()), prop::array::uniform6(count())).prop_map(|(ir_front, ir_rear)| {
            AdcSample { ir_front, ir_rear, tilt: [ir_front[0], ir_rear[0]], pistons: [ir_front[1]; 4] }
        });
    let goal = (-1e4..1e4, -1e4..1e4).prop_map(|(x, y)| Command::Goto(Goal::new(x, y).unwrap()));
    let teleop = (-353.0..=353.0, -1.0..=1.0).prop_map(|(rpm, steering)| Command::Teleop {
        rpm: WheelRpm::try_from(rpm).unwrap(),
        steering: Steering::try_from(steering).unwrap(),
    });
    let command = prop_oneof![Just(Command::Idle), Just(Command::Wander), goal, teleop];
    prop_oneof![
        4 => gyro.prop_map(Sample::Gyro),
        2 => any::<u32>().prop_map(|pulses| Sample::Encoder { pulses }),
        2 => (0_u32..100).prop_map(|pulses| Sample::Encoder { pulses }),
        2 => adc.prop_map(Sample::Adc),
        1 => command.prop_map(Sample::Command),
    ]
}

proptest! {
    #[test]
    fn no_sequence_of_samples_leaves_the_servo_limits_or_the_numbers(
        samples in prop::collection::vec((sample(), 0_u64..5_000_000_000), 1..200),
        published: bool,
    ) {
        let mut config = VehicleConfig::default();
        if published {
            config.goto.law = GotoLaw::Published;
            config.speed.anti_windup = false;
            config.speed.direction_interlock = false;
            config.speed.reset_on_change = false;
        }
        let mut controller = Controller::new(config);
        let mut t = Stamp::ZERO;
        for (sample, pause_ns) in samples {
            t = t.plus_ns(pause_ns);
            let out = controller.step(t, &sample);
            let pwm = &out.pwm;
            let mut counts = vec![
                pwm.motor, pwm.steer_front, pwm.steer_rear, pwm.bumper_front, pwm.bumper_rear, pwm.spare,
            ];
            counts.extend(pwm.pistons);
            prop_assert!(counts.iter().all(|count| (2331..=5272).contains(&count.get())), "{pwm:?}");
            for number in [out.pose.x_m, out.pose.y_m, out.pose.yaw.deg(), out.rpm, out.steering] {
                prop_assert!(number.is_finite(), "{out:?}");
            }
        }
    }

    #[test]
    fn the_same_samples_give_the_same_bits(samples in prop::collection::vec(sample(), 1..100)) {
        let run = || {
            let mut controller = Controller::new(VehicleConfig::default());
            let step = |(i, sample): (usize, &Sample)| controller.step(Stamp::from_ms(10 * i as u64), sample);
            let outputs: Vec<_> = samples.iter().enumerate().map(step).collect();
            format!("{outputs:?}")
        };
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn an_obstacle_ahead_holds_the_motor_whatever_the_reference(rpm in 0.1..353.0, pulses in 0_u32..100) {
        let mut controller = Controller::new(VehicleConfig::default());
        let near = AdcCount::try_from(400_u16).unwrap();
        let far = AdcCount::ZERO;
        let adc = AdcSample { ir_front: [far, far, near, far, far, far], ir_rear: [far; 6], tilt: [far; 2], pistons: [far; 4] };
        let teleop = Command::Teleop { rpm: WheelRpm::try_from(rpm).unwrap(), steering: Steering::CENTRED };
        controller.step(Stamp::from_ms(0), &Sample::Command(teleop));
        controller.step(Stamp::from_ms(10), &Sample::Adc(adc));
        let out = controller.step(Stamp::from_ms(50), &Sample::Encoder { pulses });
        prop_assert_eq!(out.pwm.motor, PwmCount::NEUTRAL);
        prop_assert!(out.blocked);
    }

    #[test]
    fn a_reversed_reference_holds_the_motor_at_once_and_until_the_wheels_stand(rpm in 1.0..353.0) {
        let mut controller = Controller::new(VehicleConfig::default());
        let ask = |rpm: f64| {
            let rpm = WheelRpm::try_from(rpm).unwrap();
            Sample::Command(Command::Teleop { rpm, steering: Steering::CENTRED })
        };
        controller.step(Stamp::from_ms(0), &ask(rpm));
        let out = controller.step(Stamp::from_ms(50), &Sample::Encoder { pulses: 0 });
        prop_assert!(out.pwm.motor > PwmCount::NEUTRAL);
        let out = controller.step(Stamp::from_ms(60), &ask(-rpm));
        prop_assert_eq!(out.pwm.motor, PwmCount::NEUTRAL);
        let out = controller.step(Stamp::from_ms(100), &Sample::Encoder { pulses: 10 });
        prop_assert_eq!(out.pwm.motor, PwmCount::NEUTRAL);
        let out = controller.step(Stamp::from_ms(150), &Sample::Encoder { pulses: 1 });
        prop_assert!(out.pwm.motor < PwmCount::NEUTRAL);
    }
}
