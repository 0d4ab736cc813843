//! From nothing to a drive over TLS, as a new user would do it, with the programs themselves.

use fleet_tests::eventually;
use fleet_tests::processes::{Process, program};
use serde_json::Value;
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Output};

/// One of the programs, in a home of its own.
fn in_home(home: &Path, name: &str, line: &str) -> Command {
    let mut command = Command::new(program(name));
    command.env_clear().env("HOME", home).current_dir(home).args(line.split_whitespace());
    command
}

fn cli(home: &Path, line: &str) -> Output {
    in_home(home, "fleet-cli", line).output().unwrap()
}

fn done(output: Output) -> String {
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// The names of robots that somebody sees.
async fn robots(home: &Path, line: &str) -> Option<Vec<String>> {
    let mut command = in_home(home, "fleet-cli", line);
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    let listed: Value = serde_json::from_slice(output.stdout.trim_ascii()).ok()?;
    let names = listed.get("robots")?.as_array()?.iter().map(|robot| robot["name"].as_str());
    names.map(|name| name.map(str::to_owned)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn five_commands_then_router_agent_and_a_drive_over_tls() {
    let [office, robot, desk] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    done(cli(office.path(), &format!("pki init --port {port}")));
    done(cli(office.path(), "pki add-robot xtb-1"));
    done(cli(office.path(), "pki add-person alice --role operator"));
    let pki = office.path().join(".config/xtb/pki");
    let mut router = Command::new(program("fleet-cli"));
    router.args(["--json", "router", "--listen", &format!("tls/127.0.0.1:{port}"), "--pki"]).arg(&pki);
    let (_router, ready) = Process::start_ready(&mut router);
    assert!(ready.contains("\"ready\":true"), "{ready}");

    let file = |name: &str| office.path().join(name).display().to_string();
    let mut enrol = in_home(robot.path(), "robot-agent", "enrol");
    done(enrol.args([&file("xtb-1.xtbid"), "--remove"]).output().unwrap());
    done(
        in_home(desk.path(), "fleet-cli", "enrol").args([&file("alice.xtbid"), "--remove"]).output().unwrap(),
    );

    let agent = in_home(robot.path(), "robot-agent", "--hardware simulated").spawn().unwrap();
    let _agent = Process(agent);
    let seen = || async { robots(desk.path(), "list --json").await.filter(|names| names == &["xtb-1"]) };
    eventually("the robot", seen).await;
    let drove = eventually("a drive", || async {
        // The agent may just have started: nothing heard of its gyro yet.
        let output = in_home(desk.path(), "fleet-cli", "goto xtb-1 0.1 0.8 --wait").output().unwrap();
        output.status.success().then_some(output)
    });
    done(drove.await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_simulator_runs_under_identities_of_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let (home, set) = (folder.path(), folder.path().join("set"));
    let mut sim = Command::new(program("fleet-cli"));
    let line = "--json sim --robots 2 --speed 4 --listen tls/127.0.0.1:0 --dispatch --ledger";
    sim.args(line.split_whitespace()).arg(home.join("lab.ledger")).arg("--identities").arg(&set);
    let (_sim, ready) = Process::start_ready(&mut sim);
    assert!(ready.contains("\"ready\":true") && ready.contains("tls/127.0.0.1:"), "{ready}");
    for who in ["operator", "viewer", "recorder"] {
        let seen = || async { robots(home, &format!("list --json --identity set/{who}")).await };
        let seen = || async { seen().await.filter(|names| names == &["xtb-1", "xtb-2"]) };
        eventually("robots", seen).await;
    }
    let goto = |who: &str| format!("dispatch goto 0.1 1.5 --wait --timeout 20 --identity set/{who}");
    let said = done(cli(home, &goto("operator")));
    assert!(said.contains("done"), "{said}");
    let refused = cli(home, "stop xtb-1 --timeout 1 --identity set/viewer");
    assert!(!refused.status.success(), "{refused:?}");
}
