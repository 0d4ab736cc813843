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

use measure::{Pair, drives, gaps, kills, levellings};
use rig::Rig;
use std::path::{Path, PathBuf};
use xtb_board_emulator::{Emulator, EmulatorError};
use xtb_control::VehicleConfig;
use xtb_control::vehicle::Imu;
use xtb_protocol::messages::{GoalStatus, STOP_SWITCH};

/// How often each thing is done.
struct Form {
    goals: usize,
    levellings: u64,
    walls: u64,
    kills: u64,
}

/// For CI.
const SHORT: Form = Form { goals: 2, levellings: 8, walls: 2, kills: 2 };
const LONG: Form = Form { goals: 20, levellings: 40, walls: 40, kills: 20 };

/// The firmware reads the ranges in the first quarter of a scan, the simulated board at its end; a frame of it is on the
/// line for 4 ms, one with the pulses for 2.4 ms, and the pulses end 1.5 ms after their period's beginning.
const RANGES_LATER_S: f64 = 0.038 + 0.004 + 0.0024 + 0.0015;

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

/// Shows both times; how much longer it took with the firmware, as a part.
fn compared(what: &str, Pair { emulated, simulated }: Pair) -> f64 {
    let part = emulated / simulated - 1.0;
    row(what, &format!("{emulated:.3} s, simulated board {simulated:.3} s: {:+.2} %", part * 100.0));
    part
}

fn goals(count: usize) {
    let firmware = firmware().unwrap();
    let drives = drives(&firmware, count);
    for (i, pair) in drives.times.iter().enumerate() {
        let what = format!("goal {}", i + 1);
        let part = compared(&what, *pair);
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
    let part = compared("levelled, mean", pair);
    assert!(part.abs() <= 0.02, "{pair:?}");
}

/// A truck stands where its settings say, `obstacle.reaction_s` after it has come too near at an admitted speed.
fn stops_before_a_wall(count: u64) {
    let vehicle = VehicleConfig::default();
    let gaps = gaps(&firmware().unwrap(), count);
    let least = |board: fn(&Pair) -> f64| gaps.iter().map(board).fold(f64::INFINITY, f64::min);
    let mean = |board: fn(&Pair) -> f64| gaps.iter().map(board).sum::<f64>() / gaps.len() as f64;
    let (emulated, simulated) = (mean(|gap| gap.emulated), mean(|gap| gap.simulated));
    let said = format!(
        "{emulated:.1} cm, least {:.1}; simulated board {simulated:.1} cm, least {:.1}",
        least(|gap| gap.emulated),
        least(|gap| gap.simulated)
    );
    row("gap left before a wall, mean", &said);
    assert!(least(|gap| gap.emulated) >= vehicle.infrared.near_cm, "{said}");
    let later_cm = vehicle.admitted_mps() * RANGES_LATER_S * 100.0;
    assert!((simulated - emulated).abs() <= later_cm, "{said}");
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
    firmware().map_or_else(skip, |_| goals(SHORT.goals));
}

#[test]
fn a_slope_is_levelled_as_fast_as_with_the_simulated_board() {
    firmware().map_or_else(skip, |_| levelled(SHORT.levellings));
}

#[test]
fn a_truck_at_the_admitted_speed_stops_before_a_wall_as_its_settings_say() {
    firmware().map_or_else(skip, |_| stops_before_a_wall(SHORT.walls));
}

#[test]
fn an_agent_that_is_killed_leaves_a_neutral_motor_within_125_ms() {
    firmware().map_or_else(skip, |_| killed(SHORT.kills));
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
    assert!(rig.truth().speed_mps.abs() > 0.05, "{:?}", rig.truth());
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
#[ignore = "minutes; a row of the table of robot-agent/firmware/README.md"]
fn long_form_of_the_goals() {
    goals(LONG.goals);
}

#[test]
#[ignore = "minutes; a row of the table of robot-agent/firmware/README.md"]
fn long_form_of_the_levellings() {
    levelled(LONG.levellings);
}

#[test]
#[ignore = "minutes; a row of the table of robot-agent/firmware/README.md"]
fn long_form_of_the_walls() {
    stops_before_a_wall(LONG.walls);
}

#[test]
#[ignore = "minutes; a row of the table of robot-agent/firmware/README.md"]
fn long_form_of_the_kills() {
    killed(LONG.kills);
}
