//! Separate processes: serial lines, real kills, and clients in another language.

use fleet_tests::dispatch::{Asker, Serve, goto};
use fleet_tests::processes::{Process, program};
use fleet_tests::{Fleet, Setup, eventually};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use xtb_control::Mode;

fn agent(fleet: &Fleet, lines: &Path) -> Process {
    let child = Command::new(program("robot-agent"))
        .env_clear()
        .args(["--hardware", "serial", "--name", "xtb-1", "--connect", fleet.simulator.endpoint()])
        .arg("--board")
        .arg(lines.join("xtb-1.board"))
        .arg("--gyro")
        .arg(lines.join("xtb-1.gyro"))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    Process(child)
}

async fn serial_fleet(lines: &Path) -> Fleet {
    let fleet = Fleet::start(Setup { speed: 1.0, pty: Some(lines.to_owned()), ..Setup::default() }).await;
    assert!(lines.join("xtb-1.board").exists() && lines.join("xtb-1.gyro").exists());
    fleet
}

#[tokio::test(flavor = "multi_thread")]
async fn an_agent_on_serial_lines_drives_and_its_death_is_neutral_within_200_ms() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = serial_fleet(folder.path()).await;
    let mut process = agent(&fleet, folder.path());
    eventually("the agent", || async { (fleet.alive().await.len() == 1).then_some(()) }).await;
    fleet.reaches(1, 0.1, 0.5).await;

    fleet.goto(1, 0.0, 5.0).await;
    eventually("driving", || async { (fleet.truth(1).speed_mps > 0.08).then_some(()) }).await;
    process.0.kill().unwrap();
    let killed_s = fleet.time_s();
    let neutral_s = eventually("neutral", || async { fleet.truth(1).neutral_since_s }).await;
    assert!(neutral_s - killed_s <= 0.2, "neutral only {} s after kill -9", neutral_s - killed_s);

    let _second = agent(&fleet, folder.path());
    eventually("the agent again", || async {
        let states = fleet.bus.get(&fleet.robot(1).state(), std::time::Duration::from_secs(1)).await.unwrap();
        let state = states.first()?.decode::<xtb_protocol::messages::RobotState>().ok()?;
        (state.mode == Mode::Idle && state.input_age_ms.gyro.is_some()).then_some(())
    })
    .await;
    eventually("standing", || async { (fleet.truth(1).speed_mps == 0.0).then_some(()) }).await;
    let before = fleet.truth(1);
    fleet.simulated(2.0).await;
    let after = fleet.truth(1);
    assert_eq!((before.x_m, before.y_m), (after.x_m, after.y_m), "{before:?} {after:?}");
    fleet.end().await;
}

/// A Python that has the package `eclipse-zenoh`, if there is one.
fn python() -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    candidates.map(PathBuf::from).find(|python| {
        let import = Command::new(python).args(["-c", "import zenoh"]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    })
}

/// An example of the docs, which stands in them as it is; and a Python to run it with, if there is one.
fn example(file: &str) -> (PathBuf, Option<PathBuf>) {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let example = docs.join("examples").join(file);
    let code = std::fs::read_to_string(&example).unwrap();
    let page = std::fs::read_to_string(docs.join("protocol.md")).unwrap();
    assert!(page.contains(code.trim()), "docs/protocol.md does not hold docs/examples/{file} as it is");
    (example, python())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_python_example_of_the_docs_drives_a_robot() {
    let (example, Some(python)) = example("goto.py") else {
        return eprintln_skip("no Python with the package eclipse-zenoh: the example was not run");
    };
    // The robot's time is the program's: it retains its lease every 100 ms.
    let fleet = Fleet::start(Setup { robots: 3, speed: 1.0, ..Setup::default() }).await;
    let mut command = Command::new(python);
    command.arg(&example).args([fleet.simulator.endpoint(), "lab", "xtb-1", "0.1", "0.8"]);
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    assert!(output.status.success(), "{output:?}");
    let truth = fleet.truth(1);
    assert!((truth.x_m - 0.1).hypot(truth.y_m - 0.8) < 0.4, "{truth:?}");
    fleet.until(1, "the lease given back", |state| state.lease.is_none()).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_python_example_of_the_docs_watches_tasks() {
    let (example, Some(python)) = example("tasks.py") else {
        return eprintln_skip("no Python with the package eclipse-zenoh: the example was not run");
    };
    let fleet = Fleet::start(Setup { robots: 2, speed: 4.0, ..Setup::default() }).await;
    let folder = tempfile::tempdir().unwrap();
    let _serve = Serve::start(fleet.simulator.endpoint(), &folder.path().join("lab.ledger"));
    let mut command = Command::new(python);
    command.arg(&example).args([fleet.simulator.endpoint(), "lab"]);
    let watching = tokio::task::spawn_blocking(move || command.output());
    Asker::new(&fleet.bus, "test").submit(vec![goto(0.0, 1.5), goto(2.0, 1.5)]).await;
    let output = watching.await.unwrap().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("t1 done xtb-") && text.contains("t2 done"),
        "{output:?}"
    );
    fleet.end().await;
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn eprintln_skip(why: &str) {
    eprintln!("skipped: {why}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_program_on_the_client_library_alone_drives_a_robot_to_its_goal() {
    let fleet = Fleet::start(Setup::default()).await;
    let mut command = Command::new(program("examples/drive"));
    command.env_clear().env("XTB_CONNECT", fleet.simulator.endpoint()).args(["0.1", "0.5"]);
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    assert_eq!(String::from_utf8_lossy(&output.stdout), "xtb-1: Reached\n", "{output:?}");
    fleet.end().await;
}
