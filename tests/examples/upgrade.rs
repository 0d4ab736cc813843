//! Programs of two releases in one fleet, over loopback: robots, dispatcher and the people's program, each of the
//! release before or of this one. The table of docs/upgrade.md:
//! `XTB_BEFORE=FOLDER cargo run -p fleet-tests --example upgrade`, after `cargo build --workspace`, where FOLDER holds
//! `robot-agent` and `fleet-cli` of the release before. Exit code 1 if anything did not work.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use fleet_tests::processes::{Process, program};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

/// Robots and dispatcher are there within this.
const STARTS_WITHIN: Duration = Duration::from_secs(60);

/// Which release runs what: `true` = this one.
#[derive(Clone, Copy)]
struct Mix {
    /// The simulated robots, and the router.
    sim: bool,
    /// The robot in a process of its own.
    agent: bool,
    dispatcher: bool,
    cli: bool,
}

/// The programs of both releases.
struct Releases {
    before: PathBuf,
}

impl Releases {
    fn of(&self, this: bool, name: &str) -> Command {
        let path = if this { program(name) } else { self.before.join(name) };
        let mut command = Command::new(path);
        command.env_clear();
        command
    }
}

/// A fleet of two robots in a simulator and one in a process of its own.
struct Lab<'a> {
    releases: &'a Releases,
    mix: Mix,
    home: tempfile::TempDir,
    endpoint: String,
    _processes: Vec<Process>,
}

impl<'a> Lab<'a> {
    fn start(releases: &'a Releases, mix: Mix) -> Self {
        let home = tempfile::tempdir().unwrap();
        let world = Path::new(env!("CARGO_MANIFEST_DIR")).join("../worlds/lab.toml");
        let mut sim = releases.of(mix.sim, "fleet-cli");
        sim.args([
            "--json",
            "sim",
            "--listen",
            "tcp/127.0.0.1:0",
            "--robots",
            "2",
            "--speed",
            "2",
            "--world",
        ]);
        let (sim, ready) = Process::start_ready(sim.arg(world));
        let ready: Value = serde_json::from_str(&ready).unwrap();
        let endpoint = ready["router"].as_str().unwrap().to_owned();
        let mut agent = releases.of(mix.agent, "robot-agent");
        agent.args(["--hardware", "simulated", "--name", "xtb-9", "--start-pose", "3,-3,1.57"]);
        let agent = Process::start(agent.args(["--connect", &endpoint]).stdout(Stdio::null()));
        let mut dispatcher = releases.of(mix.dispatcher, "fleet-cli");
        dispatcher.args(["--json", "--connect", &endpoint, "dispatch", "serve", "--ledger"]);
        let (dispatcher, _) = Process::start_ready(dispatcher.arg(home.path().join("tasks.ledger")));
        Self { releases, mix, home, endpoint, _processes: vec![sim, agent, dispatcher] }
    }

    /// A verb: its exit code, its last line, and what it said otherwise.
    fn run(&self, verb: &str) -> (i32, Value, String) {
        let mut command = self.releases.of(self.mix.cli, "fleet-cli");
        command.env("HOME", self.home.path()).args(["--json", "--connect", &self.endpoint]);
        let output = command.args(verb.split(' ')).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let last = text.lines().last().and_then(|line| serde_json::from_str(line).ok()).unwrap_or_default();
        let said = format!("{text}{}", String::from_utf8_lossy(&output.stderr));
        (output.status.code().unwrap_or(-1), last, said)
    }

    /// Waits until all three robots are told of as ready.
    fn ready(&self) {
        let began = Instant::now();
        loop {
            let (_, list, said) = self.run("list");
            let robots = list["robots"].as_array().map_or(0, Vec::len);
            if robots >= 3 && !said.contains("\"unknown\"") {
                return;
            }
            assert!(began.elapsed() < STARTS_WITHIN, "{said}");
        }
    }
}

/// Each verb, and the exit code that it should have.
const VERBS: [(&str, i32); 12] = [
    ("list", 0),
    ("goto xtb-1 0 1 --wait", 0),
    ("goto xtb-9 3 -2 --wait", 0),
    ("wander xtb-2 --for 60", 0),
    ("stop xtb-2", 0),
    ("estop xtb-2", 0),
    ("reset xtb-2", 0),
    ("set-pose xtb-9 3 -2 --yaw 90", 0),
    ("dispatch goto 0 2 --wait", 0),
    ("dispatch route 0,1 1,1 --wait", 0),
    ("tasks", 0),
    ("doctor", 0),
];

fn main() -> ExitCode {
    let before =
        std::env::var_os("XTB_BEFORE").expect("XTB_BEFORE=FOLDER with the programs of the release before");
    let releases = Releases { before: before.into() };
    let word = |this: bool| if this { "this" } else { "before" };
    let mut wrong = 0;
    println!(
        "| xtb-1, xtb-2 | xtb-9 | dispatcher | fleet-cli | worked | did not |\n| --- | --- | --- | --- | ---: | --- |"
    );
    for number in 1..16_u8 {
        let [sim, agent, dispatcher, cli] = [1, 2, 4, 8].map(|bit| number & bit != 0);
        let mix = Mix { sim, agent, dispatcher, cli };
        let lab = Lab::start(&releases, mix);
        lab.ready();
        let (mut worked, mut failed) = (0, Vec::new());
        for (verb, expected) in VERBS {
            let (code, _, said) = lab.run(verb);
            match code == expected {
                true => worked += 1,
                false => failed.push(format!("`{verb}`: {code}, {said}")),
            }
        }
        println!(
            "| {} | {} | {} | {} | {worked} of {} | {} |",
            word(mix.sim),
            word(mix.agent),
            word(mix.dispatcher),
            word(mix.cli),
            VERBS.len(),
            failed.join("; ").replace('\n', " ")
        );
        said_of_samples(&lab);
        if mix.cli {
            said_of_releases(&lab);
        }
        wrong += failed.len();
    }
    ExitCode::from(u8::from(wrong > 0))
}

/// What this release's program says of the others.
fn said_of_releases(lab: &Lab<'_>) {
    let (_, report, _) = lab.run("doctor");
    for finding in report["findings"].as_array().into_iter().flatten().filter(|it| it["topic"] == "versions")
    {
        println!("  doctor: {} {}: {}", finding["level"], finding["robot"], finding["text"]);
    }
}

/// What the people's program makes of samples, which have another version in each release.
fn said_of_samples(lab: &Lab<'_>) {
    let (_, seen, said) = lab.run("watch xtb/*/xtb-9/sensors --count 1");
    let word = seen["error"].as_str().or(seen["type"].as_str()).unwrap_or(said.trim());
    println!("  samples of xtb-9: {word}");
}
