//! How much of an MCAP file is taken in: a file may have come from anywhere, and little of it can be much
//! memory.
//!
//! Records are bounded by their length before they are looked into, names by theirs and by their number,
//! JSON by what it takes once it is read.

use mcap::records::op;
use mcap::sans_io::LinearReaderOptions;
use std::collections::HashMap;
use std::hash::Hash;
use thiserror::Error;

/// Longest record, also a whole chunk, and longest of a chunk's once it is unpacked, in bytes.
const MAX_RECORD: usize = 64 << 20;
/// Longest message, in bytes: a fleet's map as JSON.
const MAX_MESSAGE: usize = 32 << 20;
/// Longest schema, channel or metadata, in bytes.
const MAX_DEFINITION: usize = 1 << 20;
/// Longest name of a topic, schema or metadata, in bytes.
const MAX_NAME: usize = 1024;
/// Topics, schemas and kinds of metadata of a file, each.
const MAX_NAMES: usize = 4096;
/// Values in one message of JSON; an object counts as many, as each takes as much memory.
const MAX_VALUES: usize = 2_000_000;
/// So many values an object counts for.
const OBJECT_VALUES: usize = 16;

/// A file holds more of something than any recording does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{what}: {got}, more than the limit of {most}")]
pub struct Excess {
    what: &'static str,
    got: usize,
    most: usize,
}

fn within(what: &'static str, got: usize, most: usize) -> Result<(), Excess> {
    if got > most { Err(Excess { what, got, most }) } else { Ok(()) }
}

/// A reader that takes no record beyond the bounds, and reads files that were cut up to the cut.
pub(crate) fn reader_options() -> LinearReaderOptions {
    LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD)
}

/// Checks a record's length before it is looked into.
///
/// # Errors
/// [`Excess`].
pub(crate) fn record(opcode: u8, bytes: usize) -> Result<(), Excess> {
    match opcode {
        op::MESSAGE => within("bytes of a message", bytes, MAX_MESSAGE),
        op::SCHEMA => within("bytes of a schema", bytes, MAX_DEFINITION),
        op::CHANNEL => within("bytes of a channel", bytes, MAX_DEFINITION),
        op::METADATA => within("bytes of metadata", bytes, MAX_DEFINITION),
        _ => Ok(()),
    }
}

/// Checks a name that is to be remembered beside `known` others.
///
/// # Errors
/// [`Excess`].
pub(crate) fn name(name: &str, known: usize) -> Result<(), Excess> {
    within("bytes of a name", name.len(), MAX_NAME)?;
    within("names of one kind", known + 1, MAX_NAMES)
}

/// How many are known beside this one.
pub(crate) fn beside<K: Eq + Hash, V>(known: &HashMap<K, V>, id: &K) -> usize {
    known.len() - usize::from(known.contains_key(id))
}

/// Checks JSON before it is read.
///
/// # Errors
/// [`Excess`].
pub(crate) fn json(text: &[u8]) -> Result<(), Excess> {
    let weight = |byte: &u8| match byte {
        b',' | b'[' => 1,
        b'{' => OBJECT_VALUES,
        _ => 0,
    };
    within("values of a message", text.iter().map(weight).sum(), MAX_VALUES)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_long_or_too_many_is_named_with_its_limit() {
        assert!(record(op::MESSAGE, MAX_MESSAGE).is_ok() && record(op::CHUNK, MAX_RECORD).is_ok());
        let excess = record(op::CHANNEL, MAX_DEFINITION + 1).unwrap_err();
        assert_eq!(excess.to_string(), "bytes of a channel: 1048577, more than the limit of 1048576");
        assert!(name(&"x".repeat(MAX_NAME), MAX_NAMES - 1).is_ok());
        assert!(name(&"x".repeat(MAX_NAME + 1), 0).is_err());
        assert_eq!(name("x", MAX_NAMES).unwrap_err().what, "names of one kind");
        assert!(json(br#"{"a":[1,2,3]}"#).is_ok());
        assert!(json(&b"{}".repeat(MAX_VALUES / OBJECT_VALUES + 1)).is_err());
        assert!(json(&b",".repeat(MAX_VALUES + 1)).is_err());
    }
}
