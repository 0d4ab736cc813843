//! What a robot makes of lines that carry something, but not what they should.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod bench;

use bench::*;
use xtb_control::PwmCount;
use xtb_control::controller::GyroSample;
use xtb_protocol::board::{BoardStatus, FrameWriter};
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

/// A status as a board gives it that gets none of our pulses.
fn starved(bench: &mut Bench, watchdog: bool) {
    let setup_checksum = bench.setup.unwrap().checksum();
    let status = BoardStatus { firmware: 0x0100, ready: true, watchdog, setup_checksum, rejected: 0 };
    let frame = bench.board.status(&status);
    bench.robot.board_bytes(bench.now, frame.as_bytes());
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
