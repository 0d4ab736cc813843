//! What a stand-by asks of the dispatcher that it may have to replace, and what it is answered: records of the
//! ledger, and how both stand.

use super::{MAX_ASSIGN_SEQ, MAX_LEDGER, Message, bounded};
use crate::keys::Name;
use crate::text;
use crate::wire::CodecError;
use serde::{Deserialize, Serialize};

/// Assignments of one term: 27 bits. The term of an assignment is what stands above them in its number.
pub const TERM_BITS: u32 = 27;
/// The last term: 13 bits.
pub const MAX_TERM: u32 = (MAX_ASSIGN_SEQ >> TERM_BITS) as u32;
/// Records of one answer take at most this many bytes; a longer one comes in pieces.
pub const STANDBY_PAGE_BYTES: usize = 1024 * 1024;
/// Longest question or answer, in bytes.
const MAX_BYTES: usize = 4 * 1024 * 1024;
/// Robots of an answer at most.
const MAX_WITNESSES: usize = 2048;

/// What is asked of the active dispatcher.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StandbyRequest {
    /// Whoever asks has these records on its disk, and wants those that follow. It promises to take over only
    /// as docs/dispatch.md says.
    Follow {
        /// Number of the copy, random, at most 48 bits; the same for the same file.
        copy: u64,
        /// Whether all records of the copy came from a dispatcher in this way.
        copied: bool,
        /// Number of its ledger; 0 = it is empty.
        ledger: u64,
        /// The term that its records end with.
        term: u32,
        /// Its last record; 0 = none.
        last: u64,
        /// CRC-32 of that record's JSON.
        sum: u32,
        /// Bytes of the next record that it has already.
        offset: u64,
        /// Which [`Witnesses`] it knows; 0 = none.
        witnesses: u32,
    },
    /// It ends, and does not take over.
    Leave {
        /// Which copy.
        copy: u64,
    },
    /// How the dispatcher stands.
    Status {},
}

impl Message for StandbyRequest {
    const NAME: &'static str = "StandbyRequest";

    fn validate(&self) -> Result<(), CodecError> {
        match self {
            Self::Follow { copy, ledger, term, .. } => {
                bounded("copy", *copy as f64, 0.0, MAX_LEDGER as f64, "")?;
                bounded("ledger", *ledger as f64, 0.0, MAX_LEDGER as f64, "")?;
                bounded("term", f64::from(*term), 0.0, f64::from(MAX_TERM), "")
            }
            Self::Leave { copy } => bounded("copy", *copy as f64, 0.0, MAX_LEDGER as f64, ""),
            Self::Status {} => Ok(()),
        }
    }
}

/// A record of the ledger, or a piece of a long one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct CopiedRecord {
    /// Its number.
    pub seq: u64,
    /// Whether it replaces all before it.
    pub snapshot: bool,
    /// Length of its JSON, in bytes.
    pub bytes: u64,
    /// Its JSON, or the piece that begins at the offset that was asked for: as it is, it is read before it is kept.
    pub body: String,
}

/// Robots by whose visibility dispatcher and stand-by decide which of them goes on alone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct Witnesses {
    /// Counts the lists of this run, from a number that no earlier run had; never 0.
    pub version: u32,
    /// Those that were online.
    pub robots: Vec<Name>,
}

/// A stand-by as the dispatcher knows it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StandbyView {
    /// Number of the copy.
    pub copy: u64,
    /// Whether nothing is acknowledged before the stand-by has it.
    pub paired: bool,
    /// The last record on its disk.
    pub last: u64,
    /// Since when nothing was heard of it, in ms.
    pub age_ms: u64,
}

/// Records that follow those of the asker.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Copied {
    /// These; none = the asker has all, or did not ask for any.
    Records(Vec<CopiedRecord>),
    /// The asker's last record is none of this ledger's: it has to begin anew.
    Diverged {},
}

/// How a dispatcher stands, and what follows the asker's records.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct StandbyReply {
    /// Which run of the dispatcher answers: random, at most 48 bits.
    pub run: u64,
    /// Number of its ledger.
    pub ledger: u64,
    /// The term in which it assigns.
    pub term: u32,
    /// The last record on its disk.
    pub last: u64,
    /// Its stand-by.
    pub standby: Option<StandbyView>,
    /// Why it assigns nothing, if that is because of its stand-by.
    #[serde(default, deserialize_with = "text::read_option")]
    pub held: Option<String>,
    /// Given if the asker knows others.
    pub witnesses: Option<Witnesses>,
    /// What follows.
    pub copied: Copied,
}

impl Message for StandbyReply {
    const NAME: &'static str = "StandbyReply";
    const MAX_BYTES: usize = MAX_BYTES;

    fn validate(&self) -> Result<(), CodecError> {
        bounded("term", f64::from(self.term), 0.0, f64::from(MAX_TERM), "")?;
        let robots = self.witnesses.as_ref().map_or(0, |witnesses| witnesses.robots.len());
        bounded("witnesses", robots as f64, 0.0, MAX_WITNESSES as f64, "")
    }
}
