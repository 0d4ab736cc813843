//! From nothing to a drive over TLS, as a new user would do it, with the programs themselves.

use fleet_tests::eventually;
use fleet_tests::hosts::{Host, hosts};
use fleet_tests::processes::{Process, Signal, program};
use serde_json::Value;
use std::fs::{self, File};
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// A computer of its own or, where this machine has no network namespaces, a home of its own.
struct Computer {
    home: TempDir,
    host: Option<Host>,
}

impl Computer {
    fn three() -> [Self; 3] {
        let mut hosts = hosts(3).unwrap_or_default().into_iter();
        std::array::from_fn(|_| Self { home: tempfile::tempdir().unwrap(), host: hosts.next() })
    }

    fn address(&self) -> String {
        self.host.as_ref().map_or_else(|| "127.0.0.1".into(), Host::address)
    }

    /// As typed there: in the home folder, with nothing in the environment that somebody would have to set first.
    fn types(&self, line: &str) -> Command {
        let (name, arguments) = line.split_once(' ').unwrap();
        let program = program(name);
        let mut command =
            self.host.as_ref().map_or_else(|| Command::new(&program), |host| host.command(&program));
        command.env_clear().env("HOME", self.home.path()).current_dir(self.home.path());
        command.args(arguments.split_whitespace());
        command
    }

    /// Copies a file to the home folder there.
    fn copies(&self, file: &str, to: &Self) {
        fs::copy(self.home.path().join(file), to.home.path().join(file)).unwrap();
    }
}

fn cli(home: &Path, line: &str) -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.env_clear().env("HOME", home).current_dir(home).args(line.split_whitespace());
    command
}

fn done(mut command: Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{command:?}: {output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// What a command says, if it succeeds.
async fn said(mut command: Command) -> Option<String> {
    let output = tokio::task::spawn_blocking(move || command.output()).await.unwrap().unwrap();
    output.status.success().then(|| String::from_utf8(output.stdout).unwrap())
}

/// The names of robots that `list --json` shows.
async fn robots(list: Command) -> Option<Vec<String>> {
    let listed: Value = serde_json::from_str(said(list).await?.trim()).ok()?;
    let names = listed.get("robots")?.as_array()?.iter().map(|robot| robot["name"].as_str());
    names.map(|name| name.map(str::to_owned)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn five_commands_on_three_computers_then_router_agent_and_a_drive_over_tls() {
    let [office, robot, desk] = Computer::three();
    let port = match &office.host {
        Some(_) => 7447,
        None => TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port(),
    };
    done(office.types(&format!("fleet-cli pki init --router-name {} --port {port}", office.address())));
    done(office.types("fleet-cli pki add-robot xtb-1"));
    done(office.types("fleet-cli pki add-person alice --role operator"));
    office.copies("xtb-1.xtbid", &robot);
    office.copies("alice.xtbid", &desk);
    done(robot.types("robot-agent enrol xtb-1.xtbid --remove"));
    done(desk.types("fleet-cli enrol alice.xtbid --remove"));

    let listen = format!("fleet-cli --json router --listen tls/{}:{port}", office.address());
    let (_router, ready) = Process::start_ready(&mut office.types(&listen));
    assert!(ready.contains("\"ready\":true"), "{ready}");
    let agent = robot.types("robot-agent --hardware simulated").spawn().unwrap();
    let _agent = Process(agent);
    let seen =
        || async { robots(desk.types("fleet-cli list --json")).await.filter(|names| names == &["xtb-1"]) };
    eventually("the robot", seen).await;
    // The agent may just have started: nothing heard of its gyro yet.
    let goto = || said(desk.types("fleet-cli goto xtb-1 0.1 0.8 --wait"));
    eventually("a drive", goto).await;
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
        let seen = || robots(cli(home, &format!("list --json --identity set/{who}")));
        let seen = || async { seen().await.filter(|names| names == &["xtb-1", "xtb-2"]) };
        eventually("robots", seen).await;
    }
    let goto = |who: &str| format!("dispatch goto 0.1 1.5 --wait --timeout 20 --identity set/{who}");
    let said = done(cli(home, &goto("operator")));
    assert!(said.contains("done"), "{said}");
    let refused = cli(home, "stop xtb-1 --timeout 1 --identity set/viewer").output().unwrap();
    assert!(!refused.status.success(), "{refused:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stand_by_takes_over_from_a_killed_dispatcher_over_tls() {
    let folder = tempfile::tempdir().unwrap();
    let home = folder.path();
    let mut sim = cli(home, "--json sim --robots 1 --speed 4 --listen tls/127.0.0.1:0 --identities set");
    let (_sim, ready) = Process::start_ready(&mut sim);
    assert!(ready.contains("\"ready\":true"), "{ready}");
    let serve = |ledger: &str| format!("--json dispatch serve --identity set/dispatcher --ledger {ledger}");
    let (first, ready) = Process::start_ready(&mut cli(home, &serve("a.ledger")));
    assert!(ready.contains("\"ready\":true"), "{ready}");
    let output = home.join("b.out");
    let mut standby = cli(home, &format!("{} --standby", serve("b.ledger")));
    let _standby = Process::start(standby.stdout(File::create(&output).unwrap()));
    let says = |word: &'static str| {
        let output = &output;
        move || async move { fs::read_to_string(output).ok().filter(|said| said.contains(word)) }
    };
    eventually("a pair", says("\"paired\"")).await;
    let route = "dispatch route 0,1.2 0,2.4 0,3.4 --identity set/operator --json";
    let task: Value = serde_json::from_str(done(cli(home, route)).trim()).unwrap();
    let task = task["id"].as_str().unwrap().to_owned();
    first.signal(Signal::Kill);
    eventually("a take-over", says("\"ready\":true")).await;
    let ended = || said(cli(home, &format!("task {task} --identity set/operator --json")));
    eventually("the end of the task", || async { ended().await.filter(|said| said.contains("\"done\"")) })
        .await;
}
