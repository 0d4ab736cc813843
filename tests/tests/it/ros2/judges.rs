//! Judged by foreign code: zenoh-ros2-sdk as the node, rosbags for types and bytes, the ground truth for the truck.
//! Without a Python that has both these tests say so and are skipped; `.ci/run` installs them.

use super::nodes::DOMAIN;
use super::{drives, neutral_since_s, robot};
use crate::identities::robot::Robot;
use fleet_tests::identities::Pki;
use fleet_tests::processes::{Process, program};
use fleet_tests::{Fleet, Setup, eventually, name};
use robot_agent::config::Ros2;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use xtb_bus::LINK_LEASE;
use xtb_identity::Role;
use xtb_services::router;

fn python() -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    let found = candidates.map(PathBuf::from).find(|python| {
        let import = "import zenoh_ros2_sdk, rosbags, xxhash";
        let status = Command::new(python).args(["-c", import]).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    });
    if found.is_none() {
        let text = "SKIP: no Python with zenoh-ros2-sdk and rosbags: ROS 2 is not judged by them";
        std::io::Write::write_all(&mut std::io::stderr(), format!("{text}\n").as_bytes()).unwrap();
    }
    found
}

fn script(python: &Path, endpoint: &str, script: &str, arguments: &[&str]) -> Command {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/ros2");
    let mut command = Command::new(python);
    command.arg(folder.join(script)).args([endpoint, "xtb-1"]).args(arguments);
    command.env("ROS_DOMAIN_ID", DOMAIN.to_string()).stdin(Stdio::null());
    command
}

