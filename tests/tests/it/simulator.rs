//! `fleet-cli sim` from outside: what it says when the machine is too slow for it, when its robots' names
//! are taken, and when a router is named that it does not use.

use super::commands::{fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, program};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};
use std::time::Instant;

/// No machine turns three trucks and their agents a thousand times as fast as real time.
const TOO_FAST: [&str; 4] = ["--robots", "3", "--speed", "1000"];

/// `fleet-cli` in an empty home, with text output.
fn in_words(arguments: &[&str]) -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.env_clear().env("HOME", std::env::temp_dir()).args(arguments).stdin(Stdio::null());
    command
}

/// The first line of standard error that `wanted` finds something in; panics if none comes.
fn line(process: &mut Process, wanted: &str) -> String {
    let lines = BufReader::new(process.0.stderr.take().unwrap()).lines();
    let mut seen = Vec::new();
    for line in lines.map_while(Result::ok) {
        if line.contains(wanted) {
            return line;
        }
        seen.push(line);
    }
    panic!("no {wanted:?} in {seen:?}");
}

#[test]
fn an_overloaded_simulator_says_so_to_whoever_runs_it_and_to_whoever_looks() {
    let mut command = in_words(&["sim", "--listen", "tcp/127.0.0.1:0"]);
    let child = command.args(TOO_FAST).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let said = line(&mut Process(child), "simulator runs at");
    assert!(said.starts_with("warning: ") && said.contains("× real time, 1000 × requested"), "{said}");
    assert!(said.contains("a lower --speed"), "{said}");

    let sim = sim(&TOO_FAST);
    let (_, stats, output) = sim.run(&["watch", "xtb/lab/sim/stats", "--count", "1"]);
    assert_eq!(
        (&stats["type"], &stats["value"]["speed"]),
        (&"SimStats".into(), &1000.0.into()),
        "{output:?}"
    );
    let give_up = Instant::now() + PATIENCE;
    let factor = loop {
        let (_, list, output) = sim.run(&["list"]);
        if let Some(factor) = list["simulator"]["real_time_factor"].as_f64() {
            break factor;
        }
        assert!(Instant::now() < give_up, "{output:?}");
    };
    assert!(factor > 0.0 && factor < 900.0, "{factor}");
    let list = in_words(&["--connect", &sim.endpoint, "list"]).output().unwrap();
    let list = String::from_utf8(list.stdout).unwrap();
    assert!(list.lines().last().unwrap().starts_with("simulator runs at "), "{list}");

    let (_, report, output) = sim.run(&["doctor"]);
    let findings = report["findings"].as_array().unwrap_or_else(|| panic!("{output:?}"));
    let of = |topic: &'static str| findings.iter().filter(move |finding| finding["topic"] == topic);
    let simulator = of("simulator").next().unwrap();
    assert!(simulator["level"] == "warning" && simulator["hint"].as_str().unwrap().contains("--speed"));
    for finding in ["clocks", "loops", "versions"].into_iter().flat_map(of) {
        assert_ne!(finding["level"], "problem", "{finding}");
    }
}

#[test]
fn a_simulator_that_must_keep_up_ends_when_it_does_not() {
    let strict = || fleet_cli(&["sim", "--listen", "tcp/127.0.0.1:0", "--strict"]);
    let output = strict().args(TOO_FAST).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let error: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!((output.status.code(), &error["error"]["code"]), (Some(1), &"failed".into()), "{text}");
    assert!(error["error"]["message"].as_str().unwrap().starts_with("simulator runs at "), "{text}");
    assert!(error["error"]["hint"].as_str().unwrap().contains("fewer --robots"), "{text}");
}

#[test]
fn a_second_simulator_whose_names_are_taken_ends_with_4_and_is_never_ready() {
    let first = sim(&["--robots", "2"]);
    let mut second = fleet_cli(&["--connect", &first.endpoint, "sim", "--robots", "3"]);
    let output = second.output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!((output.status.code(), text.lines().count()), (Some(4), 1), "{text}");
    let error: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(error["error"]["code"], "name_taken", "{text}");
    let message = error["error"]["message"].as_str().unwrap();
    assert!(message.contains("xtb-1, xtb-2 are already in use in fleet lab"), "{message}");
    assert!(error["error"]["hint"].as_str().unwrap().contains("--fleet"), "{text}");
    // The first has not noticed anything.
    let (code, list, output) = first.run(&["list"]);
    assert_eq!((code, list["robots"].as_array().unwrap().len()), (0, 2), "{output:?}");
}

