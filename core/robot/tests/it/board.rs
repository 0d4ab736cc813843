//! What a board says beyond its samples: its emergency stop, its firmware, and its inertial unit.

use crate::bench::*;
use xtb_control::vehicle::{BumperFinders, Imu, ImuYaw, RangeFinder};
use xtb_control::{Controller, PwmCount, VehicleConfig};
use xtb_protocol::board::{Ask, BoardIdentity, Firmware};
use xtb_protocol::messages::{
    Body, EventKind, Fault, GoalStatus, Latch, Outcome, RejectCode, STOP_SWITCH, StopReason,
};
use xtb_robot::line::PortTrouble;

/// The firmware of this release.
const NEW: Firmware = Firmware(0x0102);

fn faults(bench: &mut Bench) -> Vec<(Fault, Option<String>)> {
    bench.state().faults.into_iter().map(|state| (state.fault, state.detail)).collect()
}

fn driving(vehicle: VehicleConfig) -> Bench {
    let mut bench = Bench::at_board(vehicle, NEW);
    bench.ask(ahead(5.0));
    bench.run_ms(1000);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    bench
}

fn latch_events(bench: &mut Bench) -> Vec<(bool, String)> {
    let mut events = Vec::new();
    while let Some(event) = bench.robot.agent_mut().next_event() {
        if let EventKind::Latch { latch: Latch::Estop, set, by } = event.kind {
            events.push((set, by));
        }
    }
    events
}

#[test]
fn the_switch_at_the_board_is_a_latched_stop_that_is_reset_only_when_it_is_released() {
    let mut bench = driving(VehicleConfig::default());
    bench.stop = Some(true);
    bench.run_ms(25);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    bench.run_ms(2000);
    let state = bench.state();
    assert_eq!(state.goal.as_ref().unwrap().status, GoalStatus::Failed);
    assert_eq!(state.stopped_because[0], StopReason::Estop);
    let [latch] = &state.latches[..] else { panic!("{:?}", state.latches) };
    assert_eq!((latch.latch, latch.by.as_str(), latch.present), (Latch::Estop, STOP_SWITCH, true));
    assert!(latch.remedy(&state).starts_with("first release the emergency stop switch; then"));
    assert_eq!(state.faults, [], "it is no fault, and the board stays set up");

    let Outcome::Error(error) = bench.ask(Body::Reset { latch: None }).result else { panic!("it was reset") };
    assert_eq!(error.code, RejectCode::CausePresent);
    assert!(error.message.contains(STOP_SWITCH), "{}", error.message);
    bench.stop = Some(false);
    bench.run_ms(1000);
    assert!(!bench.state().latches[0].present);
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::Latched);
    bench.ask(Body::Reset { latch: None });
    bench.run_ms(100);
    assert_eq!(
        (bench.motor, bench.state().latches),
        (PwmCount::NEUTRAL, Vec::new()),
        "nothing moves by itself"
    );
    bench.ask(ahead(5.0));
    bench.run_ms(500);
    assert_ne!(bench.motor, PwmCount::NEUTRAL);
    let by = |set, by: &str| (set, by.to_owned());
    assert_eq!(latch_events(&mut bench), [by(true, STOP_SWITCH), by(false, CLIENT)]);
}

#[test]
fn a_board_that_says_nothing_of_its_switch_any_more_has_not_released_it() {
    let mut bench = driving(VehicleConfig::default());
    bench.stop = Some(true);
    bench.run_ms(100);
    bench.board_silent = true;
    bench.robot.board_port(bench.now, Some((PortTrouble::Unplugged, "/dev/ttyUSB0: no such device")));
    bench.run_ms(1000);
    let present = |bench: &mut Bench| bench.state().latches[0].present;
    assert!(present(&mut bench));
    bench.robot.board_port(bench.now, None);
    bench.run_ms(50);
    assert!(present(&mut bench));
    (bench.board_silent, bench.stop) = (false, Some(false));
    bench.run_ms(1000);
    assert!(!present(&mut bench));
}

#[test]
fn of_an_older_firmware_it_is_unknown_until_it_says_pressed() {
    let mut bench = Bench::new();
    let said = |bench: &Bench| bench.robot.readings(bench.now).status.unwrap().emergency_stop;
    assert_eq!(said(&bench), None);
    bench.stop = Some(true);
    bench.run_ms(100);
    assert_eq!(said(&bench), Some(true));
    bench.stop = None;
    bench.run_ms(100);
    assert_eq!(said(&bench), Some(false), "it has shown that it knows the bit");
    assert!(!bench.state().latches[0].present);
}

#[test]
fn a_press_while_a_client_has_stopped_it_is_told_and_holds_the_reset() {
    let mut bench = driving(VehicleConfig::default());
    bench.estop(1);
    bench.run_ms(50);
    bench.stop = Some(true);
    bench.run_ms(50);
    let by = |by: &str| (true, by.to_owned());
    assert_eq!(latch_events(&mut bench), [by(CLIENT), by(STOP_SWITCH)]);
    assert_eq!(code_of(&bench.ask(Body::Reset { latch: None })), RejectCode::CausePresent);
}

