//! Remote control (§4.2.2, §4.3, Fig. 10).

use crate::any::{adc, command, config, remote_sample, samples, ticks};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::controller::{AdcSample, GyroSample, Outputs, RemoteSample};
use xtb_control::remote::{RemoteStage, Selector, Stick, TickReading, reading};
use xtb_control::vehicle::{Remote, SLOTS};
use xtb_control::{Controller, Mode, PwmCount, Sample, Stamp, VehicleConfig};

const MANUAL: Option<u32> = Some(750);
const AUTOMATIC: Option<u32> = Some(1125);

/// Ticks of a usable pulse.
fn pulse() -> impl Strategy<Value = u32> {
    583_u32..=1318
}

/// A reading that cannot be used: missing, too short, too long, or impossible.
fn unusable() -> impl Strategy<Value = Option<u32>> {
    prop_oneof![
        Just(None),
        (0_u32..=582).prop_map(Some),
        (1319_u32..=6900).prop_map(Some),
        (13_876_u32..).prop_map(Some)
    ]
}

fn lost() -> impl Strategy<Value = RemoteSample> {
    (ticks(), ticks(), unusable()).prop_map(|(speed, steering, selector)| RemoteSample {
        speed,
        steering,
        selector,
    })
}

fn frame(speed: u32, steering: u32, selector: Option<u32>) -> Sample {
    Sample::Remote(RemoteSample { speed: Some(speed), steering: Some(steering), selector })
}

/// What the sticks' pulses are in PWM counts: ticks of 1.6 µs.
fn counts(ticks: u32) -> f64 {
    f64::from(ticks) * 4.0
}

/// Twelve sensors: so near, or nothing.
fn scan(front: bool, rear: bool) -> Sample {
    let side = |near: bool| [adc(if near { 300.0 } else { 0.0 }); SLOTS];
    Sample::Adc(AdcSample {
        ir_front: side(front),
        ir_rear: side(rear),
        tilt: [adc(512.0); 2],
        pistons: [adc(512.0); 4],
    })
}

fn under(samples: impl IntoIterator<Item = Sample>, config: VehicleConfig) -> (Controller, Vec<Outputs>) {
    let mut controller = Controller::new(config);
    let step = |(i, sample): (usize, Sample)| controller.step(Stamp::from_ms(20 * i as u64), &sample);
    let outputs = samples.into_iter().enumerate().map(step).collect();
    (controller, outputs)
}

