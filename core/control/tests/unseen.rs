//! Directions in which no range finder looks: by itself the car does not drive there, by hand it crawls.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_control::goto::GotoGoal;
use xtb_control::vehicle::{BumperFinders, UNSEEN_MPS};
use xtb_control::{
    Command, Controller, Mode, Outputs, PwmCount, Sample, Stamp, Steering, VehicleConfig, WheelRpm,
};

/// An XTB without range finders at these bumpers.
fn car(bare_front: bool, bare_rear: bool) -> VehicleConfig {
    let mut config = VehicleConfig::default();
    for (side, is_bare) in
        [(&mut config.range_finders.front, bare_front), (&mut config.range_finders.rear, bare_rear)]
    {
        if is_bare {
            *side = BumperFinders(Vec::new());
        }
    }
    config.validate().unwrap();
    config
}

fn drive(rpm: f64, of: fn(WheelRpm, Steering) -> Command) -> Command {
    of(WheelRpm::try_from(rpm).unwrap(), Steering::CENTRED)
}

fn teleop(rpm: WheelRpm, steering: Steering) -> Command {
    Command::Teleop { rpm, steering }
}

fn follow(rpm: WheelRpm, steering: Steering) -> Command {
    Command::Follow { rpm, steering }
}

/// What is decided after a command and some windows in which the wheels do not turn.
fn after(config: &VehicleConfig, command: Command) -> Outputs {
    let mut controller = Controller::new(config.clone());
    let mut outputs = controller.step(Stamp::from_ms(1), &Sample::Command(command));
    for window in 1..5 {
        outputs = controller.step(Stamp::from_ms(53 * window), &Sample::Encoder { pulses: 0 });
    }
    outputs
}

#[test]
fn by_itself_a_car_does_not_drive_where_it_does_not_look() {
    let (front_only, rear_only, neither) = (car(false, true), car(true, false), car(true, true));
    for (config, rpm, drives) in [
        (&front_only, 13.0, true),
        (&front_only, -13.0, false),
        (&rear_only, 13.0, false),
        (&rear_only, -13.0, true),
        (&neither, 13.0, false),
        (&neither, -13.0, false),
    ] {
        let outputs = after(config, drive(rpm, follow));
        assert_eq!(outputs.pwm.motor != PwmCount::NEUTRAL, drives, "{rpm}: {outputs:?}");
        assert_eq!(outputs.blocked, !drives, "{rpm}");
    }
    let wandering = after(&rear_only, Command::Wander);
    assert_eq!((wandering.pwm.motor, wandering.mode), (PwmCount::NEUTRAL, Mode::Wander));
    let mut controller = Controller::new(rear_only);
    controller.step(Stamp::from_ms(1), &Sample::Command(Command::Goto(GotoGoal::new(0.0, 2.0).unwrap())));
    let gyro = xtb_control::controller::GyroSample::default();
    controller.step(Stamp::from_ms(2), &Sample::Gyro(gyro));
    let outputs = controller.step(Stamp::from_ms(53), &Sample::Encoder { pulses: 0 });
    assert!(outputs.reference_rpm > 0.0 && outputs.blocked, "{outputs:?}");
}

#[test]
fn by_hand_it_crawls_there_and_nowhere_else() {
    let front_only = car(false, true);
    let crawl_rpm = UNSEEN_MPS / front_only.mps_per_rpm();
    for (rpm, expected) in [(20.0, 20.0), (-20.0, -crawl_rpm), (-3.0, -3.0), (0.0, 0.0)] {
        let outputs = after(&front_only, drive(rpm, teleop));
        assert_eq!(outputs.reference_rpm, expected, "{rpm}");
        assert!(!outputs.blocked);
        assert_eq!(outputs.pwm.motor == PwmCount::NEUTRAL, rpm == 0.0, "{rpm}");
    }
    let xtb = car(false, false);
    assert_eq!(after(&xtb, drive(-20.0, teleop)).reference_rpm, -20.0);
}
