//! How a command ends, as the shell sees it.

use xtb_client::ErrorKind;
use xtb_protocol::messages::DispatchCode;

/// How a command ended; `--help` lists the codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Done.
    Done,
    /// Refused, goal not reached, contact, port taken …
    Failed,
    /// Wrong usage or configuration.
    Usage,
    /// No router, no robot or no dispatcher answered, the router does not admit this identity, or the outcome is
    /// unknown.
    Unknown,
    /// Another robot or simulator of the fleet has the name.
    NameTaken,
    /// By Ctrl-C.
    Interrupted,
}

impl Exit {
    /// The worse one of two: what is not known is worse than what has failed.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        if other.code() > self.code() { other } else { self }
    }

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

impl From<ErrorKind> for Exit {
    fn from(kind: ErrorKind) -> Self {
        match kind {
            ErrorKind::Invalid | ErrorKind::Config => Self::Usage,
            ErrorKind::NoRouter
            | ErrorKind::NoRobot
            | ErrorKind::NoDispatcher
            | ErrorKind::NoMap
            | ErrorKind::OutcomeUnknown
            | ErrorKind::NotAdmitted
            | ErrorKind::NotDispatched(DispatchCode::Unconfirmed) => Self::Unknown,
            ErrorKind::Refused(_)
            | ErrorKind::ParamRefused(_)
            | ErrorKind::NotDispatched(_)
            | ErrorKind::NotEdited(_)
            | ErrorKind::NotAllowed
            | ErrorKind::PortTaken
            | ErrorKind::Failed => Self::Failed,
            ErrorKind::NameTaken => Self::NameTaken,
            ErrorKind::Idle | ErrorKind::Interrupted => Self::Interrupted,
            ErrorKind::PipeClosed => Self::Done,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::messages::{MapEditCode, RejectCode};

    #[test]
    fn the_worst_of_several_decides_how_a_command_ends() {
        assert_eq!(Exit::Done.worse(Exit::Failed), Exit::Failed);
        assert_eq!(Exit::Unknown.worse(Exit::Failed), Exit::Unknown);
        assert_eq!(Exit::Done.worse(Exit::Done), Exit::Done);
    }

    #[test]
    fn each_kind_of_error_has_its_code_and_its_exit_code() {
        for (kind, code, exit) in [
            (ErrorKind::Invalid, "usage", 2),
            (ErrorKind::Config, "config", 2),
            (ErrorKind::NoRouter, "no_router", 3),
            (ErrorKind::NoRobot, "no_robot", 3),
            (ErrorKind::NoDispatcher, "no_dispatcher", 3),
            (ErrorKind::NoMap, "no_map", 3),
            (ErrorKind::OutcomeUnknown, "outcome_unknown", 3),
            (ErrorKind::Refused(RejectCode::LeaseHeld), "lease_held", 1),
            (ErrorKind::NotDispatched(DispatchCode::KeepOut), "keep_out", 1),
            (ErrorKind::NotDispatched(DispatchCode::Unconfirmed), "unconfirmed", 3),
            (ErrorKind::NotEdited(MapEditCode::Conflict), "conflict", 1),
            (ErrorKind::NotAllowed, "not_allowed", 1),
            (ErrorKind::NotAdmitted, "not_admitted", 3),
            (ErrorKind::NameTaken, "name_taken", 4),
            (ErrorKind::Idle, "interrupted", 130),
            (ErrorKind::Failed, "failed", 1),
        ] {
            assert_eq!((kind.code().as_str(), Exit::from(kind).code()), (code, exit));
        }
    }
}