#[test]
fn a_firmware_that_the_agent_does_not_know_is_refused_by_its_version_and_never_set_up() {
    let mut bench = Bench::at_board(VehicleConfig::default(), Firmware(0x0203));
    bench.run_ms(1000);
    let [(fault, Some(words))] = &faults(&mut bench)[..] else { panic!("{:?}", bench.state().faults) };
    assert_eq!(*fault, Fault::BoardNotSetUp);
    assert!(words.starts_with("firmware 2.3 is not known") && words.contains("flash"), "{words}");
    assert!(bench.setup.is_some(), "it was told before it had said who it is, and it confirms");
    bench.setup = None;
    bench.run_ms(1000);
    assert_eq!(
        (bench.setup, bench.asks.len()),
        (None, 0),
        "now it is told nothing that it could misunderstand"
    );
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::NotReady);
    bench.firmware = NEW; // flashed
    bench.run_ms(1000);
    assert_eq!(faults(&mut bench), []);
}

#[test]
fn a_board_that_names_no_version_is_accepted_and_not_asked() {
    for firmware in [0, 0x0100] {
        let mut bench = Bench::at_board(VehicleConfig::default(), Firmware(firmware));
        bench.ask(ahead(5.0));
        bench.run_ms(1000);
        assert_ne!(bench.motor, PwmCount::NEUTRAL);
        assert_eq!(bench.asks, []);
        assert_eq!(bench.robot.readings(bench.now).identity, None);
    }
}

#[test]
fn frames_of_another_version_of_the_layout_name_it() {
    let mut bench = Bench::new();
    bench.board_silent = true;
    let mut writer = xtb_board_codec::Writer::default();
    for _ in 0..10 {
        bench.run_ms(20);
        bench.robot.board_bytes(bench.now, writer.frame(0x24, [0x0200, 0, 0, 0]).as_bytes());
    }
    let [(fault, Some(words))] = &faults(&mut bench)[..] else { panic!("{:?}", bench.state().faults) };
    assert_eq!(*fault, Fault::BoardWrongDevice);
    assert!(words.starts_with("firmware 2.x is not known"), "{words}");
}

#[test]
fn a_board_is_asked_who_it_is_and_again_after_it_has_restarted() {
    let mut bench = Bench::at_board(VehicleConfig::default(), NEW);
    let identity = BoardIdentity {
        firmware: NEW,
        hash: 7,
        model: 1,
        after_hang: true,
        late_periods: 0,
        replaced_samples: 0,
    };
    let said = bench.board.identity(&identity);
    bench.robot.board_bytes(bench.now, said.as_bytes());
    let before = bench.asks.len();
    bench.run_ms(500);
    assert_eq!(bench.asks.len(), before, "it has answered");
    assert_eq!(bench.asks[0], Ask { identity: true, ..Ask::default() });
    assert_eq!(bench.robot.readings(bench.now).identity, Some(identity));
    bench.setup = None;
    bench.run_ms(100);
    assert!(bench.asks.len() > before);
    assert_eq!(bench.robot.readings(bench.now).identity, None);
}

fn with_bno085() -> VehicleConfig {
    VehicleConfig { imu: Imu::Bno085Rvc, ..VehicleConfig::default() }
}

#[test]
fn a_bno085_at_the_board_turns_the_pose_as_its_setting_says() {
    for (imu_yaw, turned) in [(ImuYaw::CounterClockwise, 0.5), (ImuYaw::Clockwise, -0.5)] {
        let mut bench = Bench::at_board(VehicleConfig { imu_yaw, ..with_bno085() }, NEW);
        assert!(bench.robot.gyro_request(bench.now).is_none(), "there is no line to ask on");
        let before = bench.state().pose.yaw_rad;
        bench.imu.as_mut().unwrap().yaw_cdeg = 2865; // 0.5 rad
        bench.run_ms(100);
        let after = bench.state().pose.yaw_rad;
        assert!((after - before - turned).abs() < 1e-3, "{imu_yaw:?}: {before} to {after}");
        assert_eq!(faults(&mut bench), []);
    }
}

#[test]
fn a_bno085_that_falls_silent_stops_the_truck_under_its_name_and_recovers_by_itself() {
    let mut bench = driving(with_bno085());
    bench.gyro_silent = true;
    bench.run_ms(170);
    assert_eq!(faults(&mut bench), [(Fault::GyroSilent, Some("BNO085 at the I/O board".to_owned()))]);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    let state = bench.state();
    assert_eq!(state.latches[0].by, "gyro_silent: BNO085 at the I/O board");
    bench.run_ms(300);
    assert!(bench.asks.iter().filter(|ask| ask.imu).count() > 2, "it is asked for again");
    bench.gyro_silent = false;
    bench.run_ms(1000);
    assert_eq!(faults(&mut bench), []);
}

