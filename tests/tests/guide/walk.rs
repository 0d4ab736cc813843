//! Walks through a page as its reader would, in an empty home: types, compares, ends programs.
//!
//! What differs from the reader's: programs listen on free ports, and the others are sent there; a
//! simulator without serial lines runs eight times as fast, unless the page says how fast; and who
//! waits for an answer waits longer than a person would.

use super::page::{Notes, Step, What, steps, text};
use super::shown::fits;
use super::terminal;
use fleet_cli::config::FleetConfig;
use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, Signal, program};
use robot_agent::config::SettingLayers;
use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

const FAST: &str = " --speed 8";
/// Verbs that bring a router with them.
const ROUTERS: [&str; 2] = ["router", "sim"];
/// For commands that are answered: a machine that runs many tests at once may be slow.
const PATIENT: &str = "fleet-cli --timeout 20 ";
/// What programs that stay say when they are ready.
const READY: [&str; 4] =
    ["ready", "the link to the router is up", "dispatcher of fleet", "traffic control of fleet"];
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// The exit code when nobody has answered: that takes the whole of a command's patience.
const UNANSWERED: i32 = 3;
/// A command that was not done yet when it was interrupted.
const INTERRUPTED: i32 = 130;
/// Each command, and each program's way to ready and to its end.
const AT_MOST: Duration = PATIENCE.saturating_mul(2);

/// A program that stays.
struct Running {
    typed: String,
    process: Process,
    output: PathBuf,
}

/// The reader, somewhere on a page.
struct Walk<'a> {
    page: &'a str,
    home: TempDir,
    variables: BTreeMap<String, String>,
    /// Where a router with identities listens: their files name it, so it is chosen before there is one.
    tls: String,
    running: Vec<Running>,
    /// What the last block of commands has shown.
    seen: String,
    outputs: usize,
}

/// Walks through a page from its first line to its last.
pub(super) fn walk(page: &str) {
    let mut walk = Walk::new(page);
    let steps = steps(page, &text(page));
    for (i, step) in steps.iter().enumerate() {
        let shown = match steps.get(i + 1).map(|next| &next.what) {
            Some(What::Shown(shown)) => Some(shown.as_str()),
            _ => None,
        };
        walk.step(step, shown);
    }
    walk.ctrl_c(0, "");
}

impl<'a> Walk<'a> {
    fn new(page: &'a str) -> Self {
        let home = tempfile::tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        for folder in ["worlds", "configs"] {
            std::os::unix::fs::symlink(root.join(folder), home.path().join(folder)).unwrap();
        }
        let programs = program("fleet-cli").parent().unwrap().display().to_string();
        assert!(program("robot-agent").exists());
        let variables = [
            ("PATH", format!("{programs}:/usr/local/bin:/usr/bin:/bin")),
            ("HOME", home.path().display().to_string()),
            ("XTB_CONNECT", "tcp/127.0.0.1:1".to_owned()),
        ];
        let variables = variables.into_iter().map(|(name, value)| (name.to_owned(), value)).collect();
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        Self {
            page,
            home,
            variables,
            tls: format!("tls/{free}"),
            running: Vec::new(),
            seen: String::new(),
            outputs: 0,
        }
    }

    fn step(&mut self, step: &Step, shown: Option<&str>) {
        match &step.what {
            What::Commands(notes, _) if notes.has("not-run") => {}
            What::Commands(notes, typed) => self.block(step.line, notes, typed, shown),
            What::Shown(shown) => {
                let place = self.place(step.line);
                // A busy computer may not hear at once of a dispatcher that has just started.
                let sooner = self.seen.replace("waiting for a dispatcher\n", "");
                let fits = fits(shown, &self.seen) || fits(shown, &sooner);
                assert!(fits, "{place}: shown is\n{shown}\n\nseen is\n{}", self.seen);
            }
            What::File(notes, text) => self.write(step.line, notes, text),
            What::CtrlC(word) => self.ctrl_c(step.line, word),
        }
    }

    fn block(&mut self, line: usize, notes: &Notes, typed: &[String], shown: Option<&str>) {
        self.seen.clear();
        if notes.has("background") {
            typed.iter().for_each(|typed| self.begin(line, notes, typed));
        } else if notes.has("screen") {
            typed.iter().for_each(|typed| self.draw(line, notes, typed));
        } else {
            self.finish(line, notes, typed, shown);
        }
    }

