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