#[test]
fn a_board_that_is_lost_is_the_boards_fault_and_not_that_of_its_bno085() {
    let mut bench = driving(with_bno085());
    while bench.robot.agent_mut().next_event().is_some() {}
    bench.board_silent = true;
    bench.run_ms(1000);
    bench.board_silent = false;
    bench.run_ms(1000);
    let mut seen = Vec::new();
    while let Some(event) = bench.robot.agent_mut().next_event() {
        if let EventKind::Fault { fault, .. } = event.kind {
            seen.push(fault);
        }
    }
    assert_eq!(seen, [Fault::BoardSilent; 2], "it came and went");
}

#[test]
fn a_bno085_that_hangs_is_frozen_by_name() {
    let mut bench = driving(with_bno085());
    let sample = bench.imu.unwrap();
    bench.gyro_silent = true;
    for _ in 0..40 {
        let frame = bench.board.bno085(&sample);
        bench.robot.board_bytes(bench.now, frame.as_bytes());
        bench.run_ms(10);
    }
    let present = faults(&mut bench);
    assert_eq!(present[0].0, Fault::GyroFrozen);
    assert!(present[0].1.as_deref().unwrap().starts_with("BNO085"), "{present:?}");
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
}

#[test]
fn gaps_and_wrong_check_sums_of_a_bno085_are_counted() {
    let mut bench = driving(with_bno085());
    let before = bench.state().rejected;
    let unit = bench.imu.as_mut().unwrap();
    (unit.index, unit.bad) = (unit.index.wrapping_add(3), 2);
    bench.run_ms(50);
    let after = bench.state().rejected;
    assert_eq!((after.gyro_lost - before.gyro_lost, after.gyro_bytes - before.gyro_bytes), (3, 38));
}

#[test]
fn a_board_whose_firmware_is_too_old_for_a_bno085_is_the_reason_that_is_named() {
    let mut bench = Bench::at_board(with_bno085(), Firmware(0x0100));
    bench.run_ms(1000);
    let words = "BNO085: firmware 1.0 of the I/O board does not send its samples";
    assert_eq!(faults(&mut bench), [(Fault::GyroSilent, Some(words.to_owned()))]);
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::NotReady);
}

#[test]
fn a_drive_with_a_bno085_replays_bit_for_bit() {
    let mut bench = Bench::booted(with_bno085(), NEW);
    bench.robot.record_steps();
    bench.run_ms(200);
    bench.ask(ahead(0.5));
    let mut steps = Vec::new();
    for i in 0..300_i16 {
        bench.imu.as_mut().unwrap().yaw_cdeg = 7 * i;
        bench.run_ms(10);
        steps.extend(std::iter::from_fn(|| bench.robot.take_step()));
    }
    let mut replay = Controller::new(with_bno085());
    assert!(steps.len() > 400, "{}", steps.len());
    for step in steps {
        assert_eq!(replay.step(step.t, &step.sample), step.outputs, "step {}", step.number);
    }
}

/// Seven range finders ahead, the last of them on the right.
fn with_seven() -> VehicleConfig {
    let mut vehicle = VehicleConfig::default();
    let lefts_m = (0..7).map(|i| 0.18 - 0.06 * f64::from(i));
    vehicle.range_finders.front = BumperFinders(lefts_m.map(RangeFinder::at).collect());
    vehicle
}

#[test]
fn a_car_with_seven_range_finders_on_a_bumper_asks_for_wide_scans_and_stops_at_what_the_seventh_sees() {
    let mut bench = driving(with_seven());
    assert!(bench.asks.iter().all(|ask| ask.wide_scan), "{:?}", bench.asks);
    let asked = bench.asks.len();
    bench.run_ms(1000);
    assert_eq!(bench.asks.len(), asked, "what it has asked for comes");
    bench.last_front = 300; // 18 cm
    bench.run_ms(100);
    assert_eq!(bench.motor, PwmCount::NEUTRAL);
    assert_eq!(bench.state().stopped_because[0], StopReason::ObstacleFront);
    let outputs = bench.robot.outputs();
    assert!(outputs.ir_front_cm[6].is_some_and(|cm| (17.0..19.0).contains(&cm)), "{:?}", outputs.ir_front_cm);
    assert_eq!(outputs.ir_front_cm[7], None, "nothing is fitted there, whatever it shows");
}

#[test]
fn a_board_whose_firmware_is_too_old_for_seven_range_finders_is_the_reason_that_is_named() {
    let mut bench = Bench::at_board(with_seven(), Firmware(0x0101));
    bench.run_ms(1000);
    let words = "firmware 1.1 of the I/O board sends six range finders a bumper, the car has more";
    assert_eq!(faults(&mut bench), [(Fault::ConverterSilent, Some(words.to_owned()))]);
    assert_eq!(code_of(&bench.ask(ahead(1.0))), RejectCode::NotReady);
}

#[test]
fn a_board_that_restarts_is_asked_for_wide_scans_again() {
    let mut bench = Bench::at_board(with_seven(), NEW);
    bench.asks.clear();
    bench.setup = None;
    bench.run_ms(1000);
    assert!(bench.asks.iter().any(|ask| ask.wide_scan));
    assert_eq!(faults(&mut bench), []);
}
