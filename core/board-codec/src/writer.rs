//! Frames, built for the line.

use crate::{MAX_BODY, MAX_FRAME, crc32, stuffing};

/// A frame ready for the line.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    bytes: [u8; MAX_FRAME],
    len: usize,
}

impl Frame {
    /// The bytes, delimiter included; at most [`MAX_FRAME`].
    #[must_use]
    #[inline]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Builds frames and counts their sequence.
#[derive(Debug, Clone, Default)]
pub struct Writer {
    seq: u8,
}

impl Writer {
    /// The next frame of this direction, with at most 23 numbers.
    ///
    /// # Panics
    /// If the payload is longer than any frame's.
    #[inline]
    pub fn frame(&mut self, kind: u8, payload: impl IntoIterator<Item = u16>) -> Frame {
        let mut body = [0_u8; MAX_BODY];
        body[0] = kind;
        body[1] = self.seq;
        self.seq = self.seq.wrapping_add(1);
        let mut len = 2;
        for value in payload {
            body[len..len + 2].copy_from_slice(&value.to_le_bytes());
            len += 2;
        }
        let crc = crc32(&body[..len]);
        body[len..len + 4].copy_from_slice(&crc.to_le_bytes());
        let mut frame = Frame { bytes: [0; MAX_FRAME], len: 0 };
        let encoded = stuffing::encode(&body[..len + 4], &mut frame.bytes);
        frame.len = encoded + 1; // the delimiter is already there
        frame
    }
}
