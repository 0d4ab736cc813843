//! What can go wrong for the operator: kind, exit code, message, and a hint at what to do.

use crate::text::reasons;
use std::fmt;
use xtb_bus::BusError;
use xtb_client::ErrorKind;
use xtb_protocol::messages::{DispatchCode, DispatchError, RejectCode};
use xtb_recording::Error as RecordingError;

/// How a command ended, as the shell sees it; `--help` lists the codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// Refused, goal not reached, contact, port taken …
    Failed,
    /// Wrong usage or configuration.
    Usage,
    /// No router, no robot or no dispatcher answered, or the outcome is unknown.
    Unknown,
    /// Another robot or simulator of the fleet has the name.
    NameTaken,
    /// By Ctrl-C.
    Interrupted,
}

impl Exit {
    /// The process's exit code.
    #[must_use]
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Usage => 2,
            Self::Unknown => 3,
            Self::NameTaken => 4,
            Self::Interrupted => 130,
        }
    }
}

/// Kinds of failure, each with its code for programs and its exit code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The command line asks for something impossible.
    Usage,
    /// A config or world file is not valid.
    Config,
    /// No router answers.
    NoRouter,
    /// No robot, or not this one, answers.
    NoRobot,
    /// The fleet has no dispatcher.
    NoDispatcher,
    /// A request was sent and not answered.
    OutcomeUnknown,
    /// The robot refused.
    Refused(RejectCode),
    /// The dispatcher refused.
    NotDispatched(DispatchCode),
    /// A port is taken.
    PortTaken,
    /// Robots of these names are there already.
    NameTaken,
    /// Everything else.
    Failed,
    /// By Ctrl-C.
    Interrupted,
    /// Nobody reads the output any more: nothing to say, and to nobody.
    PipeClosed,
}

/// An error that an operator can act on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Failure {
    /// What kind.
    pub kind: Kind,
    /// What happened.
    pub message: String,
    /// What to do; empty if nothing is known to help.
    pub hint: String,
}

/// What commands return.
pub type Result<T> = std::result::Result<T, Failure>;

impl Kind {
    /// For programs: the `code` of the JSON error.
    #[must_use]
    pub fn code(self) -> String {
        match self {
            Self::Usage => "usage".into(),
            Self::Config => "config".into(),
            Self::NoRouter => "no_router".into(),
            Self::NoRobot => "no_robot".into(),
            Self::NoDispatcher => "no_dispatcher".into(),
            Self::OutcomeUnknown => "outcome_unknown".into(),
            Self::Refused(code) => reasons::name(&code),
            Self::NotDispatched(code) => reasons::name(&code),
            Self::PortTaken => "port_taken".into(),
            Self::NameTaken => "name_taken".into(),
            Self::Failed => "failed".into(),
            Self::Interrupted => "interrupted".into(),
            Self::PipeClosed => "pipe_closed".into(),
        }
    }

    /// For the shell.
    #[must_use]
    pub fn exit(self) -> Exit {
        match self {
            Self::Usage | Self::Config => Exit::Usage,
            Self::NoRouter | Self::NoRobot | Self::NoDispatcher | Self::OutcomeUnknown => Exit::Unknown,
            Self::NotDispatched(DispatchCode::Unconfirmed) => Exit::Unknown,
            Self::Refused(_) | Self::NotDispatched(_) | Self::PortTaken | Self::Failed => Exit::Failed,
            Self::NameTaken => Exit::NameTaken,
            Self::Interrupted => Exit::Interrupted,
            Self::PipeClosed => Exit::Done,
        }
    }
}

impl Failure {
    /// A failure without a hint.
    #[must_use]
    pub fn new(kind: Kind, message: impl Into<String>) -> Self {
        Self { kind, message: message.into(), hint: String::new() }
    }

    /// The same with a hint at what to do.
    #[must_use]
    pub fn hint(self, hint: impl Into<String>) -> Self {
        Self { hint: hint.into(), ..self }
    }
}

