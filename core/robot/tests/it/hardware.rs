//! What breaks on a truck, and who drives it: faults by name, set-up, remote control.

use crate::bench::*;
use xtb_control::controller::{Mode, RemoteSample};
use xtb_control::{PwmCount, VehicleConfig};
use xtb_protocol::messages::{Body, EventKind, Fault, GoalStatus, Latch, RejectCode, Setpoint, StopReason};
use xtb_robot::line::PortTrouble;

fn faults(bench: &mut Bench) -> Vec<Fault> {
    bench.state().faults.iter().map(|state| state.fault).collect()
}

fn sticks(speed: u32, selector: u32) -> Option<RemoteSample> {
    Some(RemoteSample { speed: Some(speed), steering: Some(928), selector: Some(selector) })
}

const MANUAL: u32 = 750;
const AUTOMATIC: u32 = 1125;

#[test]
fn a_board_that_restarts_stops_the_truck_is_set_up_again_and_nothing_moves() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench.setup = None;
    bench.run_ms(40);
    assert!(bench.setup.is_some(), "asked to set up again");
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    bench.run_ms(3000);
    let state = bench.state();
    assert_eq!(
        (bench.motor, state.mode, state.goal.unwrap().status),
        (PwmCount::NEUTRAL, Mode::Idle, GoalStatus::Failed)
    );
    assert_eq!(state.faults, Vec::new());
}

#[test]
fn a_fault_has_its_name_within_200_ms_stops_the_goal_and_goes_by_itself() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.gyro_silent = true;
    bench.run_ms(170);
    assert_eq!(faults(&mut bench), [Fault::GyroSilent]);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::Latched);
    assert_eq!(code_of(&bench.ask(Body::Reset { latch: None })), RejectCode::CausePresent);
    bench.gyro_silent = false;
    bench.run_ms(1000);
    assert_eq!(faults(&mut bench), []);
    assert_eq!((bench.motor, bench.state().mode), (PwmCount::NEUTRAL, Mode::Idle));
    let mut seen = Vec::new();
    while let Some(event) = bench.robot.agent_mut().next_event() {
        if let EventKind::Fault { fault, present, .. } = event.kind {
            seen.push((fault, present));
        }
    }
    assert_eq!(seen, [(Fault::GyroSilent, true), (Fault::GyroSilent, false)]);
}

#[test]
fn a_port_that_is_gone_is_a_fault_in_the_same_turn_with_the_systems_words() {
    let mut bench = Bench::new();
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    bench.board_silent = true;
    bench.robot.board_port(bench.now, Some((PortTrouble::Unplugged, "/dev/ttyUSB0: no such device")));
    bench.run_ms(5);
    let state = bench.state();
    assert_eq!(state.faults[0].fault, Fault::BoardUnplugged);
    assert_eq!(state.faults[0].detail.as_deref(), Some("/dev/ttyUSB0: no such device"));
    assert_eq!(state.goal.unwrap().status, GoalStatus::Failed);
    bench.robot.board_port(bench.now, None);
    bench.board_silent = false;
    bench.run_ms(1000);
    assert_eq!(faults(&mut bench), []);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn manual_ends_what_the_network_asked_for_and_refuses_more() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(100);
    let goal = goal_of(&bench.ask(ahead(5.0)));
    bench.run_ms(1000);
    bench.remote = sticks(1000, MANUAL);
    bench.run_ms(100);
    assert_eq!((bench.motor.get(), bench.state().mode), (4000, Mode::Manual));
    assert!(bench.goal_events().contains(&(goal, GoalStatus::Cancelled)));
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::Latched);
    assert_eq!(code_of(&bench.ask(Body::Reset { latch: None })), RejectCode::CausePresent);
    bench.setpoint(13.0);
    bench.run_ms(20);
    assert_eq!(bench.state().mode, Mode::Manual);
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(1000);
    assert_eq!((bench.motor, bench.state().mode), (PwmCount::NEUTRAL, Mode::Idle));
}

#[test]
fn a_joystick_that_a_late_setpoint_showed_held_under_the_transmitter_has_to_be_let_go_first() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(300);
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(100);
    assert_eq!(bench.state().mode, Mode::Manual);
    bench.lease_of(CLIENT);
    let held = bench.fresh_setpoint(13.0);
    bench.put(&Setpoint { echo_tick_ms: Some(bench.now.ms() - 301), ..held });
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(100);
    assert_eq!(bench.state().mode, Mode::Idle);
    let drives = |bench: &mut Bench| {
        for _ in 0..10 {
            bench.setpoint(13.0);
            bench.run_ms(50);
        }
        bench.state().mode == Mode::Teleop
    };
    assert!(!drives(&mut bench));
    let let_go = bench.fresh_setpoint(0.0);
    bench.put(&Setpoint { echo_tick_ms: Some(bench.now.ms() - 301), ..let_go });
    assert!(!drives(&mut bench), "a late one does not tell that it is let go now");
    bench.setpoint(0.0);
    assert!(drives(&mut bench));
}

