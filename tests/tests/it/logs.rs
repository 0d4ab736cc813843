//! The log of both programs as JSON lines, on request.

use fleet_tests::processes::program;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// The first line that a program logs.
fn first_line(command: &mut Command) -> String {
    let command = command.env("XTB_LOG", "debug").stdin(Stdio::null()).stdout(Stdio::null());
    let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut line).unwrap();
    let _ = child.kill();
    let _ = child.wait();
    line
}

fn is_event(line: &str) -> bool {
    let event: serde_json::Value = serde_json::from_str(line).unwrap_or_default();
    ["timestamp", "level", "target", "message"].iter().all(|field| event[field].is_string())
}

#[test]
fn both_programs_log_json_when_told_to_and_text_otherwise() {
    let nowhere = ["--connect", "tcp/127.0.0.1:1"];
    let mut list = Command::new(program("fleet-cli"));
    list.env_clear();
    let line = first_line(list.args(nowhere).args(["--timeout", "1", "--log-format", "json", "list"]));
    assert!(is_event(&line), "{line}");
    let agent = || {
        let mut agent = Command::new(program("robot-agent"));
        agent.env_clear().args(["--hardware", "simulated", "--name", "xtb-1"]).args(nowhere);
        agent
    };
    let line = first_line(agent().env("XTB_LOG_FORMAT", "json"));
    assert!(is_event(&line), "{line}");
    let line = first_line(&mut agent());
    assert!(!line.is_empty() && !is_event(&line) && !line.contains('\x1b'), "{line:?}");
}
