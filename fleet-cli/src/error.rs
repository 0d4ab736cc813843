//! What can go wrong for the operator: kind, exit code, message, and a hint at what to do.

use crate::words;
use std::fmt;
use xtb_bus::BusError;
use xtb_protocol::messages::{DispatchCode, DispatchError, ErrorBody, RejectCode};

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
            Self::Refused(code) => words::name(&code),
            Self::NotDispatched(code) => words::name(&code),
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

    /// A robot's refusal.
    #[must_use]
    pub fn refused(robot: &xtb_protocol::Name, error: &ErrorBody) -> Self {
        Self::new(Kind::Refused(error.code), format!("{robot} refuses: {}", error.message))
            .hint(error.hint.clone())
    }
}

impl From<DispatchError> for Failure {
    fn from(error: DispatchError) -> Self {
        Self::new(Kind::NotDispatched(error.code), error.message).hint(error.hint)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl From<BusError> for Failure {
    fn from(error: BusError) -> Self {
        match &error {
            BusError::Setting { .. } => {
                Self::new(Kind::Usage, error.to_string()).hint("an endpoint looks like tcp/192.168.1.10:7447")
            }
            BusError::Open { .. } => Self::new(Kind::NoRouter, error.to_string()),
            BusError::Operation { .. } | BusError::Encode(_) => Self::new(Kind::Failed, error.to_string()),
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