#[test]
fn sticks_do_not_drive_into_an_obstacle() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(100);
    bench.remote = sticks(1000, MANUAL);
    bench.front = 300;
    bench.run_ms(200);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert!(bench.state().stopped_because.contains(&StopReason::ObstacleFront));
    bench.remote = sticks(875, MANUAL);
    bench.run_ms(100);
    assert_eq!(bench.motor.get(), 3500, "away from it they may");
}

#[test]
fn a_transmitter_out_of_range_is_a_fault_that_ends_the_goal() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(100);
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.remote = Some(RemoteSample::default());
    bench.run_ms(230);
    let state = bench.state();
    assert_eq!((state.mode, state.goal.unwrap().status), (Mode::Fault, GoalStatus::Failed));
    assert_eq!(faults(&mut bench), [Fault::RemoteLost]);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(500);
    assert_eq!((bench.motor, bench.state().mode), (PwmCount::NEUTRAL, Mode::Idle));
    assert_eq!(faults(&mut bench), []);
}

#[test]
fn an_impossible_reading_resets_its_channel() {
    let mut bench = Bench::new();
    bench.remote = sticks(58_275, MANUAL);
    bench.run_ms(100);
    let mask = bench.resets.first().copied().unwrap();
    assert_eq!((mask.speed, mask.steering, mask.selector), (true, false, false));
}

#[test]
fn the_pose_in_the_map_does_not_jump_when_the_odometry_is_set_back() {
    let mut vehicle = VehicleConfig::default();
    vehicle.odometry.keep_pose = false;
    let mut bench = Bench::with(vehicle);
    bench.yaw = 5000;
    bench.ask(ahead(0.6));
    bench.run_ms(5000);
    let before = bench.state().pose;
    assert!(before.y_m.abs() + before.x_m.abs() > 0.3);
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(1000);
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(200);
    assert_eq!(bench.robot.outputs().pose.y_m, 0.0);
    let after = bench.state().pose;
    assert!(
        (after.x_m - before.x_m).abs() < 0.2 && (after.y_m - before.y_m).abs() < 0.2,
        "{before:?} {after:?}"
    );
    assert!((after.yaw_rad - before.yaw_rad).abs() < 1e-6);
}

#[test]
fn a_tilt_sensor_without_an_angle_is_a_fault_that_stops_nothing() {
    let mut bench = Bench::new();
    bench.tilt = [1023, 512];
    bench.run_ms(100);
    assert_eq!(faults(&mut bench), [Fault::TiltOutOfRange]);
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
}

/// In mode manual, the stick held well ahead, the truck driving.
fn driven_by_hand() -> Bench {
    let mut bench = Bench::new();
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(100);
    bench.remote = sticks(1000, MANUAL);
    bench.run_ms(100);
    assert_eq!(bench.motor.get(), 4000);
    bench
}

/// Whether the motor stays neutral for so long.
fn stands_for_ms(bench: &mut Bench, ms: u64) -> bool {
    (0..ms / 5).all(|_| {
        bench.run_ms(5);
        bench.motor == PwmCount::NEUTRAL
    })
}

/// While the loop is held up the stick rests, and then it is pushed; the line brings that in several turns.
#[test]
fn a_stick_that_is_pushed_after_a_stalled_loop_has_to_be_let_go_and_what_is_read_late_does_not_count() {
    let mut bench = driven_by_hand();
    bench.now = bench.now.plus_ms(3000);
    bench.board_silent = true;
    for speed in [938, 938, 1000] {
        bench.remote = sticks(speed, MANUAL);
        bench.board_samples(20);
        bench.run_ms(5);
    }
    bench.board_silent = false;
    assert!(stands_for_ms(&mut bench, 1000), "held");
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(50);
    bench.remote = sticks(1000, MANUAL);
    bench.run_ms(50);
    assert_eq!(bench.motor.get(), 4000, "let go and pushed again");
}

#[test]
fn a_receiver_that_sends_no_frames_any_more_is_lost_after_ten() {
    let mut bench = driven_by_hand();
    bench.remote = None;
    bench.run_ms(180);
    assert_eq!(bench.state().mode, Mode::Manual);
    bench.run_ms(80);
    assert_eq!((bench.motor, bench.state().mode), (PwmCount::NEUTRAL, Mode::Fault));
    assert_eq!(faults(&mut bench), [Fault::RemoteLost]);
}

#[test]
fn a_stick_that_was_never_neutral_does_not_drive() {
    let mut bench = Bench::new();
    bench.remote = sticks(1000, MANUAL);
    assert!(stands_for_ms(&mut bench, 1000));
    bench.remote = sticks(940, MANUAL);
    bench.run_ms(50);
    bench.remote = sticks(1000, MANUAL);
    bench.run_ms(50);
    assert_eq!(bench.motor.get(), 4000);
}

