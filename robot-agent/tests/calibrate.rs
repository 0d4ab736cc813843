//! `robot-agent calibrate` from outside: it finds a simulated truck's own lines, and writes nothing
//! that it should not.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;
use toml::Table;
use xtb_control::calibration::{Actuator, ActuatorKind};
use xtb_control::vehicle::Line;
use xtb_sim::{Simulation, TruckParameters, World};

fn agent() -> Command {
    let mut command = Command::cargo_bin("robot-agent").expect("cargo builds it for this test");
    command.env_clear();
    command
}

/// The simulated truck of this seed, as `--hardware simulated` makes it.
fn truth(seed: u64, what: Actuator) -> Line {
    let parameters = TruckParameters::default();
    let simulation =
        Simulation::new(World::default(), &parameters, &["truck"], seed).expect("a room with a truck");
    let truth = simulation.trucks()[0].calibration_truth();
    match what.kind() {
        ActuatorKind::Steering(i) => truth.steering[i],
        ActuatorKind::Bumper(i) => truth.bumpers[i],
        ActuatorKind::Piston(i) => truth.pistons[i],
    }
}

fn json(command: &mut Command, code: i32) -> Value {
    let output = command.arg("--json").assert().code(code).get_output().clone();
    serde_json::from_slice(&output.stdout).expect("JSON on standard output")
}

fn number(of: &Value, key: &str) -> f64 {
    of[key].as_f64().unwrap_or_else(|| panic!("{key} in {of}"))
}

fn table(text: &str) -> Table {
    text.parse().expect("TOML")
}

/// The fit of a whole calibration of the truck with this seed, written to `file`.
fn calibrated(seed: u64, what: Actuator, file: &Path) -> Value {
    let mut command = agent();
    command.args(["calibrate", what.name(), "--hardware", "simulated", "--yes", "--write"]).arg(file);
    let report = json(command.args(["--set", &format!("hardware.seed={seed}")]), 0);
    assert_eq!(report["written"].as_str(), file.to_str(), "{report}");
    report["fit"].clone()
}

#[test]
fn every_line_of_a_simulated_truck_is_found_within_its_noise() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for seed in 1..=3 {
        let file = folder.path().join(format!("truck-{seed}.toml"));
        for what in Actuator::ALL {
            let (truth, fit) = (truth(seed, what), calibrated(seed, what, &file));
            // A piston's curve bends away from its line by 0.2 % of the slope over ± 200 counts, and
            // weight moves the middle of its dead band by less than half a count.
            let (bend, shift) =
                if matches!(what.kind(), ActuatorKind::Piston(_)) { (0.003, 0.5) } else { (0.0, 0.0) };
            for (key, true_value, error, known) in [
                ("slope", truth.slope, "slope_error", bend * truth.slope.abs()),
                ("intercept", truth.intercept, "intercept_error", bend * truth.intercept.abs()),
                ("zero_count", truth.count(0.0), "zero_error", shift),
            ] {
                let off = number(&fit, key) - true_value;
                let allowed = 4.0 * number(&fit, error) + known;
                assert!(
                    off.abs() <= allowed,
                    "seed {seed}, {what}: {key} is off by {off}, {allowed} allowed"
                );
            }
            // The errors are honest only if they are small: a guess would not pass.
            assert!(number(&fit, "slope_error") < 0.007 * truth.slope.abs(), "seed {seed}, {what}: {fit}");
            assert!(number(&fit, "zero_error") < 4.0 && number(&fit, "r") > 0.995, "{what}: {fit}");
        }
        let printed = agent().arg("--config").arg(&file).arg("--print-config").assert().success();
        let in_force = table(&String::from_utf8_lossy(&printed.get_output().stdout));
        let written = table(&std::fs::read_to_string(&file).expect("the configuration"));
        for (section, settings) in [("calibration", 8 * 2), ("steering", 2)] {
            let section = |of: &Table| of["vehicle"][section].as_table().expect("a section").clone();
            assert_eq!(section(&written).len(), settings, "{written}");
            for (key, value) in section(&written) {
                assert_eq!(section(&in_force)[&key], value, "{key}");
            }
        }
    }
}

#[test]
fn play_and_dead_band_are_reported() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("robot.toml");
    let steering = calibrated(1, Actuator::SteeringRear, &file);
    assert!((number(&steering, "hysteresis") - 1.0).abs() < 0.4, "twice 0.5 deg: {steering}");
    let piston = calibrated(1, Actuator::PistonFl, &file);
    assert!((number(&piston, "dead_band") - 24.0).abs() < 8.0, "twice 12 counts: {piston}");
    for plot in ["calibration-steering-rear.svg", "calibration-piston-fl.svg"] {
        let plot = std::fs::read_to_string(folder.path().join(plot)).expect("a plot beside the file");
        assert!(plot.starts_with("<svg") && plot.contains("R = 0.99"));
    }
}

#[test]
fn the_rear_steering_of_a_front_steered_car_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (config, readings) = (folder.path().join("robot.toml"), folder.path().join("rear.txt"));
    let text = "[vehicle]\ndrivetrain = \"front_axle\"\n";
    std::fs::write(&config, text).expect("a file");
    std::fs::write(&readings, "3000 1.0\n").expect("a file");
    for how in [["--hardware", "simulated"], ["--readings", "rear.txt"]] {
        let mut command = agent();
        command.current_dir(folder.path()).args([
            "calibrate",
            "steering-rear",
            "--yes",
            "--config",
            "robot.toml",
        ]);
        let output = command.args(how).assert().code(2).get_output().clone();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(error.contains("front axle steers alone"), "{error}");
    }
    assert_eq!(std::fs::read_to_string(&config).expect("the file"), text);
    assert!(!folder.path().join("calibration-steering-rear.svg").exists());
}

