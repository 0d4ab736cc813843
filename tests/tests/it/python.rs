//! The Python package (`fleet-cli/python`): its own tests, and a robot whose driver is killed.

use fleet_tests::processes::{Process, Signal, program};
use fleet_tests::{Fleet, Setup, eventually};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// A Python that has the package, if there is one.
fn python() -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    candidates.map(PathBuf::from).find(|python| {
        let import = Command::new(python).args(["-c", "import xtb_fleet"]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    })
}

fn tests() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fleet-cli/python/tests")
}

#[tokio::test(flavor = "multi_thread")]
async fn the_python_package_passes_its_own_tests() {
    let Some(python) = python() else {
        return eprintln_skip("no Python with the package xtb-fleet: its tests were not run");
    };
    let mut command = Command::new(python);
    command
        .args(["-m", "unittest", "discover", "-s"])
        .arg(tests())
        .env("XTB_FLEET_CLI", program("fleet-cli"));
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_whose_interpreter_is_killed_stands_by_the_rules_of_its_lease() {
    let Some(python) = python() else {
        return eprintln_skip("no Python with the package xtb-fleet: none was killed");
    };
    // The robot's time is the program's: it retains its lease every 100 ms.
    let fleet = Fleet::start(Setup { robots: 2, speed: 1.0, ..Setup::default() }).await;
    // A setpoint lives 200 ms, a goal 500 ms without its client; the board's frames come on top.
    for (robot, how, within_s) in [(1, "teleop", 0.35), (2, "goto", 0.7)] {
        let name = format!("xtb-{robot}");
        let mut command = Command::new(&python);
        command.arg(tests().join("drives.py")).args([fleet.simulator.endpoint(), &name, how]);
        let (process, line) = Process::start_ready(&mut command);
        assert_eq!(line, "driving\n");
        eventually("driving", || async { (fleet.truth(robot).speed_mps > 0.05).then_some(()) }).await;
        process.signal(Signal::Kill);
        let killed_s = fleet.time_s();
        // For good, not between two pulses of the speed control.
        let neutral_s = eventually("neutral", || async {
            fleet.truth(robot).neutral_since_s.filter(|since_s| fleet.time_s() > since_s + 1.0)
        })
        .await;
        let took_s = neutral_s - killed_s;
        assert!(took_s <= within_s, "{how}: neutral only {took_s} s after kill -9");
        fleet.until(robot, "the lease free", |state| state.lease.is_none()).await;
    }
    fleet.end().await;
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn eprintln_skip(why: &str) {
    eprintln!("skipped: {why}");
}
