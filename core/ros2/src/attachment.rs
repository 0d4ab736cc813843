//! What rmw_zenoh attaches to every sample, request and reply: 33 bytes, little endian.
//!
//! A peer drops a sample without them, and its whole process ends if they are malformed (rmw_zenoh#637): they are
//! made here and nowhere else, always 33.

use crate::gid::Gid;
use thiserror::Error;

/// Their number.
pub const BYTES: usize = 33;
/// The length of the gid, as it stands before it.
const GID_BYTES: u8 = 16;

/// Bytes that are no attachment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum AttachmentError {
    /// More or fewer.
    #[error("an attachment of {0} bytes instead of {BYTES}")]
    Length(usize),
    /// A gid of another length.
    #[error("an attachment whose gid has {0} bytes instead of {GID_BYTES}")]
    GidLength(u8),
}

/// Which sample of which endpoint, and when. A reply bears its request's number and gid, and its own time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attachment {
    /// From 1.
    pub sequence: i64,
    /// By the sender's clock, in ns since 1970.
    pub source_ns: i64,
    /// Whose.
    pub gid: Gid,
}

impl Attachment {
    /// The attachment of the reply to this one's request.
    #[must_use]
    pub fn of_reply(&self, now_ns: i64) -> Self {
        Self { source_ns: now_ns, ..*self }
    }

    /// Its bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; BYTES] {
        let mut bytes = [0; BYTES];
        let [sequence, source, length, gid] = parts_mut(&mut bytes);
        sequence.copy_from_slice(&self.sequence.to_le_bytes());
        source.copy_from_slice(&self.source_ns.to_le_bytes());
        length.copy_from_slice(&[GID_BYTES]);
        gid.copy_from_slice(&self.gid.0);
        bytes
    }

    /// What these bytes say.
    ///
    /// # Errors
    /// [`AttachmentError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, AttachmentError> {
        let mut bytes: [u8; BYTES] = bytes.try_into().map_err(|_| AttachmentError::Length(bytes.len()))?;
        let [sequence, source, length, gid] = parts_mut(&mut bytes);
        if *length != [GID_BYTES] {
            return Err(AttachmentError::GidLength(length.first().copied().unwrap_or_default()));
        }
        Ok(Self {
            sequence: i64::from_le_bytes(array(sequence)),
            source_ns: i64::from_le_bytes(array(source)),
            gid: Gid(array(gid)),
        })
    }
}

/// Number, time, length of the gid, gid.
fn parts_mut(bytes: &mut [u8; BYTES]) -> [&mut [u8]; 4] {
    let (sequence, rest) = bytes.split_at_mut(8);
    let (source, rest) = rest.split_at_mut(8);
    let (length, gid) = rest.split_at_mut(1);
    [sequence, source, length, gid]
}

/// A part, which has that length.
fn array<const N: usize>(part: &[u8]) -> [u8; N] {
    std::array::from_fn(|i| part.get(i).copied().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_bytes_are_those_of_the_table() {
        let attachment = Attachment { sequence: 1, source_ns: 0x0102, gid: Gid([7; 16]) };
        let expected = [&[1, 0, 0, 0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 0, 0, 0x10][..], &[7; 16]].concat();
        assert_eq!(attachment.to_bytes().to_vec(), expected);
        assert_eq!(Attachment::from_bytes(&[]), Err(AttachmentError::Length(0)));
        assert_eq!(Attachment::from_bytes(&[0; BYTES]), Err(AttachmentError::GidLength(0)));
    }

    proptest! {
        #[test]
        fn attachments_round_trip(sequence: i64, source_ns: i64, gid: [u8; 16]) {
            let attachment = Attachment { sequence, source_ns, gid: Gid(gid) };
            prop_assert_eq!(Attachment::from_bytes(&attachment.to_bytes()), Ok(attachment));
        }

        #[test]
        fn no_bytes_panic(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
            if let Ok(attachment) = Attachment::from_bytes(&bytes) {
                prop_assert_eq!(attachment.to_bytes().to_vec(), bytes);
            }
        }
    }
}