proptest! {
    #[test]
    fn a_usable_reading_is_within_the_limits_of_every_configuration(config in config(), ticks: u32) {
        let remote = &config.remote;
        let measured = f64::from(ticks) * remote.tick_us / (remote.period_ms * 1000.0);
        match reading(remote, Some(ticks)) {
            TickReading::Usable(duty) => {
                prop_assert!((remote.min_duty_pct / 100.0..=remote.max_duty_pct / 100.0).contains(&duty));
            }
            TickReading::Impossible => prop_assert!(measured > 1.0),
            TickReading::Rejected => prop_assert!(measured <= 1.0),
        }
    }

    #[test]
    fn the_gap_between_two_pulses_reads_as_the_pulse(ticks in 584_u32..=1317) {
        let duty = |ticks| match reading(&Remote::default(), Some(ticks)) {
            TickReading::Usable(duty) => duty,
            other => panic!("{other:?}"),
        };
        prop_assert!((duty(ticks) - duty(13_875 - ticks)).abs() < 1e-12);
    }

    #[test]
    fn a_channel_is_lost_after_exactly_so_many_frames_in_a_row_and_back_with_the_next_usable_one(
        lost_after in 1_u32..30, frames in vec((unusable(), unusable(), unusable()), 1..60), good in pulse(),
    ) {
        let (config, mut stage) = (Remote { lost_after, ..Remote::default() }, RemoteStage::default());
        let usable = RemoteSample { speed: Some(good), steering: Some(good), selector: MANUAL };
        stage.step(&config, &usable);
        for (i, (speed, steering, selector)) in frames.into_iter().enumerate() {
            stage.step(&config, &RemoteSample { speed, steering, selector });
            let gone = i as u32 + 1 >= lost_after;
            prop_assert_eq!(stage.selector(), if gone { Selector::Lost } else { Selector::Manual });
            let stick = if gone { Stick::Lost } else { Stick::Keep };
            prop_assert_eq!((stage.speed(&config), stage.steering(&config)), (stick, stick));
        }
        stage.step(&config, &usable);
        prop_assert_eq!(stage.selector(), Selector::Manual);
        prop_assert!(matches!(stage.speed(&config), Stick::Counts(c) if (c - counts(good)).abs() < 1e-6));
    }

    #[test]
    fn in_manual_the_sticks_go_to_motor_and_steering_the_rear_mirrored(speed in pulse(), steering in pulse()) {
        let (_, outputs) = under([frame(speed, steering, MANUAL)], VehicleConfig::default());
        let pwm = outputs[0].pwm;
        prop_assert_eq!(outputs[0].mode, Mode::Manual);
        prop_assert!((pwm.motor.as_f64() - counts(speed)).abs() <= 0.5);
        let offset = (counts(steering) - 3710.0).clamp(-975.0, 975.0);
        prop_assert!((pwm.steer_front.as_f64() - (3710.0 + offset)).abs() <= 0.5);
        prop_assert!((pwm.steer_rear.as_f64() - (4179.0 - offset).clamp(2331.0, 5272.0)).abs() <= 0.5);
    }

    #[test]
    fn in_manual_the_motor_never_goes_into_an_obstacle(
        frames in vec((remote_sample(), any::<bool>(), any::<bool>()), 1..60),
    ) {
        let manual = |sample: RemoteSample| Sample::Remote(RemoteSample { selector: MANUAL, ..sample });
        let samples = frames.into_iter().flat_map(|(sample, front, rear)| [manual(sample), scan(front, rear)]);
        for out in under(samples, VehicleConfig::default()).1 {
            prop_assert_eq!(out.mode, Mode::Manual);
            prop_assert!(!out.obstacle.front || out.pwm.motor <= PwmCount::NEUTRAL, "{out:?}");
            prop_assert!(!out.obstacle.rear || out.pwm.motor >= PwmCount::NEUTRAL, "{out:?}");
        }
    }

    #[test]
    fn in_manual_and_in_fault_commands_change_nothing(
        fault: bool, frames in vec(remote_sample(), 12..40), commands in vec(command(), 40),
    ) {
        let selector = |sample| Sample::Remote(RemoteSample { selector: if fault { None } else { MANUAL }, ..sample });
        let frames: Vec<Sample> = frames.into_iter().map(selector).collect();
        // A fault needs ten frames; what is commanded before them still counts.
        let (mut with, _) = under(frames[..11].iter().copied(), VehicleConfig::default());
        let mut without = with.clone();
        for (i, (frame, command)) in frames[11..].iter().zip(commands).enumerate() {
            let t = Stamp::from_ms(500 + 20 * i as u64);
            with.step(t, &Sample::Command(command));
            let (with, without) = (with.step(t, frame), without.step(t, frame));
            prop_assert_eq!(with.mode, if fault { Mode::Fault } else { Mode::Manual });
            prop_assert_eq!(with, without);
        }
    }

    #[test]
    fn a_speed_stick_that_is_lost_stops_the_motor_and_a_steering_stick_centres_the_wheels(
        speed in pulse(), steering in pulse(), gone in vec((unusable(), unusable()), 10),
    ) {
        let manual = |speed, steering| Sample::Remote(RemoteSample { speed, steering, selector: MANUAL });
        let first = manual(Some(speed), Some(steering));
        let later = gone.into_iter().map(|(speed, steering)| manual(speed, steering));
        let (_, outputs) = under(std::iter::once(first).chain(later), VehicleConfig::default());
        for out in &outputs[..10] {
            prop_assert_eq!(out.pwm, outputs[0].pwm, "until then the last command is kept");
        }
        prop_assert_eq!((outputs[10].mode, outputs[10].pwm.motor), (Mode::Manual, PwmCount::NEUTRAL));
        prop_assert_eq!(outputs[10].pwm.steer_front.get(), 3710);
    }

    #[test]
    fn a_selector_that_is_lost_stops_whatever_goes_on(
        before in command(), others in vec(lost(), 10), gyro: i16, pulses in 0_u32..50,
    ) {
        let mut samples = vec![
            frame(938, 938, AUTOMATIC),
            Sample::Gyro(GyroSample::default()),
            Sample::Command(before),
            Sample::Encoder { pulses },
        ];
        samples.extend(others.into_iter().map(Sample::Remote));
        samples.extend([Sample::Gyro(GyroSample { roll: 0, pitch: 0, yaw: gyro }), Sample::Encoder { pulses }]);
        let (_, outputs) = under(samples, VehicleConfig::default());
        for out in &outputs[13..] {
            prop_assert_eq!((out.mode, out.pwm.motor, out.steering), (Mode::Fault, PwmCount::NEUTRAL, 0.0));
            prop_assert_eq!((out.reference_rpm, out.goto), (0.0, None));
        }
    }

    #[test]
    fn every_change_of_mode_by_the_transmitter_leaves_it_stopped_or_with_the_sticks(
        config in config(), samples in samples(120),
    ) {
        let mut controller = Controller::new(config);
        let mut before = Mode::Idle;
        for (t, sample) in samples {
            let out = controller.step(t, &sample);
            let remote = matches!(sample, Sample::Remote(_));
            if remote && out.mode != before {
                match (before, out.mode) {
                    (_, Mode::Manual) => {}
                    (Mode::Manual | Mode::Fault, Mode::Idle) | (_, Mode::Fault) => {
                        prop_assert_eq!((out.pwm.motor, out.steering), (PwmCount::NEUTRAL, 0.0));
                    }
                    (before, now) => prop_assert!(false, "{before:?} to {now:?}"),
                }
            }
            let ends_itself = matches!(before, Mode::Goto) && out.mode == Mode::Idle;
            let commanded = matches!(sample, Sample::Command(_)) && !matches!(before, Mode::Manual | Mode::Fault);
            prop_assert!(out.mode == before || remote || commanded || ends_itself, "{before:?} {sample:?}");
            before = out.mode;
        }
    }

    #[test]
    fn each_hand_over_to_automatic_zeroes_the_odometry_as_published_and_keeps_it_with_ours(
        keep_pose: bool, hand_overs in 1_usize..6, yaw: i16, pulses in 1_u32..100,
    ) {
        let mut config = VehicleConfig::default();
        config.odometry.keep_pose = keep_pose;
        let around = [
            frame(938, 938, MANUAL),
            Sample::Gyro(GyroSample { roll: 0, pitch: 0, yaw }),
            Sample::Encoder { pulses },
            frame(938, 938, AUTOMATIC),
        ];
        let (_, outputs) = under((0..hand_overs).flat_map(|_| around), config);
        let rezeroed = outputs.iter().filter(|out| out.rezeroed).count();
        prop_assert_eq!(rezeroed, if keep_pose { 0 } else { hand_overs });
        let last = outputs[outputs.len() - 1].pose;
        prop_assert_eq!(last.y_m == 0.0 && last.x_m == 0.0, !keep_pose);
    }

    #[test]
    fn without_permission_the_transmitter_does_nothing(frames in vec(remote_sample(), 1..30)) {
        let mut config = VehicleConfig::default();
        config.remote.enabled = false;
        let (_, outputs) = under(frames.into_iter().map(Sample::Remote), config);
        for out in outputs {
            prop_assert_eq!((out.mode, out.pwm.motor), (Mode::Idle, PwmCount::NEUTRAL));
        }
    }
}
