//! What `--json` prints, held against `fleet-cli schema`: every verb that can be run here, by somebody else's validator.

use crate::commands::{Sim, fleet_cli, sim};
use fleet_tests::processes::{Process, Signal};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// They print none, or need what is not here: a terminal, a broker.
const NOT_RUN: [&str; 4] = ["top", "completions", "teleop", "vda5050 serve"];

const ROOM: &str = "name = 'hall'\n[room]\nwidth_m = 8.0\ndepth_m = 8.0\n\
                    [[places]]\nname = 'dock-7'\nkind = 'dock'\nx_m = -3.0\ny_m = 3.0\n[[zones]]\nname = 'east'\nkind = 'one_way'\n\
                    heading_rad = 0.0\npoints = [[2.0, 2.0], [3.0, 2.0], [3.0, 3.0]]\n";
const INSTANCE: &str =
    "world: hall.toml\nagents:\n  - {name: xtb-1, start: [0, -2, 1.57], goal: [0, 1, 1.57]}\n";

/// A Python with the package `jsonschema`, if there is one.
fn python() -> Option<PathBuf> {
    let candidates = std::env::var_os("XTB_PYTHON").into_iter().chain(["python3".into()]);
    candidates.map(PathBuf::from).find(|python| {
        let import = Command::new(python).args(["-c", "import jsonschema"]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    })
}

/// A fleet, a folder to work in, and what was printed so far: by which verb, and which line.
struct Bench {
    sim: Sim,
    folder: TempDir,
    printed: Vec<(String, Value)>,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).display().to_string();
        std::fs::write(at("hall.toml"), ROOM).unwrap();
        std::fs::write(at("instance.yaml"), INSTANCE).unwrap();
        let (world, ledger, record) = (at("hall.toml"), at("lab.ledger"), at("recordings"));
        let sim = sim(&[
            "--robots",
            "2",
            "--speed",
            "8",
            "--world",
            &world,
            "--dispatch",
            "--home",
            "--ledger",
            &ledger,
            "--record",
            &record,
        ]);
        Self { sim, folder, printed: Vec::new() }
    }

    fn command(&self, line: &str) -> Command {
        // A busy machine takes its time to connect.
        let mut command = fleet_cli(&["--timeout", "20"]);
        let own_router = ["router", "sim", "demo"].contains(&line.split(' ').next().unwrap_or_default());
        if !own_router {
            command.args(["--connect", &self.sim.endpoint]);
        }
        command.args(line.split(' ')).current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    fn keep(&mut self, verb: &str, printed: &str) {
        let read =
            |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{verb}: {error}: {line}"));
        self.printed.extend(printed.lines().map(|line| (verb.to_owned(), read(line))));
    }

    /// Runs a verb to its end; the last line that it printed.
    fn run(&mut self, verb: &str, arguments: &str) -> Value {
        let line =
            [verb, arguments].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join(" ");
        let output = self.command(&line).output().unwrap();
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(!printed.is_empty(), "{line} prints nothing: {output:?}");
        self.keep(verb, &printed);
        self.printed.last().unwrap().1.clone()
    }

    /// Runs a verb that goes on until it says that it is ready, and then to what it says at its end.
    fn serve(&mut self, verb: &str, arguments: &str) {
        let (mut process, ready) = Process::start_ready(&mut self.command(&format!("{verb} {arguments}")));
        self.keep(verb, &ready);
        assert_eq!(self.printed.last().unwrap().1["ready"], true, "{verb}: {ready}");
        process.signal(Signal::Interrupt);
        process.0.wait().unwrap();
    }
}

fn floor_and_files(bench: &mut Bench) {
    bench.run("map show", "hall.toml");
    bench.run("map show", "--live");
    bench.run("map check", "hall.toml");
    bench.run("map import", "hall.toml --out hall.yaml");
    bench.run("map history", "");
    bench.run("place add", "dock-1 1 1 --yaw 90 --kind dock --tag north --file hall.yaml");
    bench.run("place here", "bench xtb-1 --file hall.yaml");
    bench.run("place list", "--file hall.yaml");
    bench.run("place list", "");
    bench.run("place remove", "dock-1 --file hall.yaml");
    bench.run("plan", "instance.yaml --out schedule.yaml --time-limit 2");
    bench.run("man", "pages");
    bench.run("schema", "");
}

fn robots(bench: &mut Bench) {
    for (verb, arguments) in [
        ("list", ""),
        ("list", "--expect xtb-1,xtb-2,xtb-9"),
        ("status", ""),
        ("why", "xtb-1 xtb-2 xtb-9"),
        ("doctor", ""),
        ("goto", "xtb-1 0 1"),
        ("goto", "xtb-1 0 0.6 --wait"),
        ("goto", "xtb-9 0 1"),
        ("wander", "xtb-2 --for 1"),
        ("watch", "xtb/lab/*/state --count 2"),
        ("watch", "xtb/lab/** --count 60"),
        ("stop", "--all"),
        ("stop", "xtb-11"),
        ("set-pose", "xtb-1 0 0 --yaw 90"),
        ("estop", "--all"),
        ("why", "xtb-1"),
        ("alerts", "--all"),
        ("alerts ack", "--all"),
        ("reset", "--all --yes"),
        ("param list", "xtb-1 xtb-9"),
        ("param get", "navigation.drive.limit_mps xtb-1"),
        ("param set", "navigation.drive.limit_mps 0.2 xtb-1"),
        ("param save", "xtb-1"),
        ("status", "xtb-1"),
    ] {
        bench.run(verb, arguments);
    }
}

