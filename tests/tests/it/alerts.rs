//! Alerts, history and report as people and scripts use them: `fleet-cli` from outside, a dispatcher in a process of its
//! own that is killed, simulated robots.

use crate::commands::{Sim, fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::dispatch::Serve;
use fleet_tests::processes::{Process, Signal};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::process::Stdio;
use std::time::Instant;
use tempfile::TempDir;

struct Lab {
    sim: Sim,
    folder: TempDir,
    serve: Option<Process>,
}

impl Lab {
    /// Two robots, and a dispatcher that tells a program of its alerts.
    fn new() -> Self {
        let mut lab = Self {
            sim: sim(&["--robots", "2", "--speed", "8"]),
            folder: tempfile::tempdir().unwrap(),
            serve: None,
        };
        let told = lab.told();
        let config = format!(
            "[alerts]\ncommand = [\"/bin/sh\", \"-c\", 'cat >> \"$0\"', {:?}]\n",
            told.display().to_string()
        );
        std::fs::write(lab.folder.path().join("fleet.toml"), config).unwrap();
        lab.serve();
        lab
    }

    fn told(&self) -> PathBuf {
        self.folder.path().join("told")
    }

    fn serve(&mut self) {
        let mut command = Serve::command(&self.sim.endpoint, &self.folder.path().join("lab.ledger"));
        command.arg("--config").arg(self.folder.path().join("fleet.toml"));
        let (process, line) = Process::start_ready(&mut command);
        assert!(line.starts_with("{\"ready\":true"), "{line:?}");
        self.serve = Some(process);
    }

    fn kill_and_restart(&mut self) {
        let mut process = self.serve.take().unwrap();
        process.signal(Signal::Kill);
        process.0.wait().unwrap();
        self.serve();
    }

    /// The exit code, and the lines of JSON.
    fn run(&self, line: &str) -> (i32, Vec<Value>) {
        let mut command = fleet_cli(&["--timeout", "30", "--connect", &self.sim.endpoint]);
        let output = command.args(line.split(' ')).stdin(Stdio::null()).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let read = |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
        (output.status.code().unwrap(), text.lines().map(read).collect())
    }

    fn ok(&self, line: &str) -> Vec<Value> {
        let (code, lines) = self.run(line);
        assert_eq!(code, 0, "{line}: {lines:?}");
        lines
    }

    /// Asks again until it is so.
    fn until<T>(&self, line: &str, so: impl Fn(&[Value]) -> Option<T>) -> T {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let (_, lines) = self.run(line);
            if let Some(found) = so(&lines) {
                return found;
            }
            assert!(Instant::now() < give_up, "{line}: {lines:?}");
        }
    }

    /// The alert of this kind, once it is in this state.
    fn alert(&self, kind: &str, state: &str) -> Value {
        self.until("alerts --all", |lines| {
            let all = lines[0]["alerts"].as_array()?;
            all.iter().find(|alert| alert["kind"] == kind && alert["state"] == state).cloned()
        })
    }
}

