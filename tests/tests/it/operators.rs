//! Operators at their terminals: who has control, what is latched, and what they are told about it.

use crate::commands::{Sim, fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::processes::Process;
use serde_json::{Value, json};
use std::process::Stdio;
use std::time::Instant;

/// A long drive whose client stays with it; returns once it has control.
fn driver(sim: &Sim, client: &str) -> Process {
    let mut command = fleet_cli(&["--connect", &sim.endpoint, "--client", client]);
    command
        .args(["goto", "xtb-1", "0", "900", "--via", "direct", "--wait"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null());
    let process = Process(command.spawn().unwrap());
    let give_up = Instant::now() + PATIENCE;
    while sim.run(&["status", "xtb-1"]).1["robots"][0]["state"]["lease"]["holder"] != client {
        assert!(Instant::now() < give_up, "{client} never had control");
    }
    process
}

#[test]
fn a_second_operator_is_told_who_drives_and_takes_control_only_when_told_to() {
    let sim = sim(&["--robots", "1"]);
    let mut alice = driver(&sim, "alice");
    let (code, refused, _) = sim.run(&["goto", "xtb-1", "0", "1", "--client", "bob"]);
    assert_eq!((code, &refused["error"]["code"]), (1, &json!("lease_held")), "{refused}");
    assert!(refused["error"]["message"].as_str().unwrap().contains("alice"), "{refused}");
    let bob = ["goto", "xtb-1", "0", "900", "--via", "direct", "--client", "bob", "--take"];
    let (code, taken, _) = sim.run(&bob);
    assert_eq!((code, &taken["taken_from"]), (0, &json!("alice")), "{taken}");
    let mut said = String::new();
    std::io::Read::read_to_string(alice.0.stdout.as_mut().unwrap(), &mut said).unwrap();
    assert_eq!(alice.0.wait().unwrap().code(), Some(1), "{said}");
    let lost: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(lost["error"]["code"], "lease_lost", "{said}");
    assert!(said.contains("bob"), "{said}");
    let (_, why, _) = sim.run(&["why", "xtb-1"]);
    assert_eq!(why["verdict"], "drives", "bob's goal goes on without him: {why}");
}

#[test]
fn who_dies_leaves_a_robot_that_stands_says_why_and_is_free_again() {
    let sim = sim(&["--robots", "1"]);
    drop(driver(&sim, "alice"));
    let give_up = Instant::now() + PATIENCE;
    let goto = ["goto", "xtb-1", "0", "1", "--client", "bob"];
    let why = loop {
        let (_, why, _) = sim.run(&["why", "xtb-1"]);
        if why["reasons"][0]["name"] == "lease_expired" {
            break why;
        }
        assert!(Instant::now() < give_up, "{why}");
    };
    assert_eq!(why["verdict"], "stands", "{why}");
    while sim.run(&goto).0 != 0 {
        assert!(Instant::now() < give_up, "the lease never became free");
    }
}

#[test]
fn an_emergency_stop_is_acknowledged_explained_found_and_reset() {
    let sim = sim(&["--robots", "2"]);
    let (code, doctor, _) = sim.run(&["doctor"]);
    assert_eq!((code, &doctor["problems"]), (0, &json!(0)), "{doctor}");
    let (code, stopped, _) = sim.run(&["estop", "--all", "--client", "carol"]);
    assert_eq!((code, &stopped["complete"]), (0, &json!(true)), "{stopped}");
    let (code, partly, _) = sim.run(&["estop", "--all", "--expect", "xtb-1,xtb-9", "--timeout", "0.5"]);
    assert_eq!((code, &partly["robots"]["xtb-9"]), (3, &json!("unknown")), "{partly}");
    assert_eq!((&partly["robots"]["xtb-2"], &partly["complete"]), (&json!("stopped"), &json!(false)));

    let (code, refused, _) = sim.run(&["goto", "xtb-1", "0", "1"]);
    assert_eq!((code, &refused["error"]["code"]), (1, &json!("latched")), "{refused}");
    let (_, why, _) = sim.run(&["why", "xtb-1"]);
    let first = &why["reasons"][0];
    assert_eq!((&first["kind"], &first["name"]), (&json!("latch"), &json!("estop")), "{why}");
    assert!(first["text"].as_str().unwrap().contains("carol"), "{why}");
    let (code, doctor, _) = sim.run(&["doctor"]);
    assert_eq!((code, &doctor["problems"]), (1, &json!(2)), "{doctor}");

    let (code, other, _) = sim.run(&["reset", "xtb-1", "--latch", "gyro_lost"]);
    assert_eq!((code, &other["cleared"]), (0, &json!([])), "{other}");
    assert_eq!(other["remaining"][0]["latch"], "estop", "{other}");
    let (code, reset, _) = sim.run(&["reset", "xtb-1"]);
    assert_eq!((code, &reset["cleared"], &reset["remaining"]), (0, &json!(["estop"]), &json!([])), "{reset}");
    let (_, why, _) = sim.run(&["why", "xtb-1"]);
    assert_eq!(why["verdict"], "stands", "a reset moves nothing: {why}");
    let (code, goal, _) = sim.run(&["goto", "xtb-1", "0", "1"]);
    assert_eq!((code, &goal["status"]), (0, &json!("accepted")), "{goal}");
}

#[test]
fn a_robot_that_stands_is_told_where_it_is() {
    let sim = sim(&["--robots", "1", "--fixes", "0"]);
    let pose = |value: &Value| ["x_m", "y_m", "yaw_rad"].map(|name| value[name].as_f64().unwrap());
    let (code, first, _) = sim.run(&["set-pose", "xtb-1", "1.5", "-2", "--yaw", "90"]);
    assert_eq!((code, &first["robot"], &first["taken_from"]), (0, &json!("xtb-1"), &Value::Null), "{first}");
    let [x_m, y_m, yaw_rad] = pose(&first["after"]);
    assert!((x_m - 1.5).abs() < 1e-6 && (y_m + 2.0).abs() < 1e-6, "{first}");
    assert!((yaw_rad - std::f64::consts::FRAC_PI_2).abs() < 0.05, "{first}");
    let (code, second, _) = sim.run(&["set-pose", "xtb-1", "0", "3"]);
    assert_eq!(code, 0, "{second}");
    assert_eq!(pose(&second["before"])[..2], [1.5, -2.0], "{second}");
    assert!((pose(&second["after"])[2] - yaw_rad).abs() < 0.05, "the yaw stays: {second}");

    let alice = driver(&sim, "alice");
    let (code, refused, _) = sim.run(&["set-pose", "xtb-1", "0", "0", "--client", "bob"]);
    assert_eq!((code, &refused["error"]["code"]), (1, &json!("lease_held")), "{refused}");
    let (code, taken, _) = sim.run(&["set-pose", "xtb-1", "7", "8", "--client", "bob", "--take"]);
    assert_eq!((code, &taken["taken_from"]), (0, &json!("alice")), "her goal halts without her: {taken}");
    assert!((pose(&taken["pose"])[0] - 7.0).abs() < 1e-6, "{taken}");
    drop(alice);
    let (code, nobody, _) = sim.run(&["set-pose", "xtb-9", "0", "0", "--timeout", "0.5"]);
    assert_eq!(code, 3, "{nobody}");
}
