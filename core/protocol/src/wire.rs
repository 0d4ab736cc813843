//! What every message keeps to, and what is wrong with one that does not.

use thiserror::Error;
use xtb_control::units::OutOfRange;

/// Version of the wire as a whole, raised when the version of any type is. What the version before wrote is read too,
/// and who asked in it is answered in it ([`Message::PREVIOUS`](crate::messages::Message::PREVIOUS)).
pub const WIRE: u32 = 7;
/// Longest message that is read, in bytes, unless its type says otherwise.
pub const MAX_BYTES: usize = 16 * 1024;
/// The encoding of JSON messages.
pub const JSON: &str = "application/json";

/// Why bytes are not the message they should be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CodecError {
    /// Too long to be read.
    #[error("{len} bytes, at most {max} are allowed")]
    Oversized {
        /// As received.
        len: usize,
        /// What the type allows.
        max: usize,
    },
    /// Neither of our encodings.
    #[error("encoding {got:?}, expected {expected:?} or {JSON:?}")]
    UnknownEncoding {
        /// As received.
        got: String,
        /// What this place takes.
        expected: String,
    },
    /// Our type in another version.
    #[error("{name} version {got}, this program speaks version {expected}")]
    WrongVersion {
        /// The type.
        name: &'static str,
        /// As received.
        got: String,
        /// As spoken here.
        expected: u32,
    },
    /// The version before has no words for this.
    #[error("{name} version {version} cannot say this, version {needs} can")]
    TooNew {
        /// The type.
        name: &'static str,
        /// The version before.
        version: u32,
        /// As spoken here.
        needs: u32,
    },
    /// The bytes do not have the type's layout.
    #[error("not a {name}: {reason}")]
    Malformed {
        /// The type.
        name: &'static str,
        /// What the parser says.
        reason: String,
    },
    /// A number is not finite or out of range.
    #[error("{0}")]
    OutOfRange(#[from] OutOfRange),
}
