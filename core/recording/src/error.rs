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
    #[error("no recording of a robot-agent: {0}")]
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
    #[error("{} is there already", .0.display())]
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