    /// Runs commands to their end; where the block says `until`, again and again until all is as told.
    fn finish(&mut self, line: usize, notes: &Notes, typed: &[String], shown: Option<&str>) {
        let (began, wanted) = (Instant::now(), notes.exit_code());
        loop {
            self.seen.clear();
            let mut as_told = true;
            for typed in typed {
                let code = self.run(line, typed, wanted);
                let last_try = !notes.has("until") || began.elapsed() > AT_MOST;
                assert!(
                    code == wanted || !last_try,
                    "{}: {typed} ended with {code}\n{}",
                    self.place(line),
                    self.seen
                );
                as_told &= code == wanted;
            }
            as_told &= shown.is_none_or(|shown| fits(shown, &self.seen));
            if as_told || !notes.has("until") || began.elapsed() > AT_MOST {
                return;
            }
        }
    }

    /// Runs a command on a terminal of its own until it ends.
    fn draw(&mut self, line: usize, notes: &Notes, typed: &str) {
        let mut command = self.shell(&typed.replace("fleet-cli ", PATIENT));
        let (code, drawn) = terminal::run(&mut command, notes.value("shows"), notes.value("keys"));
        assert_eq!(code, notes.exit_code(), "{}: {typed}\n{drawn}", self.place(line));
        self.seen.push_str(&drawn);
    }

    /// Runs a command to its end, and returns its exit code.
    fn run(&mut self, line: usize, typed: &str, wanted: i32) -> i32 {
        if let Some((name, value)) = typed.strip_prefix("export ").and_then(|rest| rest.split_once('=')) {
            let value = self.adapted(value.split(" #").next().unwrap_or_default().trim());
            self.variables.insert(name.to_owned(), value);
            return 0;
        }
        let mut typed = match wanted {
            UNANSWERED => typed.to_owned(),
            _ => typed.replace("fleet-cli ", PATIENT),
        };
        if ROUTERS.iter().any(|verb| typed == format!("{PATIENT}{verb}")) {
            // To the reader it is the same port that is taken.
            typed.push_str(&format!(" --listen {}", self.variables["XTB_CONNECT"]));
        }
        let output = self.output();
        let mut command = self.shell(&typed);
        let mut process = Process(to_file(&mut command, &output).spawn().unwrap());
        let began = Instant::now();
        let status = loop {
            if let Some(status) = process.0.try_wait().unwrap() {
                break status;
            }
            let place = self.place(line);
            assert!(began.elapsed() < AT_MOST, "{place}: does not end: {typed}\n{}", read(&output));
            std::thread::sleep(LOOK_EVERY);
        };
        self.seen.push_str(&read(&output));
        status.code().unwrap_or(-1)
    }

    /// Starts a program that stays, and waits until it is ready.
    fn begin(&mut self, line: usize, notes: &Notes, typed: &str) {
        let output = self.output();
        let mut command = self.shell(&self.on_a_free_port(typed));
        let mut process = Process(to_file(&mut command, &output).spawn().unwrap());
        let began = Instant::now();
        let ready = loop {
            let seen = read(&output);
            let whole = seen.rsplit_once('\n').map_or("", |(whole, _)| whole);
            let is_ready = |line: &&str| match notes.value("ready") {
                Some(word) => line.contains(word),
                None => READY.iter().any(|word| line.contains(word)),
            };
            if let Some(ready) = whole.lines().find(is_ready) {
                break ready.to_owned();
            }
            let place = self.place(line);
            assert!(process.runs() && began.elapsed() < AT_MOST, "{place}: not ready: {typed}\n{seen}");
            std::thread::sleep(LOOK_EVERY);
        };
        if let Some(endpoint) = endpoint(typed, &ready) {
            self.variables.insert("XTB_CONNECT".to_owned(), endpoint);
        }
        self.seen.push_str(&read(&output));
        self.running.push(Running { typed: typed.to_owned(), process, output });
    }

    /// Ctrl-C for the programs with `word` in their command line, the last one first.
    fn ctrl_c(&mut self, line: usize, word: &str) {
        let (ending, staying) =
            std::mem::take(&mut self.running).into_iter().partition(|one| one.typed.contains(word));
        self.running = staying;
        let ending: Vec<Running> = ending;
        assert!(line == 0 || !ending.is_empty(), "{}: nothing runs with {word}", self.place(line));
        self.seen.clear();
        for mut one in ending.into_iter().rev() {
            one.process.signal(Signal::Interrupt);
            let began = Instant::now();
            let status = loop {
                if let Some(status) = one.process.0.try_wait().unwrap() {
                    break status;
                }
                assert!(began.elapsed() < AT_MOST, "{}: Ctrl-C does not end {}", self.page, one.typed);
                std::thread::sleep(LOOK_EVERY);
            };
            let seen = read(&one.output);
            assert!(
                matches!(status.code(), Some(0 | INTERRUPTED)),
                "{}: {} ended with {status}\n{seen}",
                self.page,
                one.typed
            );
            self.seen.push_str(&seen);
        }
    }