fn tasks(bench: &mut Bench) {
    bench.run("dispatch status", "");
    bench.run("dispatch activate", "");
    bench.run("dispatch goto", "0 1.2 --robot xtb-1");
    bench.run("dispatch wander", "--for 1 --robot xtb-2 --wait");
    let id = |line: &Value| line["id"].as_str().unwrap().to_owned();
    let route = id(&bench.run("dispatch route", "0,1 0,2 --robot xtb-1"));
    let patrol = id(&bench.run("dispatch patrol", "0,1 1,1 --robot xtb-1"));
    std::fs::write(bench.folder.path().join("tasks.toml"), "[[task]]\ngoto = [0.0, 1.0]\n").unwrap();
    bench.run("dispatch submit", "tasks.toml");
    bench.run("extend", &format!("{route} 0,1.5"));
    for verb in ["pause", "resume", "task", "cancel", "retry", "task"] {
        bench.run(verb, &route);
    }
    bench.run("cancel", &format!("{patrol} t9999"));
    let home = bench.run("home", "xtb-1");
    assert_eq!((home["robot"].as_str(), home["place"].as_str()), (Some("xtb-1"), Some("dock-7")), "{home}");
    bench.run("list", "");
    bench.run("tasks", "");
    bench.run("dispatch adopt", "");
    bench.run("traffic status", "");
    bench.run("events", "--limit 20");
    bench.run("report", "");
    bench.run("dispatch export", "--ledger lab.ledger");
    bench.run("audit", "--ledger lab.ledger");
}

fn recordings(bench: &mut Bench) {
    bench.run("record", "--for 1 --out a.mcap");
    bench.run("play", "a.mcap --speed 100");
    bench.run("export", "a.mcap --csv");
    bench.run("audit", "a.mcap");
    bench.run("fetch-log", "xtb-1 --list");
    bench.run("fetch-log", "xtb-1");
}

fn identities(bench: &mut Bench) {
    for (verb, arguments) in [
        ("pki init", "--router-name lab-pc.local"),
        ("pki add-robot", "xtb-1"),
        ("pki add-person", "alice --role operator"),
        ("pki add-service", "recorder"),
        ("pki add-router", "second --router-name 10.0.0.2"),
        ("pki renew", "alice --force"),
        ("pki renew", "--router"),
        ("pki token", "alice"),
        ("pki token", "alice --remove"),
        ("pki export", "--browser alice --out alice.p12"),
        ("pki revoke", "alice"),
        ("pki list", ""),
    ] {
        bench.run(verb, format!("{arguments} --pki pki").trim());
    }
    bench.run("enrol", "recorder.xtbid --to identity");
    bench.run("router", "--print-acl --listen tls/127.0.0.1:0 --pki pki");
}

fn services(bench: &mut Bench) {
    bench.serve("router", "--listen tcp/127.0.0.1:0");
    bench.serve("map serve", "hall.yaml --fleet second");
    bench.serve("traffic serve", "--map hall.yaml --fleet third");
    bench.serve("dispatch serve", "--ledger fourth.ledger --fleet fourth");
    bench.run("dispatch compact", "--ledger fourth.ledger --fleet fourth");
    bench.serve("dashboard", "--listen 127.0.0.1:0");
    bench.serve("sim", "--robots 1 --listen tcp/127.0.0.1:0 --fleet fifth");
    bench.run("demo", "--headless --robots 1 --goals 1 --speed 16");
}

#[test]
fn what_every_verb_prints_matches_its_schema() {
    let Some(python) = python() else {
        return eprintln_skip("no Python with the package jsonschema: no line was checked");
    };
    let mut bench = Bench::new();
    floor_and_files(&mut bench);
    robots(&mut bench);
    tasks(&mut bench);
    recordings(&mut bench);
    identities(&mut bench);
    services(&mut bench);
    let mut schemas = Map::new();
    let listed = bench.run("schema", "");
    let all: BTreeSet<&str> =
        listed["verbs"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
    for verb in &all {
        let output = bench.command(&format!("schema {verb}")).output().unwrap();
        schemas.insert((*verb).to_owned(), serde_json::from_slice(&output.stdout).unwrap());
    }
    let run: BTreeSet<&str> = bench.printed.iter().map(|(verb, _)| verb.as_str()).chain(NOT_RUN).collect();
    assert_eq!(run, all, "a verb was not run");
    let said = judged(&python, &json!({ "schemas": schemas, "lines": bench.printed }));
    assert!(said.ends_with("lines, 0 do not match\n"), "{said}");
}

fn judged(python: &Path, asked: &Value) -> String {
    let judge = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/schemas/judge.py");
    let mut command = Command::new(python);
    command.arg(judge).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(asked.to_string().as_bytes()).unwrap();
    String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap()
}

#[test]
fn a_line_that_does_not_match_is_found() {
    let Some(python) = python() else {
        return eprintln_skip("no Python with the package jsonschema: the check was not checked");
    };
    let output = fleet_cli(&["schema", "man"]).output().unwrap();
    let schema: Value = serde_json::from_slice(&output.stdout).unwrap();
    for (line, good) in [
        (json!({ "folder": "pages" }), true),
        (json!({ "error": { "code": "failed", "message": "no", "hint": "so" } }), true),
        (json!({ "folder": 7 }), false),
        (json!({}), false),
        (json!({ "folder": "pages", "more": 1 }), false),
        (json!(["pages"]), false),
    ] {
        let said = judged(&python, &json!({ "schemas": { "man": schema }, "lines": [["man", line]] }));
        assert_eq!(said.ends_with("1 lines, 0 do not match\n"), good, "{line}: {said}");
    }
}

fn eprintln_skip(why: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {why}");
}
