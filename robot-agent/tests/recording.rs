//! Recordings of the program itself: killed in the middle, and on a disk that is full.

use assert_cmd::Command as Assert;
use assert_cmd::cargo::cargo_bin;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(60);

/// Polls until there is something.
fn eventually<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        if let Some(found) = look() {
            return found;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("{what} did not happen within {PATIENCE:?}");
}

fn the_file(folder: &Path) -> Option<PathBuf> {
    std::fs::read_dir(folder).ok()?.next()?.ok().map(|entry| entry.path())
}

fn start(command: &mut Command) -> Child {
    command.env_clear().stderr(Stdio::piped()).spawn().expect("starting it")
}

fn arguments(folder: &Path) -> Vec<String> {
    let folder = folder.display().to_string();
    ["--hardware", "simulated", "--connect", "tcp/127.0.0.1:1", "--record", &folder]
        .map(str::to_owned)
        .to_vec()
}

/// A recording whose recorder got `kill -9` after a few chunks.
fn killed_while_recording(folder: &Path) -> PathBuf {
    let mut child = start(Command::new(cargo_bin("robot-agent")).args(arguments(folder)));
    let file = eventually("two flushed chunks", || {
        let file = the_file(folder)?;
        (std::fs::metadata(&file).ok()?.len() > 20_000).then_some(file)
    });
    child.kill().expect("kill -9");
    child.wait().expect("its end");
    file
}

/// What `replay` says about a recording, and whether it is satisfied.
fn replay(file: &Path) -> (bool, String) {
    let output =
        Assert::cargo_bin("robot-agent").expect("built").env_clear().arg("replay").arg(file).output();
    let output = output.expect("running it");
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn a_recorder_that_is_killed_leaves_a_recording_up_to_the_last_second() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = killed_while_recording(folder.path());
    let (satisfied, said) = replay(&file);
    assert!(satisfied && said.starts_with("identical, "), "{said}");
    assert!(said.contains("incomplete"), "{said}");
    let samples: u64 =
        said["identical, ".len()..].split(' ').next().and_then(|n| n.parse().ok()).expect("a number");
    assert!(samples > 150, "{said}");
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_robot() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A file may grow to 40 KiB and no further: writing beyond it fails like on a full disk.
    let script = "trap '' XFSZ; ulimit -f 40; exec \"$@\"";
    let mut child = start(
        Command::new("bash")
            .args(["-c", script, "-"])
            .arg(cargo_bin("robot-agent"))
            .args(arguments(folder.path())),
    );
    let lines = BufReader::new(child.stderr.take().expect("its log")).lines();
    let said = lines.map_while(Result::ok).find(|line| line.contains(" stopped: "));
    let lives = child.try_wait().expect("asking").is_none();
    child.kill().expect("ending it");
    child.wait().expect("its end");
    assert!(said.is_some() && lives, "said: {said:?}, lives: {lives}");
    let (satisfied, said) = replay(&the_file(folder.path()).expect("the recording"));
    assert!(satisfied && said.starts_with("identical, ") && said.contains("incomplete"), "{said}");
}

#[test]
fn a_recording_becomes_a_trace_that_replays_line_by_line() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = killed_while_recording(folder.path());
    let trace = folder.path().join("trace.jsonl");
    let mut command = Assert::cargo_bin("robot-agent").expect("built");
    command.env_clear().arg("replay").arg(&file).arg("--export").arg(&trace).assert().success();
    let mut command = Assert::cargo_bin("robot-agent").expect("built");
    let output = command.env_clear().args(["replay", "--trace"]).arg(&trace).assert().success();
    let mut command = Assert::cargo_bin("robot-agent").expect("built");
    command.env_clear().arg("replay").arg(&file).arg("--export").arg(&file).assert().code(1);
    let (satisfied, said) = replay(&file);
    assert!(satisfied, "exporting onto itself is refused and costs nothing: {said}");
    let samples = std::fs::read_to_string(&trace).expect("the trace").lines().count();
    let decided = String::from_utf8_lossy(&output.get_output().stdout).lines().count();
    assert!(samples > 100 && samples == decided, "{samples} {decided}");
}

#[test]
fn a_replay_does_not_depend_on_the_environment() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = killed_while_recording(folder.path());
    let mut command = Assert::cargo_bin("robot-agent").expect("built");
    command.env_clear().env("XTB_AGENT_CONFIG", "/nonexistent.toml").arg("replay").arg(&file);
    let output = command.assert().success().get_output().clone();
    assert!(String::from_utf8_lossy(&output.stdout).starts_with("identical, "));
}

#[test]
fn what_is_no_recording_is_said_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("x.mcap");
    std::fs::write(&file, "hello").expect("writing it");
    let (satisfied, said) = replay(&file);
    assert!(!satisfied && said.contains("hint:"), "{said}");
    let (satisfied, said) = replay(&folder.path().join("missing.mcap"));
    assert!(!satisfied && said.contains("missing.mcap"), "{said}");
}
