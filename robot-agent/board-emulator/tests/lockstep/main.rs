//! Robot, truck and the board's firmware in lockstep, beside the same with the simulated board.
//!
//! `XTB_BOARD_FIRMWARE` names the firmware's ELF file; without it these tests say so and are skipped. The long
//! form, with a table:
//!
//! ```sh
//! XTB_BOARD_FIRMWARE=… cargo test --release -p xtb-board-emulator -- --ignored --nocapture
//! ```

#![allow(clippy::unwrap_used)]

mod measure;
mod rig;

use measure::{Pair, drives, kills, levellings};
use rig::Rig;
use std::path::{Path, PathBuf};
use xtb_board_emulator::{Emulator, EmulatorError};
use xtb_control::VehicleConfig;
use xtb_control::vehicle::Imu;
use xtb_protocol::messages::{GoalStatus, STOP_SWITCH};

/// Goals, levellings and kills of the short form, for CI, and of the long one.
const SHORT: (usize, u64, u64) = (2, 8, 2);
const LONG: (usize, u64, u64) = (20, 40, 20);

/// The firmware needs this long for a scan, which the simulated board makes in a moment; then the line, and a PWM
/// period.
const SCAN_S: f64 = 0.038;
const SCAN_ON_LINE_S: f64 = 0.004;
const PERIOD_S: f64 = 0.0222;

/// The firmware's ELF file, if it is named.
fn firmware() -> Option<PathBuf> {
    std::env::var_os("XTB_BOARD_FIRMWARE").map(PathBuf::from)
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn skip() {
    eprintln!("SKIP: no XTB_BOARD_FIRMWARE: no robot drove with the board's firmware");
}

#[allow(clippy::print_stdout)] // the long form's table
fn row(what: &str, measured: &str) {
    println!("| {what:<44} | {measured:<60} |");
}

/// Shows both times; how much longer it took with the firmware, as a part and in s.
fn compared(what: &str, Pair { emulated_s, simulated_s }: Pair) -> (f64, f64) {
    let (part, more_s) = (emulated_s / simulated_s - 1.0, emulated_s - simulated_s);
    row(what, &format!("{emulated_s:.3} s, simulated board {simulated_s:.3} s: {:+.2} %", part * 100.0));
    (part, more_s)
}

fn goals(count: usize) {
    let firmware = firmware().unwrap();
    let drives = drives(&firmware, count);
    for (i, pair) in drives.times.iter().enumerate() {
        let what = format!("goal {}", i + 1);
        let (part, _) = compared(&what, *pair);
        assert!(part.abs() <= 0.02, "{what}: {pair:?}");
    }
    let frames = format!("{} of the board, {:?}", drives.frames, drives.trouble);
    row("frames; lost, refused, resets", &frames);
    assert!(drives.frames > 40 * count as u64, "{frames}");
    assert_eq!(drives.trouble, rig::Trouble::default());
    row("the same drive again", if drives.same { "the same bits" } else { "not the same" });
    assert!(drives.same, "the same drive again gave other bits");
}

fn levelled(count: u64) {
    let pair = levellings(&firmware().unwrap(), count);
    let (_, more_s) = compared("levelled, mean", pair);
    assert!((0.0..=SCAN_S + SCAN_ON_LINE_S + PERIOD_S).contains(&more_s), "{pair:?}");
}

fn killed(count: u64) {
    let took_ms = kills(&firmware().unwrap(), count);
    let most_ms = took_ms.iter().copied().fold(0.0, f64::max);
    let least_ms = took_ms.iter().copied().fold(f64::INFINITY, f64::min);
    row("agent killed: neutral after", &format!("{least_ms:.2} to {most_ms:.2} ms"));
    assert!(took_ms.len() as u64 == count && least_ms >= 100.0 && most_ms <= 125.0, "{took_ms:?}");
}

#[test]
fn two_goals_take_as_long_as_with_the_simulated_board_and_twice_the_same_bits() {
    firmware().map_or_else(skip, |_| goals(SHORT.0));
}

#[test]
fn a_slope_is_levelled_later_than_with_the_simulated_board_by_a_scan_and_a_period_at_most() {
    firmware().map_or_else(skip, |_| levelled(SHORT.1));
}

#[test]
fn an_agent_that_is_killed_leaves_a_neutral_motor_within_125_ms() {
    firmware().map_or_else(skip, |_| killed(SHORT.2));
}

/// A robot whose inertial unit is at the emulated board.
fn with_bno085() -> Option<Rig> {
    let vehicle = VehicleConfig { imu: Imu::Bno085Rvc, ..VehicleConfig::default() };
    let firmware = firmware().or_else(|| {
        skip();
        None
    })?;
    Some(Rig::ready_with(Some(&firmware), "", 5, &vehicle))
}

#[test]
fn a_robot_reaches_its_goal_by_the_yaw_of_the_bno085_at_the_board() {
    let Some(mut rig) = with_bno085() else { return };
    let readings = rig.readings();
    let identity = readings.identity.unwrap();
    assert_eq!((identity.model_name(), identity.after_hang), ("Pico", false));
    assert_eq!(Some(identity.firmware), readings.status.map(|status| status.firmware));
    rig.goto(0.7, 0.7);
    while rig.goal() == GoalStatus::Running || rig.goal() == GoalStatus::Accepted {
        rig.run_s(0.5);
        assert!(rig.now_s() < 60.0);
    }
    let truth = rig.truth();
    assert_eq!(rig.goal(), GoalStatus::Reached);
    assert!((truth.x_m - 0.7).hypot(truth.y_m - 0.7) < 0.35, "{truth:?}");
    let (readings, state) = (rig.readings(), rig.state());
    assert!(readings.gyro_frames > 90 * rig.now_s() as u64, "{} samples", readings.gyro_frames);
    assert_eq!((readings.gyro_lost, state.faults.len()), (0, 0));
    assert_eq!(rig.frames().1, rig::Trouble::default());
}

#[test]
fn the_switch_at_the_board_stops_the_robot_until_it_is_released_and_reset() {
    let Some(mut rig) = with_bno085() else { return };
    assert_eq!(rig.readings().status.unwrap().emergency_stop, Some(false));
    rig.goto(3.0, 0.0);
    rig.run_s(3.0);
    rig.press(true);
    rig.run_s(0.1);
    assert!(rig.truth().neutral_since_s.is_some());
    rig.run_s(1.0);
    let state = rig.state();
    assert_eq!((state.latches[0].by.as_str(), state.latches[0].present), (STOP_SWITCH, true));
    assert_eq!(state.faults, [], "the board stays set up");
    assert!(!rig.reset());
    rig.press(false);
    rig.run_s(0.5);
    assert!(rig.reset());
    rig.goto(3.0, 0.0);
    rig.run_s(2.0);
    assert!(rig.truth().speed_mps > 0.05);
}

#[test]
fn what_is_no_firmware_is_refused_with_the_emulators_word() {
    firmware().map_or_else(skip, |_| {
        let refused = Emulator::start(Path::new("nowhere.elf"), &rig::folder(), true);
        assert!(matches!(refused, Err(EmulatorError::NoFirmware(_))), "{refused:?}");
        let text = Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml");
        let refused = Emulator::start(&text, &rig::folder(), true).unwrap_err();
        assert!(matches!(&refused, EmulatorError::Ended(why) if why.starts_with("Error: ")), "{refused:?}");
    });
}

#[test]
#[ignore = "minutes; prints the table of robot-agent/firmware/README.md"]
fn long_form() {
    goals(LONG.0);
    levelled(LONG.1);
    killed(LONG.2);
}