impl From<DispatchError> for Failure {
    fn from(error: DispatchError) -> Self {
        xtb_client::Error::from(error).into()
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl From<xtb_client::Error> for Failure {
    fn from(error: xtb_client::Error) -> Self {
        let kind = match error.kind {
            ErrorKind::Invalid => Kind::Usage,
            ErrorKind::NoRouter => Kind::NoRouter,
            ErrorKind::NoRobot => Kind::NoRobot,
            ErrorKind::NoDispatcher => Kind::NoDispatcher,
            ErrorKind::OutcomeUnknown => Kind::OutcomeUnknown,
            ErrorKind::Refused(code) => Kind::Refused(code),
            ErrorKind::NotDispatched(code) => Kind::NotDispatched(code),
            ErrorKind::Idle => Kind::Interrupted,
            ErrorKind::Failed => Kind::Failed,
        };
        Self { kind, message: error.message, hint: error.hint }
    }
}

impl From<BusError> for Failure {
    fn from(error: BusError) -> Self {
        xtb_client::Error::from(error).into()
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        let message = error.to_string();
        match error {
            RecordingError::Io(error) => error.into(),
            RecordingError::Exists(_) => Self::new(Kind::Usage, message)
                .hint("name another file with --out, or overwrite it with --force"),
            RecordingError::Write { full: true, .. } => Self::new(Kind::Failed, message)
                .hint("the disk is full: the recording so far is readable; free space, then record again"),
            RecordingError::Write { .. } => {
                Self::new(Kind::Failed, message).hint("check that the folder exists and is writable")
            }
            _ => Self::new(Kind::Failed, message),
        }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        let kind = match error.kind() {
            std::io::ErrorKind::BrokenPipe => Kind::PipeClosed,
            _ => Kind::Failed,
        };
        Self::new(kind, error.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;

    #[test]
    fn what_cannot_be_recorded_says_what_to_do() {
        let path = || PathBuf::from("day.mcap");
        let write = |full| RecordingError::Write { path: path(), reason: "no".into(), full };
        for (error, kind, message, hint) in [
            (RecordingError::Exists(path()), Kind::Usage, "day.mcap is there already", "--force"),
            (write(true), Kind::Failed, "cannot write day.mcap: no", "the disk is full"),
            (write(false), Kind::Failed, "cannot write day.mcap: no", "may you write to it?"),
        ] {
            let failure = Failure::from(error);
            assert_eq!((failure.kind, failure.message.as_str()), (kind, message));
            assert!(failure.hint.contains(hint), "{failure:?}");
        }
    }

    #[test]
    fn what_the_client_says_keeps_its_code_and_gets_its_exit_code() {
        let end = |kind: ErrorKind| {
            let failure = Failure::from(xtb_client::Error::new(kind, "so it is").hint("do this"));
            assert_eq!((failure.message.as_str(), failure.hint.as_str()), ("so it is", "do this"));
            (failure.kind.code(), failure.kind.exit().code())
        };
        for (kind, code, exit) in [
            (ErrorKind::Invalid, "usage", 2),
            (ErrorKind::NoRouter, "no_router", 3),
            (ErrorKind::NoRobot, "no_robot", 3),
            (ErrorKind::NoDispatcher, "no_dispatcher", 3),
            (ErrorKind::OutcomeUnknown, "outcome_unknown", 3),
            (ErrorKind::Refused(RejectCode::LeaseHeld), "lease_held", 1),
            (ErrorKind::NotDispatched(DispatchCode::KeepOut), "keep_out", 1),
            (ErrorKind::NotDispatched(DispatchCode::Unconfirmed), "unconfirmed", 3),
            (ErrorKind::Idle, "interrupted", 130),
            (ErrorKind::Failed, "failed", 1),
        ] {
            assert_eq!(end(kind), (code.to_owned(), exit));
        }
    }
}
