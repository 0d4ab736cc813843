//! What a robot makes of lines that carry something, but not what they should.

use crate::bench::*;
use xtb_control::PwmCount;
use xtb_control::controller::GyroSample;
use xtb_protocol::board::{BoardStatus, Firmware, FrameWriter};
use xtb_protocol::gyro_3dmg::{EulerFrame, START_CONTINUOUS};
use xtb_protocol::messages::{Fault, GoalStatus};

fn faults(bench: &mut Bench) -> Vec<Fault> {
    bench.state().faults.iter().map(|state| state.fault).collect()
}

#[test]
fn our_own_echo_is_the_wrong_device() {
    let mut bench = Bench::new();
    bench.board_silent = true;
    let (mut writer, pwm) = (FrameWriter::default(), bench.robot.outputs().pwm);
    for _ in 0..10 {
        bench.run_ms(20);
        bench.robot.board_bytes(bench.now, writer.pwm(&pwm).as_bytes());
    }
    assert_eq!(faults(&mut bench), [Fault::BoardWrongDevice]);
}

#[test]
fn a_board_that_repeats_one_frame_is_frozen_and_nothing_of_it_counts() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.board_silent = true;
    let before = bench.state().rejected;
    let frame = bench.board.encoder(20);
    for _ in 0..20 {
        bench.robot.board_bytes(bench.now, frame.as_bytes());
        bench.run_ms(10);
    }
    assert_eq!(faults(&mut bench), [Fault::BoardFrozen]);
    let after = bench.state().rejected;
    assert_eq!((after.board_repeated, after.board_lost), (19, before.board_lost));
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn a_gyro_that_hangs_is_frozen_and_recovers_by_itself() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.gyro_silent = true;
    let frame = bench.gyro_frame(bench.now.ms()).encode();
    for _ in 0..20 {
        bench.robot.gyro_bytes(bench.now, &frame);
        bench.run_ms(10);
    }
    assert_eq!(faults(&mut bench), [Fault::GyroFrozen]);
    assert_eq!((bench.motor, bench.state().goal.unwrap().status), (PwmCount::NEUTRAL, GoalStatus::Failed));
    bench.gyro_silent = false;
    bench.run_ms(1500);
    assert_eq!(faults(&mut bench), []);
}

#[test]
fn windows_that_cannot_be_are_the_encoders_fault_and_not_the_boards() {
    let mut bench = Bench::new();
    bench.wild_encoder = true;
    bench.run_ms(500);
    assert_eq!(faults(&mut bench), [Fault::EncoderOutOfRange]);
    let state = bench.state();
    assert_eq!(state.faults[0].detail.as_deref(), Some("4711 pulses in one window"));
}

/// A status as a board gives it that gets none of our pulses.
fn starved(bench: &mut Bench, watchdog: bool) {
    let setup_checksum = bench.setup.unwrap().checksum();
    let (firmware, ready, emergency_stop) = (Firmware(0x0100), true, None);
    let status = BoardStatus { firmware, ready, watchdog, emergency_stop, setup_checksum, rejected: 0 };
    let frame = bench.board.status(&status);
    bench.robot.board_bytes(bench.now, frame.as_bytes());
}

#[test]
fn a_board_whose_watchdog_began_gets_a_neutral_frame_before_the_goal_goes_on() {
    let mut bench = Bench::new();
    let reply = bench.ask(ahead(5.0));
    bench.run_ms(1000);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    starved(&mut bench, true);
    bench.run_ms(20);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    starved(&mut bench, false);
    bench.run_ms(25);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    let goal = bench.state().goal.unwrap();
    assert_eq!((goal.id, goal.status), (goal_of(&reply), GoalStatus::Running));
}

#[test]
fn a_board_that_hears_no_pulses_ends_the_goal_and_nothing_goes_on_when_it_does() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.board_silent = true; // all but its status
    for _ in 0..3 {
        starved(&mut bench, true);
        bench.run_ms(100);
    }
    assert_eq!(faults(&mut bench), [Fault::BoardNotSetUp]);
    assert_eq!(bench.state().goal.unwrap().status, GoalStatus::Failed);
    starved(&mut bench, false);
    bench.board_silent = false;
    bench.run_ms(5);
    assert_eq!(faults(&mut bench), [], "its encoder gets its time to speak");
    bench.run_ms(1000);
    assert_eq!((faults(&mut bench), bench.motor), (Vec::new(), PwmCount::NEUTRAL));
}

#[test]
fn the_clock_of_a_gyro_that_has_just_been_started_tells_of_no_losses() {
    let mut bench = Bench::new();
    let frame = |ticks| EulerFrame { angles: GyroSample::default(), ticks }.encode();
    assert!(bench.robot.gyro_request(bench.now).is_some(), "asked who it is although it sends");
    bench.run_ms(100);
    assert_eq!(bench.robot.gyro_request(bench.now), Some(&START_CONTINUOUS[..]));
    bench.gyro_silent = true;
    for ticks in [40_000, 40_002, 40_020] {
        bench.robot.gyro_bytes(bench.now, &frame(ticks));
    }
    assert_eq!(bench.state().rejected.gyro_lost, 11, "118 ms between two frames");
}
