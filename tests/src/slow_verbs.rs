//! What a user's verbs do over a slow link: each as a process of its own, against a simulator beside it.

use crate::processes::{Process, program};
use crate::slow_link::{LinkQuality, SlowLink};
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Verbs in an order in which each of them has something to do, with `xtb-1` at (x, y) to begin with.
#[must_use]
pub fn verbs((x_m, y_m): (f64, f64)) -> Vec<(&'static str, Vec<String>)> {
    let words = |text: &str| text.split(' ').map(str::to_owned).collect();
    let goto = |ahead_m: f64| format!("goto xtb-1 {x_m} {} --via direct", y_m + ahead_m);
    vec![
        ("list", words("list")),
        ("goto", words(&goto(4.5))),
        ("stop", words("stop xtb-1")),
        ("goto --wait", words(&format!("{} --wait", goto(2.6)))),
        ("wander", words("wander xtb-2 --for 60")),
        ("stop --all", words("stop --all")),
        ("estop", words("estop xtb-1")),
        ("reset", words("reset xtb-1")),
        ("estop --all", words("estop --all")),
        ("reset (after all)", words("reset xtb-2")),
    ]
}

/// How a verb ended.
#[derive(Debug, Clone)]
pub struct Ended {
    /// Its name.
    pub verb: &'static str,
    /// Exit code.
    pub code: Option<i32>,
    /// How long it took.
    pub took: Duration,
    /// What it printed.
    pub said: String,
}

/// A simulator, and a slow link to its router.
pub struct SlowFleet {
    _simulator: Process,
    /// The link.
    pub link: SlowLink,
    /// The router, for whoever looks at the fleet beside the link.
    pub router: String,
    start: (f64, f64),
}

impl SlowFleet {
    /// So many robots in an empty room, at real time.
    ///
    /// # Panics
    /// If it does not start.
    pub async fn start(robots: usize, quality: LinkQuality, seed: u64) -> Self {
        let count = robots.to_string();
        let mut command = cli();
        command.args(["--json", "sim", "--listen", "tcp/127.0.0.1:0", "--robots", &count]);
        let child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut child = child.unwrap_or_else(|error| panic!("{error}"));
        let output = child.stdout.take().unwrap_or_else(|| panic!("no output"));
        let simulator = Process(child);
        let mut line = String::new();
        let read = BufReader::new(output).read_line(&mut line);
        read.unwrap_or_else(|error| panic!("{error}"));
        let router = between(&line, "\"router\":\"", "\"");
        let link = SlowLink::open(&router, quality, seed).await;
        // Beside the link: where the first robot stands.
        let (_, list) = run(&router, &["--json".into(), "list".into()]);
        let number = |key: &str| between(&list, key, ",").parse().unwrap_or_else(|_| panic!("{key}: {list}"));
        let start = (number("\"x_m\":"), number("\"y_m\":"));
        Self { _simulator: simulator, link, router, start }
    }

    /// All verbs, one after the other.
    pub async fn all(&self) -> Vec<Ended> {
        let mut ended = Vec::new();
        for (verb, words) in verbs(self.start) {
            ended.push(self.run(verb, words).await);
        }
        ended
    }

    /// One of them.
    ///
    /// # Panics
    /// If it cannot be started.
    pub async fn run(&self, verb: &'static str, words: Vec<String>) -> Ended {
        let (endpoint, began) = (self.link.endpoint().to_owned(), Instant::now());
        let done = tokio::task::spawn_blocking(move || run(&endpoint, &words)).await;
        let (code, said) = done.unwrap_or_else(|error| panic!("{error}"));
        Ended { verb, code, took: began.elapsed(), said }
    }
}

/// `fleet-cli` without anything from this user's environment.
fn cli() -> Command {
    let mut command = Command::new(program("fleet-cli"));
    command.env_clear().env("HOME", std::env::temp_dir());
    command
}

fn run(endpoint: &str, words: &[String]) -> (Option<i32>, String) {
    let output = cli().args(["--connect", endpoint]).args(words).stdin(Stdio::null()).output();
    let output = output.unwrap_or_else(|error| panic!("{error}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), format!("{}{}", text(&output.stdout), text(&output.stderr)))
}

/// What stands between two texts.
fn between(text: &str, before: &str, after: &str) -> String {
    let found = text.split_once(before).and_then(|(_, rest)| rest.split_once(after));
    found.map_or_else(|| panic!("no {before} in {text}"), |(found, _)| found.to_owned())
}
