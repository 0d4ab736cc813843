//! The only encode and decode.
//!
//! Wire policy: postcard with encoding `application/x-postcard;xtb.<Type>.v<N>`; for every other
//! language the same types as JSON with encoding `application/json`. A type's version is raised when
//! its bytes change in any way (postcard has no field names), and [`WIRE`](crate::wire::WIRE) with it; one test file a
//! version pins the bytes and is never edited to pass. The version before is read and answered too. Any other version,
//! trailing bytes, non-finite or out-of-range numbers are typed rejections. Nothing is guessed: a message without an
//! encoding is refused.

use crate::messages::Message;
use crate::text;
use crate::wire::{CodecError, JSON};

const POSTCARD: &str = "application/x-postcard";

/// How a message was, or is to be, written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Format {
    /// Between our own programs.
    #[default]
    Postcard,
    /// Between our own programs, for one that speaks the version before; of a type without one as [`Self::Postcard`].
    Previous,
    /// For every other language.
    Json,
}

/// The encoding string of a type in a format.
#[must_use]
pub fn encoding<M: Message>(format: Format) -> String {
    match format {
        Format::Postcard => format!("{POSTCARD};xtb.{}.v{}", M::NAME, M::VERSION),
        Format::Previous => format!("{POSTCARD};xtb.{}.v{}", M::NAME, previous::<M>().unwrap_or(M::VERSION)),
        Format::Json => JSON.to_owned(),
    }
}

/// The version before that is still understood.
fn previous<M: Message>() -> Option<u32> {
    M::PREVIOUS.map(|_| M::VERSION - 1)
}

/// Whether a message can be said in the version before.
fn check_previous<M: Message>(message: &M) -> Result<(), CodecError> {
    match M::PREVIOUS {
        Some(can_say) if !can_say(message) => {
            Err(CodecError::TooNew { name: M::NAME, version: M::VERSION - 1, needs: M::VERSION })
        }
        _ => Ok(()),
    }
}

/// A message as bytes.
///
/// # Errors
/// [`CodecError::OutOfRange`] if the message does not pass its own validation, [`CodecError::TooNew`] if the version
/// before cannot say it, and [`CodecError::Malformed`] if serde cannot write it.
pub fn encode<M: Message>(message: &M, format: Format) -> Result<Vec<u8>, CodecError> {
    message.validate()?;
    let broken = |reason: String| CodecError::Malformed { name: M::NAME, reason: shortened(reason) };
    let bytes = match format {
        Format::Postcard => postcard::to_allocvec(message).map_err(|e| broken(e.to_string()))?,
        Format::Previous => {
            check_previous(message)?;
            message.write_previous().map_err(|e| broken(e.to_string()))?
        }
        Format::Json => serde_json::to_vec(message).map_err(|e| broken(e.to_string()))?,
    };
    check_length::<M>(bytes.len())?;
    Ok(bytes)
}

/// How many bytes a part of a message takes as JSON; what cannot be written takes none.
#[must_use]
pub fn json_bytes(part: &impl serde::Serialize) -> usize {
    serde_json::to_vec(part).map_or(0, |json| json.len())
}

/// A parser repeats the field that it does not know, whatever it holds and however long. It is shown as
/// text, and both ends of it are kept: a refusal has to fit into a reply.
fn shortened(reason: String) -> String {
    const KEPT: usize = 200;
    let reason = text::escaped(&reason).into_owned();
    let len = reason.chars().count();
    if len <= 2 * KEPT {
        return reason;
    }
    let (head, tail) = (reason.chars().take(KEPT), reason.chars().skip(len - KEPT));
    head.chain(['…']).chain(tail).collect()
}

fn check_length<M: Message>(len: usize) -> Result<(), CodecError> {
    if len > M::MAX_BYTES { Err(CodecError::Oversized { len, max: M::MAX_BYTES }) } else { Ok(()) }
}

/// A message from bytes with their encoding, and the format that an answer should have.
///
/// # Errors
/// Every [`CodecError`]; the bytes are then dropped and nothing else happens.
pub fn decode<M: Message>(encoding: &str, bytes: &[u8]) -> Result<(M, Format), CodecError> {
    check_length::<M>(bytes.len())?;
    let broken = |reason: String| CodecError::Malformed { name: M::NAME, reason: shortened(reason) };
    let format = format_of::<M>(encoding)?;
    let whole = |read: postcard::Result<(M, &[u8])>| match read {
        Ok((message, [])) => Ok(message),
        Ok((_, rest)) => Err(broken(format!("{} bytes too many", rest.len()))),
        Err(error) => Err(broken(error.to_string())),
    };
    let message = match format {
        Format::Json => serde_json::from_slice(bytes).map_err(|e| broken(e.to_string()))?,
        Format::Postcard => whole(postcard::take_from_bytes(bytes))?,
        Format::Previous => whole(M::read_previous(bytes))?,
    };
    if format == Format::Previous {
        check_previous(&message)?;
    }
    message.validate()?;
    Ok((message, format))
}

/// The format that an encoding names, if it fits `M`.
///
/// # Errors
/// [`CodecError::UnknownEncoding`] or [`CodecError::WrongVersion`].
pub fn format_of<M: Message>(encoding: &str) -> Result<Format, CodecError> {
    let (kind, schema) = encoding.split_once(';').unwrap_or((encoding, ""));
    if kind == JSON || kind == "text/json" {
        return Ok(Format::Json);
    }
    let unknown = || CodecError::UnknownEncoding {
        got: encoding.chars().take(100).collect(),
        expected: self::encoding::<M>(Format::Postcard),
    };
    if kind != POSTCARD {
        return Err(unknown());
    }
    let (name, version) =
        schema.strip_prefix("xtb.").and_then(|s| s.rsplit_once(".v")).ok_or_else(unknown)?;
    if name != M::NAME {
        return Err(unknown());
    }
    if previous::<M>().is_some_and(|previous| version == previous.to_string()) {
        return Ok(Format::Previous);
    }
    if version != M::VERSION.to_string() {
        let got = text::escaped(version).chars().take(20).collect();
        return Err(CodecError::WrongVersion { name: M::NAME, got, expected: M::VERSION });
    }
    Ok(Format::Postcard)
}
