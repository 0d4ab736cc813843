//! The whole program but its command line, on a simulated truck's lines, with the simulated person.

use super::*;
use crate::commands::bring_up::simulated;
use robot_agent::config::SettingLayers;
use xtb_sim::faults::{DriveFault, EncoderFault, RangeFinderFault, SensorFaults};

const SETTINGS: &str = "[hardware]\nkind = \"simulated\"\nseed = 5\n";

fn text(path: &Path) -> String {
    files::text(path, files::MAX_TEXT).unwrap()
}

/// A run of all steps; `breaks` is done to the truck before it.
fn bring_up(settings: &str, breaks: impl FnOnce(&mut xtb_sim::Truck) + Send + 'static) -> (Report, String) {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("robot.toml");
    std::fs::write(&config, settings).unwrap();
    let mut layers = SettingLayers::default();
    layers.file("robot.toml", settings).unwrap();
    let file = layers.finish().unwrap();
    let session = Session::new(file.vehicle.clone(), report(&file.vehicle), steps(&file.vehicle), 10.0);
    let (lines, input, person) = simulated::meet(&file).unwrap();
    person.truck(breaks);
    let console = Console::start(input).unwrap();
    let mut shell = Shell {
        file: &file,
        config: &config,
        files: Files::beside(&config),
        session,
        truck: Truck::new(&file, lines, console.interrupted().clone()),
        person: Box::new(person),
        console,
        is_terminal: false,
        now_s: 0.0,
    };
    shell.pump().unwrap();
    let written = Report::read(&text(&shell.files.json)).unwrap();
    assert_eq!(outcomes(&written), outcomes(shell.session.report()), "what was noted is in the file");
    (written, text(&config))
}

fn failed(report: &Report) -> Vec<String> {
    let failed = outcomes(report).into_iter().filter(|(_, outcome)| outcome == "failed");
    failed.map(|(id, _)| id).collect()
}

#[test]
fn a_good_truck_passes_every_step_and_its_calibration_is_written() {
    let (report, settings) = bring_up(SETTINGS, |_| {});
    assert_eq!(failed(&report), [""; 0], "{}", report.text());
    assert!(report.is_complete(), "{}", report.text());
    let settings: toml::Table = settings.parse().unwrap();
    assert_eq!(settings["vehicle"]["calibration"].as_table().unwrap().len(), 16, "eight lines");
}

#[test]
fn what_is_broken_on_a_truck_fails_in_its_own_steps() {
    let (report, _) = bring_up(SETTINGS, |truck| {
        truck.set_sensor_faults(SensorFaults {
            encoder: EncoderFault::BrokenWire,
            ..SensorFaults::range_finder(8, RangeFinderFault::BrokenWire)
        });
    });
    let expected = ["check", "range-rear-3", "encoder", "motor-ahead", "motor-astern"];
    assert_eq!(failed(&report), expected, "{}", report.text());
    assert!(report.text().contains("range rear 3 0: no signal"), "{}", report.text());

    let (report, _) = bring_up(SETTINGS, |truck| truck.set_drive_fault(DriveFault::Held));
    assert_eq!(failed(&report), ["motor-ahead", "motor-astern"], "{}", report.text());
}

#[test]
fn a_car_without_platform_and_receiver_is_asked_for_nothing_of_them() {
    let small = "platform = \"off\"\ndrivetrain = \"front_axle\"\nremote = { enabled = false }\n";
    let (report, settings) = bring_up(&format!("{SETTINGS}[vehicle]\n{small}"), |_| {});
    assert!(report.is_complete(), "{}", report.text());
    assert!(!report.text().contains("piston") && !report.text().contains("stick"), "{}", report.text());
    assert!(!settings.contains("piston"), "{settings}");
}