#[test]
fn the_settings_own_file_is_changed_in_place() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("robot.toml");
    let old = "# Red truck.\n[agent]\nname = \"red\" # mine\n\n[vehicle.steering]\nfront_centre = 3705.0 # by eye\n";
    std::fs::write(&file, old).expect("writing it");
    let mut command = agent();
    command.args(["calibrate", "steering-front", "--hardware", "simulated", "--yes", "--config"]).arg(&file);
    let report = json(&mut command, 0);
    let new = std::fs::read_to_string(&file).expect("the configuration");
    let centre = (number(&report["fit"], "zero_count") * 10.0).round() / 10.0;
    assert!(new.starts_with(&old.replace("3705.0", &format!("{centre:?}"))), "{new}");
    assert!(new.contains("steering_front_slope = -0.02"), "{new}");
}

#[test]
fn without_a_terminal_nothing_moves_unless_told() {
    let output = agent().args(["calibrate", "piston-fl"]).assert().code(2).get_output().clone();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("confirm") && said.contains("--yes"), "{said}");
    let by_hand = ["calibrate", "steering-front", "--yes", "--hardware", "serial"];
    let output = agent().args(by_hand).assert().code(2).get_output().clone();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("--readings"), "{said}");
}

#[test]
fn bad_readings_are_refused_with_the_reason_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, readings) = (folder.path().join("robot.toml"), folder.path().join("readings.txt"));
    // A steering whose rod slips: the angle hardly follows the pulse.
    let lines: String = (0..13).map(|i| format!("{} {}\n", 2900 + 100 * i, (i * 7) % 5 - i / 3)).collect();
    std::fs::write(&readings, lines).expect("writing them");
    let mut command = agent();
    command.args(["calibrate", "steering-front", "--yes", "--write"]).arg(&file);
    let report = json(command.arg("--readings").arg(&readings), 1);
    let refused = report["refused"].as_str().expect("a reason");
    assert!(refused.starts_with("R = 0.") && refused.contains("below 0.98"), "{refused}");
    assert!(report["written"].is_null() && !file.exists());
    let plot = std::fs::read_to_string(report["plot"].as_str().expect("a plot")).expect("reading it");
    assert!(plot.contains("rejected: R = 0."), "{plot}");
}

#[test]
fn good_readings_of_a_person_need_no_truck() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, readings) = (folder.path().join("robot.toml"), folder.path().join("readings.txt"));
    let line = |count: i32| format!("{count} {}\n", (f64::from(3700 - count) * 0.2).round() / 10.0);
    let lines: String = (0..13).map(|i| line(2900 + 130 * i)).collect();
    std::fs::write(&readings, lines).expect("writing them");
    let calibrate = || {
        let mut command = agent();
        command.args(["calibrate", "steering-front", "--hardware", "serial", "--yes", "--readings"]);
        command.arg(&readings);
        command
    };
    let report = json(calibrate().arg("--dry-run").arg("--plot").arg(folder.path().join("plot.svg")), 0);
    assert!(report["written"].is_null() && folder.path().join("plot.svg").exists());
    let report = json(calibrate().arg("--write").arg(&file), 0);
    assert!((number(&report["fit"], "zero_count") - 3700.0).abs() < 2.0, "{report}");
    assert!(std::fs::read_to_string(&file).expect("the configuration").contains("front_centre = 37"));
}

#[test]
fn a_line_that_the_configuration_would_not_take_is_not_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, readings) = (folder.path().join("robot.toml"), folder.path().join("readings.txt"));
    let lines: String = (0..9).map(|i| format!("{} {}\n", 3700 + i, 2 * i - 8)).collect();
    std::fs::write(&readings, lines).expect("writing them");
    let mut command = agent();
    command
        .args(["calibrate", "bumper-front", "--yes", "--write"])
        .arg(&file)
        .arg("--readings")
        .arg(&readings);
    let output = command.assert().code(1).get_output().clone();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("calibration.bumper_front_slope = 2.0 is not allowed"), "{said}");
    assert!(!file.exists());
}

#[test]
fn impossible_sweeps_and_actuators_are_wrong_usage() {
    for arguments in [
        &["motor"][..],
        &["piston-fl", "--from", "4000", "--to", "3600"],
        &["piston-fl", "--points", "3"],
        &["piston-fl", "--from", "100"],
        &["piston-fl", "--dry-run", "--write", "x.toml"],
    ] {
        agent().arg("calibrate").args(arguments).arg("--yes").assert().code(2);
    }
}

#[test]
fn a_board_that_is_not_there_is_named() {
    let mut command = agent();
    command.args(["calibrate", "piston-fl", "--yes", "--dry-run", "--hardware", "serial"]);
    command.args(["--board", "/nonexistent/board", "--gyro", "/nonexistent/gyro"]);
    let output = command.assert().code(1).get_output().clone();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("/nonexistent/board: no such device"), "{said}");
    assert!(said.contains("ALL WHEELS OFF THE GROUND") && said.contains("nothing was written"), "{said}");
}