#[test]
fn an_operator_is_called_acknowledges_by_name_and_a_kill_forgets_nothing() {
    let mut lab = Lab::new();
    assert_eq!(lab.ok("alerts")[0]["alerts"], json!([]));
    // It counts how often a robot stops from when it has heard it before that.
    let heard = |lines: &[Value]| {
        let mut robots = lines[0]["robots"].as_array()?.iter();
        robots.find(|robot| robot["robot"] == "xtb-1" && robot["heard_s"].as_f64() > Some(0.0)).map(drop)
    };
    lab.until("report", heard);
    assert_eq!(lab.run("--client bob estop xtb-1").0, 0);
    let alert = lab.alert("latched", "open");
    assert_eq!((&alert["robot"], &alert["subject"]), (&json!("xtb-1"), &json!("estop")));
    assert_eq!(alert["text"], "xtb-1 latched: emergency stop, by bob");
    assert!(alert["remedy"].as_str().unwrap().contains("`fleet-cli reset xtb-1"), "{alert}");
    let id = &alert["id"];
    // The program has been told, on its standard input.
    let give_up = Instant::now() + PATIENCE;
    let told = loop {
        let told = std::fs::read_to_string(lab.told()).unwrap_or_default();
        if told.ends_with('\n') {
            break told;
        }
        assert!(Instant::now() < give_up, "the command was not started");
    };
    let told: Value = serde_json::from_str(told.lines().next().unwrap()).unwrap();
    assert_eq!((&told["event"], &told["fleet"], &told["alert"]["id"]), (&json!("raised"), &json!("lab"), id));

    assert_eq!(lab.ok("--client alice alerts ack --all")[0]["acknowledged"], json!([id]));
    let alert = lab.alert("latched", "acknowledged");
    assert_eq!(alert["acknowledged"]["by"], "alice");
    assert_eq!(lab.ok(&format!("--client bob alerts ack {id}"))[0]["before"], json!([id]));
    let (code, refused) = lab.run("alerts ack 4711");
    assert_eq!((code, &refused.last().unwrap()["error"]["message"]), (1, &json!("no such alert: 4711")));

    // The other robot works.
    lab.ok("dispatch goto 0 2 --wait");
    let driven = |lines: &[Value]| {
        let robots = lines[0]["robots"].as_array()?;
        let robot = robots.iter().find(|robot| robot["robot"] == "xtb-2" && robot["done"] == 1)?;
        robot["driven_m"].as_f64().filter(|driven_m| *driven_m > 0.3)
    };
    let before_m = lab.until("report", driven);
    let stopped = |lines: &[Value]| {
        let mut robots = lines[0]["robots"].as_array()?.iter();
        robots
            .find(|robot| robot["robot"] == "xtb-1" && robot["stops"].to_string().contains("estop"))
            .map(drop)
    };
    lab.until("report", stopped);

    lab.kill_and_restart();
    assert_eq!(lab.alert("latched", "acknowledged")["acknowledged"]["by"], "alice", "it is still the same");
    assert!(lab.until("report", driven) >= before_m);
    let words = |line: &str| -> Vec<String> {
        lab.ok(line).iter().map(|event| event["text"].as_str().unwrap().to_owned()).collect()
    };
    let of_alerts = words("events --kind alert");
    assert!(of_alerts[0].starts_with(&format!("alert {id} raised: xtb-1 latched")), "{of_alerts:?}");
    assert!(of_alerts[1].starts_with(&format!("alert {id} acknowledged by alice")), "{of_alerts:?}");
    // What robots send again to whoever comes late is there once.
    let latched = words("events --robot xtb-1 --kind latch --since 1h");
    assert_eq!(latched, ["xtb-1 LATCHED estop by bob"]);
    assert_eq!(words("events --search T1 --kind task").last().unwrap(), "t1 done on xtb-2");
    assert_eq!(words("events --limit 2").len(), 2);

    let give_up = Instant::now() + PATIENCE;
    while lab.run("reset xtb-1").0 != 0 {
        assert!(Instant::now() < give_up, "xtb-1 is not reset");
    }
    let ended = lab.alert("latched", "ended");
    assert!(ended["ended_ms"].as_u64() > ended["since_ms"].as_u64(), "{ended}");
    assert_eq!(lab.ok("alerts")[0]["alerts"], json!([]));
}

#[test]
fn without_a_dispatcher_there_are_no_alerts_and_it_is_said() {
    let sim = sim(&["--robots", "1"]);
    for line in [&["alerts"][..], &["events"], &["report"], &["alerts", "ack", "--all"]] {
        let (code, said, _) = sim.run(line);
        assert_eq!((code, &said["error"]["code"]), (3, &json!("no_dispatcher")), "{line:?}: {said}");
        assert!(said["error"]["hint"].as_str().unwrap().contains("dispatch serve"), "{said}");
    }
}