/// Its last line, and everything it has said.
async fn verdict(mut command: Command) -> (Value, String) {
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    let (said, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let verdict = said.lines().rev().find_map(|line| serde_json::from_str(line).ok());
    (verdict.unwrap_or_default(), format!("{said}\n{errors}"))
}

/// What a judge says of xtb-1; it must be content.
async fn judge(fleet: &Fleet, python: &Path, name: &str, scenario: &[&str]) {
    let (verdict, said) = verdict(script(python, fleet.simulator.endpoint(), name, scenario)).await;
    assert!(verdict["ok"] == true, "{name} {scenario:?}: {said}");
}

/// A judge that goes on, once it has said this line.
async fn judge_that_says(mut command: Command, line: &str) -> Process {
    let mut process = Process(command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap());
    let mut said = BufReader::new(process.0.stdout.take().unwrap());
    let line = line.to_owned();
    let heard = tokio::task::spawn_blocking(move || {
        let (mut all, mut next) = (String::new(), String::new());
        while said.read_line(&mut next).unwrap() > 0 {
            if next.trim() == line {
                return said;
            }
            all.push_str(&std::mem::take(&mut next));
        }
        panic!("it has not said {line:?}: {all}")
    });
    process.0.stdout = Some(heard.await.unwrap().into_inner());
    process
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_node_finds_exactly_what_is_offered_and_decodes_it() {
    let Some(python) = python() else { return };
    let fleet = robot().await;
    judge(&fleet, &python, "judge_graph.py", &[]).await;
    judge(&fleet, &python, "judge_decode.py", &[]).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_node_drives_and_is_fenced_stopped_and_not_moved_by_a_burst() {
    let Some(python) = python() else { return };
    let fleet = robot().await;
    for scenario in ["drive", "burst", "second", "estop"] {
        judge(&fleet, &python, "judge_drive.py", &[scenario]).await;
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_client_of_navigate_to_pose_reaches_cancels_preempts_and_is_refused() {
    let Some(python) = python() else { return };
    let fleet = robot().await;
    fleet.until(1, "a map", |state| state.nav.map.is_some()).await;
    for scenario in ["reach", "cancel", "preempt", "refuse"] {
        judge(&fleet, &python, "judge_navigate.py", &[scenario]).await;
    }
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn foreign_random_bytes_move_nothing() {
    let Some(python) = python() else { return };
    let fleet = robot().await;
    judge(&fleet, &python, "judge_fuzz.py", &[]).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_agent_is_gone_from_a_foreign_graph() {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().unwrap();
    let lines = folder.path().to_owned();
    let fleet = Fleet::start(Setup { speed: 1.0, pty: Some(lines.clone()), ..Setup::default() }).await;
    let config = lines.join("robot.toml");
    std::fs::write(&config, format!("[ros2]\nenabled = true\ndomain_id = {DOMAIN}\n")).unwrap();
    let endpoint = fleet.simulator.endpoint();
    let mut agent = Command::new(program("robot-agent"));
    agent.env_clear().arg("--config").arg(config);
    agent.args(["--hardware", "serial", "--name", "xtb-1", "--connect", endpoint]);
    agent.arg("--board").arg(lines.join("xtb-1.board")).arg("--gyro").arg(lines.join("xtb-1.gyro"));
    let mut agent = Process(agent.stderr(Stdio::null()).spawn().unwrap());
    eventually("the agent", || async { (fleet.alive().await.len() == 1).then_some(()) }).await;

    let watching = script(&python, endpoint, "judge_graph.py", &["--until-gone"]);
    let mut judge = judge_that_says(watching, "ready").await;
    agent.0.kill().unwrap();
    judge.0.stdin.take().unwrap().write_all(b"\n").unwrap();
    let mut said = String::new();
    BufReader::new(judge.0.stdout.take().unwrap()).read_line(&mut said).unwrap();
    let verdict: Value = serde_json::from_str(&said).unwrap();
    assert!(verdict["ok"] == true && verdict["gone_s"].as_f64().unwrap() <= 3.0, "{said}");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_publisher_that_is_killed_drives_no_longer_than_a_setpoint_lives() {
    let Some(python) = python() else { return };
    let fleet = robot().await;
    let driving = script(&python, fleet.simulator.endpoint(), "judge_drive.py", &["kill"]);
    let mut judge = judge_that_says(driving, "driving").await;
    eventually("driving", || async { drives(&fleet).then_some(()) }).await;
    judge.0.kill().unwrap();
    let killed_s = fleet.time_s();
    let took_s = neutral_since_s(&fleet).await - killed_s;
    assert!(took_s <= 0.25, "neutral {took_s} s after kill -9");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_foreign_nodes_talk_through_our_router() {
    let Some(python) = python() else { return };
    let (_router, endpoint) = router::open("tcp/127.0.0.1:0", &[]).await.unwrap();
    let listener = verdict(script(&python, &endpoint, "judge_peers.py", &["listener"]));
    let talker = verdict(script(&python, &endpoint, "judge_peers.py", &["talker"]));
    for (verdict, said) in <[_; 2]>::from(tokio::join!(listener, talker)) {
        assert!(verdict["ok"] == true, "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_foreign_node_drives_by_its_certificate() {
    let Some(python) = python() else { return };
    let people = [("xtb-1", Role::Robot), ("alice", Role::Operator), ("vera", Role::Viewer)];
    let pki = Pki::new(&people);
    let (listen, folder) = ("tls/127.0.0.1:0", pki.folder());
    let router = router::open_leased_with_registry(listen, &[], folder, LINK_LEASE, Some(DOMAIN));
    let router = router.await.unwrap();
    let endpoint = router.endpoint();
    let bus = pki.opening("alice", endpoint).once().await.unwrap();
    let ros2 = Ros2::of(&name("xtb-1"), DOMAIN);
    let robot = Robot::start(&pki, endpoint, &bus, Some(ros2)).await;
    let drive = async |who: &str| {
        let mut command = script(&python, endpoint, "judge_drive.py", &["drive"]);
        command.env("ZENOH_CONFIG_OVERRIDE", session_override(&pki, who, endpoint));
        verdict(command).await
    };
    // She hears the odometry, and her commands do not pass.
    let (verdict, said) = drive("vera").await;
    let moved_m = verdict["moved_m"].as_f64().unwrap_or_else(|| panic!("{said}"));
    assert!(moved_m < 0.01 && robot.driven() == 0, "{said}");
    let (verdict, said) = drive("alice").await;
    assert!(verdict["ok"] == true && robot.driven() > 0, "{said}");
    robot.end().await;
    router.close().await;
}

/// What a ROS computer sets for somebody's identity.
fn session_override(pki: &Pki, who: &str, router: &str) -> String {
    let folder = pki.folder().join(who);
    let file = |name: &str| folder.join(name).display().to_string();
    let tls = [
        ("root_ca_certificate", file("ca.pem")),
        ("connect_certificate", file("certificate.pem")),
        ("connect_private_key", file("key.pem")),
    ];
    let tls = tls.map(|(name, file)| format!("transport/link/tls/{name}={file:?}"));
    let (endpoints, tls) = (format!("connect/endpoints=[{router:?}]"), tls.join(";"));
    format!("mode=\"client\";{endpoints};transport/link/tls/enable_mtls=true;{tls}")
}
