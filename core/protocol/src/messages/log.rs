//! A robot's recordings over Zenoh: which there are, and their bytes piece by piece.

use super::{Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Longest piece of a recording, in bytes.
pub const MAX_PIECE: u32 = 32 * 1024;
/// Recordings in a list at most, the newest first.
pub const MAX_LOGS: usize = 500;
/// Longest name of a recording, in characters.
pub const MAX_LOG_NAME: usize = 128;
const MAX_BYTES: usize = 256 * 1024;
const SUFFIX: &str = ".mcap";

/// The file name of a robot's recording: `<robot>-<time>[-N].mcap`, such as `xtb-1-20041201T120000Z-2.mcap`,
/// one component of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingName {
    text: String,
    robot: Name,
}

impl RecordingName {
    /// The name of the recording that `robot` began at `time` (UTC, `20041201T120000Z`), the `number`th of
    /// that second, from 1; `None`: the time is not written so.
    #[must_use]
    pub fn new(robot: &Name, time: &str, number: u32) -> Option<Self> {
        let text = match number {
            1 => format!("{robot}-{time}{SUFFIX}"),
            _ => format!("{robot}-{time}-{number}{SUFFIX}"),
        };
        Self::parse(&text)
    }

    /// Reads a name; `None`: it is not a recording's.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (begun, number) = text.strip_suffix(SUFFIX)?.rsplit_once('Z')?;
        let (robot, time) = begun.rsplit_once('-')?;
        let (day, second) = time.split_once('T')?;
        let digits =
            |text: &str, count: usize| text.len() == count && text.bytes().all(|b| b.is_ascii_digit());
        let counts = match number.strip_prefix('-') {
            Some(number) => (1..=9).any(|count| digits(number, count)) && !number.starts_with('0'),
            None => number.is_empty(),
        };
        let robot = Name::robot(robot).ok()?;
        (digits(day, 8) && digits(second, 6) && counts).then(|| Self { text: text.to_owned(), robot })
    }

    /// Whose recording it is.
    #[must_use]
    pub fn robot(&self) -> &Name {
        &self.robot
    }

    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.text
    }
}

impl fmt::Display for RecordingName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.text)
    }
}

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
        #[serde(deserialize_with = "text::read")]
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
    /// Its name, a [`RecordingName`].
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
        #[serde(deserialize_with = "text::read")]
        message: String,
    },
}

impl Message for LogReply {
    const NAME: &'static str = "LogReply";
    const VERSION: u32 = 2;
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        if let Self::Files { files, .. } = self
            && let Some(other) = files.iter().find(|file| RecordingName::parse(&file.file).is_none())
        {
            let shown: String = other.file.chars().take(MAX_LOG_NAME).collect();
            let reason = format!("{shown:?} is not the name of a recording: <robot>-<time>[-N]{SUFFIX}");
            return Err(CodecError::Malformed { name: Self::NAME, reason });
        }
        let (what, count, most) = match self {
            Self::Files { files, .. } => ("files", files.len(), MAX_LOGS),
            Self::Piece { data, .. } => ("data", data.len(), MAX_PIECE as usize),
            Self::Error { .. } => return Ok(()),
        };
        bounded(what, count as f64, 0.0, most as f64, "")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recordings_name_says_whose_it_is_and_is_only_a_name() {
        for (text, robot) in [
            ("xtb-1-20041201T120000Z.mcap", "xtb-1"),
            ("xtb-1-20041201T120000Z-2.mcap", "xtb-1"),
            ("xtb-1-2-20041201T120000Z-10.mcap", "xtb-1-2"),
            ("a-20041201T120000Z.mcap", "a"),
        ] {
            let name = RecordingName::parse(text).unwrap();
            assert_eq!((name.robot().as_str(), name.as_str()), (robot, text));
        }
        let robot = Name::new("xtb-1").unwrap();
        let numbered = |number| RecordingName::new(&robot, "20041201T120000Z", number).unwrap().to_string();
        assert_eq!(
            [numbered(1), numbered(12)],
            ["xtb-1-20041201T120000Z.mcap", "xtb-1-20041201T120000Z-12.mcap"]
        );
        assert_eq!(RecordingName::new(&robot, "today", 1), None);
    }

    #[test]
    fn nothing_else_is_a_recordings_name() {
        for text in [
            "",
            "a",
            ".mcap",
            "../xtb-1-20041201T120000Z.mcap",
            "/tmp/xtb-1-20041201T120000Z.mcap",
            "xtb-1/-20041201T120000Z.mcap",
            "xtb-1-20041201T120000Z/../x.mcap",
            "xtb-1-20041201T120000Z.mcap/..",
            "xtb-1-20041201T120000Z.mcap\0",
            "xtb-1-20041201T120000Z.mcap\n",
            "xtb-1-20041201T120000Z.mcap.sh",
            "xtb-1-20041201T120000Z",
            "-20041201T120000Z.mcap",
            "all-20041201T120000Z.mcap",
            "Xtb-20041201T120000Z.mcap",
            "xtb-1-20041201T120000.mcap",
            "xtb-1-2004120T120000Z.mcap",
            "xtb-1-20041201T12000Z.mcap",
            "xtb-1-20041201T120000Z-.mcap",
            "xtb-1-20041201T120000Z-0.mcap",
            "xtb-1-20041201T120000Z-+1.mcap",
            "xtb-1-20041201T120000Z-1234567890.mcap",
            "xtb-1-20041201T120000Z2.mcap",
        ] {
            assert_eq!(RecordingName::parse(text), None, "{text:?}");
        }
    }
}
