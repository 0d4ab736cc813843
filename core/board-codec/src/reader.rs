//! Frames, found in the bytes of a line, opened and checked.

use crate::{MAX_FRAME, crc32, stuffing};

/// Why bytes were not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// More than [`MAX_FRAME`] bytes without a delimiter.
    TooLong,
    /// Not valid COBS.
    Cobs,
    /// Shorter than any frame: its bytes.
    TooShort(usize),
    /// The check sum does not match.
    Crc {
        /// As received.
        got: u32,
        /// As computed.
        expected: u32,
    },
}

/// What a reader has missed since the start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Losses {
    /// Gaps in the sequence, in frames.
    pub lost: u64,
    /// Frames with the number of the one before.
    pub repeated: u64,
}

/// A frame whose check sum is right.
#[derive(Debug, Clone)]
pub struct Content {
    /// Its type ([`kind`](crate::kind)).
    pub kind: u8,
    /// Its number.
    pub seq: u8,
    /// It has the number of the one before.
    pub repeated: bool,
    body: [u8; MAX_FRAME],
    /// Of type, sequence and payload.
    len: usize,
}

impl Content {
    /// What it carries, at most 46 bytes.
    #[must_use]
    #[inline]
    pub fn payload(&self) -> &[u8] {
        &self.body[2..self.len]
    }
}

/// Collects bytes into frames.
#[derive(Debug, Clone)]
pub struct Reader {
    buffer: [u8; MAX_FRAME],
    len: usize,
    overrun: bool,
    next_seq: Option<u8>,
    losses: Losses,
}

impl Default for Reader {
    fn default() -> Self {
        Self { buffer: [0; MAX_FRAME], len: 0, overrun: false, next_seq: None, losses: Losses::default() }
    }
}

impl Reader {
    /// What has been missed so far.
    #[must_use]
    pub fn losses(&self) -> Losses {
        self.losses
    }

    /// Whether a frame has begun and not ended.
    #[must_use]
    #[inline]
    pub fn is_inside_frame(&self) -> bool {
        self.len > 0
    }

    /// The line was cut: what comes next has nothing to do with what came before.
    pub fn forget(&mut self) {
        (self.len, self.overrun, self.next_seq) = (0, false, None);
    }

    /// Takes bytes of the line and hands out each frame that they end.
    #[inline]
    pub fn read(&mut self, mut bytes: &[u8], mut each: impl FnMut(Result<Content, FrameError>)) {
        while let Some(end) = bytes.iter().position(|&byte| byte == 0) {
            if let Some(content) = self.close(&bytes[..end]) {
                each(content);
            }
            bytes = &bytes[end + 1..];
        }
        self.keep(bytes);
    }

    /// Bytes of a frame, without a delimiter.
    #[inline]
    fn keep(&mut self, piece: &[u8]) {
        let room = &mut self.buffer[self.len..];
        let kept = piece.len().min(room.len());
        room[..kept].copy_from_slice(&piece[..kept]);
        self.len += kept;
        self.overrun |= kept < piece.len();
    }

    /// A delimiter closes a frame, whose last piece this is: what is in it, checked.
    #[inline]
    fn close(&mut self, piece: &[u8]) -> Option<Result<Content, FrameError>> {
        if self.len == 0 && piece.len() <= MAX_FRAME {
            // All of it, or an idle line, which may send delimiters.
            return (!piece.is_empty()).then(|| self.open(piece));
        }
        self.keep(piece);
        let (buffer, len, overrun) = (self.buffer, self.len, self.overrun);
        (self.len, self.overrun) = (0, false);
        Some(if overrun { Err(FrameError::TooLong) } else { self.open(&buffer[..len]) })
    }

    #[inline]
    fn open(&mut self, frame: &[u8]) -> Result<Content, FrameError> {
        let mut body = [0; MAX_FRAME];
        let len = stuffing::decode(frame, &mut body).ok_or(FrameError::Cobs)?;
        if len < 6 {
            return Err(FrameError::TooShort(len));
        }
        let (content, crc) = body[..len].split_at(len - 4);
        let got = u32::from_le_bytes([crc[0], crc[1], crc[2], crc[3]]);
        let expected = crc32(content);
        if got != expected {
            return Err(FrameError::Crc { got, expected });
        }
        let seq = body[1];
        let next = self.next_seq.replace(seq.wrapping_add(1));
        let gap = next.map_or(0, |next| seq.wrapping_sub(next));
        let repeated = gap == u8::MAX;
        if repeated {
            self.losses.repeated += 1;
        } else {
            self.losses.lost += u64::from(gap);
        }
        Ok(Content { kind: body[0], seq, repeated, body, len: len - 4 })
    }
}

/// A payload of exactly `N` numbers; `None` if it has another length.
#[must_use]
#[inline]
pub fn words<const N: usize>(payload: &[u8]) -> Option<[u16; N]> {
    if payload.len() != 2 * N {
        return None;
    }
    let mut words = [0; N];
    for (word, bytes) in words.iter_mut().zip(payload.chunks_exact(2)) {
        *word = u16::from_le_bytes([bytes[0], bytes[1]]);
    }
    Some(words)
}