    fn write(&mut self, line: usize, notes: &Notes, text: &str) {
        let text = self.adapted(text);
        let place = self.place(line);
        let path = notes.value("file").map(|file| self.home.path().join(file.trim_start_matches("~/")));
        if notes.has("fleet") {
            FleetConfig::parse(&text).unwrap_or_else(|failure| panic!("{place}: {failure}"));
        } else if notes.has("agent") {
            let mut layers = SettingLayers::default();
            layers.file(&place, &text).unwrap_or_else(|problem| panic!("{problem}"));
            layers.finish().unwrap_or_else(|problem| panic!("{place}: {problem}"));
        } else {
            assert!(notes.has("tasks") || notes.language == "text", "{place}: what file is this?");
        }
        if let Some(path) = path {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
    }

    fn place(&self, line: usize) -> String {
        format!("docs/guide/{}:{line}", self.page)
    }

    fn output(&mut self) -> PathBuf {
        self.outputs += 1;
        let folder = self.home.path().join(".outputs");
        std::fs::create_dir_all(&folder).unwrap();
        folder.join(self.outputs.to_string())
    }

    fn shell(&self, typed: &str) -> Command {
        let mut command = Command::new("/bin/sh");
        command.env_clear().envs(&self.variables).current_dir(self.home.path());
        // In the shell's place, so that what ends the one ends the other.
        let ours = ["fleet-cli ", "robot-agent "].iter().any(|program| typed.starts_with(program));
        let exec = if ours { "exec " } else { "" };
        if typed.contains("--identity ") && !typed.contains("--identity none") {
            // It names the router, and the page has said nothing of another one.
            command.env_remove("XTB_CONNECT");
        }
        let port = self.tls.rsplit(':').next().unwrap();
        let typed = typed.replace("pki init ", &format!("pki init --port {port} "));
        command.arg("-c").arg(format!("{exec}{}", self.adapted(&typed))).stdin(Stdio::null());
        command
    }

    /// The router of this walk for that of the page.
    fn adapted(&self, text: &str) -> String {
        let ours = &self.variables["XTB_CONNECT"];
        let parts: Vec<&str> = text.split("tcp/").collect();
        let mut out = parts[0].to_owned();
        for part in &parts[1..] {
            match part.find(":7447") {
                // A listener that is refused stays as it is written.
                Some(end)
                    if !part.starts_with("0.0.0.0")
                        && part[..end].chars().all(|c| c.is_ascii_digit() || c == '.') =>
                {
                    out.push_str(ours);
                    out.push_str(&part[end + ":7447".len()..]);
                }
                _ => out.push_str(&format!("tcp/{part}")),
            }
        }
        out
    }

    /// The same command line, listening on a free port, and not slower than it need be.
    fn on_a_free_port(&self, typed: &str) -> String {
        let typed = typed.split(" #").next().unwrap_or_default().trim();
        if let Some(page) = typed.strip_suffix("--dashboard") {
            return format!("{page}--dashboard 127.0.0.1:0");
        }
        let mut words: Vec<&str> = typed.split_whitespace().collect();
        let verb = words.get(1).copied().filter(|_| words[0] == "fleet-cli");
        if typed.contains("tls/") {
            return typed.replace("tls/0.0.0.0:7447", &self.tls);
        }
        let free = match verb {
            Some(verb) if ROUTERS.contains(&verb) && !typed.contains("--connect") => "tcp/127.0.0.1:0",
            Some("dashboard") if typed.contains("--identity") => "127.0.0.1:0 --tls",
            Some("dashboard") => "127.0.0.1:0",
            _ => return typed.to_owned(),
        };
        if let Some(at) = words.iter().position(|word| *word == "--listen") {
            words.drain(at..=at + 1);
        }
        let slow = verb == Some("sim") && !typed.contains("--speed") && !typed.contains("--pty");
        format!("{} --listen {free}{}", words.join(" "), if slow { FAST } else { "" })
    }
}

/// Where the router is that a program has just brought with it.
fn endpoint(typed: &str, ready: &str) -> Option<String> {
    let verb = typed.split_whitespace().nth(1).unwrap_or_default();
    let brings = ROUTERS.contains(&verb) && !typed.contains("--connect");
    let words = ready.split(|c: char| c.is_whitespace() || c == ',' || c == '"');
    words.filter(|_| brings).find(|word| word.starts_with("tcp/")).map(str::to_owned)
}

/// Both outputs go to one file, in the order in which a terminal would show them.
fn to_file<'a>(command: &'a mut Command, output: &Path) -> &'a mut Command {
    let file = File::options().create(true).append(true).open(output).unwrap();
    command.stdout(file.try_clone().unwrap()).stderr(file)
}

fn read(output: &Path) -> String {
    String::from_utf8_lossy(&std::fs::read(output).unwrap_or_default()).into_owned()
}
