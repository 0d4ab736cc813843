//! Settings of running robots from the command line: a speed limit for all, refusals, history, the robot's own file.

use crate::commands::{Sim, fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, Signal, program};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

const LIMIT: &str = "navigation.drive.limit_mps";

fn limit(sim: &Sim, robot: &str) -> Value {
    let (code, got, output) = sim.run(&["param", "get", "limit_mps", robot]);
    assert_eq!((code, &got["robots"][robot]["params"][0]["name"]), (0, &json!(LIMIT)), "{output:?}");
    got["robots"][robot]["params"][0]["value"].clone()
}

#[test]
fn a_speed_limit_reaches_all_robots_whoever_drives_them_and_only_who_controls_one_ends_it() {
    let sim = sim(&["--robots", "2", "--speed", "8"]);
    let mut command = fleet_cli(&["--connect", &sim.endpoint, "--client", "alice"]);
    command.args(["goto", "xtb-1", "0", "900", "--via", "direct", "--wait"]);
    let _alice = Process(command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    let give_up = Instant::now() + PATIENCE;
    while sim.run(&["status", "xtb-1"]).1["robots"][0]["state"]["lease"]["holder"] != "alice" {
        assert!(Instant::now() < give_up, "alice never had control");
    }
    let set = |value: &str, who: &[&str]| {
        let arguments = [&["--client", "bob", "param", "set", "limit_mps", value], who].concat();
        sim.run(&arguments)
    };
    let (code, done, output) = set("0.15", &["--all"]);
    assert_eq!((code, done["robots"].as_object().unwrap().len()), (0, 2), "{output:?}");
    assert_eq!((limit(&sim, "xtb-1"), limit(&sim, "xtb-2")), (json!(0.15), json!(0.15)));
    let (code, refused, output) = set("0.3", &["xtb-1"]);
    assert_eq!((code, &refused["error"]["code"]), (1, &json!("lease_held")), "{output:?}");
    let (code, partly, output) = set("0.3", &["--all"]);
    assert_eq!(code, 1, "{output:?}");
    assert_eq!(partly["robots"]["xtb-1"]["error"]["code"], "lease_held", "{output:?}");
    assert_eq!(partly["robots"]["xtb-2"]["error"], Value::Null, "{output:?}");
    assert_eq!((limit(&sim, "xtb-1"), limit(&sim, "xtb-2")), (json!(0.15), json!(0.3)));
    for (value, code) in [("7", "out_of_range"), ("nan", "usage")] {
        let (_, refused, output) = set(value, &["xtb-2"]);
        assert_eq!(refused["error"]["code"], code, "{output:?}");
    }
    let (_, list, output) = sim.run(&["param", "list", "xtb-2", "--history"]);
    let changes = list["robots"]["xtb-2"]["changes"].as_array().unwrap();
    let told: Vec<_> = changes.iter().map(|it| (&it["by"], &it["from"], &it["to"])).collect();
    let (bob, one, low, high) = (json!("bob"), json!(1.0), json!(0.15), json!(0.3));
    assert_eq!(told, [(&bob, &one, &low), (&bob, &low, &high)], "{output:?}");
    let (code, refused, output) = sim.run(&["param", "save", "xtb-2"]);
    assert_eq!((code, &refused["error"]["code"]), (1, &json!("no_file")), "{output:?}");
    let (code, missing, output) = sim.run(&["param", "get", "nothing", "xtb-2"]);
    assert!(code == 2 && missing["error"]["hint"].as_str().unwrap().contains(LIMIT), "{output:?}");
}

fn agent(sim: &Sim, folder: &Path) -> Process {
    let child = Command::new(program("robot-agent"))
        .env_clear()
        .args(["--hardware", "serial", "--name", "xtb-1", "--connect", &sim.endpoint])
        .arg("--board")
        .arg(folder.join("xtb-1.board"))
        .arg("--gyro")
        .arg(folder.join("xtb-1.gyro"))
        .arg("--config")
        .arg(folder.join("robot.toml"))
        .arg("--record")
        .arg(folder.join("recordings"))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    Process(child)
}

#[test]
fn what_was_changed_is_saved_into_the_robots_own_file_and_its_recording_replays() {
    let folder = tempfile::tempdir().unwrap();
    let lines = folder.path().to_str().unwrap();
    let sim = sim(&["--robots", "1", "--pty", lines]);
    let file = folder.path().join("robot.toml");
    let before = "# The red one.\n[navigation.drive]\ncruise_mps = 0.3 # tried\n\n[agent]\nfleet = \"lab\"\n";
    std::fs::write(&file, before).unwrap();
    let robot = agent(&sim, folder.path());
    let give_up = Instant::now() + PATIENCE;
    while sim.run(&["param", "set", "limit_mps", "0.25", "xtb-1"]).0 != 0 {
        assert!(Instant::now() < give_up, "the robot never answered");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), before, "nothing is written before it is saved");
    let (code, saved, output) = sim.run(&["param", "save", "xtb-1"]);
    assert_eq!(code, 0, "{output:?}");
    let params = saved["robots"]["xtb-1"]["params"].as_array().unwrap();
    assert!(params.iter().all(|param| param["value"] == param["saved"]), "{output:?}");
    let expected = before.replace("# tried\n", "# tried\nlimit_mps = 0.25\n");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), expected);
    robot.signal(Signal::Interrupt);
    let mut robot = robot;
    assert!(robot.0.wait().unwrap().success());
    let recordings = std::fs::read_dir(folder.path().join("recordings")).unwrap();
    let recording = recordings.last().unwrap().unwrap().path();
    let replayed = Command::new(program("robot-agent")).arg("replay").arg(&recording).output().unwrap();
    assert!(replayed.status.success(), "{replayed:?}");
    let bytes = std::fs::read(&recording).unwrap();
    let changes = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    let changes = changes.filter(|message| message.channel.topic.ends_with("/params"));
    let changes: Vec<Value> = changes.map(|message| serde_json::from_slice(&message.data).unwrap()).collect();
    assert_eq!(changes.len(), 1, "{changes:?}");
    assert_eq!((&changes[0]["name"], &changes[0]["to"]), (&json!(LIMIT), &json!(0.25)));
    let audit = fleet_cli(&["audit"]).arg(&recording).output().unwrap();
    let told = String::from_utf8_lossy(&audit.stdout).into_owned();
    assert!(told.contains(&format!("set {LIMIT} from 1 to 0.25")), "{audit:?}");
    // The robot starts with it.
    let _again = agent(&sim, folder.path());
    while sim.run(&["param", "get", "limit_mps", "xtb-1"]).1["robots"]["xtb-1"]["params"][0]["value"] != 0.25
    {
        assert!(Instant::now() < give_up, "the robot does not start with what was saved");
    }
}