#[test]
fn a_board_that_comes_back_does_not_drive_on_by_a_stick_that_was_held() {
    type Break = fn(&mut Bench);
    let breaks: [Break; 3] = [
        |bench| bench.setup = None, // its power was cut
        |bench| {
            bench.board_silent = true;
            bench.run_ms(400);
            bench.board_silent = false;
        },
        |bench| {
            bench.robot.board_port(bench.now, Some((PortTrouble::Unplugged, "gone")));
            bench.robot.board_port(bench.now, None);
        },
    ];
    for (i, cut) in breaks.into_iter().enumerate() {
        let mut bench = driven_by_hand();
        cut(&mut bench);
        bench.run_ms(25);
        assert!(stands_for_ms(&mut bench, 2000), "{i}");
        assert_eq!(bench.state().mode, Mode::Manual, "{i}: the receiver is back");
        bench.remote = sticks(938, MANUAL);
        bench.run_ms(50);
        bench.remote = sticks(1000, MANUAL);
        bench.run_ms(50);
        assert_eq!(bench.motor.get(), 4000, "{i}: after neutral it drives again");
    }
}

#[test]
fn a_silent_converter_holds_the_transmitter_too() {
    let mut bench = driven_by_hand();
    bench.adc_silent = true;
    bench.run_ms(200);
    assert_eq!(faults(&mut bench), [Fault::ConverterSilent]);
    assert!(stands_for_ms(&mut bench, 500), "nobody sees obstacles");
}

#[test]
fn the_last_frame_is_neutral_whoever_drives() {
    let mut bench = driven_by_hand();
    let last = bench.robot.neutral_frame(bench.now);
    bench.board_hears(last.as_bytes());
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn a_joystick_that_is_held_through_a_fault_does_not_drive_on() {
    let mut bench = Bench::new();
    let hold = |bench: &mut Bench, rpm, times| {
        (0..times).for_each(|_| {
            bench.setpoint(rpm);
            bench.run_ms(50);
        });
    };
    hold(&mut bench, 13.0, 20);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench.gyro_silent = true;
    hold(&mut bench, 13.0, 10);
    bench.gyro_silent = false;
    hold(&mut bench, 13.0, 40);
    assert_eq!((bench.motor, faults(&mut bench)), (PwmCount::NEUTRAL, Vec::new()));
    hold(&mut bench, 0.0, 1);
    hold(&mut bench, 13.0, 20);
    assert_eq!(bench.motor, PwmCount::NEUTRAL, "the latch holds it");
    bench.ask(Body::Reset { latch: None });
    hold(&mut bench, 13.0, 20);
    assert_eq!(bench.motor, PwmCount::NEUTRAL, "held through the reset");
    hold(&mut bench, 0.0, 1);
    hold(&mut bench, 13.0, 20);
    assert_ne!(bench.motor, PwmCount::NEUTRAL, "let go and pushed again");
}

#[test]
fn a_stick_that_is_held_through_an_emergency_stop_and_its_reset_has_to_be_let_go() {
    let mut bench = driven_by_hand();
    bench.estop(1);
    bench.run_ms(25);
    assert!(stands_for_ms(&mut bench, 500));
    bench.ask(Body::Reset { latch: Some(Latch::Estop) });
    assert!(stands_for_ms(&mut bench, 1000));
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(50);
    bench.remote = sticks(1000, MANUAL);
    bench.run_ms(50);
    assert_eq!(bench.motor.get(), 4000);
}

#[test]
fn a_takeover_is_not_reset_while_the_transmitter_is_out_of_sight() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, AUTOMATIC);
    bench.run_ms(100);
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(100);
    bench.remote = None;
    bench.run_ms(500);
    assert_eq!(bench.state().mode, Mode::Fault);
    assert_eq!(code_of(&bench.ask(Body::Reset { latch: None })), RejectCode::CausePresent);
}

#[test]
fn a_stick_that_is_not_quite_neutral_stands_and_says_why() {
    let mut bench = Bench::new();
    bench.remote = sticks(938, MANUAL);
    bench.run_ms(200);
    assert_ne!(bench.motor, PwmCount::NEUTRAL, "938 time counts are 3752 counts");
    let state = bench.state();
    assert_eq!(state.stopped_because, [StopReason::RemoteNeutral]);
    assert!(state.stopped_age_ms.is_some());
}

#[test]
fn an_emergency_stop_that_is_reset_within_a_turn_stops_a_held_stick_all_the_same() {
    let mut bench = driven_by_hand();
    bench.lease_of(CLIENT);
    bench.estop(1);
    bench.ask(Body::Reset { latch: Some(Latch::Estop) });
    bench.run_ms(5);
    assert!(stands_for_ms(&mut bench, 1000));
}