/// What a simulator says on standard error until it is ready.
fn said_until_ready(environment: Option<&str>, arguments: &[&str]) -> String {
    let mut command = in_words(arguments);
    command.envs(environment.map(|routers| ("XTB_CONNECT", routers)));
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut ready = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut ready).unwrap();
    let mut stderr = child.stderr.take().unwrap();
    drop(Process(child));
    assert!(ready.starts_with("sim ready"), "{ready:?}");
    let mut said = String::new();
    stderr.read_to_string(&mut said).unwrap();
    said
}

#[test]
fn a_router_that_is_named_in_the_environment_is_not_passed_over_in_silence() {
    const ELSEWHERE: &str = "tcp/127.0.0.1:1";
    let own = ["sim", "--robots", "1", "--listen", "tcp/127.0.0.1:0"];
    let said = said_until_ready(Some(ELSEWHERE), &own);
    let line = said.lines().find(|line| line.contains("XTB_CONNECT")).unwrap_or_else(|| panic!("{said}"));
    assert!(line.contains(ELSEWHERE) && line.contains("--connect"), "{line}");
    assert!(!said_until_ready(None, &own).contains("ignores"));
    let outer = sim(&["--robots", "1"]);
    let inner = ["sim", "--robots", "1", "--fleet", "barn", "--connect", &outer.endpoint];
    assert!(!said_until_ready(Some(ELSEWHERE), &inner).contains("ignores"));
}

#[test]
fn a_name_that_the_roster_lacks_is_pointed_out_at_once_and_told_to_stop_all_the_same() {
    let sim = sim(&["--robots", "2"]);
    for verb in ["stop", "estop"] {
        let began = Instant::now();
        let mut command = in_words(&["--connect", &sim.endpoint, "--timeout", "60", verb, "xtb-11"]);
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let said = line(&mut Process(child), "xtb-11");
        assert_eq!(
            said,
            "xtb-11 is not in the roster: did you mean xtb-1? The robot is sent a stop anyway, by the name given."
        );
        assert!(began.elapsed() < PATIENCE / 2, "not before it gave up");
        let (code, report, output) = sim.run(&["--timeout", "1", verb, "xtb-2", "xtb-11"]);
        assert_eq!((code, &report["unknown_robots"]["xtb-11"]), (3, &"xtb-1".into()), "{output:?}");
        let robots = &report["robots"];
        assert_eq!((&robots["xtb-2"], &robots["xtb-11"]), (&"stopped".into(), &"unknown".into()));
    }
}

#[test]
fn a_map_of_ros_is_simulated_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let at = |file: &str| folder.path().join(file).display().to_string();
    // A wall with a door of 1.5 m between the robots and the goal.
    let world = "name = 'hall'\n[room]\nwidth_m = 8.0\ndepth_m = 12.0\n[[walls]]\npoints = [[-4.0, 4.0], [0.5, 4.0]]\n\
                 [[walls]]\npoints = [[2.0, 4.0], [4.0, 4.0]]\n";
    std::fs::write(at("hall.toml"), world).unwrap();
    let cli = |arguments: &[&str]| {
        let output = fleet_cli(arguments).output().unwrap();
        serde_json::from_slice::<Value>(&output.stdout).unwrap_or_else(|error| panic!("{error}: {output:?}"))
    };
    let (yaml, toml) = (at("hall.yaml"), at("hall.toml"));
    let file = cli(&["map", "import", &toml, "--out", &yaml]);
    let sim = sim(&["--robots", "2", "--speed", "8", "--world", &yaml]);
    let (_, live, output) = sim.run(&["map", "show", "--live"]);
    assert_eq!((&live["hash"], &live["name"]), (&file["hash"], &"hall".into()), "{output:?}");
    let (code, reached, output) = sim.run(&["goto", "xtb-1", "-2", "5", "--wait"]);
    assert_eq!((code, &reached["status"]), (0, &"reached".into()), "{output:?}");
    let (_, refused, output) = sim.run(&["goto", "xtb-2", "-2", "4"]);
    assert_eq!(refused["error"]["code"], "goal_blocked", "it stands in the wall: {output:?}");
}
