//! The controller against the published vectors, through the program: an independent
//! implementation's decisions, line by line, with the published profile.

use assert_cmd::Command;
use serde_json::Value;
use std::path::{Path, PathBuf};

const VECTORS: [&str; 13] = [
    "arrive",
    "balance",
    "edges",
    "goto",
    "infrared",
    "remote",
    "remote_cases",
    "speed",
    "speed_cases",
    "tilt_cases",
    "tilt_pid",
    "wander",
    "wander_cases",
];
/// Counts may differ by this much, every other number by the second.
const COUNTS: f64 = 1.0;
const NUMBERS: f64 = 1e-5;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn agent() -> Command {
    let mut command = Command::cargo_bin("robot-agent").expect("cargo builds it for this test");
    command.env_clear();
    command
}

/// The first field in which `got` is not what it should be.
fn difference(path: &str, got: &Value, expected: &Value) -> Option<String> {
    let ok = match (got, expected) {
        (Value::Object(a), Value::Object(b)) => {
            if a.len() == b.len() {
                return b.iter().find_map(|(key, expected)| {
                    difference(&format!("{path}.{key}"), a.get(key).unwrap_or(&Value::Null), expected)
                });
            }
            false
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let fields = a.iter().zip(b).enumerate();
            return { fields }.find_map(|(i, (a, b))| difference(&format!("{path}[{i}]"), a, b));
        }
        (Value::Number(a), Value::Number(b)) => {
            let apart = (a.as_f64().unwrap_or(f64::NAN) - b.as_f64().unwrap_or(f64::NAN)).abs();
            let turns = [".yaw_deg", ".beta_deg", ".gamma_deg"].iter().any(|end| path.ends_with(end));
            let apart = if turns { apart.min((360.0 - apart).abs()) } else { apart };
            apart <= if path.starts_with(".pwm") { COUNTS } else { NUMBERS }
        }
        _ => got == expected,
    };
    (!ok).then(|| format!("{path}: got {got}, expected {expected}"))
}

#[test]
fn every_vector_gives_the_decisions_of_the_independent_implementation() {
    let published = here("../configs/published.toml");
    let pid = tempfile::NamedTempFile::new().expect("a temporary file");
    let text = read(&published);
    let line = "platform = \"balance\"";
    assert_eq!(text.matches(line).count(), 1, "exactly one line chooses the platform controller");
    std::fs::write(pid.path(), text.replace(line, "platform = \"pid\"")).expect("writing it");
    for name in VECTORS {
        let config = if name == "tilt_pid" { pid.path() } else { &published };
        let input = here(&format!("tests/vectors/{name}.in.jsonl"));
        let mut command = agent();
        command.arg("replay").arg("--trace").arg(&input).arg("--config").arg(config);
        let output = command.assert().success().get_output().clone();
        let got = String::from_utf8(output.stdout).expect("UTF-8");
        let expected = read(&here(&format!("tests/vectors/{name}.out.jsonl")));
        assert_eq!(got.lines().count(), expected.lines().count(), "{name}");
        for (i, (got, expected)) in got.lines().zip(expected.lines()).enumerate() {
            let parse = |line: &str| serde_json::from_str::<Value>(line).expect("JSON");
            if let Some(wrong) = difference("", &parse(got), &parse(expected)) {
                panic!("{name} line {}: {wrong}", i + 1);
            }
        }
    }
}

#[test]
fn a_malformed_line_ends_the_run_and_is_named_after_the_lines_before_it() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let input = folder.path().join("IN.jsonl");
    let good = r#"{"t_ns":1,"encoder":{"pulses":1}}"#;
    for (bad, said) in [
        (r#"{"t_ns":2,"command":{"teleop":{"rpm":1.0,"steering":1.5}}}"#, "steering 1.5 is outside"),
        (r#"{"t_ns":2,"command":{"follow":{"rpm":400.0,"steering":0.5}}}"#, "wheel speed 400 is outside"),
        (r#"{"t_ns":2,"encoder":{"pulses":1,"speed":2}}"#, "unknown field `speed`"),
        (r#"{"t_ns":0,"encoder":{"pulses":1}}"#, "smaller than 1"),
        ("", "EOF"),
    ] {
        std::fs::write(&input, format!("{good}\n{bad}\n{good}\n")).expect("writing it");
        let output = agent().args(["replay", "--trace"]).arg(&input).assert().code(1).get_output().clone();
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(stderr.contains(&format!("{}:2: ", input.display())) && stderr.contains(said), "{stderr}");
        assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 1);
    }
}
