//! Judged by foreign code: zenoh-ros2-sdk as the node, rosbags for types and bytes, the ground truth for the truck.
//! Without a Python that has both these tests say so and are skipped; `.ci/run` installs them.

use super::nodes::DOMAIN;
use super::robot;
use fleet_tests::Fleet;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

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

/// What a judge says of xtb-1; it must be content.
async fn judge(fleet: &Fleet, python: &Path, script: &str, scenario: &[&str]) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/ros2");
    let mut command = Command::new(python);
    command
        .arg(folder.join(script))
        .args([fleet.simulator.endpoint(), "xtb-1"])
        .args(scenario)
        .env("ROS_DOMAIN_ID", DOMAIN.to_string())
        .stdin(Stdio::null());
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    let (said, errors) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let verdict: Option<Value> = said.lines().rev().find_map(|line| serde_json::from_str(line).ok());
    let content = verdict.is_some_and(|verdict| verdict["ok"] == true);
    assert!(output.status.success() && content, "{script} {scenario:?}: {said}\n{errors}");
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
