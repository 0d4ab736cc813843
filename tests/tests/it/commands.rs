//! `fleet-cli` from outside, against a simulator in a process of its own.

use fleet_tests::processes::{Process, RouterProcess, program};
use fleet_tests::{PATIENCE, eventually, name};
use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::RobotState;

/// `fleet-cli` in an empty home, with JSON output.
pub(crate) fn fleet_cli(arguments: &[&str]) -> Command {
    let home = std::env::temp_dir();
    let mut command = Command::new(program("fleet-cli"));
    command.env_clear().env("HOME", home).arg("--json").args(arguments);
    command
}

pub(crate) struct Sim {
    _process: Process,
    pub(crate) endpoint: String,
    roster: Vec<String>,
}

pub(crate) fn sim(arguments: &[&str]) -> Sim {
    ready(fleet_cli(&["sim", "--listen", "tcp/127.0.0.1:0"]).args(arguments))
}

/// When it says so.
pub(crate) fn ready(sim: &mut Command) -> Sim {
    let mut child = sim.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let ready: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
    assert_eq!(ready["ready"], true);
    let names =
        ready["robots"].as_array().unwrap().iter().map(|robot| robot["name"].as_str().unwrap().into());
    let endpoint = ready["router"].as_str().unwrap().to_owned();
    Sim { _process: Process(child), endpoint, roster: names.collect() }
}

impl Sim {
    pub(crate) fn run(&self, arguments: &[&str]) -> (i32, Value, Output) {
        let output = fleet_cli(&["--connect", &self.endpoint]).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(text.lines().count(), 1, "not one line of JSON: {output:?}");
        (output.status.code().unwrap(), serde_json::from_str(&text).unwrap(), output)
    }
}

