//! Why a recording cannot be read or written.

use crate::bounds::Excess;
use crate::files::FileError;
use mcap::McapError;
use std::io;
use std::path::PathBuf;

/// Why a recording cannot be read or written. That a file breaks off is none: it is read up to there.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// It cannot be read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// It cannot be opened, or is no file.
    #[error(transparent)]
    File(#[from] FileError),
    /// It holds more of something than any recording does.
    #[error(transparent)]
    Excess(#[from] Excess),
    /// It is not MCAP, or damaged; or a robot's cannot be written.
    #[error("{0}")]
    Mcap(#[from] McapError),
    /// It is MCAP without a message.
    #[error("it has no messages")]
    Empty,
    /// It is MCAP, but nothing of a fleet.
    #[error("not a recording of a fleet")]
    NotOfAFleet,
    /// It is MCAP, but no recording of a robot.
    #[error("not a recording of robot-agent: {0}")]
    NotOfARobot(String),
    /// A robot's message cannot be understood.
    #[error("step {number}: {reason}")]
    Message {
        /// The step's number, or the number of the message where it has none.
        number: u64,
        /// What is wrong.
        reason: String,
    },
    /// A file that should be made is there already.
    #[error("{} already exists", .0.display())]
    Exists(PathBuf),
    /// A fleet's cannot be written.
    #[error("cannot write {}: {reason}", .path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
        /// Whether the disk is full.
        full: bool,
    },
}

#[cfg(feature = "fleet")]
impl From<Error> for xtb_client::Error {
    fn from(error: Error) -> Self {
        use xtb_client::ErrorKind::{Failed, Invalid};
        let message = error.to_string();
        match error {
            Error::Io(error) => error.into(),
            Error::Exists(_) => {
                Self::new(Invalid, message).hint("name another file with --out, or overwrite it with --force")
            }
            Error::Write { full: true, .. } => Self::new(Failed, message)
                .hint("the disk is full: the recording so far is readable; free space, then record again"),
            Error::Write { .. } => {
                Self::new(Failed, message).hint("check that the folder exists and is writable")
            }
            _ => Self::new(Failed, message),
        }
    }
}

#[cfg(all(test, feature = "fleet"))]
mod tests {
    use super::*;
    use xtb_client::ErrorKind;

    #[test]
    fn what_cannot_be_recorded_says_what_to_do() {
        let path = || PathBuf::from("day.mcap");
        let write = |full| Error::Write { path: path(), reason: "no".into(), full };
        for (error, kind, message, hint) in [
            (Error::Exists(path()), ErrorKind::Invalid, "day.mcap already exists", "--force"),
            (write(true), ErrorKind::Failed, "cannot write day.mcap: no", "the disk is full"),
            (write(false), ErrorKind::Failed, "cannot write day.mcap: no", "is writable"),
        ] {
            let error = xtb_client::Error::from(error);
            assert_eq!((error.kind, error.message.as_str()), (kind, message));
            assert!(error.hint.contains(hint), "{error:?}");
        }
    }
}
