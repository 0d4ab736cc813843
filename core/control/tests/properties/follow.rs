//! The second level's command: a drive in mode goto, without Table 4, that may be repeated.

use crate::any::{adc_sample, config, encoder, follow, teleop};
use proptest::collection::vec;
use proptest::prelude::*;
use xtb_control::controller::GyroSample;
use xtb_control::{Command, Controller, Mode, Outputs, PwmCount, Sample, Stamp, VehicleConfig};

/// What comes without anybody's doing.
fn sensors() -> impl Strategy<Value = Vec<Sample>> {
    let gyro = any::<(i16, i16, i16)>();
    let one = prop_oneof![
        4 => gyro.prop_map(|(roll, pitch, yaw)| Sample::Gyro(GyroSample { roll, pitch, yaw })),
        4 => encoder(),
        2 => adc_sample().prop_map(Sample::Adc),
    ];
    vec(one, 1..100)
}

fn rpm() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -60.0..=60.0, 1 => Just(0.0)]
}

fn stamp(i: usize) -> Stamp {
    Stamp::from_ms(10 * i as u64)
}

proptest! {
    #[test]
    fn the_same_again_changes_nothing(
        config in config(), rpm in rpm(), steering in -1.0..=1.0, samples in sensors(),
    ) {
        let command = Sample::Command(follow(rpm, steering));
        let (mut once, mut again) = (Controller::new(config.clone()), Controller::new(config));
        once.step(Stamp::ZERO, &command);
        for (i, sample) in samples.iter().enumerate() {
            again.step(stamp(i), &command);
            let (a, b) = (once.step(stamp(i), sample), again.step(stamp(i), sample));
            prop_assert_eq!(a, b, "after {:?}", sample);
        }
    }

    #[test]
    fn it_drives_as_teleoperation_does_in_mode_goto(
        config in config(), drives in vec((rpm(), -1.0..=1.0), 1..5), samples in sensors(),
    ) {
        let (mut plan, mut hand) = (Controller::new(config.clone()), Controller::new(config));
        for (i, sample) in samples.iter().enumerate() {
            let (rpm, steering) = drives[i * drives.len() / samples.len()];
            plan.step(stamp(i), &Sample::Command(follow(rpm, steering)));
            hand.step(stamp(i), &Sample::Command(teleop(rpm, steering)));
            let (a, b) = (plan.step(stamp(i), sample), hand.step(stamp(i), sample));
            prop_assert_eq!((a.mode, b.mode), (Mode::Goto, Mode::Teleop));
            prop_assert_eq!(a.goto, None);
            prop_assert_eq!(Outputs { mode: Mode::Teleop, ..a }, b);
        }
    }
}

/// An encoder window at half the speed that is asked for.
fn window(controller: &mut Controller) -> PwmCount {
    controller.step(Stamp::ZERO, &Sample::Encoder { pulses: 30 }).pwm.motor
}

#[test]
fn a_new_speed_of_the_same_sign_keeps_the_speed_controllers_sum() {
    let asks = |rpms: [f64; 3]| {
        let mut controller = Controller::new(VehicleConfig::default());
        rpms.map(|rpm| {
            controller.step(Stamp::ZERO, &Sample::Command(follow(rpm, 0.0)));
            window(&mut controller).get()
        })[2]
    };
    let fresh = asks([0.0, 0.0, 35.0]);
    assert!(asks([34.0, 36.0, 35.0]) > fresh, "two windows with an error before");
    assert_eq!(asks([34.0, 0.0, 35.0]), fresh, "a stand forgets them");
}

#[test]
fn it_takes_over_from_a_goal_of_table_4() {
    let mut controller = Controller::new(VehicleConfig::default());
    let goal = xtb_control::goto::GotoGoal::new(1.0, 2.0).unwrap();
    controller.step(Stamp::ZERO, &Sample::Command(Command::Goto(goal)));
    let gyro = Sample::Gyro(GyroSample { roll: 0, pitch: 0, yaw: 0 });
    assert!(controller.step(Stamp::ZERO, &gyro).goto.is_some());
    controller.step(Stamp::ZERO, &Sample::Command(follow(-20.0, 0.5)));
    let out = controller.step(stamp(1), &gyro);
    assert_eq!((out.mode, out.goto, out.reference_rpm, out.steering), (Mode::Goto, None, -20.0, 0.5));
}
