//! The person at the terminal: questions, answers and Ctrl-C.
//!
//! A thread reads standard input, so that the truck's frames go on while a person thinks.

use super::bench::Trouble;
use crate::commands::{Failure, run, tell};
use std::io::{self, BufRead, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::time::Duration;
use tokio::runtime::Runtime;

/// How often somebody who waits for an answer looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(20);

/// Where answers come from.
pub(crate) enum Input {
    /// Standard input if it is a terminal, else nobody.
    Terminal,
    /// Standard input, whatever it is: a script may answer.
    Standard,
    /// Somebody in this process.
    #[cfg_attr(not(feature = "sim"), allow(dead_code))] // a simulated person
    Lines(Receiver<String>),
}

/// What the person does.
pub(crate) struct Console {
    interrupted: Arc<AtomicBool>,
    /// Lines typed; `None` if nobody sits there.
    typed: Option<Receiver<String>>,
    /// Watches for signals.
    _runtime: Runtime,
}

impl Console {
    /// From now on Ctrl-C and SIGTERM do not end the program but show in [`Console::interrupted`].
    pub(crate) fn start(input: Input) -> Result<Self, Failure> {
        let no_threads = |error: io::Error| Failure::new(error, "out of threads or memory");
        let interrupted = Arc::new(AtomicBool::new(false));
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(no_threads)?;
        let flag = interrupted.clone();
        runtime.spawn(async move {
            run::wait_for_signal().await;
            flag.store(true, Ordering::Relaxed);
        });
        let typed = match input {
            Input::Terminal if !io::stdin().is_terminal() => None,
            Input::Terminal | Input::Standard => Some(read_lines().map_err(no_threads)?),
            Input::Lines(lines) => Some(lines),
        };
        Ok(Self { interrupted, typed, _runtime: runtime })
    }

    /// Whether somebody can answer.
    pub(crate) fn is_manned(&self) -> bool {
        self.typed.is_some()
    }

    /// Becomes true with Ctrl-C.
    pub(crate) fn interrupted(&self) -> &Arc<AtomicBool> {
        &self.interrupted
    }

    /// A line that has been typed.
    pub(crate) fn typed(&self) -> Result<Option<String>, Trouble> {
        let typed = self.typed.as_ref().ok_or(Trouble::NoAnswer)?;
        match typed.try_recv() {
            Ok(line) => Ok(Some(line)),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err(Trouble::NoAnswer),
        }
    }

    /// Asks, and waits for the answer while `meanwhile` is called again and again.
    pub(crate) fn ask_while(
        &self,
        question: &str,
        mut meanwhile: impl FnMut() -> Result<(), Trouble>,
    ) -> Result<String, Trouble> {
        tell(question);
        loop {
            meanwhile()?;
            if let Some(answer) = self.typed()? {
                return Ok(answer);
            }
        }
    }

    /// Asks something to be answered with yes; anything else is no.
    pub(crate) fn confirm(&self, question: &str) -> Result<bool, Trouble> {
        tell(&format!("{question} [yes/no] "));
        let typed = self.typed.as_ref().ok_or(Trouble::NoAnswer)?;
        loop {
            if self.interrupted.load(Ordering::Relaxed) {
                return Err(Trouble::Interrupted);
            }
            match typed.recv_timeout(LOOK) {
                Ok(answer) => return Ok(matches!(answer.trim(), "yes" | "y" | "Yes" | "YES")),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(Trouble::NoAnswer),
            }
        }
    }
}

/// Lines from standard input until its end. The thread ends with the program.
fn read_lines() -> io::Result<Receiver<String>> {
    let (typed, lines) = sync_channel(8);
    std::thread::Builder::new().name("console".into()).spawn(move || {
        for line in io::stdin().lock().lines().map_while(Result::ok) {
            if typed.send(line).is_err() {
                return;
            }
        }
    })?;
    Ok(lines)
}