#[test]
fn several_are_reset_and_explained_at_once() {
    let sim = sim(&["--robots", "3", "--speed", "8"]);
    let lines = |arguments: &[&str]| {
        let output = fleet_cli(&["--connect", &sim.endpoint]).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>();
        (output.status.code().unwrap(), lines, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    assert_eq!(lines(&["estop", "--all"]).0, 0);
    let (code, why, said) = lines(&["why", "xtb-1", "xtb-2"]);
    let headlines: Vec<&str> = why.iter().map(|why| why["headline"].as_str().unwrap()).collect();
    assert!(
        headlines[0].starts_with("xtb-1: stopped") && headlines[1].starts_with("xtb-2: stopped"),
        "{why:?}"
    );
    assert_eq!((code, why.len()), (0, 2), "{said}");
    let (code, reset, said) = lines(&["reset", "xtb-1", "xtb-2"]);
    assert_eq!((code, reset.len()), (0, 2), "{said}");
    assert!(reset.iter().all(|robot| robot["cleared"] == serde_json::json!(["estop"])), "{reset:?}");
    // Nobody is there to be asked.
    let (code, refused, _) = lines(&["reset", "--all"]);
    let hint = refused[0]["error"]["hint"].as_str().unwrap();
    assert!(code == 2 && hint.contains("--yes"), "{code} {hint}");
    assert_eq!(lines(&["estop", "xtb-2"]).0, 0);
    let (code, reset, said) = lines(&["reset", "--all", "--yes"]);
    let names: Vec<&str> = reset.iter().map(|robot| robot["robot"].as_str().unwrap()).collect();
    assert_eq!((code, names), (0, vec!["xtb-2", "xtb-3"]), "{said}");
    assert_eq!(lines(&["reset", "--all", "--yes"]), (0, Vec::new(), String::new()));
    let (code, missing, _) = lines(&["reset", "--all", "--yes", "--expect", "xtb-1,xtb-9"]);
    let missing = missing[0]["error"]["message"].as_str().unwrap();
    assert!(code == 3 && missing.contains("xtb-9 does not answer"), "{code} {missing}");
}

#[test]
fn a_fleet_is_listed_driven_and_stopped_from_the_command_line() {
    let sim = sim(&["--robots", "2", "--speed", "8"]);
    assert_eq!(sim.roster, ["xtb-1", "xtb-2"]);

    let (code, list, output) = sim.run(&["list"]);
    assert_eq!((code, list["robots"].as_array().unwrap().len()), (0, 2), "{output:?}");

    let (code, goal, output) = sim.run(&["goto", "xtb-1", "-0.3", "1.5", "--wait"]);
    assert_eq!((code, &goal["status"]), (0, &Value::from("reached")), "{output:?}");

    let (code, goal, output) = sim.run(&["goto", "xtb-2", "2", "4"]);
    assert_eq!((code, &goal["status"]), (0, &Value::from("accepted")), "{output:?}");
    let (code, stopped, output) = sim.run(&["stop", "--all"]);
    assert_eq!((code, &stopped["complete"]), (0, &Value::from(true)), "{output:?}");
    let (_, status, output) = sim.run(&["status", "xtb-2"]);
    assert!(status.to_string().contains("\"cancelled\""), "{output:?}");
}

/// `robot-agent` on the serial lines of a simulated truck; returns when it is listed.
pub(crate) fn agent(sim: &Sim, lines: &Path, robot: &str) -> Process {
    let child = Command::new(program("robot-agent"))
        .env_clear()
        .args(["--hardware", "serial", "--name", robot, "--connect", &sim.endpoint, "--board"])
        .arg(lines.join(format!("{robot}.board")))
        .arg("--gyro")
        .arg(lines.join(format!("{robot}.gyro")))
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let process = Process(child);
    let give_up = Instant::now() + PATIENCE;
    while !alive(sim, robot) {
        assert!(Instant::now() < give_up, "{robot} did not come to life");
    }
    process
}

fn alive(sim: &Sim, robot: &str) -> bool {
    let (_, list, _) = sim.run(&["list"]);
    let robots = list["robots"].as_array().cloned().unwrap_or_default();
    robots.iter().any(|one| one["name"] == robot && one["alive"] == true)
}

#[test]
fn stop_all_reports_a_robot_that_has_gone_as_unknown_and_fails() {
    let lines = tempfile::tempdir().unwrap();
    let sim = sim(&["--robots", "2", "--pty", &lines.path().display().to_string()]);
    let _one = agent(&sim, lines.path(), "xtb-1");
    let two = agent(&sim, lines.path(), "xtb-2");
    let (code, stopped, output) = sim.run(&["stop", "--all"]);
    assert_eq!((code, &stopped["complete"]), (0, &Value::from(true)), "{output:?}");
    drop(two);
    let (code, stopped, output) = sim.run(&["stop", "--all"]);
    assert_eq!(code, 3, "{output:?}");
    assert_eq!(stopped["robots"]["xtb-1"], "stopped");
    assert_eq!(stopped["robots"]["xtb-2"], "unknown");
    assert_eq!(stopped["complete"], false);
}

#[test]
fn watch_decodes_what_travels() {
    let sim = sim(&["--robots", "1"]);
    let (code, seen, output) = sim.run(&["watch", "xtb/lab/*/state", "--count", "1"]);
    assert_eq!((code, &seen["type"]), (0, &Value::from("RobotState")), "{output:?}");
    assert_eq!(seen["value"]["robot"], "xtb-1");
    let (_, seen, output) = sim.run(&["watch", "xtb/lab/*/sensors", "--count", "1"]);
    assert_eq!(seen["type"], "Sensors", "{output:?}");
}

#[test]
fn robots_are_sent_to_places_by_name() {
    let sim = sim(&[
        "--robots",
        "1",
        "--world",
        concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml"),
        "--speed",
        "8",
    ]);
    let (code, listed, output) = sim.run(&["place", "list", "--kind", "dock"]);
    let names: Vec<_> = listed["places"].as_array().unwrap().iter().map(|place| &place["name"]).collect();
    assert_eq!((code, names), (0, vec![&Value::from("dock-1"), &"dock-2".into()]), "{output:?}");
    let (code, reached, output) = sim.run(&["goto", "xtb-1", "door", "--wait"]);
    assert_eq!((code, &reached["status"]), (0, &"reached".into()), "{output:?}");
    let (_, state, output) = sim.run(&["status", "xtb-1"]);
    let pose = &state["robots"][0]["state"]["pose"];
    let off = |value: &Value, place: f64| (value.as_f64().unwrap() - place).abs();
    assert!(off(&pose["x_m"], 0.0) < 0.2 && off(&pose["y_m"], 2.5) < 0.2, "{output:?}");
    assert!(off(&pose["yaw_rad"], std::f64::consts::FRAC_PI_2) < 0.3, "{output:?}");
    let (code, refused, _) = sim.run(&["goto", "xtb-1", "dock-9"]);
    assert_eq!((code, &refused["error"]["message"]), (2, &"there is no place \"dock-9\"".into()));
    let file = tempfile::NamedTempFile::with_suffix(".toml").unwrap();
    std::fs::write(&file, "[room]\nwidth_m = 6.0\ndepth_m = 6.0\n").unwrap();
    let path = file.path().to_str().unwrap();
    let (code, here, output) = sim.run(&["place", "here", "bench", "xtb-1", "--file", path]);
    assert_eq!(code, 0, "{output:?}");
    assert!(off(&here["added"]["y_m"], 2.5) < 0.2, "{output:?}");
}

#[test]
fn a_simulator_serves_the_map_of_its_world() {
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml");
    let sim = sim(&["--robots", "1", "--world", world]);
    let (code, live, output) = sim.run(&["map", "show", "--live"]);
    assert_eq!((code, &live["name"]), (0, &Value::from("lab")), "{output:?}");
    let (_, drawn, _) = sim.run(&["map", "show", world]);
    assert_eq!(live, drawn);

    let other = concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/corridor.toml");
    let (code, refused, output) = sim.run(&["map", "serve", other]);
    let said = refused["error"]["message"].as_str().unwrap();
    assert!(code == 1 && said.contains(live["hash"].as_str().unwrap()), "{output:?}");
}

#[test]
fn an_impossible_simulation_says_so() {
    let sim = sim(&["--robots", "1"]);
    let refused = |arguments: &[&str]| {
        let output = fleet_cli(&["sim"]).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let said: Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {output:?}"));
        assert!(!output.status.success() && !said["error"]["hint"].as_str().unwrap().is_empty(), "{said}");
        said["error"]["code"].as_str().unwrap().to_owned()
    };
    assert_eq!(refused(&["--listen", &sim.endpoint]), "port_taken");
    assert_eq!(refused(&["--robots", "0"]), "usage");
    assert_eq!(refused(&["--world", "/nonexistent.toml"]), "config");
    let world = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(world.path(), "[[boxes]]\nx_m = 0.0\ny_m = 0.0\nwidth_m = -1.0\ndepth_m = 1.0\n").unwrap();
    assert_eq!(refused(&["--world", &world.path().display().to_string()]), "config");
}

#[test]
fn a_simulator_uses_the_router_that_is_named() {
    let outer = sim(&["--robots", "1"]);
    let mut command = fleet_cli(&["--connect", &outer.endpoint, "--fleet", "barn", "sim", "--robots", "1"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let _inner = Process(child);
    let (code, list, output) = outer.run(&["list", "--fleet", "barn"]);
    assert_eq!((code, list["robots"].as_array().unwrap().len()), (0, 1), "{output:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_that_have_arrived_answer_a_question_to_all() {
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml");
    let sim = tokio::task::block_in_place(|| sim(&["--robots", "3", "--speed", "4", "--world", world]));
    let role = xtb_bus::SessionRole::Client { connect: vec![sim.endpoint.clone()] };
    let bus = xtb_bus::open(&role).await.unwrap();
    let any = FleetKeys::new(name("lab")).any_robot().state();
    let states = || async {
        let answers = bus.get(&any, Duration::from_secs(2)).await.unwrap();
        let states = answers.iter().filter_map(|answer| answer.decode::<RobotState>().ok());
        states.map(|state| (state.robot.to_string(), state)).collect::<BTreeMap<_, _>>()
    };
    let all = |found: BTreeMap<String, RobotState>| (found.len() == 3).then_some(found);
    let starts = eventually("three states", || async { all(states().await) }).await;
    for (robot, ahead_m) in [("xtb-1", 0.6), ("xtb-2", 2.5), ("xtb-3", 2.5)] {
        let pose = starts[robot].pose;
        let (x, y) = (pose.x_m.to_string(), (pose.y_m + ahead_m).to_string());
        let goto = ["goto", robot, &x, &y, "--via", "planned"];
        let (code, _, output) = tokio::task::block_in_place(|| sim.run(&goto));
        assert_eq!(code, 0, "{output:?}");
    }
    // As `list` does, while they drive.
    eventually("three states under way", || async { all(states().await) }).await;
    let ended = |state: &RobotState| state.goal.as_ref().is_some_and(|goal| goal.status.is_final());
    for arrived in 1..=3 {
        let what = format!("three states when {arrived} have arrived");
        eventually(&what, || async {
            all(states().await).filter(|found| found.values().filter(|state| ended(state)).count() >= arrived)
        })
        .await;
    }
}

#[test]
fn a_router_connects_to_those_of_the_flag_and_not_to_those_of_the_environment() {
    let start = |arguments: &[&str]| {
        let mut command = fleet_cli(&["router", "--listen", "tcp/127.0.0.1:0"]);
        command.args(arguments).env("XTB_CONNECT", "tcp/127.0.0.1:9");
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let ready: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
        (Process(child), ready)
    };
    let (_first, ready) = start(&[]);
    assert_eq!(ready["connect"], Value::Null);
    let endpoint = ready["router"].as_str().unwrap();
    let (mut second, ready) = start(&["--connect", endpoint]);
    assert_eq!(ready["connect"], serde_json::json!([endpoint]));
    let (say, said) = std::sync::mpsc::channel();
    let notes = BufReader::new(second.0.stderr.take().unwrap());
    std::thread::spawn(move || notes.lines().map_while(Result::ok).try_for_each(|note| say.send(note)));
    assert_eq!(said.recv_timeout(PATIENCE).unwrap(), "linked to 1 other router");
}

/// `map serve` of a file, at a router without a simulator: what is changed is in the file, and who did so beside it.
#[test]
fn a_change_of_the_served_map_is_in_its_file_and_in_its_history() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hall.toml");
    let path = file.to_str().unwrap();
    let zone = "[[zones]]\nname = \"crane\"\nkind = \"keep_out\"\npoints = [[0, 0], [1, 0], [1, 1]]\n";
    std::fs::write(&file, format!("# the hall\n[room]\nwidth_m = 6.0\ndepth_m = 6.0\n{zone}")).unwrap();
    let router = RouterProcess::start(None);
    let run = |arguments: &[&str]| {
        let output = fleet_cli(&["--connect", router.endpoint()]).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        (
            output.status.code().unwrap(),
            serde_json::from_str::<Value>(&text).unwrap_or_else(|_| panic!("{output:?}")),
        )
    };
    let (code, refused) = run(&["place", "add", "dock", "1", "2"]);
    assert_eq!((code, &refused["error"]["code"]), (3, &"no_map".into()), "{refused}");
    let serve = || {
        let mut command = fleet_cli(&["--connect", router.endpoint(), "map", "serve", path]);
        Process::start_ready(&mut command).0
    };
    let serving = serve();
    let (code, added) = run(&["place", "add", "dock", "1", "2", "--why", "we charge there"]);
    assert_eq!((code, &added["version"], &added["stored"]), (0, &2.into(), &true.into()), "{added}");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.starts_with("# the hall\n") && text.contains(zone) && text.contains("\"dock\""), "{text}");

    // By hand: other zones are served too.
    let without = text.replace(zone, "");
    std::fs::write(&file, &without).unwrap();
    let began = Instant::now();
    while run(&["map", "history"]).1["versions"].as_array().is_none_or(|all| all.len() < 3) {
        assert!(began.elapsed() < PATIENCE, "the file's own change is not served");
    }
    assert_eq!(run(&["map", "show", "--live"]).1["zones"], Value::Array(Vec::new()));
    let (code, twice) = run(&["place", "add", "dock", "1", "2"]);
    assert_eq!((code, &twice["error"]["code"]), (1, &"failed".into()), "{twice}");
    drop(serving);

    // Who serves it next goes on with the history.
    let serving = serve();
    let (code, removed) = run(&["place", "remove", "dock"]);
    assert_eq!((code, &removed["version"]), (0, &4.into()), "{removed}");
    let told = |history: &Value| {
        let all = history["versions"].as_array().unwrap().iter();
        all.map(|version| version["why"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let whys = ["as found", "we charge there", "changed in the file", "without dock"];
    assert_eq!(told(&run(&["map", "history"]).1), whys);
    drop(serving);
    assert_eq!(told(&run(&["map", "history", path]).1), whys);
}

#[test]
fn several_robots_are_sent_stopped_and_set_by_tag_each_with_its_own_result() {
    let sim = sim(&["--robots", "3", "--speed", "8"]);
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("fleet.toml");
    let roster = |number: u32, tags: &str| {
        let pose = format!("{{ x_m = {}.0, y_m = 7.0, yaw_rad = 0.5 }}", 3 * number);
        format!("[[robots]]\nname = \"xtb-{number}\"\ntags = [{tags}]\nstart_pose = {pose}\n")
    };
    let robots = [roster(1, "\"red\""), roster(2, "\"@red\", \"arm\""), roster(3, "")].concat();
    std::fs::write(&config, format!("{robots}[aliases]\nxtb-2 = \"Red Fox\"\n")).unwrap();
    let lines = |arguments: &[&str]| {
        let mut command = fleet_cli(&["--connect", &sim.endpoint, "--config"]);
        let output = command.arg(&config).args(arguments).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect::<Vec<Value>>();
        (output.status.code().unwrap(), lines, String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let of = |lines: &[Value], robot: &str| lines.iter().find(|line| line["robot"] == robot).cloned();

    let (code, refused, _) = lines(&["goto", "@red", "1", "3"]);
    let error = &refused[0]["error"];
    assert_eq!((code, &error["message"]), (2, &"2 robots cannot stand at one point".into()));
    assert!(error["hint"].as_str().unwrap().contains("--spread"), "{error}");

    let (code, reached, said) = lines(&["goto", "@red", "1", "3", "--spread=1.5", "--wait"]);
    assert_eq!((code, reached.len()), (0, 2), "{reached:?} {said}");
    let at = |robot: &str| {
        let (_, status, _) = lines(&["status", robot]);
        let pose = &status[0]["robots"][0]["state"]["pose"];
        (pose["x_m"].as_f64().unwrap(), pose["y_m"].as_f64().unwrap())
    };
    let (one, two) = (at("xtb-1"), at("xtb-2"));
    assert!((one.0 - two.0).hypot(one.1 - two.1) > 0.8, "{one:?} {two:?}");

    let (code, sent, said) = lines(&["goto", "xtb-1,xtb-9", "0", "5", "--spread"]);
    assert_eq!((code, sent.len()), (3, 2), "{sent:?} {said}");
    assert_eq!(of(&sent, "xtb-1").unwrap()["status"], "accepted");
    assert_eq!(of(&sent, "xtb-9").unwrap()["error"]["code"], "outcome_unknown");

    let (code, wandering, said) = lines(&["wander", "xtb-2", "xtb-3"]);
    assert_eq!((code, wandering.len()), (0, 2), "{said}");
    let (code, stopped, said) = lines(&["stop", "@red"]);
    let expected = serde_json::json!({ "xtb-1": "stopped", "xtb-2": "stopped" });
    assert_eq!((code, &stopped[0]["robots"]), (0, &expected), "{said}");
    // A tag that nobody has keeps nobody else from being stopped.
    let (code, stopped, _) = lines(&["estop", "xtb-3", "@rde"]);
    assert_eq!((code, &stopped[0]["robots"]["xtb-3"]), (2, &"stopped".into()), "{stopped:?}");
    assert_eq!(stopped[1]["error"]["hint"], "tags of the roster: @arm (1), @red (2)");

    let (code, refused, _) = lines(&["set-pose", "@red", "1", "2"]);
    assert_eq!((code, &refused[0]["error"]["code"]), (2, &"usage".into()));
    let (code, set, said) = lines(&["set-pose", "@red", "--start"]);
    assert_eq!((code, set.len()), (0, 2), "{set:?} {said}");
    assert_eq!(of(&set, "xtb-2").unwrap()["pose"]["x_m"], 6.0, "{set:?}");

    let (_, listed, _) = lines(&["list"]);
    let aliases: Vec<_> =
        listed[0]["robots"].as_array().unwrap().iter().map(|robot| &robot["alias"]).collect();
    assert_eq!(aliases, [&Value::Null, &"Red Fox".into(), &Value::Null]);
}
