//! Docks over real Zenoh: a simulated robot whose battery gets low goes to one by itself and is charged there.

use crate::commands::sim;
use fleet_tests::PATIENCE;
use serde_json::{Value, json};
use std::time::Instant;

const WORLD: &str = r#"
name = "shed"
[room]
width_m = 6.0
depth_m = 6.0
[[places]]
name = "dock-1"
kind = "dock"
x_m = 0.0
y_m = 1.4
[[starts]]
x_m = 0.0
y_m = 0.0
yaw_rad = 1.5707963267948966
"#;
/// Low within a minute.
const VEHICLE: &str = "[truth.battery]\nfull_v = 7.4\ncapacity_mah = 60.0\n";

#[test]
fn a_simulated_robot_goes_to_a_dock_by_itself_and_the_dispatcher_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (world, vehicle) = (file("shed.toml", WORLD), file("small.toml", VEHICLE));
    let ledger = folder.path().join("a.ledger");
    let arguments = ["--robots", "1", "--speed", "8", "--world", &world, "--vehicle", &vehicle];
    let dispatch = ["--dispatch", "--home", "--ledger", ledger.to_str().unwrap()];
    let sim = sim(&[&arguments[..], &dispatch[..]].concat());
    let give_up = Instant::now() + PATIENCE;
    let mut seen = Vec::new();
    let charging = loop {
        let (code, status, output) = sim.run(&["dispatch", "status"]);
        assert_eq!((code, &status["homes"]["active"]), (0, &json!(true)), "{output:?}");
        let home = status["homes"]["robots"][0].clone();
        if seen.last() != Some(&home["status"]) {
            seen.push(home["status"].clone());
        }
        if home["status"] == "charging" {
            break home;
        }
        assert!(Instant::now() < give_up, "{seen:?} {home}");
    };
    assert_eq!((&charging["robot"], &charging["place"]), (&json!("xtb-1"), &json!("dock-1")));
    let (_, tasks, output) = sim.run(&["tasks"]);
    let task = &tasks.as_array().or(tasks["tasks"].as_array()).unwrap()[0];
    assert_eq!((&task["by"], &task["state"]), (&json!("dispatch"), &json!("done")), "{output:?}");
    assert!(task["reason"].as_str().unwrap().contains("battery low"), "{output:?}");
    let volts = |home: &Value| home["battery_v"].as_f64().unwrap();
    loop {
        let home = sim.run(&["dispatch", "status"]).1["homes"]["robots"][0].clone();
        if home["battery_v"].is_number() && volts(&home) > volts(&charging) + 0.05 {
            break;
        }
        assert!(Instant::now() < give_up, "its voltage does not rise: {charging} {home}");
    }
}

/// A dock for two robots, and a parking place.
const YARD: &str = r#"
name = "yard"
[room]
width_m = 8.0
depth_m = 8.0
[[places]]
name = "dock-1"
kind = "dock"
x_m = 0.0
y_m = 2.4
[[places]]
name = "parking-1"
kind = "parking"
x_m = 2.0
y_m = 2.4
"#;

#[test]
fn robots_are_sent_home_by_hand_as_long_as_there_is_a_place_for_each() {
    let folder = tempfile::tempdir().unwrap();
    let (world, ledger) = (folder.path().join("yard.toml"), folder.path().join("a.ledger"));
    std::fs::write(&world, YARD).unwrap();
    let (world, ledger) = (world.to_str().unwrap(), ledger.to_str().unwrap());
    let arguments = ["--robots", "2", "--speed", "8", "--world", world, "--dispatch", "--home"];
    let sim = sim(&[&arguments[..], &["--ledger", ledger]].concat());
    let (code, refused, output) = sim.run(&["home", "--all"]);
    let message = refused["error"]["message"].as_str().unwrap();
    assert!(code == 1 && message.contains("no dock is free for"), "{output:?}");
    let (code, home, output) = sim.run(&["home", "xtb-1", "--wait"]);
    assert_eq!((code, &home["state"], &home["robot"]), (0, &json!("done"), &json!("xtb-1")), "{output:?}");
    let (code, refused, output) = sim.run(&["home", "xtb-2"]);
    let message = "no dock is free for xtb-2: dock-1 is taken by xtb-1; no robot was sent";
    assert_eq!((code, &refused["error"]["message"]), (1, &json!(message)), "{output:?}");
    let (code, parked, output) = sim.run(&["home", "xtb-2", "--parking", "--wait"]);
    assert_eq!((code, &parked["state"]), (0, &json!("done")), "{output:?}");
    let (code, refused, output) = sim.run(&["home", "xtb-9"]);
    assert_eq!((code, &refused["error"]["code"]), (3, &json!("no_robot")), "{output:?}");
}

#[test]
fn a_fleet_without_docks_sends_nobody_home_and_says_why() {
    let sim = sim(&["--robots", "1", "--speed", "8"]);
    let (code, refused, output) = sim.run(&["home", "xtb-1"]);
    assert_eq!((code, &refused["error"]["code"]), (3, &json!("no_dispatcher")), "{output:?}");
    let folder = tempfile::tempdir().unwrap();
    let ledger = folder.path().join("a.ledger");
    let sim = crate::commands::sim(&["--robots", "1", "--dispatch", "--ledger", ledger.to_str().unwrap()]);
    let (code, refused, output) = sim.run(&["home", "xtb-1"]);
    let hint = refused["error"]["hint"].as_str().unwrap();
    assert!(code == 1 && hint.contains("[home]"), "{output:?}");
}
