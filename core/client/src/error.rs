//! What can go wrong between a client and its fleet: kind, message, and a hint at what to do.

use crate::text::reasons;
use std::fmt;
use xtb_bus::BusError;
use xtb_protocol::messages::{DispatchCode, DispatchError, ErrorBody, MapEditCode, ParamCode, RejectCode};

/// Kinds of errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// What was asked for is not possible: an endpoint, a key expression, a value, a command line.
    Invalid,
    /// A config, world, map or vehicle file is not valid.
    Config,
    /// No router answers.
    NoRouter,
    /// No robot, or not this one, answers.
    NoRobot,
    /// The fleet has no dispatcher.
    NoDispatcher,
    /// Nobody serves the fleet a map.
    NoMap,
    /// A request was sent and not answered.
    OutcomeUnknown,
    /// The robot refused.
    Refused(RejectCode),
    /// The robot refused to change or save settings.
    ParamRefused(ParamCode),
    /// The dispatcher refused.
    NotDispatched(DispatchCode),
    /// The map server refused.
    NotEdited(MapEditCode),
    /// This client's role does not allow it; nothing was sent.
    NotAllowed,
    /// The router does not admit this client's identity.
    NotAdmitted,
    /// Control was given back because nobody used it.
    Idle,
    /// A port is taken.
    PortTaken,
    /// Robots of these names are there already.
    NameTaken,
    /// By the user.
    Interrupted,
    /// Nobody reads the output any more.
    PipeClosed,
    /// Everything else.
    Failed,
}

impl ErrorKind {
    /// For programs: the `code` of a JSON error.
    #[must_use]
    pub fn code(self) -> String {
        match self {
            Self::Invalid => "usage".into(),
            Self::Config => "config".into(),
            Self::NoRouter => "no_router".into(),
            Self::NoRobot => "no_robot".into(),
            Self::NoDispatcher => "no_dispatcher".into(),
            Self::NoMap => "no_map".into(),
            Self::OutcomeUnknown => "outcome_unknown".into(),
            Self::Refused(code) => reasons::name(&code),
            Self::ParamRefused(code) => reasons::name(&code),
            Self::NotDispatched(code) => reasons::name(&code),
            Self::NotEdited(code) => reasons::name(&code),
            Self::NotAllowed => "not_allowed".into(),
            Self::NotAdmitted => "not_admitted".into(),
            Self::PortTaken => "port_taken".into(),
            Self::NameTaken => "name_taken".into(),
            Self::Failed => "failed".into(),
            Self::Idle | Self::Interrupted => "interrupted".into(),
            Self::PipeClosed => "pipe_closed".into(),
        }
    }
}

impl ErrorKind {
    /// What usually helps, where nothing better is known.
    #[must_use]
    pub fn usual_hint(self) -> &'static str {
        match self {
            Self::Invalid => "`fleet-cli VERB --help` shows arguments and examples",
            Self::Config => "correct the file that is named; docs/ describes the layout of each",
            Self::NoRouter => {
                "start `fleet-cli router` or `fleet-cli sim`, or name another router with --connect"
            }
            Self::NoRobot => "`fleet-cli list` shows the robots that answer",
            Self::NoDispatcher => "start one with `fleet-cli dispatch serve`",
            Self::NoMap => {
                "serve one with `fleet-cli map serve FILE` or `fleet-cli dispatch serve --map FILE`; `fleet-cli sim` serves its world's"
            }
            Self::OutcomeUnknown => "`fleet-cli list` and `fleet-cli tasks` show what has become of it",
            Self::Refused(_) => "`fleet-cli why ROBOT` shows what keeps a robot from it",
            Self::ParamRefused(_) => {
                "`fleet-cli param list ROBOT` shows settings, ranges and when they may change"
            }
            Self::NotEdited(_) => "`fleet-cli map history` shows what has changed, by whom and why",
            Self::NotDispatched(_) => "`fleet-cli dispatch status` shows how the dispatcher stands",
            Self::NotAllowed | Self::NotAdmitted => "`fleet-cli doctor` shows this computer's identity",
            Self::PortTaken => "end the other program, or choose another port",
            Self::NameTaken => "choose another name, or end the other program",
            Self::Failed => "`fleet-cli doctor` looks for causes; XTB_LOG=debug logs more",
            // Who ended it knows what to do.
            Self::Idle | Self::Interrupted | Self::PipeClosed => "",
        }
    }
}

/// An error that a person can act on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error {
    /// What kind.
    pub kind: ErrorKind,
    /// What happened.
    pub message: String,
    /// What to do; empty if nothing is known to help.
    pub hint: String,
}

/// What the client's functions return.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// An error without a hint.
    #[must_use]
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
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
        let message = match error.code {
            RejectCode::LeaseHeld if error.message.starts_with("controlled by ") => {
                format!("{robot} is {}", error.message)
            }
            _ => format!("{robot} refuses: {}", error.message),
        };
        Self::new(ErrorKind::Refused(error.code), message).hint(error.hint.clone())
    }
}

impl From<DispatchError> for Error {
    fn from(error: DispatchError) -> Self {
        Self::new(ErrorKind::NotDispatched(error.code), error.message).hint(error.hint)
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        let kind = match error.kind() {
            std::io::ErrorKind::BrokenPipe => ErrorKind::PipeClosed,
            _ => ErrorKind::Failed,
        };
        Self::new(kind, error.to_string())
    }
}

impl From<BusError> for Error {
    fn from(error: BusError) -> Self {
        match &error {
            BusError::Setting { .. } => Self::new(ErrorKind::Invalid, error.to_string())
                .hint("an endpoint looks like tcp/192.168.1.10:7447"),
            BusError::NotSecure { .. } => Self::new(ErrorKind::Invalid, error.to_string())
                .hint("use a tls/ endpoint, or do without the identity: XTB_IDENTITY= (empty)"),
            BusError::Open { .. } => Self::new(ErrorKind::NoRouter, error.to_string()),
            BusError::Operation { .. } | BusError::Encode(_) => {
                Self::new(ErrorKind::Failed, error.to_string())
            }
        }
    }
}
