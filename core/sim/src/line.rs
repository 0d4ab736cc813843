//! What a device has sent and nobody has read yet: bounded like the buffer of a serial port.

use std::collections::VecDeque;

/// About three seconds of either device.
const CAPACITY: usize = 4096;

/// Bytes on their way to the agent. When full, the oldest are dropped and counted: the reader finds
/// the next frame by its delimiter or check sum.
#[derive(Debug, Clone)]
pub(crate) struct Outbox {
    bytes: VecDeque<u8>,
    dropped: u64,
}

impl Default for Outbox {
    fn default() -> Self {
        Self { bytes: VecDeque::with_capacity(CAPACITY), dropped: 0 }
    }
}

impl Outbox {
    pub(crate) fn send(&mut self, bytes: &[u8]) {
        let excess = (self.bytes.len() + bytes.len()).saturating_sub(CAPACITY);
        self.bytes.drain(..excess.min(self.bytes.len()));
        self.dropped += excess as u64;
        self.bytes.extend(bytes);
    }

    /// Moves everything to the end of `into`.
    pub(crate) fn take(&mut self, into: &mut Vec<u8>) {
        let (front, back) = self.bytes.as_slices();
        into.extend_from_slice(front);
        into.extend_from_slice(back);
        self.bytes.clear();
    }

    /// Bytes dropped so far.
    pub(crate) fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_bytes_are_dropped_and_counted() {
        let mut outbox = Outbox::default();
        for i in 0..=4096_u32 {
            outbox.send(&[(i % 251) as u8]);
        }
        let mut bytes = Vec::new();
        outbox.take(&mut bytes);
        assert_eq!((bytes.len(), bytes[0], outbox.dropped()), (4096, 1, 1));
        outbox.take(&mut bytes);
        assert_eq!(bytes.len(), 4096, "taken once only");
    }
}
