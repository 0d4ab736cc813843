//! The verbs, one a file, and how any of them ends.

pub(crate) mod bring_up;
pub(crate) mod calibrate;
pub(crate) mod check_hardware;
pub(crate) mod enrol;
pub(crate) mod identity;
pub(crate) mod man;
pub(crate) mod ports;
pub(crate) mod replay;
pub(crate) mod run;

use robot_agent::config::ConfigProblem;
use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;
use xtb_protocol::text;

/// Why a command failed: exit code, message, and a hint at what to do.
#[derive(Debug)]
pub(crate) struct Failure {
    code: u8,
    message: String,
    hint: String,
    placed: bool,
}

impl Failure {
    /// It failed.
    pub(crate) fn new(message: impl Display, hint: impl Display) -> Self {
        Self { code: 1, message: message.to_string(), hint: hint.to_string(), placed: false }
    }

    /// It failed at a place in a file, `FILE:LINE: what is wrong`, as compilers say it.
    pub(crate) fn at(message: impl Display, hint: impl Display) -> Self {
        Self { placed: true, ..Self::new(message, hint) }
    }

    /// With another exit code.
    pub(crate) fn code(mut self, code: u8) -> Self {
        self.code = code;
        self
    }

    /// Says so on standard error.
    pub(crate) fn report(&self) -> ExitCode {
        let error = if self.placed { "" } else { "error: " };
        let mut text = format!("{error}{}\n", self.message);
        if !self.hint.is_empty() {
            text.push_str(&format!("hint: {}\n", self.hint));
        }
        tell(&text);
        ExitCode::from(self.code)
    }
}

impl From<ConfigProblem> for Failure {
    fn from(problem: ConfigProblem) -> Self {
        let hint = match &problem {
            ConfigProblem::Identity { hint, .. } => hint.clone(),
            _ => "robot-agent --print-config shows every setting".to_owned(),
        };
        Self::new(problem, hint).code(2)
    }
}

/// Says something on standard error, beside the result. Who has closed it does not want to know.
pub(crate) fn tell(text: &str) {
    let mut err = io::stderr().lock();
    let _ = err.write_all(text::escaped_lines(text).as_bytes()).and_then(|()| err.flush());
}

/// Prints to standard output, without control characters: a recording that is replayed may come from
/// anybody. A reader that has gone away (`| head`) is no failure, but the end.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text::escaped_lines(text).as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::new(format!("cannot write: {error}"), ""))
        }
        _ => Ok(()),
    }
}

/// A value as a line of JSON.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string(value).map_err(|error| Failure::new(error, ""))?;
    print(&(text::escaped_json(&text).into_owned() + "\n"))
}

/// Rows as columns, flush left; no line ends in blanks.
pub(crate) fn columns(rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            line.push_str(&format!("{cell:<width$}  ", width = width(column)));
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}
