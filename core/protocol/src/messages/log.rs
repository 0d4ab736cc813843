//! A robot's recordings over Zenoh: which there are, and their bytes piece by piece.

use super::{Message, bounded};
use crate::codec::CodecError;
use serde::{Deserialize, Serialize};

/// Longest piece of a recording, in bytes.
pub const MAX_PIECE: u32 = 32 * 1024;
/// Recordings in a list at most, the newest first.
pub const MAX_LOGS: usize = 500;
/// Longest name of a recording, in characters.
pub const MAX_LOG_NAME: usize = 128;
const MAX_BYTES: usize = 256 * 1024;

/// What is asked of a robot's recordings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LogRequest {
    /// Which there are.
    List {},
    /// Some bytes of one.
    Read {
        /// Which.
        file: String,
        /// The first byte's place.
        offset: u64,
        /// How many at most, 1 to [`MAX_PIECE`].
        length: u32,
    },
}

impl Message for LogRequest {
    const NAME: &'static str = "LogRequest";

    fn validate(&self) -> Result<(), CodecError> {
        let Self::Read { file, length, .. } = self else { return Ok(()) };
        bounded("length of file", file.chars().count() as f64, 1.0, MAX_LOG_NAME as f64, "characters")?;
        bounded("length", f64::from(*length), 1.0, f64::from(MAX_PIECE), "bytes")
    }
}

/// One recording.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct LogFile {
    /// Its name, without any folder.
    pub file: String,
    /// Bytes, now.
    pub bytes: u64,
    /// Since something was last written to it, in s.
    pub age_s: u64,
    /// Whether the robot still writes to it.
    pub open: bool,
}

/// Why a robot refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum LogCode {
    /// Not a message of ours, or of another version.
    Malformed,
    /// A number out of its range, or a place behind the end.
    OutOfRange,
    /// The agent was not started with `--record`.
    NotRecording,
    /// There is no such recording.
    UnknownFile,
    /// The robot's disk would not.
    Unreadable,
    /// Too many questions wait for their answer.
    Overloaded,
}

/// A robot's answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum LogReply {
    /// The newest [`MAX_LOGS`], the newest first.
    Files {
        /// They.
        files: Vec<LogFile>,
        /// Older ones.
        left_out: u64,
    },
    /// Bytes, as many as were asked for or as there are.
    Piece {
        /// How many bytes the whole recording has, now.
        bytes: u64,
        /// Whether the robot still writes to it.
        open: bool,
        /// From the asked place on; empty at the end.
        data: Vec<u8>,
    },
    /// Refused.
    Error {
        /// For programs.
        code: LogCode,
        /// For people.
        message: String,
    },
}

impl Message for LogReply {
    const NAME: &'static str = "LogReply";
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        let (what, count, most) = match self {
            Self::Files { files, .. } => ("files", files.len(), MAX_LOGS),
            Self::Piece { data, .. } => ("data", data.len(), MAX_PIECE as usize),
            Self::Error { .. } => return Ok(()),
        };
        bounded(what, count as f64, 0.0, most as f64, "")
    }
}
