//! Real processes of this workspace: started, stopped and killed as a shell would.

use std::ffi::OsString;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// A program of this workspace, beside the running test: cargo builds it before it runs any test.
///
/// # Panics
/// If it is not built.
#[must_use]
pub fn program(name: &str) -> PathBuf {
    let here = std::env::current_exe().unwrap_or_else(|error| panic!("{error}"));
    let folder = here.parent().and_then(|deps| deps.parent()).unwrap_or_else(|| panic!("no folder"));
    let path = folder.join(name);
    assert!(path.exists(), "{} is not built: `cargo build --workspace` first", path.display());
    path
}

/// A process that is killed when this is dropped.
pub struct Process(pub Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A signal to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    /// `SIGINT`, as Ctrl-C.
    Interrupt,
    /// `kill -9`.
    Kill,
    /// `SIGSTOP`.
    Stop,
    /// `SIGCONT`.
    Continue,
}

impl Process {
    /// Starts `command` with no environment but what it was given.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start(command: &mut Command) -> Self {
        let given: Vec<(OsString, OsString)> =
            command.get_envs().filter_map(|(key, value)| Some((key.to_owned(), value?.to_owned()))).collect();
        command.env_clear().envs(given);
        let child = command.stdin(Stdio::null()).stderr(Stdio::null()).spawn();
        Self(child.unwrap_or_else(|error| panic!("{error}")))
    }

    /// Starts `command` and returns the first line that it prints: it is ready then.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start_ready(command: &mut Command) -> (Self, String) {
        let (process, lines) = Self::start_lines(command, 1);
        (process, lines.concat())
    }

    /// Starts it and waits for so many lines.
    ///
    /// # Panics
    /// If it cannot be started.
    #[must_use]
    pub fn start_lines(command: &mut Command, count: usize) -> (Self, Vec<String>) {
        let mut process = Self::start(command.stdout(Stdio::piped()));
        let output = process.0.stdout.take().unwrap_or_else(|| panic!("no output"));
        let mut output = BufReader::new(output);
        let mut lines = vec![String::new(); count];
        for line in &mut lines {
            let _ = output.read_line(line);
        }
        (process, lines)
    }

    /// Whether it has not ended yet.
    #[must_use]
    pub fn runs(&mut self) -> bool {
        matches!(self.0.try_wait(), Ok(None))
    }

    /// Sends a signal.
    ///
    /// # Panics
    /// If the system refuses.
    pub fn signal(&self, signal: Signal) {
        use rustix::process::{Pid, Signal as Os, kill_process};
        let signal = match signal {
            Signal::Interrupt => Os::INT,
            Signal::Kill => Os::KILL,
            Signal::Stop => Os::STOP,
            Signal::Continue => Os::CONT,
        };
        let sent = kill_process(Pid::from_child(&self.0), signal);
        sent.unwrap_or_else(|error| panic!("{error}"));
    }

    /// Memory that it holds, in KiB.
    ///
    /// # Panics
    /// If it has ended.
    #[must_use]
    pub fn memory_kib(&self) -> u64 {
        self.status_kib("VmRSS:")
    }

    /// The most memory that it has held so far, in KiB.
    ///
    /// # Panics
    /// If it has ended.
    #[must_use]
    pub fn peak_memory_kib(&self) -> u64 {
        self.status_kib("VmHWM:")
    }

    /// Memory that is locked, in KiB.
    ///
    /// # Panics
    /// If it has ended.
    #[must_use]
    pub fn locked_memory_kib(&self) -> u64 {
        self.status_kib("VmLck:")
    }

    fn status_kib(&self, field: &str) -> u64 {
        let path = format!("/proc/{}/status", self.0.id());
        let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{error}"));
        let line = text.lines().find_map(|line| line.strip_prefix(field));
        let kib = line.and_then(|line| line.split_whitespace().next()?.parse().ok());
        kib.unwrap_or_else(|| panic!("no {field} in {text}"))
    }
}

/// `fleet-cli router` as a process that can be killed and started again at the same place.
pub struct RouterProcess {
    process: Process,
    pki: Option<PathBuf>,
    endpoint: String,
}

impl RouterProcess {
    /// Starts it on a free port of this computer, open to all or for the identities of a PKI in this folder.
    ///
    /// # Panics
    /// If it does not start.
    #[must_use]
    pub fn start(pki: Option<&Path>) -> Self {
        let listen = if pki.is_some() { "tls/127.0.0.1:0" } else { "tcp/127.0.0.1:0" };
        Self::start_at(listen, pki.map(Path::to_owned))
    }

    fn start_at(listen: &str, pki: Option<PathBuf>) -> Self {
        let mut command = Command::new(program("fleet-cli"));
        command.args(["--json", "router", "--listen", listen]);
        if let Some(folder) = &pki {
            command.arg("--pki").arg(folder);
        }
        let (process, line) = Process::start_ready(&mut command);
        // {"ready":true,"router":"tcp/127.0.0.1:40001"}
        let endpoint = line.split('"').find(|part| part.starts_with(&listen[..4]));
        let endpoint = endpoint.unwrap_or_else(|| panic!("the router says {line:?}")).to_owned();
        Self { process, pki, endpoint }
    }

    /// Where it listens.
    #[must_use]
    pub fn endpoint(&self) -> &str {
        &self.endpoint
    }

    /// The process.
    #[must_use]
    pub fn process(&self) -> &Process {
        &self.process
    }

    /// `kill -9`.
    pub fn kill(&mut self) {
        self.process.signal(Signal::Kill);
        let _ = self.process.0.wait();
    }

    /// Starts it again at the same place.
    ///
    /// # Panics
    /// If it does not start.
    pub fn restart(&mut self) {
        *self = Self::start_at(&self.endpoint.clone(), self.pki.clone());
    }
}
