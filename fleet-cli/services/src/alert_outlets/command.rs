//! A program of the lab's that is started for each change: without a shell, with JSON on its standard input.

use super::{Outlet, QUEUE, Shared};
use rustix::process::{Pid, Signal, kill_process_group};
use std::io::Write;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::mpsc::sync_channel;
use std::time::{Duration, Instant};
use xtb_client::{Error, ErrorKind, Result};

/// A child has no end that could be waited for with a bound: it is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// The program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommandOutlet {
    /// Itself.
    pub program: String,
    /// Its arguments, always the same.
    pub arguments: Vec<String>,
    /// It is ended after this long.
    pub timeout: Duration,
}

/// Starts the thread that runs it, once for each change, one after the other.
pub(super) fn start(outlet: CommandOutlet) -> Result<Outlet> {
    let (sender, waiting) = sync_channel::<String>(QUEUE);
    let shared = Arc::<Shared>::default();
    let counters = Arc::clone(&shared);
    let name = format!("alert command {}", outlet.program);
    let work = move || {
        while let Ok(body) = waiting.recv() {
            counters.count(&name, &run(&outlet, &body));
        }
    };
    std::thread::Builder::new().name("alert-command".to_owned()).spawn(work).map_err(|error| {
        Error::new(ErrorKind::Failed, format!("cannot start the alert command's thread: {error}"))
    })?;
    Ok(Outlet { send: Box::new(move |body| sender.try_send(body).is_ok()), shared })
}

/// Runs it once.
fn run(outlet: &CommandOutlet, body: &str) -> std::result::Result<(), String> {
    let mut child = Command::new(&outlet.program)
        .args(&outlet.arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()
        .map_err(|error| format!("cannot be started: {error}"))?;
    if let Some(mut input) = child.stdin.take() {
        // A change is far shorter than a pipe's buffer; a program that does not read it may do so.
        let _ = input.write_all(body.as_bytes()).and_then(|()| input.write_all(b"\n"));
    }
    match within(&mut child, outlet.timeout) {
        Ok(Some(status)) if status.success() => Ok(()),
        Ok(Some(status)) => Err(format!("ended with {status}")),
        Ok(None) => {
            // With whatever it has started itself.
            let killed = kill_process_group(Pid::from_child(&child), Signal::KILL);
            killed
                .map_err(std::io::Error::from)
                .and_then(|()| child.wait())
                .map_err(|error| format!("cannot be ended: {error}"))?;
            Err(format!("was ended after {} s", outlet.timeout.as_secs_f64()))
        }
        Err(error) => Err(format!("cannot be waited for: {error}")),
    }
}

/// How it has ended; `None` = it has not in time.
fn within(child: &mut Child, timeout: Duration) -> std::io::Result<Option<ExitStatus>> {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if began.elapsed() >= timeout {
            return Ok(None);
        }
        std::thread::sleep(LOOK_EVERY);
    }
}
